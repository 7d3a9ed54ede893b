"""Measured delays as a distribution for a link."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp
from scipy.optimize import root

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import positive
from hovercontrol.logs.check import check_finite
from hovercontrol.logs.source import open_source

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Straight pieces of the quantile function.
PIECES = 24

#: A delay that is more than this share of all may be a step of the quantile function (as may the rarest).
WORTH_A_STEP = 0.06

#: Fewest delays that say something of a distribution.
FEWEST = 20


@checked
@dataclass(frozen=True, eq=False)
class MeasuredDelays:
    """Distribution of measured delays, with a piecewise linear quantile function.

    The knots are the least-squares optimum, which keeps rare long delays and the steps of retransmissions.
    The inner knots are then scaled and shifted slightly, so that mean and standard deviation equal the
    measured ones. If that would exceed the bounds, it is left out, with errors of about 1 %. Shortest and
    longest delay are exact.

    Parameters
    ----------
    samples : array_like, shape (n,)
        Measured delays [s], at least 20 and not all equal; stored in ascending order.

    Attributes
    ----------
    shares, knots : ndarray, shape (n_knots,)
        Points of the quantile function: share and delay [s]. Two knots at one share are a jump.

    Raises
    ------
    InputError
        If there are too few samples, all are equal, or one is negative or not finite.

    Examples
    --------
    >>> delays = MeasuredDelays(np.random.default_rng(0).gamma(4.0, 0.01, size=500))
    >>> bool(np.isclose(delays.mean, delays.samples.mean()))
    True
    """

    samples: Array
    shares: Array = field(init=False)
    knots: Array = field(init=False)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        samples = np.sort(np.asarray(self.samples, dtype=float).ravel())
        if not (np.isfinite(samples).all() and (samples >= 0).all()):
            raise InputError("delays: expected finite numbers that are not negative")
        if len(samples) < FEWEST or samples[0] == samples[-1]:
            raise InputError(
                f"delays: expected at least {FEWEST} that are not all equal, found {len(samples)}"
                + (f", all {samples[0]:g} s: give that one delay" if len(samples) >= FEWEST else "")
            )
        object.__setattr__(self, "samples", samples)
        shares, knots = _corners(samples)
        object.__setattr__(self, "shares", shares)
        object.__setattr__(self, "knots", _matched(shares, knots, samples))

    @property
    def mean(self) -> float:
        """Mean delay [s]."""
        return _moments(self.shares, self.knots)[0]

    @property
    def sd(self) -> float:
        """Standard deviation [s]."""
        return _moments(self.shares, self.knots)[1]

    @property
    def least(self) -> float:
        """Shortest delay [s]."""
        return float(self.knots[0])

    @property
    def most(self) -> float:
        """Longest delay [s]."""
        return float(self.knots[-1])

    def quantile(self, share: sp.Expr) -> sp.Expr:
        """Return the quantile of the delays at a share [s], as an expression without unit."""
        lines = []
        for start, end, low, high in zip(
            *(row.tolist() for row in (self.shares[:-1], self.shares[1:], self.knots[:-1], self.knots[1:])),
            strict=True,
        ):
            if end > start:
                lines.append((low + (high - low) / (end - start) * (share - start), share < end))
        return sp.Piecewise(*lines[:-1], (lines[-1][0], True))

    def plot(self) -> Figure:
        """Return a figure: histogram of the measured delays, and the expected counts of a link."""
        from matplotlib.figure import Figure

        count = min(80, len(self.samples) // 10 + 5, len(np.unique(self.samples)))
        edges = np.histogram_bin_edges(self.samples, bins=count)
        below = np.r_[0.0, np.interp(edges[1:-1], self.knots, self.shares), 1.0]
        drawn = np.diff(below) * len(self.samples)
        figure = Figure(figsize=(6.5, 3.5), layout="constrained")
        ax = figure.subplots()
        ax.hist(
            1000 * self.samples,
            (1000 * edges).tolist(),
            color="0.8",
            label=f"measured, {len(self.samples)} delays",
        )
        ax.stairs(drawn, 1000 * edges, color="tab:blue", label="expected counts of a link")
        numbers = (1000 * value for value in (self.mean, self.sd, self.least, self.most))
        ax.set_title("mean {:.4g}, sd {:.4g}, {:.4g} to {:.4g} ms".format(*numbers), fontsize="small")
        ax.set(xlabel="delay [ms]", ylabel="messages [1]")
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
        return open_in_pyplot(figure)


@checked
def read_delays(path: str | Path, column: str = "delay", *, scale: float = 1.0) -> MeasuredDelays:
    r"""Return the delays in one column of a CSV or Parquet file.

    Parameters
    ----------
    path : str or Path
        CSV with a header, or Parquet.
    column : str, optional
    scale : float, optional
        Seconds per unit of the column: 0.001 for milliseconds.

    Raises
    ------
    InputError
        If the file or the column does not exist, a delay is negative or not finite, or as for
        :class:`MeasuredDelays`. The message names the file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "delays.csv"
    ...     _ = file.write_text("\n".join(["delay", *(str(40 + k % 7) for k in range(50))]))
    ...     round(read_delays(file, scale=1e-3).most, 6)
    0.046
    """
    file, unit = Path(path), positive("scale", scale)
    source = open_source(file)
    check_known(column, source.header, f"{file}: no column {column!r}")
    pieces = [batch.column(column).to_numpy(zero_copy_only=False) for batch in source.batches([column])]
    values = np.concatenate([np.zeros(0), *pieces]).astype(float)
    check_finite(str(file), source, column, values)
    negative = np.flatnonzero(values < 0)
    if negative.size:
        where, text = source.place(int(negative[0]), column)
        raise InputError(f"{file}: {where}, column {column!r}: a delay must not be negative, found {text!r}")
    try:
        return MeasuredDelays(values * unit)
    except InputError as error:
        raise InputError(f"{file}: column {column!r}: {error}") from None


def _corners(samples: Array) -> tuple[Array, Array]:
    """Return shares and delays of the knots: the least-squares optimum of all choices."""
    shares, delays = _candidates(samples)
    cost = _costs(samples, shares, delays)
    best, total, before = np.full(len(shares), np.inf), [], []
    best[0] = 0.0
    for _ in range(PIECES):  # shortest paths of 1, 2, ... pieces
        paths = best[:, None] + cost
        before.append(paths.argmin(axis=0))
        best = paths.min(axis=0)
        total.append(best[-1])
    count = int(np.argmax(np.array(total) <= min(total) + 1e-12 * samples[-1] ** 2))
    path = [len(shares) - 1]
    for step in before[count::-1]:
        path.append(int(step[path[-1]]))
    return shares[path[::-1]], delays[path[::-1]]


def _candidates(samples: Array) -> tuple[Array, Array]:
    """Return the ends and middles of the steps of the measured quantile function, candidates for knots."""
    values, counts = np.unique(samples, return_counts=True)
    high = np.cumsum(counts) / len(samples)
    low = np.r_[0.0, high[:-1]]
    spread = (1 - np.cos(np.linspace(0, np.pi, 120))) / 2  # closer where rare delays are
    kept = np.unique(np.r_[(spread * (len(values) - 1)).round().astype(int), np.arange(len(values))[-12:]])
    rank = np.minimum(kept, len(values) - 1 - kept)
    broad = kept[((high - low)[kept] > WORTH_A_STEP) | (rank < 3) | (len(values) <= PIECES // 2)]
    x = np.r_[0.0, low[broad], (low + high)[kept] / 2, high[broad], 1.0]
    y = np.r_[values[0], values[broad], values[kept], values[broad], values[-1]]
    order = np.lexsort((y, x))
    return x[order], y[order]


def _costs(samples: Array, x: Array, y: Array) -> Array:
    """Return the integrated squared error of the line from each candidate to each later one."""
    steps, edges = samples - samples.mean(), np.arange(len(samples) + 1) / len(samples)
    y = y - samples.mean()

    def integral(of: Array, over: Array) -> Array:
        """Return the integral of steps from 0 to each candidate; inside a step it is linear in `over`."""
        return np.interp(over, grid, np.r_[0.0, np.cumsum(of * np.diff(grid))])

    # of the steps s and the line l(x) = y0 + slope (x - x0): integral of (s - l)^2 = s^2 - 2 s l + l^2,
    # the last of which is (x1 - x0) (y0^2 + y0 y1 + y1^2)/3
    grid = edges
    zeroth, square = integral(steps, x), integral(steps**2, x)
    grid = edges**2 / 2
    first = integral(steps, x**2 / 2)
    width = x - x[:, None]
    slope = np.divide(y - y[:, None], width, out=np.zeros_like(width), where=width > 0)
    area, moment = zeroth - zeroth[:, None], first - first[:, None]
    product = (y[:, None] - slope * x[:, None]) * area + slope * moment  # of steps and line
    line = width * (y**2 + y * y[:, None] + y[:, None] ** 2) / 3
    cost = np.maximum(square - square[:, None] - 2 * product + line, 0.0)
    return np.where(np.triu(np.ones_like(cost), 1) > 0, cost, np.inf)


def _moments(shares: Array, knots: Array) -> tuple[float, float]:
    """Return mean and standard deviation, exact for a piecewise linear quantile function."""
    # between shares p0, p1 with knots a, b about the mean: integral of q^2 = (p1 - p0) (a^2 + a b + b^2)/3
    weights, low, high = np.diff(shares), knots[:-1], knots[1:]
    mean = float(weights @ (low + high) / 2)
    low, high = low - mean, high - mean
    return mean, float(np.sqrt(weights @ (low**2 + low * high + high**2) / 3))


def _matched(shares: Array, knots: Array, samples: Array) -> Array:
    """Return the knots, the inner ones scaled and shifted to match mean and standard deviation."""
    wanted = np.array([samples.mean(), samples.std()])
    inner = (knots > knots[0]) & (knots < knots[-1])

    def moved(change: Array) -> Array:
        scaled = wanted[0] + change[0] * wanted[1] + change[1] * (knots - wanted[0])
        return np.where(inner, scaled, knots)

    def misfit(change: Array) -> Array:
        return (np.array(_moments(shares, moved(change))) - wanted) / wanted[1]

    if np.abs(misfit(np.array([0.0, 1.0]))).max() < 1e-9:
        return knots
    found = root(misfit, [0.0, 1.0], tol=1e-12)
    matched = moved(found.x)
    return matched if found.success and (np.diff(matched) >= 0).all() else knots
