"""Outliers are taken out, motion and what a model lacks are not."""

import numpy as np
import pytest

from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.outliers import without_outliers
from hovercontrol.discrepancy.windowed import UNSURE, gather
from hovercontrol.logs import Log

from .generator import Conditions, make

SHORT = Conditions(duration=20.0, logs=1)


def spoilt(log, rng, share=0.02, size=0.3):
    hit = {c: rng.random(len(log)) < share for c in ("u", "r")}
    values = {c: log[c] + hit[c] * size * rng.choice([-1.0, 1.0], len(log)) for c in hit}
    return Log(log.name, log.time, {**log.columns, **values}), hit


def test_outliers_are_found_and_nothing_else():
    case = make(3, [], SHORT)
    log, hit = spoilt(case.logs[0], np.random.default_rng(0))
    data = gather(case.model, [log])
    before = np.isnan(data.logs[0].values)
    clean = without_outliers(fit(case.model, data, 0.25))
    out = np.isnan(clean.logs[0].values) & ~before
    for c, wanted in hit.items():
        row = clean.logs[0].channels.index(c)
        assert out[row][wanted].mean() > 0.95
        assert out[row][~wanted].mean() < 0.002
    assert out.sum() < 1.05 * sum(h.sum() for h in hit.values())


def test_a_gross_lack_of_the_model_is_no_outlier():
    case = make(4, ["slope", "thrust_saturation"], SHORT)
    data = gather(case.model, case.logs)
    clean = without_outliers(fit(case.model, data, 0.25))
    if clean is not None:
        out = np.isnan(clean.logs[0].values) & ~np.isnan(data.logs[0].values)
        assert out.mean() < 1e-3


def test_a_command_that_changes_in_a_gap_ends_a_window():
    case = make(5, [], SHORT)
    log = case.logs[0]
    changes = np.flatnonzero(np.diff(log["thrust"])) + 1
    at = int(changes[changes > 100][0])
    kept = np.delete(np.arange(len(log)), at)
    data = gather(case.model, [log.select(kept)])
    (begin, end), (again, _) = data.logs[0].segments
    assert (begin, end) == (0, at)  # and what it does is in doubt for a while, as it may act late
    assert log.time[kept][again] == pytest.approx(log.time[kept][at] + UNSURE, abs=0.021)
    still = at + 2 if at + 3 not in changes and at + 2 not in changes else at + 5
    data = gather(case.model, [log.select(np.delete(np.arange(len(log)), still))])
    assert len(data.logs[0].segments) == 1
