"""Fans: static curves, gains, and what may be missing of a craft with fans."""

import math

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.effects import Coefficient, Effect, effect, effect_class, effect_names
from hovercontrol.craft.models.fans import BenchCurve, Fan, Polynomial
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.modelfile import load_model, save_model
from hovercontrol.craft.models.vehicles import c17_simulation, four_fan
from hovercontrol.identification.engine.measure import measure
from hovercontrol.logs import Log

HOLOHOVER = (0.02683, 1.05084, -0.43372)
BENCH = BenchCurve((0.0, 0.2, 0.6, 1.0), (0.0, 0.05, 0.3, 0.6))
EFFECTS = [effect("fan_force", 1 / 0.14), effect("fan_torque", 1 / 3.4e-4)]


def craft(*effects, **numbers):
    fans = [Fan("a", 0.044, -0.015, math.pi / 2, **numbers), Fan("b", -0.009, 0.046, -2.6, **numbers)]
    return Model("holohover", [*EFFECTS, *effects], fans=fans)


def wrench(forces, turn=0.0):
    """u', v', r' of the two fans' forces from Newton and Euler."""
    total = np.zeros(3)
    for (x, y, direction), force in zip(
        [(0.044, -0.015, math.pi / 2), (-0.009, 0.046, -2.6)], forces, strict=True
    ):
        fx, fy = force * math.cos(direction + turn), force * math.sin(direction + turn)
        total += [fx / 0.14, fy / 0.14, (x * fy - y * fx) / 3.4e-4]
    return total


def pushed(model, signals, lags=()):
    return model.plant().to_numpy().derivatives(0.0, [*np.zeros(6), *lags], signals)


@pytest.mark.parametrize(
    ("curve", "law"),
    [
        (HOLOHOVER, lambda s: HOLOHOVER[0] * s + HOLOHOVER[1] * s**2 + HOLOHOVER[2] * s**3),
        (BENCH, lambda s: np.interp(s, BENCH.signals, BENCH.forces)),
    ],
)
def test_a_fan_pushes_by_its_static_curve(curve, law, rng):
    model = craft(curve=curve)
    assert {s.unit for s in model.plant().inputs} == {"1"}
    compiled = model.plant().compile(friction="smooth")
    for _ in range(20):
        signals = rng.uniform(0, 1, 2)
        expected = wrench([law(s) for s in signals])
        np.testing.assert_allclose(pushed(model, signals)[3:], expected, atol=1e-10)
        np.testing.assert_allclose(compiled.derivatives(0.0, np.zeros(6), signals)[3:], expected, atol=1e-10)


@pytest.mark.parametrize("curve", [None, HOLOHOVER, BENCH])
def test_forces_of_a_log_are_those_of_the_plant(curve, rng):
    fan = Fan("a", 0, 0, 0, curve=curve, gain=1.1)
    values = {p.symbol: p.start for p in fan.parameters("plant")}
    for s in rng.uniform(0, 1, 5):
        at_once = float(fan.force("plant").subs(values).subs({fan.command().symbol: s}))
        assert fan.forces([s])[0] == pytest.approx(at_once)
    model = craft(curve=curve)
    size = model.input_size(effect_class("thrust_deadzone"), {"a": [0.1, 0.9], "b": [0.2, 0.2]})
    assert size == pytest.approx(float(Fan("a", 0, 0, 0, curve=curve).forces(0.9)))


def test_without_a_curve_the_input_is_the_force():
    assert [(s.name, s.unit) for s in craft().plant().inputs] == [("a", "N"), ("b", "N")]
    np.testing.assert_allclose(pushed(craft(), [0.2, 0.1])[3:], wrench([0.2, 0.1]))


def test_a_fan_that_reverses_may_pull(tmp_path):
    both_ways = craft(reverses=True)
    assert [s.lower for s in both_ways.plant().inputs] == [-math.inf, -math.inf]
    np.testing.assert_allclose(pushed(both_ways, [-0.2, 0.1])[3:], wrench([-0.2, 0.1]))
    save_model(both_ways, tmp_path / "craft.toml")
    assert load_model(tmp_path / "craft.toml") == both_ways
    with pytest.raises(InputError, match="a fan with a curve reverses where its curve does"):
        craft(reverses=True, curve=HOLOHOVER)


def test_a_log_in_which_a_fan_pulls_is_told_how_the_model_says_so():
    t = np.arange(0.0, 5.0, 0.05)
    log = Log("a", t, {"x": t, "y": t, "psi": t, "a": np.where(t > 2.0, -0.1, 0.1), "b": 0.1 + 0.0 * t})
    with pytest.raises(InputError, match=r"found -0.1 at .*reverses = true in the model file"):
        measure(craft().plant(), log, t.size)


def test_a_bench_curve_bounds_its_signal():
    signal = Fan("a", 0, 0, 0, curve=BenchCurve((0.1, 1.0), (0.0, 1.0))).command()
    assert (signal.lower, signal.upper, signal.start) == (0.1, 1.0, 0.1)


def test_effects_of_thrust_act_on_the_force_behind_the_curve():
    curve = Polynomial(HOLOHOVER)
    at = sum(c * 0.7**k for k, c in enumerate(HOLOHOVER, 1))
    found = pushed(craft(effect("fan_lag", seconds=0.03), curve=curve), [0.7, 0.0], [0.1, 0.2])
    np.testing.assert_allclose(found[3:6], wrench([0.1, 0.2]))
    np.testing.assert_allclose(found[6:], [(at - 0.1) / 0.03, -0.2 / 0.03])
    found = pushed(craft(effect("thrust_deadzone", 0.05), curve=curve), [0.7, 0.0])
    np.testing.assert_allclose(found[3:6], wrench([at - 0.05, 0.0]), atol=1e-10)


def test_fans_misaligned_turn_about_their_own_places():
    found = pushed(craft(effect("fan_misalignment", 0.1)), [0.2, 0.3])
    np.testing.assert_allclose(found[3:], wrench([0.2, 0.3], turn=0.1))
    found = pushed(craft(effect("fan_misalignment", 0.0)), [0.2, 0.3])
    np.testing.assert_allclose(found[3:], wrench([0.2, 0.3]))


def test_a_gain_is_a_coefficient_only_where_it_is_given():
    assert not [name for name in craft().coefficients() if name.endswith("_gain")]
    model = craft(gain=1.05)
    assert model.coefficients()["a_gain"] == 1.05
    assert model.linear_coefficients() == ("fan_force", "fan_torque", "a_gain", "b_gain")
    changed = model.with_coefficients({"a_gain": 0.9})
    assert changed.fans[0].gain == 0.9 and changed.fans[1].gain == 1.05
    assert changed.signature == model.signature
    np.testing.assert_allclose(pushed(changed, [0.2, 0.1])[3:], wrench([0.18, 0.105]))
    with pytest.raises(InputError, match="gain must be zero or more"):
        model.with_coefficients({"a_gain": -0.9})


@pytest.mark.parametrize("curve", [None, HOLOHOVER, BENCH])
def test_a_craft_with_curves_and_gains_survives_the_disk(curve, tmp_path):
    model = craft(effect("fan_lag", seconds=0.03), curve=curve, gain=1.02)
    again = load_model(save_model(model, tmp_path / "craft.toml"))
    assert again == model
    assert again.plant() == model.plant()


def test_one_fan_may_have_a_gain_and_a_bend_of_its_own(tmp_path):
    bare = craft()
    gain, bend = bare.effect_class("b_gain")(0.8), bare.effect_class("a_curve")(0.3, scale=0.4)
    found = pushed(bare.with_effects([gain, bend]), [0.2, 0.3])
    np.testing.assert_allclose(found[3:], wrench([0.2 * (1 + 0.3 * (1 - 0.2 / 0.4)), 0.24]))
    again = load_model(save_model(bare.with_effects([gain, bend]), tmp_path / "craft.toml"))
    assert again == bare.with_effects([gain, bend])
    given = craft(gain=1.0)
    assert "a_gain" not in {cls.name for cls in given.candidates()}, "it is a coefficient already"
    with pytest.raises(InputError, match="unknown effect 'c_gain'"):
        bare.effect_class("c_gain")


def test_fans_that_share_a_supply_weaken_each_other():
    found = pushed(craft(effect("fan_crosstalk", 0.5)), [0.2, 0.3])
    np.testing.assert_allclose(found[3:], wrench([0.2 * (1 - 0.5 * 0.3), 0.3 * (1 - 0.5 * 0.2)]))


def test_the_speed_of_a_fan_lags_before_its_static_curve():
    def law(s):
        return sum(c * s**k for k, c in enumerate(HOLOHOVER, 1))

    found = pushed(craft(effect("fan_signal_lag", seconds=0.05), curve=HOLOHOVER), [0.7, 0.1], [0.4, 0.3])
    np.testing.assert_allclose(found[3:6], wrench([law(0.4), law(0.3)]))
    np.testing.assert_allclose(found[6:], [0.3 / 0.05, -0.2 / 0.05])
    assert not craft().accepts(effect_class("fan_signal_lag")), "without a curve it is fan_lag"


class _SideWash(Effect, register=False):
    """One fan's wash on the hull, by its signal and by its force."""

    name, source = "side_wash", "a test"
    value = Coefficient("rad/s^2")
    wash = Coefficient("rad/s^2/N")

    def terms(self, c, s):
        return {"r": c.value * s.inputs["a"] + c.wash * (s.thrusts["a"] + 10 * s.thrusts["b"])}


def test_an_effect_of_ones_own_sees_each_fan_as_it_is_sent_and_as_it_acts():
    lagged = craft(_SideWash(1.0, wash=10.0), effect("fan_lag", seconds=0.05), curve=HOLOHOVER)
    without = craft(effect("fan_lag", seconds=0.05), curve=HOLOHOVER)
    added = pushed(lagged, [0.7, 0.1], [0.2, 0.03])[5] - pushed(without, [0.7, 0.1], [0.2, 0.03])[5]
    assert added == pytest.approx(0.7 + 10 * 0.2 + 100 * 0.03)


# ---- what may be missing -------------------------------------------------------------------------

SAME = {"thrust_lag", "input_delay"}
RUDDER = {n for n in effect_names() if "rudder" in n} | {"thrust", "thrust_yaw_torque", "load_friction"}
ASKED_FOR = {
    "cross_flow_drag", "sway_mass",
    "air_drag", "body_yaw_torque", "gyro_drift", "mass_drift", "surge_cubic_drag",
    "sway_cubic_drag", "yaw_cubic_drag",
}  # fmt: skip
FAN = {n for n in effect_names() if n.startswith("fan_")}


def test_a_search_tries_what_acts_on_the_craft():
    everything = set(effect_names())
    rudder, fan = c17_simulation(), four_fan()
    found = {cls.name for cls in rudder.candidates()}
    assert found == everything - FAN - ASKED_FOR - {e.name for e in rudder.effects}
    found = {cls.name for cls in fan.candidates()}
    each = {f"{f.name}_{what}" for f in fan.fans for what in ("gain", "curve")}
    before = {"fan_signal_lag"}  # considered only where it is named
    assert found == (everything | each) - RUDDER - SAME - ASKED_FOR - before - {e.name for e in fan.effects}
    bare = {cls.name for cls in Model("puck").candidates()}
    assert not bare & (RUDDER | SAME | FAN | ASKED_FOR | {"battery_sag", "thrust_curve", "thrust_deadzone"})


def test_the_same_thing_is_not_tried_under_two_names():
    old = four_fan().with_effects([effect("thrust_lag", seconds=0.1)])
    assert "fan_lag" not in {cls.name for cls in old.candidates()}
    with pytest.raises(InputError, match="'thrust_lag' and 'fan_lag' are the same: keep one"):
        old.with_effects([effect("fan_lag", seconds=0.1)])


def test_a_fan_lag_is_the_thrust_lag_of_an_older_file():
    x, forces = np.append(np.zeros(6), [0.1, 0.2, 0.0, 0.3]), [0.1, 0.2, 0.3, 0.4]
    old, new = (four_fan().with_effects([effect(n, seconds=0.1)]).plant() for n in ("thrust_lag", "fan_lag"))
    np.testing.assert_array_equal(
        old.to_numpy().derivatives(0, x, forces), new.to_numpy().derivatives(0, x, forces)
    )
    late = four_fan().with_effects([effect("fan_delay", seconds=0.02)])
    assert late.timing() == ("plant.fan_delay_seconds", "")


@pytest.mark.slow
def test_each_candidate_of_a_craft_fits_its_equations(rng):
    """Units, signs of bounds, and machine code: all at once, for each craft."""
    for model in (c17_simulation(), craft(curve=HOLOHOVER)):
        added = []
        for cls in model.candidates():
            numbers = {
                k: n.default if n.default is not None else min(max(0.4, n.lower), n.upper)
                for k, n in cls.numbers.items()
            }
            added.append(cls(**numbers))
            model.with_effects([added[-1]]).plant(late=True)
        block = model.with_effects(added).plant(late=True)
        smooth = block.compile(friction="smooth")
        for _ in range(20):
            x, u = rng.normal(size=len(block.states)), rng.uniform(0, 1, len(block.inputs))
            t = float(rng.uniform(0, 1))
            by_numpy = block.to_numpy().derivatives(t, x, u)
            np.testing.assert_allclose(smooth.derivatives(t, x, u), by_numpy, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(smooth.outputs(t, x, u), block.to_numpy().outputs(t, x, u), atol=1e-12)


def test_an_fmu_of_a_craft_with_curves_and_memories_moves_as_its_block(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    memories = [
        effect("fan_lag", seconds=0.03),
        effect("thrust_backlash", width=0.02),
        effect("lugre_yaw", stiffness=300.0, damping=8.0, coulomb=2.0, static=3.0, speed=0.1),
        effect("pose_lever_arm", x=0.01, y=-0.02),
    ]
    block = craft(*memories, curve=BENCH, gain=1.1).plant()
    time = np.arange(0.0, 1.0, 0.01)
    signals = np.array([0.3 + 0.3 * np.sin(7 * time), 0.4 + 0.4 * np.sin(11 * time)])
    expected = block.compile().simulate(time, signals, rtol=1e-9, atol=1e-11).outputs
    columns = [("time", float), ("a", float), ("b", float)]
    result = fmpy.simulate_fmu(
        str(block.to_fmu(tmp_path / "craft.fmu", step=0.01)),
        fmi_type="CoSimulation",
        input=np.array(list(zip(time, *signals, strict=True)), dtype=columns),
        stop_time=time[-1],
        output_interval=0.01,
        relative_tolerance=1e-9,
    )
    found = np.array([result[s.name] for s in block.outputs])
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert "x_measured" in [s.name for s in block.outputs]
