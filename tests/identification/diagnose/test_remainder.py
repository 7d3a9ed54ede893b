"""Unmodelled residual in each equation: gusts of a known size, before and behind what was named."""

import numpy as np
import pytest

from hovercontrol.identification.benchmark.cases import GUST_SECONDS
from hovercontrol.identification.diagnose.evidence.remainder import missing_forces, remainders
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.noise import averaging_time

from .generator import GUST, Conditions, make

SHORT = Conditions(duration=20.0, logs=1)


@pytest.fixture(scope="module")
def gusts():
    """A craft in gusts that lacks a slope: fitted as given, and with it."""
    case = make(71, ["slope"], Conditions(duration=30.0, logs=1, gusts=True))
    data = gather(case.model, case.logs)
    return base_fit(case.model, data), base_fit(case.truth, data)


def test_gusts_remain_with_their_size_averaged(gusts):
    base, final = gusts
    s = 0.2 / GUST_SECONDS
    smaller = np.sqrt(2.0 * (s + np.expm1(-s))) / s
    found = remainders(base, final)
    assert [r.equation for r in found] == ["u'", "v'", "r'"]
    assert [r.unit for r in found] == ["m/s^2", "m/s^2", "rad/s^2"]
    for r in found:
        assert r.there and r.gain > 28.0 and r.over == 0.2
        assert r.rms == pytest.approx(GUST[r.equation[0]] * smaller, rel=0.35)


def test_what_a_named_effect_took_is_told(gusts):
    base, final = gusts
    shares = {r.equation: r.share_explained for r in remainders(base, final)}
    assert max(shares["u'"], shares["v'"]) > 0.4 and shares["r'"] < 0.3
    assert all(r.share_explained == 0.0 for r in remainders(final, final))


def test_nothing_remains_where_nothing_is_missing():
    case = make(72, [], SHORT)
    fit = base_fit(case.model, gather(case.model, case.logs))
    assert [(r.there, r.rms) for r in remainders(fit, fit)] == [(False, 0.0)] * 3


def test_no_share_is_explained_where_nothing_was_added():
    case = make(72, [], SHORT)
    fit = base_fit(case.model, gather(case.model, case.logs))
    assert [r.share_explained for r in remainders(fit, fit)] == [0.0, 0.0, 0.0]


def test_missing_accelerations_lie_in_their_rows_with_a_band(gusts):
    log = gusts[0].problem.logs[0]
    for fit in gusts:
        found = missing_forces(fit)
        assert [(m.log, m.equation) for m in found] == [(log.name, e) for e in ("u'", "v'", "r'")]
        for m in found:
            assert m.force.shape == m.band.shape == m.time.shape == log.time.shape
            assert np.isfinite(m.force).mean() > 0.99 and (m.band[np.isfinite(m.force)] > 0.0).all()
            assert [q.name for q in m.over] == ["u", "v", "r", "thrust", "rudder"]
    before, after = ({m.equation: m.rms for m in missing_forces(fit)} for fit in gusts)
    assert after["u'"] < before["u'"] or after["v'"] < before["v'"]


def test_accelerations_are_averaged_over_rows_enough():
    case = make(73, [], Conditions(duration=30.0, dt=0.1, logs=1, noise=0.1))
    assert averaging_time(base_fit(case.model, gather(case.model, case.logs)).problem) == pytest.approx(0.5)
