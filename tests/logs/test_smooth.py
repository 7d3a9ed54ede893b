"""Velocities from a simulated craft whose motion is known, with the faults of motion capture."""

from dataclasses import dataclass

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs import Log, Smoothed, fit_clock, smooth_pose, steady
from hovercontrol.logs.kalman import run_filter, run_smoother

POSITION_NOISE, HEADING_NOISE = 1.0e-4, 2.0e-3  # m, rad: as measured at the real craft


@dataclass
class Flight:
    time: np.ndarray
    pose: np.ndarray  # (n, 3), true
    body: np.ndarray  # (n, 3), true u, v, r
    log: Log  # measured, without faults

    def measured(self) -> np.ndarray:
        return self.log.stack("x", "y", "psi").copy()


def fly(seconds: float = 40.0, seed: int = 0, rate: float = 50.0) -> Flight:
    """Float about under switching fans; the yaw rate swings beyond 10 rad/s."""
    rng = np.random.default_rng(seed)
    fine = 20
    h = 1.0 / rate / fine
    n = round(seconds * rate)
    state = np.zeros(6)
    force = torque = 0.0
    motion = np.empty((n, 6))
    for i in range(n):
        motion[i] = state
        block = int(i / rate / 2.0)
        push = (0.4, -0.3)[block % 2]
        twist = (4.0, -4.0)[(block // 2) % 2]
        for _ in range(fine):
            force += h / 0.15 * (push - force)
            torque += h / 0.15 * (twist - torque)
            _, _, psi, u, v, r = state
            c, s = np.cos(psi), np.sin(psi)
            rates = (u * c - v * s, u * s + v * c, r,
                     force - 0.2 * u + r * v, -0.2 * v - r * u, torque - 0.1 * r)  # fmt: skip
            state = state + h * np.array(rates)
    time = np.arange(n) / rate
    noise = rng.normal(size=(n, 3)) * (POSITION_NOISE, POSITION_NOISE, HEADING_NOISE)
    seen = motion[:, :3] + noise
    log = Log("flight", time, dict(zip(("x", "y", "psi"), seen.T, strict=True)))
    return Flight(time, motion[:, :3], motion[:, 3:], log)


def as_log(time: np.ndarray, pose: np.ndarray) -> Log:
    return Log("flight", time, dict(zip(("x", "y", "psi"), pose.T, strict=True)))


def late(time: np.ndarray, seed: int = 0) -> np.ndarray:
    """Return arrival times: 0.3 ms of jitter, and for some seconds bursts of ten samples."""
    rng = np.random.default_rng(seed)
    arrival = time + np.abs(rng.normal(size=time.size)) * 3e-4
    third = time.size // 3
    for start in range(third, third + 200, 10):
        block = slice(start, start + 10)
        arrival[block] = arrival[start + 9] + 1e-4 * np.arange(10)
    return np.maximum.accumulate(arrival) + 1e-7 * np.arange(time.size)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly()


def velocity_error(result: Smoothed, truth: np.ndarray) -> np.ndarray:
    """Root mean square error of u, v, r over the valid rows."""
    error = (result.log.stack("u", "v", "r") - truth)[result.valid]
    return np.sqrt((error**2).mean(axis=0))


def test_clean_motion_is_kept_whole_and_its_noise_is_found(flight: Flight) -> None:
    result = smooth_pose(flight.log)
    assert result.rejected == ()
    assert result.valid.all()
    assert np.abs(flight.body[:, 2]).max() > 10  # fast turning is motion
    assert result.noise_std == pytest.approx((POSITION_NOISE, POSITION_NOISE, HEADING_NOISE), rel=0.15)
    assert np.all(velocity_error(result, flight.body) < (0.0015, 0.0015, 0.012))


def test_stated_standard_deviations_hold(flight: Flight) -> None:
    result = smooth_pose(flight.log)
    for got, std, true in (
        (result.pose, result.pose_std, flight.pose),
        (result.velocity[:, 2:], result.velocity_std[:, 2:], flight.body[:, 2:]),
    ):
        squares = (((got - true) / std) ** 2).mean(axis=0)
        assert np.all((squares > 0.3) & (squares < 1.5))


def test_body_acceleration_is_the_rate_of_the_body_velocities(flight: Flight) -> None:
    result = smooth_pose(flight.log)
    true = np.gradient(flight.body, flight.time, axis=0)
    error = np.sqrt(((result.body_acceleration() - true)[5:-5] ** 2).mean(axis=0))
    assert np.all(error < (0.12, 0.12, 0.6))


FAULTS = {
    "turned over for 0.2 s": (10, (0.03, -0.02, np.pi), "heading flip"),
    "turned over for 1.2 s": (60, (0.01, 0.02, np.pi), "heading flip"),
    "jumped by 3 cm": (3, (0.02, -0.03, 0.0), "position jump"),
    "elsewhere for 0.5 s": (25, (0.3, -0.2, 0.3), "position jump"),
    "one sample turned": (1, (0.0, 0.0, 0.15), "heading jump"),
    "one sample off by 2 mm": (1, (0.002, 0.0, 0.0), "outlier"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_cut_out_and_called_by_its_name(flight: Flight, fault: str) -> None:
    rows, offset, reason = FAULTS[fault]
    pose = flight.measured()
    pose[900 : 900 + rows] += offset
    result = smooth_pose(as_log(flight.time, pose))
    (span,) = result.rejected
    assert (span.rows, span.reason) == (rows, reason)
    assert (span.start, span.stop) == (
        pytest.approx(flight.time[900]),
        pytest.approx(flight.time[900 + rows - 1]),
    )
    # over 0.3 s the smoother only guesses
    assert np.count_nonzero(~result.valid) == (rows if rows >= 15 else 0)
    assert np.all(velocity_error(result, flight.body) < (0.0015, 0.0015, 0.012))


@pytest.mark.parametrize("seed", range(3))
def test_many_faults_with_late_stamps_and_a_wrapped_heading(seed: int) -> None:
    flight = fly(seed=seed)
    rng = np.random.default_rng(seed)
    pose, bad = flight.measured(), np.zeros(flight.time.size, dtype=bool)
    for k, start in enumerate(rng.permutation(np.arange(100, 1800, 170))[: len(FAULTS)]):
        rows, offset, _ = list(FAULTS.values())[k]
        pose[start : start + rows] += offset
        bad[start : start + rows] = True
    pose[1850:1865] += rng.normal(size=(15, 3)) * (0.1, 0.1, 2.0)
    bad[1850:1865] = True
    pose[:, 2] = (pose[:, 2] + np.pi) % (2 * np.pi) - np.pi
    result = smooth_pose(as_log(late(flight.time, seed), pose))
    found = np.count_nonzero(bad & ~result.accepted)
    assert found / np.count_nonzero(bad) > 0.98  # recall
    assert found / np.count_nonzero(~result.accepted) > 0.96  # precision
    assert result.clock.steady
    assert np.all(velocity_error(result, flight.body) < (0.0016, 0.0016, 0.014))
    turned = result.log["psi"] - flight.pose[:, 2]
    whole_turns = np.rint(turned[result.valid] / (2 * np.pi))
    assert np.ptp(whole_turns) == 0  # no turn lost or gained on the way


@pytest.mark.parametrize(("rate", "noisier"), [(10, 1), (10, 50), (200, 0), (500, 20)])
def test_a_flip_is_found_at_any_rate_and_noise(rate: int, noisier: float) -> None:
    flight = fly(15.0, rate=rate)
    noise = np.random.default_rng(1).normal(size=flight.pose.shape)
    pose = flight.pose + noisier * noise * (POSITION_NOISE, POSITION_NOISE, HEADING_NOISE)
    flipped = slice(5 * rate, 5 * rate + rate // 5)
    pose[flipped] += (0.05, 0.03, np.pi)
    (span,) = smooth_pose(as_log(flight.time, pose)).rejected
    assert (span.reason, span.rows) == ("heading flip", rate // 5)


def test_a_landing_is_motion() -> None:
    """The real craft stops from 8 rad/s within 0.2 s when the lift fan stops."""
    rng = np.random.default_rng(1)
    time = 0.02 * np.arange(1000)
    rate = np.interp(time, [0, 10, 10.2], [0, 8, 0])
    speed = np.interp(time, [0, 10, 10.1], [0, 0.5, 0])
    pose = np.column_stack([np.cumsum(speed) * 0.02, 0 * time, np.cumsum(rate) * 0.02])
    pose += rng.normal(size=pose.shape) * (POSITION_NOISE, POSITION_NOISE, HEADING_NOISE)
    assert smooth_pose(as_log(time, pose)).rejected == ()


def test_behind_a_long_loss_the_craft_may_be_anywhere(flight: Flight) -> None:
    pose = flight.measured()
    keep = (flight.time < 15) | (flight.time > 19)
    pose[flight.time > 17, 0] += 1.0  # carried by hand meanwhile
    result = smooth_pose(as_log(flight.time[keep], pose[keep]))
    assert result.rejected == ()
    assert result.log.gaps == ((pytest.approx(14.98), pytest.approx(19.02)),)
    assert np.all(velocity_error(result, flight.body[keep]) < (0.002, 0.002, 0.014))


def test_rows_of_a_long_loss_become_a_gap(flight: Flight) -> None:
    pose = flight.measured()
    pose[900:960] += (0.01, 0.02, np.pi)
    result = smooth_pose(as_log(flight.time, pose))
    assert len(result.usable()) == len(flight.time) - 60
    assert result.usable().gaps == ((pytest.approx(17.98), pytest.approx(19.2)),)


def test_velocities_of_the_log_pass_through(flight: Flight) -> None:
    measured = flight.log.with_columns({"r": flight.body[:, 2] + 1.0, "thrust": flight.time})
    result = smooth_pose(measured)
    assert np.array_equal(result.log["r"], measured["r"])
    assert np.array_equal(result.log["thrust"], flight.time)
    assert not np.array_equal(result.log["x"], measured["x"])


def test_too_little_is_refused() -> None:
    with pytest.raises(InputError, match="run: expected 8 to 500000 rows to smooth, found 3"):
        smooth_pose(Log("run", np.arange(3.0), dict.fromkeys(("x", "y", "psi"), np.zeros(3))))
    with pytest.raises(InputError, match="run: no column 'psi'"):
        smooth_pose(Log("run", np.arange(9.0), dict.fromkeys(("x", "y"), np.zeros(9))))


@pytest.mark.parametrize("step", [0.001, 0.02, 0.0625, 1.0])
def test_standing_still_without_noise_is_still(step: float) -> None:
    result = smooth_pose(as_log(step * np.arange(100), np.ones((100, 3))))
    assert result.rejected == ()
    assert np.abs(result.velocity).max() < 1e-9


def test_late_stamps_and_lost_frames_do_not_hide_the_clock(flight: Flight) -> None:
    keep = np.ones(flight.time.size, dtype=bool)
    keep[500:505] = keep[1500] = False
    clock = fit_clock(late(flight.time)[keep], flight.measured()[keep])
    assert clock.steady
    assert clock.lost == 6
    assert clock.worst_delay == pytest.approx(0.18, abs=0.005)
    offset = clock.time - flight.time[keep]
    assert np.ptp(offset) < 5e-4
    assert fit_clock(clock.time).time == pytest.approx(clock.time, abs=1e-9)


def test_stamps_that_tell_the_sampling_time_are_kept() -> None:
    rng = np.random.default_rng(0)
    time = 0.02 * np.arange(1000) + rng.uniform(-0.004, 0.004, 1000)  # an unsteady sampler
    pose = np.column_stack([np.sin(2 * time), np.cos(2 * time), 5 * time])
    assert not fit_clock(time, pose).steady
    poisson = Log("run", np.cumsum(rng.exponential(0.02, 1000)), {})
    assert np.array_equal(steady(poisson).time, poisson.time)


def test_rows_at_even_steps_are_smoothed_as_any_others():
    """Where covariances stand still the means come block by block; a row a hair off its step forbids that."""
    rng = np.random.default_rng(3)
    t = 0.02 * np.arange(900)
    uneven = t.copy()
    uneven[1::2] += 1e-10  # too little to matter, enough to be another step each time
    motion = 1e-3 * np.cumsum(np.cumsum(rng.normal(size=(900, 3)), axis=0), axis=0)
    z = motion + 0.01 * rng.normal(size=(900, 3))
    used, restart = np.ones(900, dtype=bool), np.zeros(900, dtype=bool)
    used[400:430], restart[[0, 430]] = False, True
    known = np.array([3.0, 3.0, 40.0]), np.array([1e-4, 1e-4, 2e-4]), np.array([[1.0, 25.0, 1e4]] * 3)
    even, other = (run_filter(time, z, used, restart, *known) for time in (t, uneven))
    assert even.innovation == pytest.approx(other.innovation, rel=1e-6, abs=1e-7)
    assert even.innovation_variance == pytest.approx(other.innovation_variance, rel=1e-6)
    even, other = run_smoother(even), run_smoother(other)
    assert even.mean == pytest.approx(other.mean, rel=1e-6, abs=1e-6)
    assert even.covariance == pytest.approx(other.covariance, rel=1e-5, abs=1e-8)


def test_stamps_that_scatter_are_counted_though_rows_are_missing():
    rng = np.random.default_rng(8)
    true = 0.02 * np.arange(3000.0)
    kept = rng.random(3000) > 0.05
    stamps = (true + rng.uniform(-3e-3, 3e-3, 3000))[kept]
    pose = np.column_stack([np.sin(true), np.cos(0.7 * true), 0.3 * true])[kept]
    clock = fit_clock(stamps, pose)
    assert clock.steady and clock.lost == 3000 - kept.sum() - np.argmax(kept) - np.argmax(kept[::-1])
    assert np.abs(clock.time - true[kept]).max() < 3e-4  # a tenth of the scatter, at its ends
    exact = fit_clock(true[kept], pose)
    assert exact.time.tolist() == true[kept].tolist()
