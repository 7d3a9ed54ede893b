"""Functions in place of unknown ones: forms and tables as Blocks and in parameter files."""

from pathlib import Path

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.models.forms import FORMS
from hovercontrol.craft.models.functions import FormFunction, TableFunction, unknowns_of

V = hc.Signal("v", "m/s")
CART = hc.Block("cart", [V], [], [V], [], {"v": -hc.unknown("drag", of=["v"], unit="m/s^2")})
(DRAG,) = unknowns_of(CART)


@pytest.mark.parametrize("form", FORMS)
def test_a_form_is_the_same_in_a_block_and_in_numpy(form: str) -> None:
    keys = FormFunction(DRAG, form, ()).keys
    function = FormFunction(DRAG, form, tuple(0.7 + 0.4 * k for k in range(len(keys))))
    at = np.array([-1.3, -0.2, 0.4, 2.1])
    found = function.filled(CART).to_numpy().derivatives(0.0, at[None, :])[0]
    assert np.allclose(found, -function.values(at), rtol=1e-6)


def by_hand(v: np.ndarray) -> dict[str, tuple[tuple[float, ...], np.ndarray]]:
    return {
        "saturating": ((2.0, 0.5), 2.0 * v / (0.5 + v)),
        "inhibited": ((2.0, 0.5, 3.0), 2.0 * v / (0.5 + v + v**2 / 3.0)),
        "hill": ((2.0, 0.5, 2.0), 2.0 * v**2 / (0.25 + v**2)),
        "power": ((2.0, 1.7), 2.0 * v**1.7),
        "exponential approach": ((2.0, 0.5), 2.0 * (1 - np.exp(-v / 0.5))),
        "logistic": ((2.0, 0.5, 0.1), 2.0 / (1 + np.exp((0.5 - v) / 0.1))),
        "hinge on a line": ((2.0, 3.0, 0.5), 2.0 * v + 3.0 * np.maximum(v - 0.5, 0.0)),
    }


@pytest.mark.parametrize("form", by_hand(np.ones(1)))
def test_forms_are_the_equations_by_hand(form: str) -> None:
    v = np.array([0.1, 0.4, 0.9, 3.0])
    numbers, values = by_hand(v)[form]
    assert np.allclose(FormFunction(DRAG, form, numbers).values(v), values, rtol=1e-6)


@pytest.mark.parametrize(
    "function",
    [
        FormFunction(DRAG, "saturating", (2.0, 0.5)),
        TableFunction(DRAG, (0.0, 0.5, 1.0, 2.0), (0.0, 1.0, 1.5, 1.7)),
    ],
)
def test_a_parameter_file_holds_it(function: FormFunction | TableFunction, tmp_path: Path) -> None:
    model = hc.BlockModel(CART).with_functions([function])
    file = hc.save_parameters(model, tmp_path / "parameters.toml")
    again = hc.load_parameters(CART, file)
    assert again.coefficients() == model.coefficients()
    assert again.plant().equations() == model.plant().equations()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('[functions.drga]\nform = "power"', "has no unknown function 'drga'; did you mean 'drag'"),
        ('[functions.drag]\nform = "satrating"', "unknown form 'satrating'; did you mean 'saturating'"),
        ('[functions.drag]\nform = "power"\na = 1.0', "missing in functions.drag: 'n'"),
        ("[functions.drag]\ngrid = [0, 1, 2, 2]\nvalues = [0, 1, 2, 3]", "grid must increase"),
        ("[functions.drag]\ngrid = [0, 1]\nvalues = [0, 1]", "at least 4"),
        ("[functions.drag]\ngrid = 3\nvalues = [0, 1]", "must be a list of numbers, found 3"),
    ],
)
def test_a_wrong_section_is_refused_in_one_line(content: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "parameters.toml"
    file.write_text(content)
    with pytest.raises(hc.InputError, match=message) as raised:
        hc.load_parameters(CART, file)
    assert "\n" not in str(raised.value)


def test_a_table_is_one_set_of_values_with_fixed_ends() -> None:
    table = TableFunction(DRAG, (0.0, 0.5, 1.0, 2.0), (0.0, 1.0, 1.5, 1.7))
    model = hc.BlockModel(CART).with_functions([table])
    assert model.free_coefficients() == ("drag_1", "drag_2", "drag_3", "drag_4")
    with pytest.raises(hc.InputError, match="drag_high = 3 m/s is out of its bounds"):
        model.with_coefficients({"drag_high": 3.0})
