"""Known coefficients come back from simulated logs, with honest standard errors."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import c17_experiment, four_fan
from hovercontrol.identification.identify import Identified, identify, measure
from hovercontrol.logs import Log
from hovercontrol.logs.frames import in_z_up
from tests.identification.diagnose.perturbed import perturbed

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")
C17_START = {
    "surge_coulomb": 0.7,
    "surge_linear_drag": 0.3,
    "sway_coulomb": 0.3,
    "sway_linear_drag": 0.6,
    "yaw_coulomb": 0.4,
    "yaw_linear_drag": 1.0,
    "thrust": 0.5,
    "rudder_torque": 2.0,
}


def deviations(found: Identified, truth: dict[str, float]) -> dict[str, float]:
    """Distance from the truth in standard errors."""
    return {f.name: abs(f.value - truth[f.name]) / f.std for f in found.coefficients}


@pytest.mark.slow("channels1", "channels2")
@pytest.mark.parametrize("channels", [VELOCITY, POSE, POSE + VELOCITY])
def test_c17_coefficients_come_back_from_velocities_pose_or_both(rudder_log, channels):
    truth = c17_experiment().coefficients()
    found = identify(c17_experiment().with_coefficients(C17_START), [rudder_log(channels)])
    assert found.converged
    assert max(deviations(found, truth).values()) < 3
    assert all(f.excited for f in found.coefficients)
    assert found["thrust"].std < 0.01 and found["rudder_torque"].std < 0.05
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert found.model.coefficients()["thrust"] == found["thrust"].value


@pytest.mark.slow
def test_noise_of_each_channel_is_estimated(rudder_log):
    found = identify(c17_experiment(), [rudder_log(POSE + VELOCITY)])
    expected = {"x": 1e-3, "y": 1e-3, "psi": 3e-3, "u": 5e-3, "v": 5e-3, "r": 2e-2}
    for channel, level in expected.items():
        assert found.noise[channel] == pytest.approx(level, rel=0.1)
        assert found.residual[channel] == pytest.approx(level, rel=0.1)


@pytest.mark.slow
def test_four_fan_coefficients_come_back_from_several_pose_logs(fan_log, fan_truth):
    found = identify(four_fan(), [fan_log(seed=1), fan_log(seed=2)])
    assert max(deviations(found, fan_truth.coefficients()).values()) < 3
    assert found["fan_torque"].value == pytest.approx(900, rel=0.01)
    assert found.logs == ("simulated", "simulated")


@pytest.mark.slow
def test_logs_may_measure_different_things(fan_log, fan_truth):
    found = identify(four_fan(), [fan_log(POSE, seed=1), fan_log(VELOCITY, seed=2)])
    assert set(found.noise) == {*POSE, *VELOCITY}
    assert max(deviations(found, fan_truth.coefficients()).values()) < 3


def test_velocity_logs_leave_the_pose_out(rudder_log):
    found = identify(c17_experiment(), [rudder_log(VELOCITY, seconds=10)])
    assert set(found.residual) == set(VELOCITY)


@pytest.mark.slow
def test_friction_width_can_be_sought(rudder_log):
    truth = c17_experiment().with_effects([effect("surge_coulomb", 1.35, width=0.03)])
    start = c17_experiment()
    log = rudder_log(VELOCITY, model=truth, seconds=60)
    names = [*start.linear_coefficients(), "surge_coulomb_width"]
    found = identify(start, [log], names)
    width = found["surge_coulomb_width"]
    assert width.value == pytest.approx(0.03, abs=3 * width.std) and width.std < 0.01


def test_a_cart_with_measured_position_is_identified(cart, cart_log):
    found = identify(cart, [cart_log(1), cart_log(2)])
    assert found.model.block == found.block
    assert max(deviations(found, {"drag": 0.6, "gain": 1.7}).values()) < 3
    assert found.block.parameter("cart.gain").start == found["gain"].value


@pytest.mark.slow
def test_standard_errors_cover_the_truth(cart, cart_log):
    truth = {"drag": 0.6, "gain": 1.7}
    hits = []
    for seed in range(30):
        found = identify(cart, [cart_log(100 + seed)])
        hits += [d < 1.96 for d in deviations(found, truth).values()]
    assert 0.85 <= np.mean(hits) <= 1.0
    # and they are no larger than what the estimates scatter, give or take
    found = [identify(cart, [cart_log(200 + seed)])["gain"] for seed in range(20)]
    scatter = np.std([f.value for f in found])
    assert 0.6 < np.median([f.std for f in found]) / scatter < 1.8


def test_a_coefficient_that_wants_to_be_negative_stops_at_its_bound(cart, cart_log):
    found = identify(cart, [cart_log(1, drag=-0.1)])
    assert found["drag"].value == 0.0 and found["drag"].bound == "lower"
    assert 0 < found["drag"].std < 0.1, "how far inside the truth might lie"
    assert "at its lower bound" in found.table()
    assert found["gain"].bound == ""
    assert identify(cart, [cart_log(1, drag=0.1)])["drag"].bound == ""


@pytest.mark.slow
def test_drag_that_is_not_there_is_found_to_be_zero(rudder_log):
    found = identify(c17_experiment().with_coefficients(C17_START), [rudder_log(seed=5)])
    for name in ("surge_linear_drag", "sway_coulomb"):
        assert 0 <= found[name].value < 3 * found[name].std < 0.1


def test_without_rudder_yaw_is_not_excited(rudder_log):
    found = identify(c17_experiment(), [rudder_log(POSE, rudder=0.0, seconds=16, rate=50.0)])
    for name in ("rudder_torque", "yaw_coulomb", "yaw_linear_drag"):
        assert not found[name].excited, found.table()
    assert "rudder stays 0" in found["rudder_torque"].reason
    assert found["rudder_torque"].value == pytest.approx(3.66)
    assert found["thrust"].excited
    assert found["thrust"].value == pytest.approx(0.75, abs=3 * found["thrust"].std)


def test_twins_are_named(cart, cart_log):
    """Two gains that multiply the same force: only their sum is known."""
    twin = Signal("cart.twin", "1/kg", start=0.5)
    force = cart.inputs[0]
    both = Block(
        "cart",
        cart.states,
        cart.inputs,
        cart.outputs,
        [*cart.parameters, twin],
        {**cart.derivatives, "v": cart.derivatives["v"] + twin.symbol * force.symbol},
    )
    found = identify(both, [cart_log(1)])
    assert found["drag"].excited and not found["gain"].excited and not found["twin"].excited
    assert "twin" in found["gain"].reason
    assert found.unexcited[0]["gain"] == pytest.approx(-found.unexcited[0]["twin"])
    assert found["gain"].value + found["twin"].value == pytest.approx(1.7, rel=0.05)
    assert found["gain"].value - found["twin"].value == pytest.approx(0.5, abs=0.15)


@pytest.mark.slow
def test_a_lost_marker_does_not_bend_the_result(fan_log, fan_truth):
    log = fan_log(seed=3)
    bad = {name: log[name].copy() for name in POSE}
    bad["psi"][300:330] += np.pi
    bad["x"][700:704] += 0.5
    found = identify(four_fan(), [log.with_columns(bad)])
    assert max(deviations(found, fan_truth.coefficients()).values()) < 3
    assert found.chi2_per_dof < 1.3


def test_outliers_in_velocities_are_left_out(rudder_log):
    log = rudder_log(VELOCITY)
    rng = np.random.default_rng(0)
    r = log["r"].copy()
    r[rng.choice(r.size, r.size // 200, replace=False)] += 5.0
    truth = c17_experiment().coefficients()
    found = identify(c17_experiment().with_coefficients(C17_START), [log.with_columns({"r": r})])
    assert max(deviations(found, truth).values()) < 3
    assert found.residual["r"] == pytest.approx(0.02, rel=0.2)
    assert found.outliers == pytest.approx(r.size // 200, abs=3)
    assert f"{found.outliers} with an outlier" in found.table()


@pytest.mark.slow
def test_a_gap_ends_a_segment_but_does_not_bend_the_result(rudder_log):
    log = rudder_log(VELOCITY)
    log = log.select((log.time < 7.3) | (log.time > 9.1))
    measured = measure(c17_experiment().plant(), log)
    assert [log.time[a] for a, _ in measured.segments] == pytest.approx([0.0, 9.11])
    found = identify(c17_experiment().with_coefficients(C17_START), [measured])
    assert max(deviations(found, c17_experiment().coefficients()).values()) < 3


@pytest.mark.slow
def test_rows_at_irregular_times_are_taken_as_they_are(rudder_log):
    log = rudder_log(VELOCITY)
    keep = np.random.default_rng(0).random(len(log)) < 0.6
    found = identify(c17_experiment().with_coefficients(C17_START), [log.select(keep)])
    assert max(deviations(found, c17_experiment().coefficients()).values()) < 3
    assert found.misfit == ""


def test_a_huge_log_is_thinned_and_says_so(rudder_log):
    log = rudder_log(VELOCITY, seconds=10)
    t = 0.01 * np.arange(10 * len(log))
    long = Log("long", t, {k: np.tile(v, 10) for k, v in log.columns.items()})
    found = identify(c17_experiment(), [long], most_rows=2000)
    assert found.rows <= 2000 and found.rows_total == 10_000
    assert f"{found.rows} of 10000 rows" in found.table()


def test_what_is_wrong_is_said_in_one_line(rudder_log):
    log = rudder_log(VELOCITY, seconds=5)
    model = c17_experiment()
    renamed = {("trust" if k == "thrust" else k): v for k, v in log.columns.items()}
    with pytest.raises(InputError, match="no column 'thrust'; did you mean 'trust'"):
        identify(model, [Log("run", log.time, renamed)])
    with pytest.raises(InputError, match="simulated: too few rows: no stretch of 12 follows on"):
        identify(model, [log.between(0.0, 0.1)])
    with pytest.raises(InputError, match="no coefficient 'yaw_colomb'; did you mean 'yaw_cou"):
        identify(model, [log], ["yaw_colomb"])
    with pytest.raises(InputError, match="coefficient 'thrust' is named twice"):
        identify(model, [log], ["thrust", "yaw_coulomb", "plant.thrust"])
    with pytest.raises(InputError, match="simulated: rows are 10 s apart: is its time in seconds"):
        identify(model, [Log(log.name, 1000 * log.time, dict(log.columns))])
    with pytest.raises(InputError, match="at least one log"):
        identify(model, [])
    with pytest.raises(InputError, match="nothing that 'plant' computes was measured"):
        identify(model, [Log("run", log.time, {k: log[k] for k in ("thrust", "rudder")})])
    holed = log["thrust"].copy()
    holed[7] = np.inf
    with pytest.raises(InputError, match=r"input 'thrust' is not finite at 0\.07 s"):
        identify(model, [log.with_columns({"thrust": holed})])


def test_a_result_is_tabled_and_saved(rudder_log, tmp_path):
    parts = []
    found = identify(
        c17_experiment(), [rudder_log(VELOCITY, seconds=10)], progress=lambda part, what: parts.append(part)
    )
    assert parts == sorted(parts) and parts[-1] == 1.0
    assert "rudder_torque" in found.table() and "chi2/dof" in found.table()
    with found.save_csv(tmp_path / "found.csv").open() as stream:
        rows = {row["name"]: row for row in csv.DictReader(stream)}
    assert float(rows["thrust"]["value"]) == found["thrust"].value
    assert rows["thrust"]["excited"] == "True"


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("rudder", 180 / np.pi, r"column 'rudder': expected -0\.4538 to 0\.4538 rad, found .* in degrees\?"),
        ("thrust", 100.0, r"column 'thrust': expected 0 to 6\.1 A, found \d+\.?\d* at \d+\.?\d* s$"),
        ("thrust", -1.0, r"column 'thrust': expected 0 to 6\.1 A, found -"),
    ],
)
def test_commands_outside_the_models_bounds_are_refused(rudder_log, column, factor, said):
    log = rudder_log(VELOCITY, seconds=5)
    with pytest.raises(InputError, match=said):
        identify(c17_experiment(), [log.with_columns({column: factor * log[column]})])
    slightly = np.minimum(2 * log["thrust"], 1.04 * 6.1)
    assert measure(c17_experiment().plant(), log.with_columns({"thrust": slightly})).inputs.max() > 6.1


def test_a_yaw_rate_in_degrees_is_refused(rudder_log):
    log = rudder_log(POSE + VELOCITY, seconds=30)
    with pytest.raises(InputError, match="expected a yaw rate in rad/s; it says 57 times what the heading"):
        identify(c17_experiment(), [log.with_columns({"r": np.degrees(log["r"])})])


def test_the_commanded_angle_of_a_servo_may_be_many_turns():
    angle, rate, wanted = Signal("angle", "rad"), Signal("rate", "rad/s"), Signal("wanted", "rad")
    gain, damping = Signal("gain", "1/s^2", start=20.0), Signal("damping", "1/s", start=3.0)
    pull = gain.symbol * (wanted.symbol - angle.symbol) - damping.symbol * rate.symbol
    servo = Block(
        "servo",
        [angle, rate],
        [wanted],
        [angle, rate],
        [gain, damping],
        {"angle": rate.symbol, "rate": pull},
    )
    t, rng = np.arange(0, 6, 0.02), np.random.default_rng(0)
    turns = np.repeat(rng.uniform(-40.0, 40.0, 6), 50)
    moved = simulate(servo, t, [turns], params={"servo.gain": 25.0})
    columns = {name: moved[name] + 0.01 * rng.normal(size=t.size) for name in ("angle", "rate")}
    found = identify(servo, [Log("turns", t, {**columns, "wanted": turns})], ["gain"])
    assert found["gain"].value == pytest.approx(25.0, rel=1e-3)


def test_a_craft_that_never_moves_is_refused(rudder_log):
    log = rudder_log(POSE, seconds=5)
    still = log.with_columns({c: np.full(len(log), 0.1) for c in POSE})
    with pytest.raises(InputError, match="simulated: the craft never moves: x, y, psi are constant"):
        identify(c17_experiment(), [log, still])
    moving = rudder_log(VELOCITY, seconds=5)
    with pytest.raises(InputError, match="simulated: column 'v' is constant"):
        identify(c17_experiment(), [moving.with_columns({"v": np.zeros(len(moving))})])


@pytest.mark.slow
def test_noise_is_not_below_what_the_resolution_makes(rudder_log):
    """A coarse sensor's value stands still between its steps: most third differences are zero."""
    log = rudder_log(VELOCITY, seconds=10, noise=0.0)
    steps = {c: np.ptp(log[c]) / 15 for c in VELOCITY}
    coarse = {c: step * np.rint(log[c] / step) for c, step in steps.items()}
    found = identify(c17_experiment(), [log.with_columns(coarse)], ["thrust", "rudder_torque"])
    for c, step in steps.items():
        assert found.noise[c] == pytest.approx(step / np.sqrt(12))


def test_a_fit_that_does_not_explain_the_log_says_how_much_remains(rudder_log):
    log = rudder_log(POSE, seconds=10)
    mirrored = in_z_up(log.with_columns({"x": log["y"], "y": log["x"]}), "z-up")  # taken as it is
    swapped = identify(c17_experiment(), [mirrored])
    u = swapped.remaining[0]
    assert u.equation == "u'" and u.unit == "m/s^2" and u.over == 0.2
    assert "the model does not explain the logs" in swapped.table()
    assert f"{u.rms:.2g} of {u.seen:.2g} m/s^2 in u'" in swapped.misfit
    right = identify(c17_experiment(), [log])
    assert right.misfit == "" and max(r.share for r in right.remaining) < 0.1


@pytest.mark.slow
def test_a_model_that_moves_by_the_commands_of_another_run_predicts_nothing(cart, cart_log, rudder_log):
    log, other = cart_log(1, seconds=60.0), cart_log(2, seconds=60.0)
    found = identify(cart, [log.with_columns({"F": other["F"]})])
    assert "this model does not predict the motion" in found.table(), found.table()
    assert "0.25 s ahead no better than assuming constant velocity" in found.misfit
    craft, turned = rudder_log(POSE, seconds=20), rudder_log(POSE, seconds=20, seed=2)
    found = identify(c17_experiment(), [craft.with_columns({"rudder": turned["rudder"]})])
    assert "it does not predict r; something is missing or wrong" in found.misfit


def test_what_a_model_lacks_is_told_in_its_equation_and_does_not_bend_the_others(rudder_log):
    """A craft in waves of half a metre per second squared: nothing in the model says so."""
    calm, pushed = c17_experiment(), c17_experiment().with_effects([effect("slope", x=0.5)])
    found = identify(calm, [rudder_log(POSE + VELOCITY, model=pushed)])
    u, v, r = found.remaining
    assert 0.1 < u.rms < 0.5 and 0.1 < v.rms < 0.5, "a slope in the earth frame, seen from the turning craft"
    assert r.share < 0.05
    truth = calm.coefficients()
    for name in ("rudder_torque", "yaw_coulomb", "yaw_linear_drag"):
        assert found[name].value == pytest.approx(truth[name], abs=3 * found[name].std)


def test_only_rows_with_a_measurement_count_as_used(fan_log):
    log = fan_log(seed=3, seconds=10)
    psi = log["psi"].copy()
    psi[300:330] += np.pi
    found = identify(four_fan(), [log.with_columns({"psi": psi})])
    assert found.rows_total == 500 and 400 < found.rows <= 470


def weak(rudder_log, seed):
    """A pose every second that is seen to 30 cm: little more than that the craft moved."""
    slow = rudder_log(POSE, seconds=41, rate=50.0).select(slice(None, None, 50))
    rng = np.random.default_rng(seed)
    return slow.with_columns({c: slow[c] + 0.3 * rng.standard_normal(len(slow)) for c in POSE})


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_log_that_tells_little_ends_in_what_rounding_does_not_change(rudder_log, seed):
    """Another processor rounds otherwise: numbers changed by 1e-13 to 1e-10 of themselves do the same.

    The result is the same, or it is said that the logs do not determine it.
    """
    log = weak(rudder_log, seed)
    found = identify(c17_experiment(), [log])
    assert not all(f.excited for f in found.coefficients)
    for k, size in enumerate((1e-13, 1e-10)):
        again = identify(c17_experiment(), [perturbed(log, size, np.random.default_rng(k))])
        assert again.not_converged == found.not_converged
        close = 0.01 if found.converged else 0.2
        for one, other in zip(found.coefficients, again.coefficients, strict=True):
            assert one.excited == other.excited
            assert not one.excited or abs(one.value - other.value) < close * one.std


def test_a_force_that_lags_behind_its_command_need_not_be_measured():
    v, f, c = Signal("v", "m/s"), Signal("f", "N"), Signal("c", "N")
    gain, lag = Signal("gain", "1/kg", start=1.0), Signal("lag", "s", start=0.2, lower=0.01)
    slopes = {"v": gain.symbol * f.symbol, "f": (c.symbol - f.symbol) / lag.symbol}
    block = Block("lag", [v, f], [c], [v], [gain, lag], slopes)
    rng, t = np.random.default_rng(2), np.arange(0.0, 20.0, 0.05)
    push = np.repeat(rng.uniform(-1.0, 1.0, 40), 10)
    speed = simulate(block, t, {"c": push}, params={"lag.gain": 1.7, "lag.lag": 0.3}).states[0]
    log = Log("run", t, {"v": speed + 5e-3 * rng.standard_normal(t.size), "c": push})
    found = identify(block, [log], ["gain", "lag"])
    assert max(deviations(found, {"gain": 1.7, "lag": 0.3}).values()) < 3
    assert found["lag"].std < 0.02 and [r.equation for r in found.remaining] == ["v'", "f'"]


@pytest.mark.slow
def test_dry_friction_is_found_from_rows_far_apart(rudder_log):
    """Steps from row to row are cut as fine as friction of 1 cm/s width needs."""
    found = identify(c17_experiment().with_coefficients(C17_START), [rudder_log(POSE, rate=20.0)])
    assert max(deviations(found, c17_experiment().coefficients()).values()) < 3
    assert found["yaw_coulomb"].std < 0.02


def test_a_slow_plant_has_slow_rows():
    """A tank that empties in minutes, its level read every four seconds."""
    h, k, q, a = (
        Signal("h", "m"),
        Signal("k", "1/s", start=0.02),
        Signal("q", "1"),
        Signal("a", "m/s", start=0.01),
    )
    tank = Block("tank", [h], [q], [h], [k, a], {"h": a.symbol * q.symbol - k.symbol * h.symbol})
    rng, t = np.random.default_rng(0), np.arange(0.0, 2000.0, 4.0)
    pump = np.repeat(rng.uniform(0.0, 1.0, 34), 15)[: t.size]
    level = simulate(tank, t, {"q": pump}, params={"tank.k": 0.03, "tank.a": 0.013}).states[0]
    found = identify(tank, [Log("tank", t, {"h": level + 1e-3 * rng.standard_normal(t.size), "q": pump})])
    assert max(deviations(found, {"k": 0.03, "a": 0.013}).values()) < 3
    assert found["k"].std < 1e-3


def test_a_blocks_parameter_that_is_not_linear_can_be_sought(cart):
    """The mass stands below: a shape, so it is sought by name only."""
    m = Signal("cart.mass", "kg", start=1.0, lower=0.1)
    F, v = cart.inputs[0].symbol, cart.states[1].symbol
    drag = cart.parameters[0]
    heavy = replace(cart, parameters=(m, drag), derivatives={"p": v, "v": F / m.symbol - drag.symbol * v})
    rng, t = np.random.default_rng(1), np.arange(0.0, 12.0, 0.05)
    force = np.repeat(rng.uniform(-1.0, 1.0, 20), 12)
    p = simulate(heavy, t, {"F": force}, params={"cart.mass": 0.4}).states[0]
    found = identify(
        heavy, [Log("run", t, {"p": p + 0.005 * rng.standard_normal(t.size), "F": force})], ["mass"]
    )
    assert found["mass"].value == pytest.approx(0.4, abs=3 * found["mass"].std)
    assert found["mass"].std < 0.05 and found["mass"].start == 1.0
