"""A picture of a long signal shows its extremes, with few points."""

import numpy as np

from hovercontrol.base.envelope import MOST_DRAWN, envelope


def test_short_rows_are_drawn_as_they_are():
    row = np.array([1.0, np.nan, 3.0, 2.0])
    assert envelope(row).tolist() == [0, 2, 3]


def test_of_long_rows_every_extreme_is_drawn():
    row = np.random.default_rng(0).normal(size=1_000_000)
    row[[123_456, 765_432]] = 50.0, -40.0
    drawn = envelope(row)
    assert drawn.size <= MOST_DRAWN and np.all(np.diff(drawn) > 0)
    assert {123_456, 765_432} <= set(drawn.tolist())
    width = row.size // (MOST_DRAWN // 2)
    for k in range(0, row.size - width, 50_000):  # in each piece as wide as two spans: at least one is whole
        piece = row[k : k + 2 * width]
        own = row[drawn[(drawn >= k) & (drawn < k + 2 * width)]]
        assert own.size >= 2 and own.max() >= np.quantile(piece, 0.9) and own.min() <= np.quantile(piece, 0.1)
