"""Monte Carlo runs: the errors of the navigation filters are as large as their covariances say."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis.ins_monte_carlo import (
    course,
    covariance,
    estimation_errors,
    innovations,
    inputs_of,
    ranged,
    sensed,
    started,
)
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    K06_NOISE,
    SensorErrors,
    aided_ins,
    consistency,
    coupled_filter,
    heading_filter,
    noise_from_sensors,
    range_filter,
    simulate_runs,
    velocity_position_filter,
)
from hovercontrol.craft.hardware.sensors import Beacons

RUNS = 100
#: A slower IMU than K06's keeps the tests quick; its noise per sample is K06's.
DT = 0.05
BEACONS = np.array([(0.0, 0.0), (4.0, 0.2), (0.1, 3.5), (3.8, 3.9)])
ABOVE = Beacons(BEACONS, 2.0)
APART = [(0.2, 0.0), (-0.2, 0.0)]


# ---- the measure itself ----------------------------------------------------------------------------------


def drawn(rng, P, ticks, runs, factor=1.0):
    root = np.linalg.cholesky(P)
    error = factor * np.einsum("ij,jtr->itr", root, rng.normal(size=(len(P), ticks, runs)))
    return error, np.broadcast_to(P[:, :, None, None], (*P.shape, ticks, runs))


def test_errors_drawn_from_their_covariance_are_consistent(rng):
    P = np.array([[2.0, 0.5], [0.5, 1.0]])
    found = consistency(*drawn(rng, P, 200, 50), rng.normal(size=(1, 200, 50)), np.ones((1, 200, 50)))
    assert found.nees_inside == pytest.approx(0.95, abs=0.01)
    assert found.nis_inside >= 0.88
    assert (
        np.mean((found.mean_nees > found.mean_nees_band[0]) & (found.mean_nees < found.mean_nees_band[1]))
        > 0.9
    )
    assert found.nees_band == pytest.approx((0.0506, 7.378), abs=1e-3)  # chi-square table, 2 degrees


def test_nees_is_the_squared_error_over_the_covariance():
    P = np.array([[4.0, 1.0], [1.0, 3.0]])
    e = np.array([1.0, 2.0])
    found = consistency(e[:, None, None], P[:, :, None, None])
    assert found.nees[0, 0] == pytest.approx(e @ np.linalg.inv(P) @ e)


@pytest.mark.parametrize(("factor", "side"), [(2.0, 1), (0.3, 0)])
def test_errors_larger_or_smaller_than_the_covariance_are_found(rng, factor, side):
    found = consistency(*drawn(rng, np.eye(3), 100, 30, factor))
    assert found.nees_inside < 0.8
    outside = found.mean_nees > found.mean_nees_band[1] if side else found.mean_nees < found.mean_nees_band[0]
    assert outside.mean() > 0.95


def test_only_measured_ticks_count(rng):
    v, there = rng.normal(size=(2, 60, 30)), np.zeros((60, 1), bool)
    there[::6] = True
    v = np.where(there, v, 1e3)
    e, P = drawn(rng, np.eye(1), 60, 30)
    found = consistency(e, P, v, np.ones_like(v), measured=there)
    np.testing.assert_allclose(found.nis, (v[:, ::6] ** 2).mean(axis=(0, 1)))


def test_plot_shows_both(rng):
    e, P = drawn(rng, np.eye(2), 20, 5)
    assert len(consistency(e, P).plot().axes) == 1
    axes = consistency(e, P, e, np.ones_like(e)).plot(np.arange(20) * 0.1).axes
    assert [a.get_ylabel() for a in axes] == ["NEES [1]", "NIS, mean over the run [1]"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((np.zeros((2, 3)), np.zeros((2, 2, 3))), "expected error of shape (n, ticks, runs)"),
        ((np.zeros((2, 3, 1)), np.zeros((3, 2, 3, 1))), "found (2, 3, 1) and (3, 2, 3, 1)"),
        ((np.zeros((1, 3, 1)), np.zeros((1, 1, 3, 1))), "not positive definite"),
        ((np.ones((1, 3, 1)), np.ones((1, 1, 3, 1)), np.ones((1, 3, 1))), "innovation_variance"),
        (
            (*[np.ones((1, 3, 1)), np.ones((1, 1, 3, 1))], np.ones((1, 3, 1)), np.zeros((1, 3, 1))),
            "not positive",
        ),
    ],
)
def test_wrong_input_of_the_measure(arguments, text):
    with pytest.raises(InputError) as error:
        consistency(*arguments)
    assert text in str(error.value) and "\n" not in str(error.value)


def test_wrong_level_and_nothing_measured():
    e, P = np.ones((1, 3, 2)), np.ones((1, 1, 3, 2))
    with pytest.raises(InputError, match="level must be between 0 and 1, found 95"):
        consistency(e, P, level=95)
    with pytest.raises(InputError, match="there is no measurement in run 1"):
        consistency(e, P, e, e, measured=[[[True, False]] * 3])


# ---- K06's two filters, with the noise that they assume --------------------------------------------------


@pytest.mark.parametrize("noise", [K06_NOISE, noise_from_sensors()], ids=["printed", "from sensors"])
def test_heading_filter_is_consistent_with_its_own_model(rng, noise):
    """Errors drawn from (3.31), a measurement at every fifth tick (3.35)."""
    ticks = 400
    error = rng.normal(size=(2, RUNS)) * np.sqrt(noise.P1)[:, None]
    errors = np.empty((2, ticks, RUNS))
    for k in range(ticks):
        if k:
            error = np.array([[1, IMU_PERIOD], [0, 1]]) @ error
            error += rng.normal(size=(2, RUNS)) * np.sqrt(noise.Q1)[:, None]
        errors[:, k] = error
    psi = rng.uniform(-3, 3, (ticks, 1))
    use = (np.arange(ticks) % 5 == 0).astype(float)
    data = {
        "psi_ins": psi + errors[0],
        "yaw_rate": errors[1],  # of a true rate of zero
        "heading_aid": psi + rng.normal(size=(ticks, RUNS)) * np.sqrt(noise.R1),
        "heading_aid_valid": use,
    }
    found = simulate_runs(heading_filter(noise=noise), data)
    # psi_hat is psi_ins less the estimated error
    off = np.array([found["psi_hat"] - psi, found["r_hat"]])
    v, S = found["heading_aid_innovation"], found["heading_aid_innovation_variance"]
    result = consistency(off, covariance(found, "P1", 2), v[None], S[None], measured=use[:, None] > 0)
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


def test_velocity_position_filter_is_consistent_with_its_own_model(rng):
    """Errors drawn from (3.32) along a turn, a fix at every twentieth tick (3.38)."""
    noise, ticks = K06_NOISE, 400
    psi = 0.02 * np.arange(ticks)
    x = rng.normal(size=(6, RUNS)) * np.sqrt(noise.P2)[:, None]
    errors = np.empty((6, ticks, RUNS))
    for k in range(ticks):
        if k:
            c, s = np.cos(psi[k - 1]), np.sin(psi[k - 1])
            B = np.array([[c, -s], [s, c]])
            w = rng.normal(size=(4, RUNS)) * np.sqrt(noise.Q2)[:, None]
            push = B @ x[4:]
            x = np.vstack(
                [
                    x[:2] + IMU_PERIOD * push + B @ w[:2],
                    x[2:4] + IMU_PERIOD * x[:2] + IMU_PERIOD**2 / 2 * push,
                    x[4:] + w[2:],
                ]
            )
        errors[:, k] = x
    use = (np.arange(ticks) % 20 == 0).astype(float)
    data = dict(zip(("v_x_ins", "v_y_ins", "x_ins", "y_ins"), errors[:4], strict=True))  # of a craft at rest
    data |= {"acceleration_x": errors[4], "acceleration_y": errors[5], "psi_hat": psi, "fix_valid": use}
    data |= {f"fix_{a}": rng.normal(size=(ticks, RUNS)) * np.sqrt(noise.R2[0]) for a in "xy"}
    found = simulate_runs(velocity_position_filter(noise=noise), data)
    names = ["v_x_hat", "v_y_hat", "x_hat", "y_hat", "force_x_hat", "force_y_hat"]
    off = np.array([found[n] for n in names])
    v = np.array([found[f"fix_{a}_innovation"] for a in "xy"])
    S = np.array([found[f"fix_{a}_innovation_variance"] for a in "xy"])
    result = consistency(off, covariance(found, "P2", 6), v, S, measured=use[:, None] > 0)
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


# ---- whole navigation with simulated sensors -------------------------------------------------------------


XHAT = [f"last_xhat[{i}]" for i in range(5)]


def test_the_simulated_sensors_integrate_to_the_course():
    """Without noise, forces turned into the earth's axes and integrated twice give the true path."""
    still = SensorErrors(gyro_walk=0.0, gyro_noise=0.0, acceleration_walk=0.0)
    truth = course(6.0, 0.5, 0.6, period=1e-3, at=(1.5, -1.0))
    got = sensed(np.random.default_rng(1), truth, still, every=1.0, runs=2)
    rate = got.inputs["yaw_rate"][:, 0] - got.biases[0, 0]
    psi = cumulative_trapezoid(rate, truth.time, initial=0)
    assert np.abs(psi - truth.psi).max() < 1e-6
    c, s = np.cos(psi), np.sin(psi)
    force = np.array([c * truth.force[0] - s * truth.force[1], s * truth.force[0] + c * truth.force[1]])
    v = cumulative_trapezoid(force, truth.time, initial=0)
    assert np.abs(v - truth.velocity).max() < 1e-6
    p = cumulative_trapezoid(v, truth.time, initial=0)
    assert np.abs(p + np.array([[1.5], [-1.0]]) - truth.position).max() < 1e-5


def test_the_simulated_ranges_are_those_of_the_unit_whose_turn_it_is():
    truth = course(3.0, 0.3, 0.5, period=DT, at=(1.5, 1.5))
    units = [(0.2, 0.1), (-0.3, 0.0)]
    got = ranged(np.random.default_rng(1), truth, ABOVE, units, noise=1e-12, bias=0.07, runs=1)
    told = got["range_unit"]
    assert np.flatnonzero(told).tolist() == [0, 2, 20, 22, 40, 42]  # 0.1 s each, once a second
    for k in np.flatnonzero(told):
        arm = complex(*units[int(told[k]) - 1]) * np.exp(1j * truth.psi[k])
        at = complex(*truth.position[:, k]) + arm
        away = abs(at - complex(*BEACONS[2]))
        assert got["range_3"][k, 0] == pytest.approx(np.hypot(away, 2.0) + 0.07, abs=1e-9)


def test_aided_navigation_is_consistent_with_the_sensors(rng):
    """K06's whole navigation with the covariances that follow from the sensors."""
    s = SensorErrors(gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(30.0, 0.5, 0.6, period=DT)
    seen = sensed(rng, truth, s, every=0.5, runs=RUNS)
    block = aided_ins(noise=noise_from_sensors(s, period=DT), period=DT)
    names = [f"mechanisation.last_{n}_ins" for n in ("psi", "v_x", "v_y", "x", "y")]
    found = simulate_runs(block, inputs_of(block, seen.inputs), start=started(names, seen.start, truth))
    off = estimation_errors(found, truth, seen.biases)
    off[5:] *= -1  # K06's x1, x2 are the errors: psi_hat is too large by what dpsi is estimated too small
    use = seen.inputs["fix_valid"][:, None] > 0
    told = innovations(found, ["heading_aid"])
    heading = consistency(off[[0, 5]], covariance(found, "P1", 2), *told, measured=use)
    motion = consistency(off[[1, 2, 3, 4, 6, 7]], covariance(found, "P2", 6))
    assert heading.nees_inside >= 0.9 and heading.nis_inside >= 0.9
    assert motion.nees_inside >= 0.9


def test_printed_matrices_are_far_too_cautious_for_the_stated_sensors(rng):
    """K06's Q1 lacks dt^2: its heading filter all but follows the magnetometer."""
    s = SensorErrors(gyro_walk=0.0)
    truth = course(4.0, 0.0, 0.6, period=IMU_PERIOD)
    seen = sensed(rng, truth, s, every=IMU_PERIOD, runs=RUNS)
    data = seen.inputs
    psi_ins = cumulative_trapezoid(data["yaw_rate"], dx=IMU_PERIOD, axis=0, initial=0) + seen.start[0]
    given = {"psi_ins": psi_ins} | {n: data[n] for n in ("yaw_rate", "heading_aid", "heading_aid_valid")}
    rms, inside, claimed = {}, {}, {}
    for label, noise in (("printed", K06_NOISE), ("sensors", noise_from_sensors(s))):
        found = simulate_runs(heading_filter(noise=noise), given)
        off = np.array([found["psi_hat"] - truth.psi[:, None], seen.biases[0] - found["gyro_bias_hat"]])[
            :, 300:
        ]
        inside[label] = consistency(off, covariance(found, "P1", 2)[:, :, 300:]).nees_inside
        rms[label] = np.degrees(np.sqrt((off**2).mean(axis=(1, 2))))
        claimed[label] = np.degrees(np.sqrt(found["P1[1,1]"][300:].mean()))
    assert inside["sensors"] >= 0.9 > inside["printed"]
    assert claimed["printed"] > 10 * rms["printed"][1]
    assert claimed["sensors"] == pytest.approx(rms["sensors"][1], rel=0.2)
    # K06's bench: 0.5 deg and 3.7 deg/s with these matrices (table 6.7)
    assert rms["printed"][0] == pytest.approx(0.5, rel=0.3)
    assert rms["sensors"][0] < 0.3 * rms["printed"][0]
    assert rms["sensors"][1] < 0.3 * rms["printed"][1]


@pytest.mark.slow
def test_coupled_filter_finds_the_heading_from_motion_alone(rng):
    """No heading aid, 17 deg off at the start: fixes and acceleration show it."""
    s = SensorErrors(heading=0.3, gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(40.0, 0.8, 0.3, period=DT)
    seen = sensed(rng, truth, s, every=1.0, runs=RUNS)
    block = coupled_filter(noise=noise_from_sensors(s, period=DT), period=DT)
    found = simulate_runs(block, inputs_of(block, seen.inputs), start=started(XHAT, seen.start, truth))
    off = estimation_errors(found, truth, seen.biases)
    assert np.sqrt((off[0, -1] ** 2).mean()) < 0.05
    assert np.sqrt((off[5, -1] ** 2).mean()) < 0.3 * s.gyro_bias
    use = seen.inputs["fix_valid"][:, None] > 0
    told = innovations(found, ("fix_x", "fix_y"))
    result = consistency(off, covariance(found, "P", 8), *told, measured=use)
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


@pytest.mark.slow
def test_coupled_filter_does_not_believe_to_learn_the_heading_at_rest(rng):
    """The plain extended Kalman filter does: the accelerometers' noise looks like motion to it."""
    s = SensorErrors(heading=0.3, gyro_walk=0.0, acceleration_walk=0.0, acceleration_noise=(0.06, 0.06))
    truth = course(30.0, 0.0, 0.0, period=DT)
    seen = sensed(rng, truth, s, every=1.0, runs=RUNS)
    block = coupled_filter(noise=noise_from_sensors(s, period=DT), period=DT)
    given = inputs_of(block, seen.inputs)
    at = started(XHAT, seen.start, truth)
    found = simulate_runs(block, given, start=at)
    off = estimation_errors(found, truth, seen.biases)
    variance = found["P[0,0]"]
    assert (np.diff(variance, axis=0) >= 0).all()
    assert variance[-1].mean() == pytest.approx(0.3**2 + (30 * s.gyro_bias) ** 2, rel=0.05)
    assert consistency(off, covariance(found, "P", 8)).nees_inside >= 0.9
    plain = simulate_runs(block, given, ["psi_hat", "P[0,0]"], start=at, params={"ins.excitation": 0.0})
    claimed, real = plain["P[0,0]"][-1].mean(), (plain["psi_hat"][-1] ** 2).mean()
    assert claimed < 0.5 * variance[-1].mean()
    assert real > 2 * claimed


def by_ranges(rng, beacons, units, bias, seconds, *, heading=0.2, range_bias=0.05, at=(1.5, 1.5)):
    """Errors of a filter without a heading aid, its ranges' innovations, and where they are measured."""
    s = SensorErrors(heading=heading, gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(seconds, 0.3, 0.5, period=DT, at=at)
    seen = sensed(rng, truth, s, every=1.0, runs=RUNS)
    data = seen.inputs | ranged(rng, truth, beacons, units, noise=0.01, bias=bias, runs=RUNS)
    noise = noise_from_sensors(s, period=DT)
    block = range_filter(beacons, units, range_bias=range_bias, noise=noise, period=DT)
    found = simulate_runs(block, inputs_of(block, data), start=started(XHAT, seen.start, truth))
    off = estimation_errors(found, truth, seen.biases)
    if range_bias:
        off = np.array([*off, found["range_bias_hat"] - bias])
    told = innovations(found, [f"range_{k}" for k in range(1, len(beacons.positions) + 1)])
    result = consistency(
        off, covariance(found, "P", len(off)), *told, measured=data["range_unit"][:, None] > 0
    )
    return off, result, found


@pytest.mark.slow
def test_range_filter_is_consistent_and_sees_heading_and_bias(rng):
    """Two units 0.4 m apart on raw ranges with a common bias, no heading aid."""
    bias = rng.normal(size=RUNS) * 0.05
    off, result, _ = by_ranges(rng, ABOVE, APART, bias, 20.0)
    assert np.sqrt((off[0, -1] ** 2).mean()) < 0.05
    assert np.sqrt((off[8, -1] ** 2).mean()) < 0.5 * 0.05
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


PAIR = Beacons([(0.0, 0.0), (4.0, 0.2)], 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("at", [(1.5, 1.8), (1.5, -5.0)], ids=["left", "right"])
def test_two_beacons_do_on_either_side_of_their_line(rng, at):
    """The pose at the start tells the side; the craft drifts 2.6 m along y and stays on it."""
    off, result, found = by_ranges(rng, PAIR, APART, 0.0, 15.0, range_bias=0.0, at=at)
    last = np.flatnonzero(found["range_1_innovation"][:, 0])[-1]
    assert np.hypot(*off[3:5, last]).max() < 0.1  # ranges are good for 1 cm
    assert np.sqrt((off[0, -1] ** 2).mean()) < 0.05
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


@pytest.mark.slow
def test_on_their_line_two_beacons_do_not_tell_the_side(rng):
    """A craft that crosses it: some runs end mirrored."""
    off, _, found = by_ranges(rng, PAIR, APART, 0.0, 20.0, range_bias=0.0, at=(1.5, -1.8))
    wrong = np.hypot(*off[3:5, -1]) > 0.5
    assert wrong.any()
    beside = found["y_hat"][-1] - 0.05 * found["x_hat"][-1]  # of the line through the beacons
    assert (beside[wrong] < 0).all() and (beside[~wrong] > 0).all()


@pytest.mark.slow
def test_a_range_bias_of_two_beacons_is_found_from_motion_and_prior(rng):
    """Two ranges at once cannot tell it; left out, the place is far worse than the filter says."""
    bias = rng.normal(size=RUNS) * 0.05
    off, result, _ = by_ranges(rng, PAIR, APART, bias, 15.0, at=(1.5, 1.8))
    assert np.sqrt((off[8, -1] ** 2).mean()) < 0.5 * 0.05
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9
    _, trusting, _ = by_ranges(rng, PAIR, APART, bias, 15.0, range_bias=0.0, at=(1.5, 1.8))
    assert trusting.nees_inside < 0.8


@pytest.mark.slow
def test_too_few_ranges_for_a_fix_still_help(rng):
    """Two beacons out of four: no fix could be computed, the filter goes on."""
    s = SensorErrors(gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(15.0, 0.3, 0.5, period=DT, at=(1.5, 1.5))
    seen = sensed(rng, truth, s, every=1.0, runs=20)
    data = seen.inputs | ranged(rng, truth, ABOVE, [(0.0, 0.0)], noise=0.01, runs=20)
    block = range_filter(ABOVE, heading=True, noise=noise_from_sensors(s, period=DT), period=DT)
    error = {}
    for label, off in (("all", []), ("two", [3, 4]), ("none", [1, 2, 3, 4])):
        given = inputs_of(block, data | {f"range_{k}_valid": np.zeros(len(truth.time)) for k in off})
        found = simulate_runs(block, given, ["x_hat", "y_hat"], start=started(XHAT, seen.start, truth))
        error[label] = np.hypot(
            *(found[f"{a}_hat"][-1] - truth.position[i, -1] for i, a in enumerate("xy"))
        ).mean()
    assert error["all"] <= error["two"] < 0.3 * error["none"]
