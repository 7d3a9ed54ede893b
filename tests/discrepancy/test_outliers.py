"""Outliers are taken out, motion and what a model lacks are not."""

import numpy as np
import pytest

from hovercontrol.discrepancy import diagnose
from hovercontrol.discrepancy.data import UNSURE, gather
from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.outliers import cleaned, without_outliers
from hovercontrol.discrepancy.spikes import stand_out
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
    data = gather(case.model, [log])
    before = np.isnan(data.logs[0].values)
    clean = without_outliers(fit(case.model, data, 0.25))
    out = np.isnan(clean.logs[0].values) & ~before
    for c, wanted in hit.items():
        row = clean.logs[0].channels.index(c)
        assert out[row][wanted].mean() > 0.95
        assert out[row][~wanted].mean() < 0.002
    assert out.sum() < 1.05 * sum(h.sum() for h in hit.values())


def hit_by(log, rng, low, high, share=0.02):
    """Return a log with outliers in all channels, and their sizes in standard deviations of the noise."""
    shape = (len(NOISE), len(log))
    sizes = np.exp(rng.uniform(np.log(low), np.log(high), shape)) * rng.choice([-1.0, 1.0], shape)
    sizes = dict(zip(NOISE, sizes * (rng.random(shape) < share), strict=True))
    columns = {c: log[c] + sizes[c] * NOISE[c] for c in NOISE}
    return Log(log.name, log.time, {**log.columns, **columns}), sizes


def gone(before, after):
    """Return which samples of the first log were taken out, by channel."""
    lost = np.isnan(after.logs[0].values) & ~np.isnan(before.logs[0].values)
    return dict(zip(after.logs[0].channels, lost, strict=True))


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
    clean = without_outliers(fit(case.model, data, 0.25)) or data
    assert sum(out.sum() for out in gone(data, clean).values()) <= 1


def test_outliers_are_found_whatever_the_model_lacks():
    case = make(7, ["rudder_lag", "yaw_quadratic_drag"], SHORT)
    log, sizes = hit_by(case.logs[0], np.random.default_rng(1), 15.0, 500.0)
    data = gather(case.model, [log])
    out = gone(data, cleaned(case.model, data, [0.25]))
    left = {c: ~np.isnan(v) for c, v in zip(data.logs[0].channels, data.logs[0].values, strict=True)}
    wanted = {c: (sizes[c] != 0) & left[c] for c in sizes}  # the reader takes out most of the pose's
    assert sum(w.sum() for w in wanted.values()) > 40
    assert sum((out[c] & wanted[c]).sum() for c in sizes) >= 0.97 * sum(w.sum() for w in wanted.values())
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


def test_rows_go_on_in_the_next_window():
    z = np.zeros((2, 12, 1))
    z[0, -1] = z[1, 0] = 12.0  # as high, but the next window begins where this one ends
    behind = np.array([1, -1])
    z[1] += 12.0
    step = stand_out(z, np.ones(z.shape, dtype=bool), behind, np.array([[0.0], [0.0]]))
    assert not step[0].any()
    z = np.zeros((2, 12, 1))
    z[0, -1], z[1] = 8.0, 5.0
    found = stand_out(z, np.ones(z.shape, dtype=bool), behind, np.array([[-5.0], [0.0]]))
    assert np.argwhere(found).tolist() == [[0, 11, 0]]


def test_outliers_of_the_hold_out_log_are_left_out_and_told():
    case = make(200, ["munk_moment"], Conditions(duration=20.0, scale=0.2, logs=1))
    bad, sizes = hit_by(case.holdout, np.random.default_rng(2), 20.0, 500.0)
    found = diagnose(case.model, case.logs, bad, names=["munk_moment", "slope"])
    for channel, rms in found.after.rms.items():
        assert rms == pytest.approx(NOISE[channel], rel=0.12)
    assert (found.before.count, found.rows_dropped) == (found.after.count, 0)
    assert all(out.held_out and out.log == bad.name for out in found.left_out)
    count = sum(out.count for out in found.left_out if out.channel == "r" and "alone" in out.reason)
    seen = np.isfinite(gather(case.model, [bad]).logs[0].values[-1])
    assert count == pytest.approx((sizes["r"][seen] != 0).sum(), abs=2)


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
