"""What any machine may lack: made from its signals, by definition, with units that fit."""

import math
import pickle

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import Effect, effect
from hovercontrol.craft.effects.actuator import TAU
from hovercontrol.craft.effects.generic import generic_effects
from hovercontrol.craft.models.blockmodel import BlockModel

Q, V, A = 0.3, -0.7, 1.2  # angle, rate, current
K, B, J = 0.1, 0.02, 0.01


def drive(**values):
    q, v, u = Signal("q", "rad"), Signal("v", "rad/s"), Signal("u", "A")
    k, b = Signal("k", "N*m/A", start=K), Signal("b", "N*m*s", start=B)
    inertia = Signal("J", "kg*m^2", start=J, lower=1e-9)
    slope = (k.symbol * u.symbol - b.symbol * v.symbol) / inertia.symbol
    block = Block("drive", [q, v], [u], [q], [k, b, inertia], {"q": v.symbol, "v": slope})
    return BlockModel(block.with_values(values))


def tanks():
    """Two tanks, one above the other, with a pump each: Torricelli."""
    levels = [Signal("upper", "m", start=0.1, lower=0.0), Signal("lower", "m", start=0.1, lower=0.0)]
    pumps = [Signal("pump[0]", "V"), Signal("pump[1]", "V")]
    k, c = Signal("tanks.k", "m/s/V", start=0.01), Signal("c", "m^(1/2)/s", start=0.02)
    out = [c.symbol * sp.sqrt(sp.Max(0, s.symbol)) for s in levels]
    inflow = [k.symbol * p.symbol for p in pumps]
    slopes = {"upper": inflow[0] - out[0], "lower": inflow[1] + out[0] - out[1]}
    return BlockModel(Block("tanks", levels, pumps, levels, [k, c], slopes))


@pytest.mark.parametrize("name", ["time", "true", "late"])
def test_a_signal_with_a_name_that_effects_need_is_refused_in_one_line(name):
    v, k = Signal(name, "m/s"), Signal("k", "1/s", start=1.0)
    block = Block("cart", [v], [], [v], [k], {name: -k.symbol * v.symbol})
    with pytest.raises(InputError, match=f"cart.*reserved signal name '{name}': effects .* this name"):
        BlockModel(block)


def changed(name, value=None, x=(), **numbers):
    model = drive()
    e = model.effect_class(name)(value, **numbers)
    found = model.with_effects([e]).plant().to_numpy().derivatives(2.0, [Q, V, *x], [A])
    bare = model.plant().to_numpy().derivatives(2.0, [Q, V], [A])
    assert found[0] == bare[0], "kinematics is exact"
    return found[1] - bare[1], found[2:]


PUSH = K * A / J
FORCES = {
    "v_offset": ((0.4,), {}, 0.4),
    "v_linear_drag": ((0.4,), {}, -0.4 * V),
    "v_quadratic_drag": ((0.4,), {}, -0.4 * abs(V) * V),
    "v_coulomb": ((0.4,), {"width": 1e-3}, 0.4),
    "v_stribeck": ((0.4,), {"width": 1e-3, "speed": 0.5}, 0.4 * math.exp(-((V / 0.5) ** 2))),
    "v_load_friction": ((0.04,), {"width": 1e-3}, 0.04 * PUSH),
    "v_spring": ((3.0,), {}, -3.0 * Q),
    "v_asymmetric_drag": ((0.4,), {}, -0.4 * abs(V)),
    "u_offset": ((0.5,), {}, 0.5 * K / J),
    "u_asymmetry": ((0.2,), {}, 0.2 * A * K / J),
    "u_deadzone": ((0.5,), {}, -0.5 * K / J),
    "u_saturation": ((0.5,), {}, (0.5 - A) * K / J),
}


@pytest.mark.parametrize("name", FORCES)
def test_what_an_equation_and_an_input_may_lack(name):
    value, numbers, expected = FORCES[name]
    assert changed(name, *value, **numbers)[0] == pytest.approx(expected)


def test_what_has_a_memory():
    force, (slope,) = changed("u_lag", x=[0.4], seconds=0.2)
    assert (force, slope) == pytest.approx(((0.4 - A) * K / J, (A - 0.4) / 0.2))
    force, (slope,) = changed("u_backlash", x=[0.4], width=0.2)
    acting = A - 0.1  # half the width behind the command at once
    assert (force, slope) == pytest.approx(((acting - A) * K / J, (acting - 0.4) / TAU))
    force, (slope,) = changed("u_hysteresis", x=[0.4], value=0.3, play=0.2)
    assert (force, slope) == pytest.approx((0.3 * (acting - A) * K / J, (acting - 0.4) / TAU))
    force, slopes = changed("u_second_order_lag", x=[0.4, 0.7], seconds=0.2, damping=0.5)
    expected = (0.4 - A) * K / J, 0.7, (A - 0.4 - 2 * 0.5 * 0.2 * 0.7) / 0.2**2
    assert (force, *slopes) == pytest.approx(expected)
    numbers = {"stiffness": 400.0, "damping": 8.0, "coulomb": 0.5, "static": 0.8, "speed": 0.5}
    z, level = 1e-3, 0.5 + 0.3 * math.exp(-((V / 0.5) ** 2))
    bent = V - 400 * abs(V) * z / level
    force, (slope,) = changed("v_lugre", x=[z], **numbers)
    assert (force, slope) == pytest.approx((-400 * z - 8 * bent, bent))


def test_an_offset_of_a_command_and_one_of_the_force_are_one_only_where_no_log_tells_them_apart():
    model = drive()
    command, force = model.effect_class("u_offset")(0.5), model.effect_class("v_offset")(0.5)
    assert command.twin(force) and force.twin(command) and not command.twin(command)
    assert (command.place(), force.place()) == ("command", "force")
    by_command = model.with_effects([command]).plant().to_numpy()
    by_force = model.with_effects([type(force)(0.5 * K / J)]).plant().to_numpy()
    for x in ([Q, V], [2.0, 3.0]):
        assert by_command.derivatives(1.0, x, [A]) == pytest.approx(by_force.derivatives(1.0, x, [A]))
    v, u, k = Signal("v", "m/s"), Signal("u", "V"), Signal("k", "m/s^2/V^2", start=2.0)
    curved = BlockModel(Block("pump", [v], [u], [v], [k], {"v": k.symbol * u.symbol**2}))
    two = curved.effect_class("u_offset")(0.1), curved.effect_class("v_offset")(0.1)
    assert not two[0].twin(two[1]), "behind a curve an offset of the command varies with the command"


def test_friction_of_the_load_sees_the_drive_as_it_arrives():
    model = drive()
    given = [model.effect_class("v_load_friction")(0.04), model.effect_class("u_lag")(seconds=0.2)]
    found = model.with_effects(given).plant().to_numpy().derivatives(0.0, [Q, V, 0.5], [A])[1]
    assert found == pytest.approx(0.5 * K / J * 1.04 - B / J * V)


def test_what_an_output_may_lack():
    model = drive()
    given = [model.effect_class("q_bias")(0.1), model.effect_class("q_scale")(0.02)]
    block = model.with_effects(given).plant()
    assert [s.name for s in block.outputs] == ["q", "q_measured"]
    assert block.to_numpy().outputs(0.0, [Q, V], [A])[1] == pytest.approx(1.02 * Q + 0.1)
    late = model.with_effects([effect("time_offset", seconds=0.1), effect("input_delay", seconds=0.2)])
    assert late.timing() == ("drive.input_delay_seconds", "drive.time_offset_seconds", "")


def test_pure_kinematics_is_not_amended():
    axes = {getattr(cls, "axis", "") for cls in drive().candidates()}
    assert axes == {"v", ""}


@pytest.mark.slow
@pytest.mark.parametrize("make", [drive, tanks])
def test_each_fits_the_machines_units_and_its_machine_code(make, rng):
    model = make()
    added = []
    for cls in model.candidates():
        assert cls.source and (cls.__doc__ or "").endswith("."), cls.name
        assert model.accepts(cls) and model.effect_class(cls.name) is cls
        numbers = {
            k: n.default if n.default is not None else min(max(0.4, n.lower), n.upper)
            for k, n in cls.numbers.items()
        }
        added.append(cls(**numbers))
        model.with_effects([added[-1]]).plant(late=True)
    whole = model.with_effects(added)
    assert whole.candidates() == ()
    block = whole.plant(late=True)
    compiled = block.compile(friction="smooth")
    for _ in range(20):
        x, u = rng.uniform(0, 1, len(block.states)), rng.normal(size=len(block.inputs))
        expected = block.to_numpy().derivatives(0.3, x, u)
        np.testing.assert_allclose(compiled.derivatives(0.3, x, u), expected, rtol=1e-9, atol=1e-9)


def test_the_size_of_an_input_is_its_own():
    model, given = tanks(), {"pump[0]": [1.0, -3.0], "pump[1]": [2.0]}
    assert model.input_size(model.effect_class("pump_1_deadzone"), given) == 2.0
    assert model.input_size(model.effect_class("input_delay"), given) == 3.0


def test_names_of_signals_that_are_no_words_are_made_ones():
    names = {cls.name for cls in tanks().candidates()}
    assert {"pump_0_deadzone", "pump_1_lag", "upper_offset", "lower_load_friction"} <= names
    assert "upper_spring" not in names and "input_delay" in names


def test_the_same_signals_make_the_same_class():
    one, other = drive(), drive(k=0.2)
    assert one.candidates() == other.candidates()
    e = one.effect_class("v_coulomb")(0.3)
    assert one.with_effects([e]).signature == one.with_effects([e]).with_coefficients({"k": 0.3}).signature
    assert pickle.loads(pickle.dumps(e)) == e
    assert type(pickle.loads(pickle.dumps(e))) is type(e)


def test_they_are_known_to_their_machine_alone():
    assert "v_coulomb" in generic_effects(drive().block)
    assert "v_coulomb" not in Effect.known
    with pytest.raises(InputError, match="unknown effect 'v_colomb'; did you mean 'v_coulomb'"):
        drive().effect_class("v_colomb")


def test_a_catalogue_says_what_may_be_missing_and_may_name_generic_effects():
    block = drive().block
    model = BlockModel(block, ["v_coulomb", "input_delay"])
    assert [cls.name for cls in model.candidates()] == ["v_coulomb", "input_delay"]
    assert BlockModel(block, []).candidates() == ()
    assert not BlockModel(block, []).accepts(generic_effects(block)["v_coulomb"])
