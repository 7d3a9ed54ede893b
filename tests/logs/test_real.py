"""The recorded runs of a real craft: README of the data folder says what is wrong with them."""

import os
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.logs import (
    BenchTable,
    Log,
    Smoothed,
    fit_clock,
    join_logs,
    read_log,
    smooth_pose,
)

_SHARED = Path(__file__).parents[2].parent / "shared" / "data"
FOLDER = Path(os.environ.get("HOVERCONTROL_DATA", _SHARED))
DATA, FAST = FOLDER / "real_hovercraft", FOLDER / "holohover"
FANS = ("rear_left", "rear_right", "front_left", "front_right")

pytestmark = pytest.mark.skipif(
    not (DATA.is_dir() and FAST.is_dir()),
    reason=f"measured data not at {FOLDER}; set HOVERCONTROL_DATA to the folder that holds it",
)


def load(run: str) -> Log:
    pose = read_log(DATA / f"run_{run}_pose.csv")
    commands = read_log(DATA / f"run_{run}_command.csv")
    bench = BenchTable.from_csv(DATA / "thrust_bench.csv")
    joined = join_logs(pose, commands, before=1000.0, hold=5.0)
    return bench.apply(joined, {f"pwm_{fan}": fan for fan in FANS})


@pytest.fixture(scope="module")
def runs() -> dict[str, tuple[Log, Smoothed]]:
    logs = {run: load(run) for run in "abcd"}
    return {run: (log, smooth_pose(log)) for run, log in logs.items()}


def test_arrival_bursts_and_lost_frames_are_seen_through(runs) -> None:
    for run, lost in {"a": 1, "b": 1, "c": 0, "d": 6}.items():
        clock = runs[run][1].clock
        assert clock.steady
        assert clock.period == pytest.approx(0.02, rel=1e-3)
        pose = read_log(DATA / f"run_{run}_pose.csv")
        assert fit_clock(pose.time, pose.stack("x", "y", "psi")).lost == lost


def test_only_the_jumps_of_run_d_are_rejected(runs) -> None:
    rejected = {run: smoothed.rejected for run, (_, smoothed) in runs.items()}
    assert rejected["a"] == rejected["b"] == rejected["c"] == ()
    starts = [span.start for span in rejected["d"]]
    assert starts == pytest.approx([30.36, 30.84, 31.28, 31.98], abs=0.03)
    assert sum(span.rows for span in rejected["d"]) <= 16


def test_no_jump_survives_and_no_fast_turn_is_lost(runs) -> None:
    for run, fastest in {"a": 18.5, "b": 14.5, "c": 10.9, "d": 16.4}.items():
        log, smoothed = runs[run]
        assert np.abs(smoothed.log["r"]).max() == pytest.approx(fastest, rel=0.03)
        assert np.abs(smoothed.velocity[:, :2]).max() < 0.85
        assert np.abs(smoothed.body_acceleration()[:, 2]).max() < 60  # the landing
        used = smoothed.accepted
        assert np.abs(log["x"] - smoothed.log["x"])[used].max() < 1.5e-3
        assert np.abs(log["psi"] - smoothed.log["psi"])[used].max() < 0.035


def test_fans_push_the_way_the_readme_says(runs) -> None:
    """Surge gain within 20 % of 1/m = 5.67 /kg; yaw gain positive and alike over the runs."""
    for log, smoothed in runs.values():
        rl, rr, fl, fr = (log[fan] for fan in FANS)
        lift = log["pwm_lift"] > 1300
        flying = lift & (log.time > log.time[lift][0] + 1.0)
        surge, torque = rl + rr - fl - fr, 0.0425 * (rl - rr - fl + fr)
        u, v, r = smoothed.log.stack("u", "v", "r").T
        ahead, _, turn = smoothed.body_acceleration().T
        ones = np.ones_like(u)
        terms = np.column_stack([surge, u, r**2, ones])[flying]
        gain, drag, lever, _ = np.linalg.lstsq(terms, (ahead - r * v)[flying])[0]
        assert gain == pytest.approx(5.0, rel=0.2)
        assert -0.5 < drag < 0
        assert lever == pytest.approx(-0.0096, abs=0.001)  # the tracked point lies 1 cm ahead
        terms = np.column_stack([torque, r, ones])[flying]
        gain = np.linalg.lstsq(terms, turn[flying])[0][0]
        assert 700 < gain < 1500


@pytest.mark.parametrize("name", ["h1_aligned", "h1_blue_aligned", "h1_blue_raw_pose"])
def test_no_row_of_a_fast_craft_is_rejected(name: str) -> None:
    """At 240 Hz and up to 22 rad/s; a marker body that is changed on the way shifts it by 2 mm at once."""
    smoothed = smooth_pose(read_log(FAST / f"{name}.csv"))
    assert smoothed.rejected == ()
    assert smoothed.accepted.all()


@pytest.mark.slow("run_")
@pytest.mark.parametrize("run", ["h1_aligned", "run_a_pose"])
def test_gross_outliers_in_real_motion_never_pull_the_pose(run: str) -> None:
    log = read_log((FAST if run.startswith("h1") else DATA) / f"{run}.csv")
    clean, pose = smooth_pose(log), log.stack("x", "y", "psi")
    rng = np.random.default_rng(4)
    bad = np.zeros(len(log), dtype=bool)
    for first in rng.permutation(np.arange(10, len(log) - 10, 8))[: len(log) // 75]:  # 2 % of the rows
        rows = slice(first, first + rng.integers(1, 3))  # alone or in twos
        size = np.append(rng.uniform(0.05, 1.0, 2), rng.uniform(0.2, 3.0))
        pose[rows] += size * rng.choice([-1, 0, 1], 3, p=[0.4, 0.2, 0.4])
        bad[rows] = np.abs(pose[rows] - log.stack("x", "y", "psi")[rows]).max(axis=1) > 0.01
    found = smooth_pose(log.with_columns(dict(zip(("x", "y", "psi"), pose.T, strict=True))))
    assert not (bad & found.accepted).any()
    assert np.count_nonzero(~bad & ~found.accepted & clean.accepted) <= 5
    pull = found.pose - clean.pose
    pull[:, 2] = (pull[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.all(np.abs(pull[found.valid]).max(axis=0) < (1.5e-3, 1.5e-3, 0.02))
