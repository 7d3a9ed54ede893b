"""An effect is one class in one file and nothing else."""

import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hovercontrol
from hovercontrol.base.errors import InputError
from hovercontrol.base.pythonfile import from_python
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.craft.effects import Coefficient, Effect, Shape, effect, effect_class, effect_names
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.modelfile import load_model, model_text


@pytest.fixture
def skirt_leak():
    """A new effect: one class, nothing else; forgotten again after the test."""

    class SkirtLeak(Effect):
        """Air that leaves the skirt on one side pushes the craft."""

        name, source = "skirt_leak_in_a_test", "none"
        value = Coefficient("1/s", lower=0.0)
        lean = Shape("rad", default=0.5)

        def terms(self, c, s):
            return {"v": c.value * s.u * (c.lean - s.psi) ** 2}

    yield SkirtLeak
    del Effect.known["skirt_leak_in_a_test"]


def test_a_new_class_is_known_to_model_files_plants_and_estimators_at_once(skirt_leak, tmp_path):
    assert "skirt_leak_in_a_test" in effect_names()
    path = tmp_path / "leaky.toml"
    path.write_text("[effects]\nskirt_leak_in_a_test = {value = 0.3, lean = 0.1}\nsurge_linear_drag = 0.2\n")
    model = load_model(path)
    plant = model.plant()
    x = np.array([0, 0, 0.4, 2.0, 0, 0])
    assert plant.to_numpy().derivatives(0.0, x)[4] == pytest.approx(0.3 * 2.0 * 0.3**2)
    assert [s.name for s in kalman_bucy(plant).outputs] == [
        "skirt_leak_in_a_test_hat",
        "surge_linear_drag_hat",
    ]
    assert model.linear_coefficients() == ("skirt_leak_in_a_test", "surge_linear_drag")
    path.write_text(model_text(model))
    assert load_model(path) == model


@pytest.mark.slow
def test_a_new_file_in_the_folder_is_all_it_takes(tmp_path):
    package = tmp_path / "hovercontrol"
    shutil.copytree(Path(hovercontrol.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "craft" / "effects" / "tether.py").write_text(
        "from hovercontrol.craft.effects import Coefficient, Effect\n\n\n"
        "class Tether(Effect):\n"
        '    """A rope pulls the craft back to the origin of x."""\n\n'
        '    name, source = "tether", "a test"\n'
        '    value = Coefficient("1/s^2", lower=0.0)\n\n'
        "    def terms(self, c, s):\n"
        '        return {"u": -c.value * s.x}\n'
    )
    script = (
        "import hovercontrol, hovercontrol.craft.models.modelfile as f\n"
        "m = f.model_from_table({'effects': {'tether': 2.0}})\n"
        "print(hovercontrol.__file__, m.plant().equations().splitlines()[3])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith(str(tmp_path))
    assert "u' = -plant.tether*x + r*v" in done.stdout


def test_two_effects_cannot_share_a_name(skirt_leak):
    with pytest.raises(InputError, match="already in"):

        class Impostor(Effect):
            name = "skirt_leak_in_a_test"


def test_an_effect_that_says_not_what_it_adds_is_refused():
    with pytest.raises(InputError, match=r"effect mute: Mute defines none of terms, .*; term\(\) is none"):

        class Mute(Effect):
            name = "mute"
            value = Coefficient("1/s")

            def term(self, c, s):
                return {"v": c.value * s.v}

    assert "mute" not in Effect.known


def test_a_name_that_no_parameter_may_have_is_refused():
    with pytest.raises(InputError, match="effect 'spin force': expected letters"):

        class Spin(Effect):
            name = "spin force"

            def terms(self, c, s):
                return {}


@pytest.mark.parametrize(
    ("term", "said"),
    [
        ("c.value * s.yawrate", "'yawrate' does not exist here; known: .*psi, r, rudder"),
        ("c.vale * s.r", "'vale' does not exist here; did you mean 'value'"),
        ("np.sqrt(s.u)", "NameError: name 'np' is not defined"),
    ],
)
def test_a_fault_in_an_effect_is_told_with_its_line(term, said, tmp_path):
    file = tmp_path / "own.py"
    file.write_text(
        "import hovercontrol as hc\nclass Spin(hc.Effect):\n    name = 'spin_in_a_test'\n"
        f"    value = hc.Coefficient('1')\n    def terms(self, c, s):\n        return {{'v': {term}}}\n"
        "MODEL = hc.vehicle('c17_simulation')\n"
    )
    try:
        model = from_python(f"{file}:MODEL", Model)
        with pytest.raises(InputError, match=rf"effect spin_in_a_test: .*own.py, line 6: .*{said}"):
            model.with_effects([effect("spin_in_a_test", 0.1)]).plant()
    finally:
        Effect.known.pop("spin_in_a_test", None)


@pytest.mark.parametrize(
    ("bounds", "said"),
    [
        ({"lower": 2.0, "upper": 1.0}, "lower is above upper"),
        ({"lower": 1.0}, r"neutral = 0 .* not within the bounds \[1, inf\]"),
        ({"upper": 1.0, "default": 2.0}, "default = 2 is not within"),
    ],
)
def test_bounds_that_leave_no_effect_out_are_refused(bounds, said):
    with pytest.raises(InputError, match=said):
        Coefficient("1", **bounds)


def test_an_unknown_effect_is_answered_with_the_nearest():
    with pytest.raises(InputError, match="unknown effect 'yaw_colomb'; did you mean 'yaw_coulomb'"):
        effect("yaw_colomb", 0.8)
    with pytest.raises(InputError, match="did you mean"):
        effect_class("thurst")


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({}, "'value' is missing"),
        ({"value": -0.1}, r"value = -0\.1 is out of its bounds \[0, inf\]"),
        ({"value": float("nan")}, "value"),
        ({"value": float("inf")}, "value must be a finite number"),
        ({"value": "0.8"}, "value: expected a number or None, found '0.8'"),
        ({"value": True}, "value: expected a number or None"),
        ({"value": 1.0, "widht": 0.1}, "unknown number 'widht'; did you mean 'width'"),
        ({"value": 1.0, "width": 0.0}, "width = 0 is out of its bounds"),
    ],
)
def test_numbers_that_make_no_effect_are_refused_by_name(numbers, message):
    with pytest.raises(InputError, match=f"effect( yaw_coulomb)?: .*{message}"):
        effect("yaw_coulomb", **numbers)


def test_equal_numbers_make_equal_effects():
    assert effect("thrust", 1) == effect("thrust", value=1.0)
    assert hash(effect("thrust", 1)) == hash(effect("thrust", value=1.0))
    assert effect("thrust", 1.0) != effect("thrust", 2.0)
    assert effect("surge_linear_drag", 1.0) != effect("sway_linear_drag", 1.0)


@pytest.mark.parametrize("name", effect_names())
def test_every_effect_explains_itself_names_its_source_and_has_units(name):
    cls = effect_class(name)
    sentence = (cls.__doc__ or "").strip()
    assert sentence.splitlines()[0].endswith("."), "one sentence"
    assert cls.source
    for key, number in cls.numbers.items():
        assert number.unit, key
        assert number.lower <= number.upper


@pytest.mark.parametrize("name", effect_names())
def test_every_effect_travels_to_another_process(name):
    e = effect_class(name).small()
    assert pickle.loads(pickle.dumps(e)) == e


@pytest.mark.parametrize("name", [n for n in effect_names() if n.endswith(("_coulomb", "_drag"))])
def test_drag_coefficients_are_not_negative(name):
    numbers = effect_class(name).numbers
    assert all(n.lower >= 0.0 for n in numbers.values()) and numbers


def test_a_parameter_carries_the_sentence_and_the_bounds_of_its_effect():
    plant = Model("puck", [effect("yaw_coulomb", 0.83, width=0.02)]).plant()
    friction, width = plant.parameters
    assert (friction.name, friction.start, friction.lower) == ("plant.yaw_coulomb", 0.83, 0.0)
    assert friction.description == "Dry friction against yaw, a torque of constant size."
    assert (width.name, width.start, width.unit) == ("plant.yaw_coulomb_width", 0.02, "rad/s")
