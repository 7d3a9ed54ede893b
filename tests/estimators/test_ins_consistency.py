"""Monte Carlo runs: the errors of the navigation filters are as large as their covariances say."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from hovercontrol.errors import InputError
from hovercontrol.estimators.ins import (
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
from hovercontrol.hardware.sensors import Beacons

RUNS = 100
#: A slower IMU than K06's keeps the tests quick; its noise per sample is K06's.
DT = 0.05
BEACONS = np.array([(0.0, 0.0), (4.0, 0.2), (0.1, 3.5), (3.8, 3.9)])


def covariance(found, label, size):
    """Shape (size, size, ticks, runs)."""
    entry = {(i, j): found[f"{label}[{i},{j}]"] for i in range(size) for j in range(i, size)}
    return np.array([[entry[min(i, j), max(i, j)] for j in range(size)] for i in range(size)])


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
    assert len(consistency(e, P).plot()) == 1
    axes = consistency(e, P, e, np.ones_like(e)).plot(np.arange(20) * 0.1)
    assert [a.get_ylabel() for a in axes] == ["NEES", "NIS, mean over the run"]


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
    with pytest.raises(InputError, match="nothing was measured in run 1"):
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


def course(seconds, push, turn, dt=DT):
    """True motion: pushed back and forth along x and y [m/s^2], swinging its heading [rad]."""
    t = np.arange(0, seconds, dt)
    psi, r = turn * np.sin(0.5 * t), 0.5 * turn * np.cos(0.5 * t)
    a = push * np.array([np.cos(t), np.sin(1.7 * t)])
    fine = np.arange(0, seconds, dt / 20)
    fine_a = push * np.array([np.cos(fine), np.sin(1.7 * fine)])
    v = cumulative_trapezoid(fine_a, fine, initial=0)
    p = cumulative_trapezoid(v, fine, initial=0)
    c, s = np.cos(psi), np.sin(psi)
    body = np.array([c * a[0] + s * a[1], -s * a[0] + c * a[1]])
    return {"t": t, "psi": psi, "r": r, "v": v[:, ::20], "p": p[:, ::20], "body": body}


def sensed(rng, truth, s, dt=DT, every=1.0, runs=RUNS):
    """What IMU, heading aid and fixes measure, and the biases; one aid each `every` seconds."""
    ticks = len(truth["t"])
    draw = rng.normal
    b_g = draw(size=runs) * s.gyro_bias
    b_a = draw(size=(2, runs)) * s.acceleration_bias
    force = truth["body"][:, :, None] + b_a[:, None]
    force = force + draw(size=force.shape) * np.array(s.acceleration_noise)[:, None, None]
    use = (np.arange(ticks) % round(every / dt) == 0).astype(float)
    fix = truth["p"][:, :, None] + draw(size=(2, ticks, runs)) * s.fix
    data = {
        "acceleration_x": force[0],
        "acceleration_y": force[1],
        "yaw_rate": truth["r"][:, None] + b_g + draw(size=(ticks, runs)) * s.gyro_noise,
        "heading_aid": truth["psi"][:, None] + draw(size=(ticks, runs)) * s.heading_aid,
        "heading_aid_valid": use,
        "fix_x": fix[0],
        "fix_y": fix[1],
        "fix_valid": use,
    }
    start = [
        draw(size=runs) * s.heading,
        *draw(size=(2, runs)) * s.velocity,
        *draw(size=(2, runs)) * s.position,
    ]
    return data, start, np.array([b_g, *b_a])


def single_filter_errors(found, truth, biases):
    names = ["psi_hat", "v_x_hat", "v_y_hat", "x_hat", "y_hat"]
    true = [truth["psi"], *truth["v"], *truth["p"]]
    off = [found[n] - v[:, None] for n, v in zip(names, true, strict=True)]
    names = ["gyro_bias_hat", "acceleration_x_bias_hat", "acceleration_y_bias_hat"]
    return np.array(off + [found[n] - b for n, b in zip(names, biases, strict=True)])


def started(block, names, start, truth):
    """States of a single filter whose start is off by `start`."""
    true = [truth["psi"][0], *truth["v"][:, 0], *truth["p"][:, 0]]
    return {name: v + off for name, v, off in zip(names, true, start, strict=True)}


XHAT = [f"last_xhat[{i}]" for i in range(5)]


def inputs_of(block, data):
    return {s.name: data[s.name] for s in block.inputs}


def test_aided_navigation_is_consistent_with_the_sensors(rng):
    """K06's whole navigation with the covariances that follow from the sensors."""
    s = SensorErrors(gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(30.0, 0.5, 0.6)
    data, start, biases = sensed(rng, truth, s, every=0.5)
    block = aided_ins(noise=noise_from_sensors(s, period=DT), period=DT)
    names = [f"mechanisation.last_{n}_ins" for n in ("psi", "v_x", "v_y", "x", "y")]
    found = simulate_runs(block, inputs_of(block, data), start=started(block, names, start, truth))
    off = single_filter_errors(found, truth, biases)
    off[5:] *= -1  # K06's x1, x2 are the errors: psi_hat is too large by what dpsi is estimated too small
    use = data["fix_valid"][:, None] > 0
    v, S = found["heading_aid_innovation"], found["heading_aid_innovation_variance"]
    heading = consistency(off[[0, 5]], covariance(found, "P1", 2), v[None], S[None], measured=use)
    motion = consistency(off[[1, 2, 3, 4, 6, 7]], covariance(found, "P2", 6))
    assert heading.nees_inside >= 0.9 and heading.nis_inside >= 0.9
    assert motion.nees_inside >= 0.9


def test_printed_matrices_are_far_too_cautious_for_the_stated_sensors(rng):
    """K06's Q1 lacks dt^2: its heading filter all but follows the magnetometer."""
    s = SensorErrors(gyro_walk=0.0)
    truth = course(4.0, 0.0, 0.6, dt=IMU_PERIOD)
    data, start, biases = sensed(rng, truth, s, dt=IMU_PERIOD, every=IMU_PERIOD)
    psi_ins = cumulative_trapezoid(data["yaw_rate"], dx=IMU_PERIOD, axis=0, initial=0) + start[0]
    given = {"psi_ins": psi_ins} | {n: data[n] for n in ("yaw_rate", "heading_aid", "heading_aid_valid")}
    rms, inside, claimed = {}, {}, {}
    for label, noise in (("printed", K06_NOISE), ("sensors", noise_from_sensors(s))):
        found = simulate_runs(heading_filter(noise=noise), given)
        off = np.array([found["psi_hat"] - truth["psi"][:, None], biases[0] - found["gyro_bias_hat"]])[
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


def test_coupled_filter_finds_the_heading_from_motion_alone(rng):
    """No heading aid, 17 deg off at the start: fixes and acceleration show it."""
    s = SensorErrors(heading=0.3, gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(40.0, 0.8, 0.3)
    data, start, biases = sensed(rng, truth, s)
    block = coupled_filter(noise=noise_from_sensors(s, period=DT), period=DT)
    found = simulate_runs(block, inputs_of(block, data), start=started(block, XHAT, start, truth))
    off = single_filter_errors(found, truth, biases)
    assert np.sqrt((off[0, -1] ** 2).mean()) < 0.05
    assert np.sqrt((off[5, -1] ** 2).mean()) < 0.3 * s.gyro_bias
    use = data["fix_valid"][:, None] > 0
    v = np.array([found[f"fix_{a}_innovation"] for a in "xy"])
    S = np.array([found[f"fix_{a}_innovation_variance"] for a in "xy"])
    result = consistency(off, covariance(found, "P", 8), v, S, measured=use)
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


def test_coupled_filter_does_not_believe_to_learn_the_heading_at_rest(rng):
    """The plain extended Kalman filter does: the accelerometers' noise looks like motion to it."""
    s = SensorErrors(heading=0.3, gyro_walk=0.0, acceleration_walk=0.0, acceleration_noise=(0.06, 0.06))
    truth = course(30.0, 0.0, 0.0)
    data, start, biases = sensed(rng, truth, s)
    block = coupled_filter(noise=noise_from_sensors(s, period=DT), period=DT)
    given = inputs_of(block, data)
    at = started(block, XHAT, start, truth)
    found = simulate_runs(block, given, start=at)
    off = single_filter_errors(found, truth, biases)
    variance = found["P[0,0]"]
    assert (np.diff(variance, axis=0) >= 0).all()
    assert variance[-1].mean() == pytest.approx(0.3**2 + (30 * s.gyro_bias) ** 2, rel=0.05)
    assert consistency(off, covariance(found, "P", 8)).nees_inside >= 0.9
    plain = simulate_runs(block, given, ["psi_hat", "P[0,0]"], start=at, params={"ins.excitation": 0.0})
    claimed, real = plain["P[0,0]"][-1].mean(), (plain["psi_hat"][-1] ** 2).mean()
    assert claimed < 0.5 * variance[-1].mean()
    assert real > 2 * claimed


def ranged(rng, truth, units, height, bias, noise, runs):
    """Ranges to each beacon; the units take turns, 0.1 s each, once a second (K06 5.5)."""
    ticks = len(truth["t"])
    turn = np.arange(ticks) % 20
    unit = np.where(turn % 2 == 0, turn // 2 + 1, 0)
    unit[unit > len(units)] = 0
    c, s = np.cos(truth["psi"]), np.sin(truth["psi"])
    forward, side = np.array([(0.0, 0.0), *units])[unit].T
    at = truth["p"] + np.array([c * forward - s * side, s * forward + c * side])
    data = {"range_unit": unit.astype(float)}
    for k, beacon in enumerate(BEACONS, 1):
        true = np.sqrt(((at - beacon[:, None]) ** 2).sum(axis=0) + height**2)
        data[f"range_{k}"] = true[:, None] + bias + rng.normal(size=(ticks, runs)) * noise
        data[f"range_{k}_valid"] = (unit > 0).astype(float)
    return data


def test_range_filter_is_consistent_and_sees_heading_and_bias(rng):
    """Two units 0.4 m apart on raw ranges with a common bias, no heading aid."""
    runs, units = RUNS, [(0.2, 0.0), (-0.2, 0.0)]
    s = SensorErrors(heading=0.2, gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(20.0, 0.3, 0.5)
    truth["p"] = truth["p"] + 1.5
    data, start, biases = sensed(rng, truth, s, runs=runs)
    bias = rng.normal(size=runs) * 0.05
    data |= ranged(rng, truth, units, 2.0, bias, 0.01, runs)
    block = range_filter(
        Beacons(BEACONS, 2.0), units, range_bias=0.05, noise=noise_from_sensors(s, period=DT), period=DT
    )
    found = simulate_runs(block, inputs_of(block, data), start=started(block, XHAT, start, truth))
    off = np.array([*single_filter_errors(found, truth, biases), found["range_bias_hat"] - bias])
    assert np.sqrt((off[0, -1] ** 2).mean()) < 0.05
    assert np.sqrt((off[8, -1] ** 2).mean()) < 0.5 * 0.05
    v, S = (np.array([found[f"range_{k}_innovation{end}"] for k in range(1, 5)]) for end in ("", "_variance"))
    result = consistency(off, covariance(found, "P", 9), v, S, measured=data["range_unit"][:, None] > 0)
    assert result.nees_inside >= 0.9
    assert result.nis_inside >= 0.9


def test_too_few_ranges_for_a_fix_still_help(rng):
    """Two beacons out of four: no fix could be computed, the filter goes on."""
    runs = 20
    s = SensorErrors(gyro_walk=0.0, acceleration_walk=0.0)
    truth = course(15.0, 0.3, 0.5)
    truth["p"] = truth["p"] + 1.5
    data, start, _ = sensed(rng, truth, s, runs=runs)
    data |= ranged(rng, truth, [(0.0, 0.0)], 2.0, 0.0, 0.01, runs)
    block = range_filter(
        Beacons(BEACONS, 2.0), heading=True, noise=noise_from_sensors(s, period=DT), period=DT
    )
    error = {}
    for label, off in (("all", []), ("two", [3, 4]), ("none", [1, 2, 3, 4])):
        given = inputs_of(block, data | {f"range_{k}_valid": np.zeros(len(truth["t"])) for k in off})
        found = simulate_runs(block, given, ["x_hat", "y_hat"], start=started(block, XHAT, start, truth))
        error[label] = np.hypot(
            *(found[f"{a}_hat"][-1] - truth["p"][i, -1] for i, a in enumerate("xy"))
        ).mean()
    assert error["all"] <= error["two"] < 0.3 * error["none"]
