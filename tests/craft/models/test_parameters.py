"""Parameter files: what a fit found of a machine that is written in Python."""

import pytest

import hovercontrol as hc
from hovercontrol.craft.effects import effect

q, v, u = hc.Signal("q", "rad"), hc.Signal("v", "rad/s"), hc.Signal("u", "A")
k, J = hc.Signal("k", "N*m/A", start=0.1, lower=0.0), hc.Signal("J", "kg*m^2", start=0.01, lower=1e-9)
DRIVE = hc.Block("drive", [q, v], [u], [q], [k, J], {"q": v.symbol, "v": k.symbol * u.symbol / J.symbol})


def written(text, folder):
    file = folder / "parameters.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_what_is_saved_is_what_is_loaded(tmp_path):
    lacks = hc.BlockModel(DRIVE)
    added = [lacks.effect_class("v_coulomb")(value=0.5, width=0.02), lacks.effect_class("input_delay")(0.04)]
    found = lacks.with_coefficients({"k": 0.13, "J": 0.02}).with_effects(added)
    file = hc.save_parameters(found, tmp_path / "parameters.toml")
    for model in (lacks, DRIVE, found):
        loaded = hc.load_parameters(model, file)
        assert loaded.coefficients() == found.coefficients()
        assert {e.name: e.values for e in loaded.effects} == {e.name: e.values for e in found.effects}
        assert loaded.plant().equations() == found.plant().equations()


def test_a_craft_has_parameters_too(tmp_path):
    craft = hc.vehicle("c17_experiment")
    faster = craft.with_effects([effect("slope", x=0.1)]).with_coefficients({"thrust": 0.9})
    loaded = hc.load_parameters(craft, hc.save_parameters(faster, tmp_path / "p.toml"))
    assert loaded.coefficients() == faster.coefficients()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[coefficients]\nkk = 1.0\n", "unknown coefficient 'kk'; did you mean 'k'?"),
        ("[coefficients]\nk = 'a'\n", "coefficients.k must be a number, found 'a'"),
        ("[coefficients]\nk = -1.0\n", "k = -1"),
        ("[effects]\nv_colomb = 1.0\n", "did you mean 'v_coulomb'?"),
        ("[effects]\nv_coulomb = {valu = 1.0}\n", "did you mean 'value'?"),
        ("[model]\nname = 'servo'\n", "model.name: expected 'drive', found 'servo'"),
        ("[plant]\nname = 'drive'\n", "unknown section 'plant'"),
        ("coefficients = 3\n", "[coefficients] must be a table"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(text, said, tmp_path):
    file = written(text, tmp_path)
    with pytest.raises(hc.InputError) as error:
        hc.load_parameters(DRIVE, file)
    assert (
        said in str(error.value) and str(error.value).startswith(str(file)) and "\n" not in str(error.value)
    )
