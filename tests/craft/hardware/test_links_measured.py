"""Delays from a user's own file: a link draws what was measured, steps and rare long ones included."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy.stats import ks_2samp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.hybrid import Ticking
from hovercontrol.craft.hardware.links import MeasuredDelays, empirical_delay, read_delays

SHARE = sp.Symbol("share", real=True)
COUNT = 20_000


def drawn(delays):
    """Return delays at equal shares, from the expression a Block evaluates."""
    q = sp.lambdify(SHARE, delays.quantile(SHARE))
    return np.broadcast_to(q((np.arange(COUNT) + 0.5) / COUNT), COUNT)


def gamma():
    return np.random.default_rng(0).gamma(4.0, 0.01, 500)


RETRANSMITTED = np.repeat([0.01, 0.03, 0.05], [70, 20, 10])
ONE_LONG = np.append(gamma(), 2.0)


@pytest.mark.parametrize("samples", [gamma(), RETRANSMITTED, ONE_LONG, np.linspace(0.0, 1.0, 50)])
def test_what_is_drawn_is_what_was_measured(samples):
    delays = MeasuredDelays(samples)
    assert (delays.mean, delays.sd) == pytest.approx((samples.mean(), samples.std()))
    assert (delays.least, delays.most) == (samples.min(), samples.max())
    x = drawn(delays)
    assert (x.mean(), x.std()) == pytest.approx((samples.mean(), samples.std()), rel=1e-3)
    assert x.min() >= samples.min() and x.max() <= samples.max()
    assert ks_2samp(x, samples).statistic < 0.05


def test_steps_stay_steps():
    values, counts = np.unique(drawn(MeasuredDelays(RETRANSMITTED)).round(9), return_counts=True)
    assert values.tolist() == [0.01, 0.03, 0.05]
    assert (counts / COUNT).tolist() == pytest.approx([0.7, 0.2, 0.1])


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(0, 1).map(lambda s: round(s, 4)), min_size=20, max_size=80))
def test_any_delays_are_kept_within_their_bounds_and_quantiles_rise(samples):
    assume(max(samples) > min(samples))
    delays = MeasuredDelays(samples)
    x = drawn(delays)
    assert (np.diff(x) >= -1e-12).all()
    assert min(samples) - 1e-12 <= x[0] and x[-1] <= max(samples) + 1e-12
    assert delays.mean == pytest.approx(np.mean(samples), abs=0.02 * np.std(samples))
    assert delays.sd == pytest.approx(np.std(samples), rel=0.05)


def test_a_file_in_milliseconds_becomes_a_link(tmp_path):
    file = tmp_path / "delays.csv"
    file.write_text("k,ms\n" + "".join(f"{k},{20 + k % 40}\n" for k in range(400)))
    delays = read_delays(file, "ms", scale=0.001)
    assert (delays.least, delays.most) == pytest.approx((0.02, 0.059))
    assert delays.mean == pytest.approx(0.0395)
    link = Ticking(empirical_delay([Signal("y")], delays, 0.1))
    rows = [link.tick(0.001 * k, {"y": 1.0}) for k in range(3000)]
    first = [
        row["link_age"]
        for row, last in zip(rows[1:], rows, strict=False)
        if row["link_delivered"] > last["link_delivered"]
    ]
    assert len(first) == 30
    assert min(first) >= 0.02 - 1e-9 and max(first) <= 0.059 + 1e-9
    assert np.mean(first) == pytest.approx(0.0395, abs=5 * 0.0115 / np.sqrt(30))


@pytest.mark.parametrize("samples", [gamma(), RETRANSMITTED])
def test_the_picture_counts_every_message_twice_measured_and_drawn(samples):
    figure = MeasuredDelays(samples).plot()
    assert isinstance(figure, Figure)
    (axis,) = figure.axes
    bars = [bar.get_height() for bar in axis.patches if hasattr(bar, "get_height")]
    (stairs,) = (patch for patch in axis.patches if not hasattr(patch, "get_height"))
    assert sum(bars) == len(samples) == pytest.approx(stairs.get_data().values.sum())
    assert stairs.get_data().values == pytest.approx(bars, abs=0.05 * len(samples))


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        ("delay\n" + "0.1\n" * 5, "at least 20"),
        ("delay\n" + "0.1\n" * 30, "all 0.1 s: give that one delay"),
        ("delay\n0.1\n-0.2\n" + "0.1\n" * 30, "line 3, column 'delay': a delay must not be negative"),
        ("delay\n0.1\nx\n" + "0.1\n" * 30, "line 3, column 'delay': expected a number"),
        ("delay\n0.1\ninf\n" + "0.1\n" * 30, "line 3, column 'delay': expected a finite number"),
        ("delays\n0.1\n", "no column 'delay'; did you mean 'delays'"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, rows, line):
    file = tmp_path / "delays.csv"
    file.write_text(rows)
    with pytest.raises(InputError, match=line) as caught:
        read_delays(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_and_a_wrong_scale_are_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_delays(tmp_path / "none.csv")
    with pytest.raises(InputError, match="scale must be positive"):
        read_delays(tmp_path / "none.csv", scale=0.0)
    with pytest.raises(InputError, match="finite numbers that are not negative"):
        MeasuredDelays([-0.1] * 30)
