"""Logs that a navigation wrote: corrections are found, drift is estimated, effects named in spite of both."""

import numpy as np
import pytest

from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.evidence.holdout import held_fit
from hovercontrol.identification.diagnose.evidence.whiteness import innovations
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.navigation import (
    Navigated,
    corrections,
    measure_navigated,
    over_ground,
)
from hovercontrol.logs import Log

from .generator import NOISE, Conditions, make

#: What the navigation's velocities are off by: an offset [m/s], a ramp [m/s^2]; seconds between fixes.
OFFSET, RAMP, FIX = 0.05, 0.02, 1.0


def navigated(log, rng):
    """Return a log as a navigation would have written it: drift between fixes, which move the position."""
    t = log.time - log.time[0]
    interval = (t // FIX).astype(int)
    count = interval[-1] + 1
    since = t - FIX * interval
    drift = (
        OFFSET * rng.normal(size=(2, count))[:, interval]
        + RAMP * rng.normal(size=(2, count))[:, interval] * since
    )
    ground = over_ground(log) + drift
    c, s = np.cos(log["psi"]), np.sin(log["psi"])
    steps = np.diff(t, prepend=t[0])
    moved = np.cumsum(ground * steps, axis=1)
    fixes = 0.05 * rng.normal(size=(2, count))[:, interval]
    columns = {
        **log.columns,
        "u": c * ground[0] + s * ground[1],
        "v": c * ground[1] - s * ground[0],
        "x": moved[0] + fixes[0] + 1e-4 * rng.normal(size=t.size),
        "y": moved[1] + fixes[1] + 1e-4 * rng.normal(size=t.size),
    }
    return Log(log.name, log.time, columns)


def case_of(seed, names, duration=40.0):
    """Return model, training logs and held-out log of a case whose logs a navigation wrote."""
    case = make(seed, names, Conditions(duration=duration))
    rng = np.random.default_rng([seed, 2])
    return case.model, [navigated(log, rng) for log in case.logs], navigated(case.holdout, rng)


def test_corrections_are_found_to_the_row_and_only_where_there_are_some():
    _, (log, _), _ = case_of(3, [])
    found = corrections(log)
    wanted = np.flatnonzero(np.diff(log.time // FIX) > 0) + 1
    assert set(found) <= set(wanted)
    assert found.size > 0.8 * wanted.size  # some are smaller than the noise
    plain = make(3, [], Conditions(duration=40.0))
    assert not any(corrections(log).size for log in plain.logs)


@pytest.mark.parametrize("seed", range(4))
def test_outliers_gaps_and_jitter_are_no_corrections(seed):
    case = make(seed, ["slope"], Conditions(duration=60.0, faults=True))
    assert not any(measure_navigated(case.model.plant(), log) for log in case.logs)


@pytest.mark.parametrize("size", [50, 200, 500])
def test_large_outliers_are_no_corrections(size):
    for seed in range(200, 204):
        log = make(seed, ["munk_moment"], Conditions(duration=30.0, logs=1)).logs[0]
        rng = np.random.default_rng(seed)
        hit = {c: (rng.random(len(log)) < 0.02) * size * rng.normal(size=len(log)) for c in NOISE}
        columns = {c: log[c] + hit[c] * NOISE[c] for c in NOISE}
        assert corrections(Log(log.name, log.time, {**log.columns, **columns})).size == 0


def test_corrections_are_found_among_outliers():
    _, (log, _), _ = case_of(3, [])
    rng = np.random.default_rng(0)
    columns = {c: log[c] + (rng.random(len(log)) < 0.005) * 1.0 for c in ("u", "v", "x")}
    found = corrections(Log(log.name, log.time, {**log.columns, **columns}))
    wanted = np.flatnonzero(np.diff(log.time // FIX) > 0) + 1
    assert len(set(found) & set(wanted)) > 0.8 * wanted.size
    assert found.size < 1.3 * wanted.size


def test_neither_exact_nor_coarse_positions_are_corrections():
    exact = make(5, [], Conditions(duration=40.0, noise=0.0)).logs[0]
    assert not corrections(exact).size
    t = 0.01 * np.arange(4000)
    slow = {"x": np.round(0.005 * t, 3), "u": 0.005 + 0 * t}  # a camera that counts millimetres
    coarse = Log("coarse", t, {**dict.fromkeys(("y", "psi", "v", "r"), 0 * t), **slow})
    assert not corrections(coarse).size


@pytest.mark.slow
def test_drift_is_estimated_beside_the_motion():
    case = make(4, [], Conditions(duration=40.0))
    logs = [navigated(log, np.random.default_rng([4, 2, k])) for k, log in enumerate(case.logs)]
    fit = held_fit(case.truth, gather(case.truth, logs))
    assert all(isinstance(m, Navigated) for m in fit.problem.logs)
    rows, channels = fit.problem.rows, fit.problem.rows.channels
    assert "x" not in channels
    z = innovations(fit)
    for name in ("u", "v"):
        c = channels.index(name)
        assert np.nanstd(z[..., c]) == pytest.approx(1.0, abs=0.1)
        wrong, left = [], []
        for w, k in enumerate(rows.log):
            there = rows.at[:, w] >= 0
            at = rows.at[there, w]
            drift = (logs[k][name] - case.logs[k][name])[at]
            wrong.append(drift)
            left.append(drift - fit.drift[there, w, c])
        wrong, left = (np.sqrt(np.mean(np.concatenate(e) ** 2)) for e in (wrong, left))
        assert left < 0.5 * wrong


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "duration"),
    [("rudder_offset", 40.0), ("reverse_thrust_loss", 24.0), ("surge_quadratic_drag", 40.0)],
)
def test_effects_are_named_in_spite_of_drift(name, duration):
    model, logs, holdout = case_of(6, [name], duration)
    found = diagnose(model, logs, holdout)
    assert (found.verdict, [e.effect for e in found.effects][:1]) == ("effect", [name])
    hidden = make(6, [name], Conditions(duration=duration)).truth.effect(name)
    for number in found.effects:
        wanted = hidden.values[
            number.parameter.removeprefix(f"{name}_") if number.parameter != name else "value"
        ]
        assert abs(number.value - wanted) < 4 * number.std
    assert any("corrections of a navigation" in line for line in found.warnings)
    channel = {"rudder_offset": "r"}.get(name, "u")
    assert found.after.rms[channel] < found.before.rms[channel]


@pytest.mark.slow
def test_nothing_is_named_where_only_the_navigation_drifts():
    model, logs, holdout = case_of(8, [])
    assert diagnose(model, logs, holdout).verdict == "none"
