"""A model file says what the model is; what it says wrongly is answered with file and key."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.craft.effects import effect, effect_class, effect_names
from hovercontrol.craft.models.fans import BenchCurve, Polynomial
from hovercontrol.craft.models.model import Fan, Model
from hovercontrol.craft.models.modelfile import load_model, model_from_table, model_text, save_model
from hovercontrol.craft.models.motion import RUDDER, THRUST
from hovercontrol.craft.models.vehicles import VEHICLES, vehicle

FAN = "[fans]\nleft = {x = 0, y = 0, direction = 0, "
names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,9}", fullmatch=True)


@st.composite
def effects(draw):
    cls = effect_class(draw(st.sampled_from(effect_names())))
    numbers = {}
    for key, number in cls.numbers.items():
        if number.default is None or draw(st.booleans()):
            low = max(number.lower, -1e12)
            high = min(number.upper, 1e12)
            numbers[key] = draw(st.floats(low, high))
    return cls(**numbers)


forces = st.floats(-1e3, 1e3, allow_subnormal=False)
curves = st.one_of(
    st.none(),
    st.lists(forces, min_size=1, max_size=4).map(Polynomial),
    st.lists(forces.filter(bool), min_size=2, max_size=5).map(lambda f: BenchCurve(range(len(f)), f)),
)


@st.composite
def models(draw):
    chosen = {e.name: e for e in draw(st.lists(effects(), max_size=8))}
    taken = ("x", "y", "psi", "u", "v", "r", "t", "thrust", "rudder")
    fans = [
        Fan(n, *draw(st.tuples(*[st.floats(-2, 2)] * 3)), draw(curves), draw(st.none() | st.floats(0, 9)))
        for n in draw(st.lists(names.filter(lambda n: n not in taken), unique=True, max_size=3))
    ]
    if not fans:
        chosen = {n: e for n, e in chosen.items() if not n.startswith("fan_")}
    chosen = {n: e for n, e in chosen.items() if e.instead_of not in chosen}
    upper = draw(st.floats(0.1, 100))
    thrust = THRUST.replace(
        unit=draw(st.sampled_from(["1", "N", "A", "kg*m/s^2"])),
        upper=upper,
        description=draw(st.text(st.characters(codec="utf-8"), max_size=20)),
    )
    rudder = RUDDER.replace(lower=-upper, upper=upper) if draw(st.booleans()) else RUDDER
    return Model(
        draw(names | st.text(st.characters(codec="utf-8"), min_size=1, max_size=12)),
        list(chosen.values()),
        thrust,
        rudder,
        fans,
    )


@given(models())
def test_a_model_written_and_read_again_is_the_same_model(model):
    text = model_text(model)
    again = model_from_table(tomllib.loads(text))
    assert again == model
    assert model_text(again) == text
    assert again.plant(late=True).content_hash == model.plant(late=True).content_hash


@pytest.mark.parametrize("name", VEHICLES)
def test_every_craft_survives_the_disk(name, tmp_path):
    path = save_model(vehicle(name), tmp_path / "deep" / f"{name}.toml")
    assert load_model(path) == vehicle(name)


def test_a_missing_effect_is_a_missing_line(tmp_path):
    text = model_text(vehicle("c17_simulation"))
    path = tmp_path / "amended.toml"
    path.write_text("".join(line for line in text.splitlines(keepends=True) if "yaw_coulomb" not in line))
    full, amended = vehicle("c17_simulation"), load_model(path)
    assert {e.name for e in full.effects} - {e.name for e in amended.effects} == {"yaw_coulomb"}


def test_units_that_fit_are_converted():
    drag = model_from_table({"effects": {"yaw_coulomb": {"value": 90, "unit": "deg/s^2", "width": 0.02}}})
    assert drag.effects[0].values == pytest.approx({"value": math.pi / 2, "width": 0.02})
    thrust = model_from_table(
        {
            "inputs": {"thrust": {"unit": "A"}},
            "effects": {"thrust": {"value": 0.1, "unit": "m/s^2/mA"}},
        }
    )
    assert thrust.effects[0].values["value"] == pytest.approx(100.0)


def test_a_commands_lower_limit_may_lie_above_zero():
    craft = model_from_table({"inputs": {"thrust": {"lower": 0.5, "upper": 2.0}}, "effects": {"thrust": 1.0}})
    assert (craft.thrust.lower, craft.thrust.start) == (0.5, 0.5)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "[effects]\nyaw_colomb = 0.8\n",
            "unknown effect 'yaw_colomb'; did you mean 'yaw_coulomb'",
        ),
        ("[efects]\n", "unknown section 'efects'; did you mean 'effects'"),
        ("[plant]\nnmae = 'x'\n", "nmae.*did you mean 'name'"),
        ("[plant]\nname = 3\n", "plant.name must be text"),
        (
            "[effects]\nyaw_coulomb = -0.8\n",
            r"yaw_coulomb: value = -0\.8 is out of its bounds \[0, inf\]",
        ),
        ("[effects]\nyaw_coulomb = '0.8'\n", "effects.yaw_coulomb must be a number, found '0.8'"),
        ("[effects]\nyaw_coulomb = true\n", "effects.yaw_coulomb must be a number"),
        ("[effects]\nyaw_coulomb = nan\n", "yaw_coulomb.*number"),
        ("[effects]\nyaw_coulomb = inf\n", "yaw_coulomb.*number"),
        ("[effects]\nyaw_coulomb = {width = 0.1}\n", "yaw_coulomb: 'value' is missing"),
        ("[effects]\nyaw_coulomb = {value = 1, widht = 0.1}\n", "did you mean 'width'"),
        ("[effects]\nyaw_coulomb = {value = 1, width = 0}\n", "width = 0 is out of its bounds"),
        (
            "[effects]\nyaw_coulomb = {value = 1, unit = 'm/s^2'}\n",
            "effects.yaw_coulomb: unit must be like 'rad/s.2'",
        ),
        (
            "[effects]\nyaw_coulomb = {value = 1, unit = 'furlongs'}\n",
            "effects.yaw_coulomb: unit .*furlongs",
        ),
        ("[effects]\nyaw_coulomb = {value = 1, unit = 3}\n", "effects.yaw_coulomb.unit must be text"),
        ("[effects]\nyaw_coulomb = {unit = 'rad/s^2'}\n", "a unit needs a value"),
        ("[effects]\nfan_force = 1.0\n", "needs fans"),
        ("effects = 3\n", r"\[effects\] must be a table"),
        ("[fans]\nleft = 3\n", "fans.left must be a table"),
        ("[fans]\nleft = {x = 0.0, y = 0.1}\n", "fans.left: 'direction' is missing"),
        ("[fans]\nleft = {x = 0.0, y = 0.1, directoin = 0.0}\n", "did you mean 'direction'"),
        ("[fans]\nthrust = {x = 0.0, y = 0.1, direction = 0.0}\n", "'thrust' is taken"),
        ("[inputs]\nthurst = {}\n", "unknown input 'thurst'; did you mean 'thrust'"),
        ("[inputs]\nthrust = {unti = 'A'}\n", "did you mean 'unit'"),
        ("[inputs]\nthrust = {unit = 3}\n", "inputs.thrust.unit must be text"),
        ("[inputs]\nthrust = {upper = 'full'}\n", "inputs.thrust.upper must be a number"),
        ("[inputs]\nrudder = {unit = 'deg', lower = -26, upper = 26}\n", "rudder.*SI.*'deg'"),
        ("[inputs]\nrudder = {unit = 'm'}\n", "rudder.*not m"),
        ("[inputs]\nrudder = {lower = 3.0, upper = -1.0}\n", "inputs.rudder: lower = 3 is above upper = -1"),
        ("[inputs]\nthrust = {unit = 'Newtn'}\n", "inputs.thrust: .*Newtn"),
        ("[effects]\nspin_force = 1\n", "unknown effect 'spin_force'.*an own effect: load this file in"),
        (FAN + "curve = []}\n", "fans.left: curve must be a list of 1 or more finite numbers, found"),
        (FAN + "curve = 0.3}\n", "fans.left: curve must be a list of numbers, found 0.3"),
        (FAN + "curve = [0.1, 'x']}\n", "fans.left: curve.1. must be a number, found 'x'"),
        (FAN + "curve = {signal = [0, 1]}}\n", "fans.left.curve: 'force' is missing"),
        (FAN + "curve = {signal = [0, 1], froce = [0, 1]}}\n", "did you mean 'force'"),
        (FAN + "curve = {signal = [0, 1], force = [0]}}\n", "fans.left: curve.force must be a list of 2"),
        (FAN + "curve = {signal = [0, 1, 2], force = [0, 1]}}\n", "as many signals as forces.*3 and 2"),
        (FAN + "curve = {signal = [0, 1, 1], force = [0, 1, 2]}}\n", "must increase, found 1 after 1"),
        (FAN + "curve = {signal = [0, 1], force = [0, 0]}}\n", "all forces are zero"),
        (FAN + "gain = -1}\n", "left: gain must be zero or more, found -1"),
        (FAN + "gian = 1}\n", "did you mean 'gain'"),
        ("[effects]\nfan_lag = {seconds = 0.1}\n", "the effect 'fan_lag' needs fans"),
        (
            FAN.rstrip(", ") + "}\n[effects]\nfan_lag = {seconds = 0.1}\nthrust_lag = {seconds = 0.1}\n",
            "'thrust_lag' and 'fan_lag' are the same: keep one",
        ),
        ("[effects\n", "not readable as TOML.*line 1"),
        ("[effects]\nthrust = 1\nthrust = 2\n", "not readable as TOML.*line 3.*: 'thrust' occurs twice"),
        ("[effects]\nthrust = 0,75\n", "line 2.*: expected a decimal point, found a comma"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_in_one_line_with_the_files_name(content, message, tmp_path):
    path = tmp_path / "craft.toml"
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        load_model(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("make", [lambda p: p, lambda p: p / "nothing.toml"])
def test_a_folder_or_a_missing_file_is_said_to_be_one(make, tmp_path):
    with pytest.raises(InputError, match=str(tmp_path)):
        load_model(make(tmp_path))


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "craft.toml"
    path.write_bytes(b"\xff\xfe\x00binary")
    with pytest.raises(InputError, match="not readable as TOML: expected text, found binary data"):
        load_model(path)


def test_an_empty_file_is_a_craft_without_effects(tmp_path):
    path = tmp_path / "craft.toml"
    path.write_text("")
    assert load_model(path) == Model("hovercraft")


def test_only_numbers_that_differ_from_the_default_are_written():
    text = model_text(Model("puck", [effect("yaw_coulomb", 0.8), effect("surge_coulomb", 0.1, width=0.02)]))
    assert "yaw_coulomb = 0.8\n" in text
    assert "surge_coulomb = {value = 0.1, width = 0.02}\n" in text
