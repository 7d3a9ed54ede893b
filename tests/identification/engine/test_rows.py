"""Rows of logs in blocks: nothing is lost, gaps are filled, very long ones end a block."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.measure import measure
from hovercontrol.identification.engine.rows import BLOCKING, arrange
from hovercontrol.logs import Log


@pytest.fixture
def arranged(cart):
    """Return a function that cuts logs, given by their times, into blocks."""

    def make(*times, lost=()):
        logs = []
        for k, t in enumerate(times):
            p = np.sin(t) + 1e-3 * np.random.default_rng(k).normal(size=t.size)
            p[list(lost)] = np.nan
            logs.append(measure(cart, Log(f"log {k}", t, {"p": p, "F": np.cos(t)})))
        states = [{"p": np.nan_to_num(m.values[0])} for m in logs]
        return logs, arrange(logs, states, ("p",))

    return make


def test_every_row_is_in_one_block_with_its_time_and_value(arranged):
    logs, rows = arranged(0.05 * np.arange(600), 3.0 + 0.05 * np.arange(400))
    for k, log in enumerate(logs):
        own = (rows.at >= 0) & (rows.log == k)
        at = rows.at[own]
        assert sorted(at.tolist()) == list(range(log.time.size))
        np.testing.assert_allclose(rows.time[own], log.time[at] - log.origin)
        np.testing.assert_array_equal(rows.values[own][:, 0], log.values[0, at])
    assert (np.diff(rows.time, axis=0) >= 0.0).all()
    assert (rows.block_log[rows.block] == rows.log).all()
    assert BLOCKING.least_blocks <= len(rows.block_log) <= BLOCKING.most_blocks
    assert rows.seconds.std() < 0.2 * rows.seconds.mean()


def test_short_blocks_are_padded_with_their_last_row(arranged):
    _, rows = arranged(0.05 * np.arange(603))
    pad = rows.at < 0
    assert pad.any() and np.isnan(rows.values[pad]).all()
    step = np.diff(rows.time, axis=0)
    onward = pad[1:] & ~pad[:-1] & np.append(rows.follows[1:], False)  # to the begin of the next stretch
    assert (step[pad[1:] & ~onward] == 0.0).all() and (step[~pad[1:] | onward] > 0.0).all()


def test_a_stretch_ends_where_the_next_one_of_its_piece_begins(arranged):
    t = 0.05 * np.arange(600)
    _, rows = arranged(np.where(t < 15.0, t, t + 60.0))
    assert (rows.follows == (np.diff(rows.piece, prepend=-1) == 0)).all() and not rows.follows.all()
    after = np.flatnonzero(rows.follows)
    assert (rows.time[-1, after - 1] == rows.time[0, after]).all()
    path = rows.joined(np.random.default_rng(1).normal(size=(*rows.time.shape, 2)))
    assert (path[-1, after - 1] == path[0, after]).all()


def test_a_gap_is_filled_with_rows_without_a_measurement(arranged):
    t = 0.05 * np.arange(600)
    _, rows = arranged(t[(np.arange(600) < 300) | (np.arange(600) > 310)])
    step = np.diff(rows.time, axis=0, prepend=-1.0)
    assert step[1:].max() < 0.051
    extra = (rows.at < 0) & (step > 0)
    assert np.isnan(rows.values[extra]).all()
    lost = np.setdiff1d(rows.time[extra], rows.time[rows.at >= 0])
    np.testing.assert_allclose(lost, 0.05 * np.arange(300, 311))


def test_a_very_long_gap_ends_a_block(arranged):
    t = 0.05 * np.arange(600)
    _, rows = arranged(np.where(t < 15.0, t, t + 60.0))
    assert rows.seconds.sum() < 31.0
    first, last = rows.time[0], rows.time[-1]
    assert not ((first < 20.0) & (last > 70.0)).any()


def test_long_blocks_are_filtered_in_stretches_side_by_side(arranged):
    _, rows = arranged(0.002 * np.arange(20_000))
    assert len(rows.block_log) < len(rows.log)
    assert rows.time.shape[0] < 2 * BLOCKING.stretch + 2
    sums = rows.by_block(np.ones(len(rows.log)))
    assert sums.sum() == len(rows.log) and sums.shape == rows.block_log.shape
    assert rows.seconds.min() > 1.0


def test_too_few_rows_are_refused(arranged):
    with pytest.raises(InputError, match="log 0: too few rows"):
        arranged(0.05 * np.arange(8))
