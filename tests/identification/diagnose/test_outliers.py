"""Outliers are taken out, motion and what a model lacks are not."""

import numpy as np
import pytest

from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.spikes import stand_out
from hovercontrol.logs import Log

from .generator import NOISE, Conditions, make

SHORT = Conditions(duration=20.0, logs=1)


def spoilt(log, rng, share=0.02, size=0.3):
    hit = {c: rng.random(len(log)) < share for c in ("u", "r")}
    values = {c: log[c] + hit[c] * size * rng.choice([-1.0, 1.0], len(log)) for c in hit}
    return Log(log.name, log.time, {**log.columns, **values}), hit


def test_outliers_are_found_and_nothing_else():
    case = make(3, [], SHORT)
    log, hit = spoilt(case.logs[0], np.random.default_rng(0))
    found, before = gone(base_fit(case.model, gather(case.model, [log])), log)
    for c, wanted in hit.items():
        assert found[c][wanted & before[c]].mean() > 0.95
        assert found[c][~wanted].mean() < 0.002
    assert sum(f.sum() for f in found.values()) < 1.05 * sum(h.sum() for h in hit.values())


def hit_by(log, rng, low, high, share=0.02):
    """Return a log with outliers in all channels, and their sizes in standard deviations of the noise."""
    shape = (len(NOISE), len(log))
    sizes = np.exp(rng.uniform(np.log(low), np.log(high), shape)) * rng.choice([-1.0, 1.0], shape)
    sizes = dict(zip(NOISE, sizes * (rng.random(shape) < share), strict=True))
    columns = {c: log[c] + sizes[c] * NOISE[c] for c in NOISE}
    return Log(log.name, log.time, {**log.columns, **columns}), sizes


def gone(fit, log):
    """Return which samples of a log a fit left out, and which it had, by channel."""
    problem = fit.problem
    channels = problem.rows.channels
    out, had = ({c: np.zeros(len(log), dtype=bool) for c in channels} for _ in range(2))
    values = problem.logs[0].values
    for i, c in enumerate(channels):
        had[c] = np.isfinite(values[i])
        for w in range(len(problem.rows.log)):
            own = problem.rows.at[:, w] >= 0
            at = problem.rows.at[own, w]
            out[c][at] = had[c][at] & ~problem.seen[own, w, i]
    return out, had


@pytest.mark.slow("names1", "names2", "names3")
@pytest.mark.parametrize(
    ("seed", "names"),
    [
        (1, ["thrust_lag", "slope"]),
        (2, ["input_delay"]),
        (7, ["rudder_lag", "yaw_quadratic_drag"]),
        (8, ["time_offset"]),
    ],
)
def test_what_a_model_lacks_is_no_outlier(seed, names):
    case = make(seed, names, Conditions(duration=30.0))
    data = gather(case.model, case.logs)
    fit = base_fit(case.model, data)
    assert (np.isfinite(data.rows.values) & ~fit.problem.seen).sum() <= 1


def test_outliers_are_found_whatever_the_model_lacks():
    case = make(7, ["rudder_lag", "yaw_quadratic_drag"], SHORT)
    log, sizes = hit_by(case.logs[0], np.random.default_rng(1), 20.0, 500.0)
    out, had = gone(base_fit(case.model, gather(case.model, [log])), log)
    wanted = {c: (sizes[c] != 0) & had[c] for c in sizes}  # the reader takes out most of the pose's
    assert sum(w.sum() for w in wanted.values()) > 40
    assert sum((out[c] & wanted[c]).sum() for c in sizes) >= 0.95 * sum(w.sum() for w in wanted.values())
    assert sum((out[c] & ~wanted[c]).sum() for c in sizes) <= 3


def test_spikes_stand_out_from_both_sides():
    rng = np.random.default_rng(0)
    z = rng.normal(size=(1, 60, 1))
    every = np.ones(z.shape, dtype=bool)
    assert not stand_out(z, every).any()
    far = {0: 30, 9: -12, 20: 40, 21: 40, 30: -50, 31: -60, 32: -45, 40: 50, 41: -50, 59: -30}
    z[0, list(far), 0] += list(far.values())  # ends, one, two alike, three alike, two unlike
    assert np.flatnonzero(stand_out(z, every)).tolist() == list(far)
    for change in (np.where(np.arange(60) < 30, 0, 50), 200 * np.exp(-np.arange(60) / 5), 30 * np.arange(60)):
        assert not stand_out(rng.normal(size=z.shape) + change[None, :, None], every).any()


@pytest.mark.slow
def test_outliers_of_the_held_out_log_are_left_out():
    case = make(200, ["munk_moment"], Conditions(duration=20.0, scale=0.2, logs=1))
    bad, sizes = hit_by(case.holdout, np.random.default_rng(2), 20.0, 500.0)
    found = diagnose(case.model, case.logs, bad, names=["munk_moment", "slope"])
    fit = found.held_after
    out, had = gone(fit, bad)
    assert found.rows_dropped == 0
    assert {e.effect for e in found.effects} <= {"munk_moment"}
    for c in NOISE:
        assert out[c].sum() == pytest.approx(((sizes[c] != 0) & had[c]).sum(), abs=4)
