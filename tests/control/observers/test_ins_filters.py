"""The navigation filters against K06's equations written out by hand, Riccati's equation and exact motion."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    K06_NOISE,
    InsNoise,
    SensorErrors,
    aided_ins,
    coupled_filter,
    heading_filter,
    ins_mechanisation,
    noise_from_sensors,
    range_arrivals,
    range_filter,
    simulate_runs,
    velocity_position_filter,
)
from hovercontrol.craft.hardware.sensors import Beacons
from hovercontrol.craft.models.vehicles import c17_simulation

from .by_hand import by_hand_342, shaken, turned

DT = IMU_PERIOD
BEACONS = [(0.0, 0.0), (3.0, 0.2), (0.1, 2.5), (2.8, 2.9)]
ABOVE = Beacons(BEACONS, 2.0)
UNEVEN = {"acceleration_x": [0.0], "acceleration_y": [0.0, 0.0], "yaw_rate": [0.0, 0.0, 0.0]}


# ---- K06's two filters -----------------------------------------------------------------------------------


def k06_by_hand(data, noise, dt=DT):
    """K06 sections 3.3.3 and 5.4.5 with full matrices and P = (I - K H) P."""
    psi_ins = by_hand_342(data, dt)[0]
    x1, P1 = np.zeros(2), np.diag(noise.P1)
    Phi1, H1 = np.array([[1, dt], [0, 1]]), np.array([[1.0, 0.0]])
    psi_hat, r_hat, P1s = [], [], []
    for k in range(len(psi_ins)):
        if k:
            x1, P1 = Phi1 @ x1, Phi1 @ P1 @ Phi1.T + np.diag(noise.Q1)
        if data["heading_aid_valid"][k]:
            z = psi_ins[k] - data["heading_aid"][k] - x1[0]
            z = np.arctan2(np.sin(z), np.cos(z))
            K = P1 @ H1.T / (H1 @ P1 @ H1.T + noise.R1)
            x1, P1 = x1 + K[:, 0] * z, P1 - K @ H1 @ P1
        psi_hat.append(psi_ins[k] - x1[0])
        r_hat.append(data["yaw_rate"][k] - x1[1])
        P1s.append(P1)
    _, v, r = by_hand_342(data, dt, heading=psi_hat)
    x2, P2 = np.zeros(6), np.diag(noise.P2)
    H2 = np.hstack([np.zeros((2, 2)), np.eye(2), np.zeros((2, 2))])
    v_hat, pos_hat, P2s = [], [], []
    for k in range(len(psi_ins)):
        if k:
            c, s = np.cos(psi_hat[k - 1]), np.sin(psi_hat[k - 1])
            c1, c2 = dt, dt**2 / 2
            Phi2 = np.array(
                [
                    [1, 0, 0, 0, c1 * c, -c1 * s],
                    [0, 1, 0, 0, c1 * s, c1 * c],
                    [c1, 0, 1, 0, c2 * c, -c2 * s],
                    [0, c1, 0, 1, c2 * s, c2 * c],
                    [0, 0, 0, 0, 1, 0],
                    [0, 0, 0, 0, 0, 1],
                ]
            )
            G2 = np.zeros((6, 4))
            G2[:2, :2], G2[4:, 2:] = turned(psi_hat[k - 1]), np.eye(2)
            x2, P2 = Phi2 @ x2, Phi2 @ P2 @ Phi2.T + G2 @ np.diag(noise.Q2) @ G2.T
        if data["fix_valid"][k]:
            z = r[:, k] - [data["fix_x"][k], data["fix_y"][k]]
            K = P2 @ H2.T @ np.linalg.inv(H2 @ P2 @ H2.T + np.diag(noise.R2))
            x2, P2 = x2 + K @ (z - H2 @ x2), P2 - K @ H2 @ P2
        v_hat.append(turned(-psi_hat[k]) @ (v[:, k] - x2[:2]))
        pos_hat.append(r[:, k] - x2[2:4])
        P2s.append(P2)
    return psi_hat, r_hat, np.array(v_hat).T, np.array(pos_hat).T, np.array(P1s), np.array(P2s)


@pytest.mark.parametrize("noise", [K06_NOISE, noise_from_sensors()], ids=["printed", "from sensors"])
def test_aided_navigation_is_k06s(rng, noise):
    data = shaken(rng)
    found = {name: v[:, 0] for name, v in simulate_runs(aided_ins(noise=noise), data).items()}
    psi, r, v, pos, P1, P2 = k06_by_hand(data, noise)
    close = {"rtol": 1e-9, "atol": 1e-9}
    np.testing.assert_allclose(found["psi_hat"], psi, **close)
    np.testing.assert_allclose(found["r_hat"], r, **close)
    np.testing.assert_allclose([found["u_hat"], found["v_hat"]], v, **close)
    np.testing.assert_allclose([found["x_hat"], found["y_hat"]], pos, **close)
    for i in range(2):
        np.testing.assert_allclose(found[f"P1[{i},1]"], P1[:, i, 1], **close)
    for i in range(6):
        for j in range(i, 6):
            np.testing.assert_allclose(found[f"P2[{i},{j}]"], P2[:, i, j], **close)


@pytest.mark.parametrize(
    "noise", [K06_NOISE, noise_from_sensors(SensorErrors(gyro_walk=0.003))], ids=["printed", "from sensors"]
)
def test_heading_filter_settles_at_riccatis_solution(noise):
    """With the magnetometer at each tick, as K06 ran it."""
    ticks = 5000
    zero = np.zeros(ticks)
    inputs = {"psi_ins": zero, "yaw_rate": zero, "heading_aid": zero, "heading_aid_valid": zero + 1}
    names = ["P1[0,0]", "P1[0,1]", "P1[1,1]", "heading_aid_innovation_variance"]
    found = simulate_runs(heading_filter(noise=noise), inputs, names)
    F, H = np.array([[1, DT], [0, 1]]), np.array([[1.0, 0.0]])
    before = solve_discrete_are(F.T, H.T, np.diag(noise.Q1), np.array([[noise.R1]]))
    S = before[0, 0] + noise.R1
    after = before - np.outer(before[:, 0], before[:, 0]) / S
    last = [found[name][-1, 0] for name in names]
    np.testing.assert_allclose(last, [after[0, 0], after[0, 1], after[1, 1], S], rtol=1e-6)


def test_printed_matrices_take_the_gyro_for_far_noisier_than_it_is():
    """K06's Q1 is the variance of a sample; its model adds it to the heading at each tick."""
    sample = np.sqrt(K06_NOISE.Q1[0])
    assert np.degrees(sample) == pytest.approx(1.27, abs=0.01)  # of the sensor at rest
    right = noise_from_sensors(SensorErrors(gyro_noise=sample))
    assert K06_NOISE.Q1[0] / right.Q1[0] == pytest.approx(1 / DT**2)
    seconds = 1 / DT
    assert np.degrees(np.sqrt(K06_NOISE.Q1[0] * seconds)) == pytest.approx(15.7, abs=0.1)
    assert np.degrees(np.sqrt(right.Q1[0] * seconds)) == pytest.approx(0.103, abs=0.001)
    assert np.sqrt(K06_NOISE.Q2[0] * seconds) == pytest.approx(2.3, abs=0.1)
    assert np.sqrt(noise_from_sensors().Q2[0] * seconds) == pytest.approx(0.0149, abs=1e-4)
    assert np.degrees(np.sqrt([K06_NOISE.Q1[1], K06_NOISE.P1[1]])) == pytest.approx([1.28, 57.3], abs=0.05)


# ---- the single filter -----------------------------------------------------------------------------------


def ekf_by_hand(data, noise, measurements, x, P, dt=DT):
    """The extended Kalman filter on (3.42), its derivatives by complex steps.

    `measurements` are (name of the measured input, of its flag, h(x), variance, whether an angle).
    """

    def move(x, w, k):
        b, ba, extra = x[5], x[6:8], x[8:]
        psi = x[0] + dt / 2 * (data["yaw_rate"][k] + data["yaw_rate"][k - 1] - 2 * b)
        F = [np.array([data["acceleration_x"][i], data["acceleration_y"][i]]) - ba for i in (k - 1, k)]
        f0, f1 = turned(x[0]) @ F[0], turned(psi) @ F[1]
        v = x[1:3] + dt / 2 * (f0 + f1) + turned(x[0]) @ w[1:3]
        r = x[3:5] + x[1:3] * dt + dt**2 / 6 * (f1 + 2 * f0)
        return np.concatenate([[psi + w[0]], v, r, [b + w[3]], ba + w[4:6], extra])

    def derivative(f, x):
        return np.array([np.imag(f(x + 1e-30j * e)) / 1e-30 for e in np.eye(len(x))]).T

    Q = np.diag([noise.Q1[0], *noise.Q2[:2], noise.Q1[1], *noise.Q2[2:]])
    xs, Ps = [], []
    for k in range(len(data["yaw_rate"])):
        if k:
            F = derivative(lambda x, k=k: move(x, np.zeros(6), k), x)
            G = derivative(lambda w, k=k, x=x: move(x, w, k), np.zeros(6))
            x, P = move(x, np.zeros(6), k), F @ P @ F.T + G @ Q @ G.T
        for name, flag, h, R, angle in measurements:
            if data[flag][k]:
                H = derivative(lambda x, h=h: np.array([h(x)]), x)
                z = data[name][k] - h(x)
                z = np.arctan2(np.sin(z), np.cos(z)) if angle else z
                K = P @ H.T / (H @ P @ H.T + R)
                x, P = x + K[:, 0] * z, P - K @ H @ P
        xs.append(x)
        Ps.append(P)
    return np.array(xs), np.array(Ps)


def assert_same_filter(found, xs, Ps):
    names = ["psi_hat", "v_x_hat", "v_y_hat", "x_hat", "y_hat", "gyro_bias_hat"]
    names += ["acceleration_x_bias_hat", "acceleration_y_bias_hat", "range_bias_hat"]
    for i, name in enumerate(names[: xs.shape[1]]):
        np.testing.assert_allclose(found[name][:, 0], xs[:, i], rtol=1e-8, atol=1e-9, err_msg=name)
    for i in range(xs.shape[1]):
        for j in range(i, xs.shape[1]):
            p = found[f"P[{i},{j}]"][:, 0]
            np.testing.assert_allclose(p, Ps[:, i, j], rtol=1e-8, atol=1e-10, err_msg=f"P[{i},{j}]")


def test_coupled_filter_is_the_extended_kalman_filter(rng):
    noise, data = noise_from_sensors(), shaken(rng, 150)
    arm = np.array([0.1, -0.05])
    data["heading_aid_valid"][:] *= rng.random(150) < 0.3
    block = coupled_filter(heading=True, arm=arm, noise=noise, pose=(0.1, 0.2, 0.3), excitation=0.0)
    at = [lambda x, i=i: x[3 + i] + (turned(x[0]) @ arm)[i] for i in (0, 1)]
    measurements = [
        ("heading_aid", "heading_aid_valid", lambda x: x[0], noise.R1, True),
        ("fix_x", "fix_valid", at[0], noise.R2[0], False),
        ("fix_y", "fix_valid", at[1], noise.R2[1], False),
    ]
    P = np.diag([noise.P1[0], *noise.P2[:4], noise.P1[1], *noise.P2[4:]])
    x = np.array([0.3, 0, 0, 0.1, 0.2, 0, 0, 0])
    assert_same_filter(simulate_runs(block, data), *ekf_by_hand(data, noise, measurements, x, P))


@pytest.mark.slow("cone")
@pytest.mark.parametrize("cone", [None, (0.0032, -0.038)], ids=["plain", "cone"])
def test_range_filter_is_the_extended_kalman_filter(rng, cone):
    """Two units that take turns, three beacons, a common bias; K06's cone-angle error (5.7) or none."""
    noise, data, ticks = noise_from_sensors(), shaken(rng, 100), 100
    units, height, beacons = np.array([(0.1, 0.02), (-0.1, 0.0)]), 2.0, BEACONS[:3]
    block = range_filter(
        Beacons(beacons, height),
        units,
        cone=cone,
        range_bias=0.05,
        noise=noise,
        pose=(1.0, 1.0, 0.3),
        excitation=0.0,
    )
    inputs = {k: data[k] for k in ("acceleration_x", "acceleration_y", "yaw_rate")}
    inputs["range_unit"] = rng.integers(1, 3, ticks).astype(float)
    measurements = []
    for k, beacon in enumerate(beacons, 1):
        inputs[f"range_{k}"] = rng.normal(2.5, 0.1, ticks)
        inputs[f"range_{k}_valid"] = (rng.random(ticks) < 0.3).astype(float)
        for number, unit in enumerate(units, 1):

            def distance(x, unit=unit, beacon=beacon):
                away = x[3:5] + turned(x[0]) @ unit - beacon
                flat = np.sqrt(away @ away)
                phi = np.arctan(flat / height)
                ratio = 1 + cone[0] * phi + cone[1] * phi**2 if cone else 1.0
                return np.sqrt(flat**2 + height**2) / ratio + x[8]

            flag = f"range_{k} by unit {number}"
            data[flag] = inputs[f"range_{k}_valid"] * (inputs["range_unit"] == number)
            measurements.append((f"range_{k}", flag, distance, 1e-4, False))
    P = np.diag([noise.P1[0], *noise.P2[:4], noise.P1[1], *noise.P2[4:], 0.05**2])
    x = np.array([0.3, 0, 0, 1.0, 1.0, 0, 0, 0, 0])
    expected = ekf_by_hand({**data, **inputs}, noise, measurements, x, P)
    assert_same_filter(simulate_runs(block, inputs), *expected)


@pytest.mark.slow
def test_ranges_overhead_do_no_harm():
    """Exactly under a beacon the cone angle has no derivative."""
    block = range_filter(Beacons(BEACONS[:3], 2.0), cone=(0.0032, -0.038))
    inputs = dict.fromkeys((s.name for s in block.inputs), np.zeros(20))
    inputs |= {"range_1": np.full(20, 2.0), "range_1_valid": np.ones(20)}
    assert all(np.isfinite(v).all() for v in simulate_runs(block, inputs).values())


# ---- what always holds -----------------------------------------------------------------------------------


def covariance(found, label, size):
    P = np.empty((*found[f"{label}[0,0]"].shape, size, size))
    for i in range(size):
        for j in range(i, size):
            P[..., i, j] = P[..., j, i] = found[f"{label}[{i},{j}]"]
    return P


@pytest.mark.slow
@settings(max_examples=6)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-12, 1e-4, 1.0]))
def test_covariances_stay_positive(seed, R):
    """Whatever comes when, and however good the aids are against the start."""
    rng = np.random.default_rng(seed)
    data = shaken(rng, (40, 20))
    data["fix_valid"] = (rng.random((40, 20)) < rng.random(20)).astype(float)
    noise = InsNoise(R1=R, R2=(R, R))
    found = simulate_runs(aided_ins(noise=noise), data)
    for label, size in (("P1", 2), ("P2", 6)):
        eigenvalues = np.linalg.eigvalsh(covariance(found, label, size))
        assert (eigenvalues > -1e-12 * eigenvalues[..., -1:]).all()
        assert (np.diagonal(covariance(found, label, size), axis1=-2, axis2=-1) > 0).all()


@settings(max_examples=6)
@given(st.integers(-5, 5), st.integers(0, 2**32 - 1))
def test_whole_turns_of_the_heading_aid_do_not_matter(turns, seed):
    data = shaken(np.random.default_rng(seed), (40, 20))
    block, names = aided_ins(), ["psi_hat", "x_hat", "heading_aid_innovation"]
    one = simulate_runs(block, data, names)
    other = simulate_runs(block, {**data, "heading_aid": data["heading_aid"] + 2 * np.pi * turns}, names)
    # an innovation at +-pi may fall to either side
    sure = (np.abs(one["heading_aid_innovation"]) < np.pi - 1e-6).all(axis=0)
    for name in names:
        np.testing.assert_allclose(one[name][:, sure], other[name][:, sure], atol=1e-9)
    assert sure.any() and (np.abs(one["heading_aid_innovation"]) <= np.pi + 1e-12).all()


@pytest.mark.parametrize("make", [aided_ins, lambda: coupled_filter(heading=True)], ids=["aided", "coupled"])
def test_what_is_not_valid_does_not_matter_even_if_it_is_no_number(rng, make):
    block = make()
    data = shaken(rng, 60)
    spoilt = dict(data)
    for name, flag in (("heading_aid", "heading_aid"), ("fix_x", "fix"), ("fix_y", "fix")):
        spoilt[name] = np.where(data[f"{flag}_valid"] > 0, data[name], np.nan)
    one, other = simulate_runs(block, data), simulate_runs(block, spoilt)
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def test_without_aids_nothing_is_learned(rng):
    data = shaken(rng, 200) | {"heading_aid_valid": np.zeros(200), "fix_valid": np.zeros(200)}
    found = simulate_runs(aided_ins(noise=noise_from_sensors()), data)
    for name in ("P1[0,0]", "P1[1,1]", *(f"P2[{i},{i}]" for i in range(4))):
        assert (np.diff(found[name][:, 0]) >= 0).all()
    assert not found["gyro_bias_hat"].any()


@pytest.mark.slow
def test_the_order_of_ranges_matters_only_beyond_first_order():
    """Beacons numbered otherwise give the same estimate, up to the curvature within one update."""
    rng = np.random.default_rng(5)
    at, height, ticks = np.array([1.2, 1.1]), 2.0, 30
    noisy = [np.hypot(np.hypot(*(at - b)), height) + rng.normal(0, 0.005, ticks) for b in BEACONS]
    inputs = dict.fromkeys(("acceleration_x", "acceleration_y", "yaw_rate"), np.zeros(ticks))
    block = range_filter(Beacons(BEACONS, height), pose=(1.2, 1.1, 0.0))

    def estimate(numbers):
        places = {
            f"ins.beacon_{k}_{c}": BEACONS[i][a] for k, i in enumerate(numbers, 1) for a, c in enumerate("xy")
        }
        ranges = {f"range_{k}": noisy[i] for k, i in enumerate(numbers, 1)}
        flags = {f"range_{k}_valid": np.ones(ticks) for k in range(1, 5)}
        found = simulate_runs(block, {**inputs, **ranges, **flags}, ["x_hat", "y_hat"], params=places)
        return np.array([found["x_hat"][-1, 0], found["y_hat"][-1, 0]])

    in_order = estimate([0, 1, 2, 3])
    for order in ([3, 2, 1, 0], [1, 3, 0, 2]):
        np.testing.assert_allclose(estimate(order), in_order, atol=2e-5)
    np.testing.assert_allclose(in_order, at, atol=0.01)


def test_the_definition_is_small_and_prints_to_c():
    """K06's whole navigation: a few hundred named quantities, quickly made."""
    block = aided_ins()
    assert len(block.definitions) < 250
    source = c_source(block, partials=False)
    assert len(source) < 150_000
    assert all(isinstance(e, sp.Expr) for e in block.derivatives.values())


# ---- wrong input -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: ins_mechanisation(period=-0.01), "mechanisation: period must be positive, found -0.01"),
        (lambda: heading_filter(period=0.0), "period must be positive"),
        (lambda: velocity_position_filter(period=float("nan")), "period"),
        (lambda: aided_ins(pose=(0, 0)), "pose: expected 3 finite numbers"),
        (lambda: aided_ins(velocity=(0, np.inf)), "velocity: expected 2 finite numbers"),
        (lambda: coupled_filter(arm=(1,)), "arm: expected 2 finite numbers"),
        (lambda: coupled_filter(period=-1), "period must be positive"),
        (lambda: coupled_filter(excitation=-1), "excitation = -1 m/s^2 is out of its bounds"),
        (lambda: InsNoise(Q1=(-1, 0)), "Q1 must be finite and not negative, found -1"),
        (lambda: InsNoise(R1=0.0), "R1 must be finite and positive, found 0"),
        (lambda: InsNoise(P2=(1, 1, 0, 1, 1, 1)), "P2 must be finite and positive"),
        (lambda: InsNoise(Q2=(1, 2)), "Q2: expected one number or 4 of them"),
        (lambda: SensorErrors(gyro_noise=-0.1), "gyro_noise must not be negative"),
        (lambda: SensorErrors(fix=0.0), "fix must be positive"),
        (lambda: noise_from_sensors(period=0), "noise_from_sensors: period must be positive"),
        (lambda: range_filter(BEACONS), "beacons: expected a Beacons, found [(0.0, 0.0)"),
        (lambda: range_filter(ABOVE, []), "units: expected at least one pair of coordinates"),
        (lambda: range_filter(ABOVE, [(0, 0), (1,)]), "units, number 2: expected 2 finite numbers"),
        (lambda: range_filter(ABOVE, range_noise=0.0), "range_noise must be positive"),
        (lambda: range_filter(ABOVE, range_bias=-1), "range_bias must not be negative"),
        (lambda: range_filter(ABOVE, cone=(np.nan, 0)), "cone"),
        (lambda: range_arrivals(0), "range_arrivals: count: expected 1 to 1000 beacons, found 0"),
        (lambda: range_arrivals(10**400), "range_arrivals: count: expected 1 to 1000 beacons, found 1000"),
        (lambda: simulate_runs(heading_filter(), {"psi_ims": [0.0]}), "did you mean 'psi_ins'"),
        (lambda: simulate_runs(c17_simulation().plant(), {}), "block 'plant' is not sampled"),
        (lambda: simulate_runs(ins_mechanisation(), UNEVEN), "inputs differ in shape (ticks, runs)"),
        (lambda: simulate_runs(heading_filter(), {"psi_ins": [0.0]}), "no values for input 'yaw_rate'"),
    ],
)
def test_wrong_input_is_said_in_one_line(make, text):
    with pytest.raises(InputError) as error:
        make()
    assert text in str(error.value)
    assert "\n" not in str(error.value)
