"""The particle filter on raw ranges: Bayes' rule on a grid, the Kalman filter where it is right, and more."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis.ins_monte_carlo import (
    course,
    estimation_errors,
    inputs_of,
    ranged,
    sensed,
    started,
)
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    SensorErrors,
    noise_from_sensors,
    range_filter,
    range_particles,
    run_ins,
    simulate_runs,
)
from hovercontrol.control.observers.ins.cloud import Cloud, effective, systematic
from hovercontrol.craft.hardware.sensors import Beacons

FOUR = Beacons([(0.0, 0.0), (4.0, 0.2), (0.1, 3.5), (3.8, 3.9)], 2.0)
TWO = Beacons([(0.0, 0.0), (4.0, 0.0)], 2.0)
UNITS = ((0.2, 0.0), (-0.2, 0.0))
ERRORS = SensorErrors(gyro_walk=0.0, acceleration_walk=0.0)
NOISE = noise_from_sensors(ERRORS)
STATES = [f"last_xhat[{i}]" for i in range(5)]


def flown(rng, beacons, seconds, runs):
    truth = course(seconds, 0.3, 0.9, period=IMU_PERIOD, at=(1.5, 1.2))
    seen = sensed(rng, truth, ERRORS, every=1.0, runs=runs)
    inputs = seen.inputs | ranged(rng, truth, beacons, UNITS, noise=0.01, runs=runs)
    return truth, seen, inputs


def found(block, inputs, seen, truth, outputs=None):
    return simulate_runs(block, inputs_of(block, inputs), outputs, start=started(STATES, seen.start, truth))


def test_systematic_resampling_draws_each_as_often_as_its_weight_asks(rng):
    for _ in range(50):
        w = rng.exponential(size=40) ** 3
        counts = np.bincount(systematic(w, rng.random()), minlength=40)
        share = 40 * w / w.sum()
        assert counts.sum() == 40 and (np.abs(counts - share) < 1 + 1e-9).all()
    assert effective(np.zeros(10)) == pytest.approx(10) and effective(np.log([1, 1e-30])) == pytest.approx(1)


@pytest.mark.slow
@pytest.mark.parametrize("sigma, tolerance", [(0.5, 0.05), (0.02, 0.2)])
def test_particles_are_the_exact_posterior_on_a_grid(rng, sigma, tolerance):
    """Three ranges of a place in a square, two of whose beacons mirror it; the grid is Bayes' rule itself."""
    places = np.array([(0.0, 0.0), (4.0, 0.0), (1.0, 0.3)])
    at = np.array([1.4, 0.8])
    z = np.hypot(*(places - at).T)

    def log_likelihood(x):
        gaps = [(np.hypot(x[0] - a, x[1] - b) - r) / sigma for (a, b), r in zip(places, z, strict=True)]
        return -0.5 * sum(g**2 for g in gaps)

    axis = np.linspace(-2, 4, 2401)
    X = np.array(np.meshgrid(axis, axis - 1, indexing="ij"))
    p = np.exp(log_likelihood(X))
    p /= p.sum()
    mean = (p * X).sum(axis=(1, 2))
    spread = np.sqrt((p * (X - mean[:, None, None]) ** 2).sum(axis=(1, 2)))
    x = np.array([rng.uniform(-2, 4, (40, 4000)), rng.uniform(-3, 3, (40, 4000))]).transpose(1, 0, 2)
    cloud = Cloud(x, np.full(2, sigma), 0.3, rng)
    for run in range(40):
        cloud.meet(run, log_likelihood)
    w = cloud.weights
    means = np.einsum("rip,rp->ir", cloud.x, w)
    second = np.einsum("rip,rp->ir", cloud.x**2, w)
    off = (means - mean[:, None]) / spread[:, None]
    assert np.abs(off.mean(axis=1)).max() < 3 * off.std(axis=1).max() / np.sqrt(40) + tolerance / 4
    assert np.abs(off).max() < 0.5
    np.testing.assert_allclose(np.sqrt((second - means**2).mean(axis=1)), spread, rtol=tolerance)


@pytest.mark.slow
def test_where_little_is_unsure_it_is_the_kalman_filter_within_sampling_error(rng):
    truth, seen, inputs = flown(rng, FOUR, 2.5, 3)
    kalman = found(range_filter(FOUR, UNITS, noise=NOISE, excitation=0.0), inputs, seen, truth)
    particles = found(range_particles(FOUR, UNITS, noise=NOISE, particles=4000), inputs, seen, truth)
    late = slice(len(truth.time) // 3, None)
    for i, name in enumerate(("psi_hat", "v_x_hat", "v_y_hat", "x_hat", "y_hat")):
        sd = np.sqrt(kalman[f"P[{i},{i}]"][late])
        gap = (particles[name][late] - kalman[name][late]) / sd
        assert np.sqrt(np.mean(gap**2)) < 0.35, name
        ratio = np.sqrt(particles[f"P[{i},{i}]"][late].mean()) / np.sqrt((sd**2).mean())
        assert 0.8 < ratio < 1.3, name


@pytest.mark.slow
def test_of_two_beacons_it_finds_the_side_of_a_start_that_nobody_told(rng):
    truth, seen, inputs = flown(rng, TWO, 3.2, 5)
    lost = range_particles(TWO, UNITS, noise=NOISE, area=((0, 4), (-4, 4)))
    off = estimation_errors(found(lost, inputs, seen, truth, PLACE), truth, seen.biases)
    miss = np.hypot(*off[3:5])
    assert np.median(miss[20]) > 0.5  # at first the place and its mirror image, and so the line between
    assert (miss[-1] < 0.15).all()


PLACE = [
    "psi_hat", "v_x_hat", "v_y_hat", "x_hat", "y_hat",
    "gyro_bias_hat", "acceleration_x_bias_hat", "acceleration_y_bias_hat",
]  # fmt: skip


@pytest.mark.slow
def test_echoes_are_borne_only_if_they_are_expected(rng):
    truth, seen, inputs = flown(rng, FOUR, 3.0, 6)
    for k in range(1, 5):
        wrong = rng.random(inputs[f"range_{k}"].shape) < 0.1
        inputs[f"range_{k}"] = np.where(wrong, rng.uniform(0, 10, wrong.shape), inputs[f"range_{k}"])
    late = slice(len(truth.time) // 2, None)
    miss = []
    for echoes in (0.1, 0.0):
        block = range_particles(FOUR, UNITS, noise=NOISE, echoes=echoes, particles=2000)
        off = estimation_errors(found(block, inputs, seen, truth, PLACE), truth, seen.biases)
        miss.append(np.sqrt(np.mean(off[3:5, late] ** 2)))
    assert miss[0] < 0.03 < 0.1 < miss[1]


def test_it_has_the_kalman_filters_ports_and_runs_over_logs_as_it_does(rng):
    truth, _, inputs = flown(rng, FOUR, 1.2, 1)
    given = {"range_bias": 0.05, "heading": True, "pose": (1.5, 1.2, 0.0)}
    kalman = range_filter(FOUR, UNITS, **given)
    block = range_particles(FOUR, UNITS, particles=300, **given)
    assert block.inputs == kalman.inputs and block.outputs[:-1] == kalman.outputs
    many = simulate_runs(block, inputs_of(block, inputs))
    imu = {name: np.ravel(inputs[name]) for name in ("acceleration_x", "acceleration_y", "yaw_rate")}
    aids = []
    for use, names in (
        ("heading_aid_valid", ["heading_aid"]),
        ("range_1_valid", [f"range_{k}" for k in (1, 2, 3, 4)]),
    ):
        at = np.ravel(inputs[use]) > 0
        aid = {name: np.ravel(inputs[name])[at] for name in names} | {"time": truth.time[at]}
        aids.append(aid | ({"range_unit": inputs["range_unit"][at]} if len(names) > 1 else {}))
    log = run_ins(block, {"time": truth.time, **imu}, aids)
    for name, row in zip(log.output_labels, log.outputs, strict=True):
        np.testing.assert_array_equal(row, many[name][:, 0], err_msg=name)


@pytest.mark.parametrize(
    "given, line",
    [
        ({"particles": 1}, "expected a whole number of particles, at least 2, found 1"),
        ({"roughening": 1.0}, "roughening must be from 0 to less than 1"),
        ({"echoes": -0.1}, "echoes must be from 0 to less than 1"),
        ({"area": ((0, 4),)}, r"expected \(\(x_min, x_max\), \(y_min, y_max\)\)"),
        ({"area": ((4, 0), (0, 1))}, "expected x_min < x_max, found 4 and 0"),
        ({"range_noise": 0.0}, "range_noise"),
    ],
)
def test_wrong_arguments_are_one_line(given, line):
    with pytest.raises(InputError, match=line):
        range_particles(FOUR, **given)


def test_values_of_a_particle_filter_are_given_where_it_is_made():
    block = range_particles(FOUR, particles=10)
    inputs = {s.name: np.zeros(2) for s in block.inputs}
    with pytest.raises(InputError, match="a particle filter's values are given where it is made"):
        simulate_runs(block, inputs, params={"dt": 0.01})
    with pytest.raises(InputError, match="a particle filter's values are given where it is made"):
        run_ins(block, {"time": [0.0], **{s.name: [0.0] for s in block.inputs[:3]}}, params={"dt": 0.01})
