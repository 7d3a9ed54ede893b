"""Spikes are found by the definition, row by row, however few rows are looked at closely."""

from __future__ import annotations

import time

import numpy as np
import pytest

from hovercontrol.identification.engine.spikes import SPIKES, stand_out


def by_definition(row: np.ndarray) -> np.ndarray:
    """The rule for rows with three others on both sides, written out for one sample or a few together."""
    found = np.zeros(row.size, dtype=bool)
    for width, sharp in enumerate(SPIKES.sharp, start=1):
        for k in range(3, row.size - 3 - width + 1):
            before, own, after = row[k - 3 : k][::-1], row[k : k + width], row[k + width : k + width + 3]
            left, right = np.median(before), np.median(after)
            up = np.sign(own[0] - (left + right) / 2)
            far = min(up * (own - (left + right) / 2))
            least = far - abs(left - right) / 2
            edge = min(up * own) - max(up * before[0], up * after[0])
            step = np.sort(np.abs([*np.diff(before), *np.diff(after)]))[1]
            clear = far > SPIKES.stands_out and least > SPIKES.steps * step
            if clear and edge > sharp * least and abs(left - right) < SPIKES.apart * least:
                found[k : k + width] = True
    return found


@pytest.mark.parametrize("drift", [0.0, 1.0, 5.0])
def test_spikes_are_those_of_the_definition(drift):
    rng, count = np.random.default_rng(int(drift)), 0
    for size in (1.0, 0.3, 2.0):
        row = size * rng.normal(size=500) + drift * np.cumsum(rng.normal(size=500))
        for k in rng.integers(8, 490, 40):
            row[k : k + rng.integers(1, 4)] += rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 40.0)
        inside = slice(6, -6)  # beside the ends another rule holds
        found = stand_out(row[None, :, None], np.ones((1, 500, 1), dtype=bool))[0, :, 0]
        assert np.array_equal(found[inside], by_definition(row)[inside])
        count += int(found.sum())
    assert count > 20


def test_one_row_alone_is_no_spike():
    assert not stand_out(np.full((2, 1, 1), 9.0), np.ones((2, 1, 1), dtype=bool)).any()


def test_a_million_rows_take_no_ranks_of_each():
    z = np.random.default_rng(0).normal(size=(1, 1_000_000, 1))
    begin = time.process_time()
    stand_out(z, np.ones(z.shape, dtype=bool))
    assert time.process_time() - begin < 2.0  # 3.4 s and more when every row was ranked; now 0.3 s
