"""Prediction errors of a fitted model: simulations from many rows of the smoothed path against the log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array, Indices
from hovercontrol.blocks.backends.shoot import shoot
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.problem import Problem

#: Maximum number of rows from which predictions start.
STARTS = 600

#: Longest sub-step [s].
STEP = 0.01

#: Largest change of a predicted state by halving the sub-steps, relative to the range of the state.
CLOSE = 1e-4

#: Minimum number of horizons that must fit into the logs. Fewer do not show the scatter of the errors.
TIMES = 10


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction errors at one horizon.

    Attributes
    ----------
    horizon : float
        Time from start to prediction [s].
    channels : tuple of str
    errors : ndarray, shape (N, C)
        Measured value minus drift of a navigation minus prediction; NaN where not measured.
    block : ndarray of int, shape (N,)
        Part of the logs in which each prediction starts. A part is one block, or as many blocks as twice the
        horizon lasts, because predictions that overlap have correlated errors.
    """

    horizon: float
    channels: tuple[str, ...]
    errors: Array
    block: NDArray[np.intp]

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square error of each channel."""
        with np.errstate(all="ignore"):
            return {
                c: float(np.sqrt(np.nanmean(e**2))) if np.isfinite(e).any() else float("nan")
                for c, e in zip(self.channels, self.errors.T, strict=True)
            }


def predict(fit: Fit, horizon: float, starts: int = STARTS) -> Prediction | None:
    """Return the prediction errors of a fitted model; None if no unbroken log is as long as `horizon`.

    Parameters
    ----------
    horizon : float
        Time ahead [s]. The row nearest to it is predicted, whether in the same block or another.
    starts : int, optional
        Maximum number of predictions, spread evenly.
    """
    problem = fit.problem
    time = problem.rows.time
    slack = 0.5 * problem.shortest - horizon
    pieces = [(piece, int((piece.when - slack <= piece.when[-1]).sum())) for piece in _pieces(problem)]
    total = sum(count for _, count in pieces)
    if not total:
        return None
    keep = np.unique(np.linspace(0, total - 1, min(starts, total)).astype(int))
    begin, end = [], []
    for piece, count in pieces:
        own = keep[(keep >= 0) & (keep < count)]
        begin.append(piece.rows(own))
        end.append(piece.rows(np.searchsorted(piece.when, piece.when[own] - slack)))
        keep = keep - count
    first, start_of = np.concatenate(begin, axis=1)
    last, of = np.concatenate(end, axis=1)
    t0, t1 = time[first, start_of], time[last, of]
    parameters = problem.parameters(fit.p)

    def ends(some: NDArray[np.intp], longest: float) -> Array:
        t, h = problem.divided(t0[some], t1[some], longest)
        u, lagged = problem.inputs.between(
            parameters, t, np.maximum(h, 1e-12 * problem.tempo), problem.rows.log[of[some]]
        )
        start = np.moveaxis(fit.path[first[some], start_of[some]], 1, 0)
        known = {i: v[:, None] for i, v in lagged.items()}
        given = (problem.block, t[:, None], h[:, None], u[:, :, None], known, parameters, start)
        with np.errstate(all="ignore"):
            return np.asarray(shoot(*given, euler=problem.euler)[1])

    # Sub-steps short enough for nearly all rows are too long for a few, as of an ignition: halved while they
    # change where a prediction ends
    step, finest = min(STEP * problem.tempo, problem.longest_piece), problem.dt.max() / problem.each.max()
    size = np.ptp(fit.path, axis=(0, 1))[:, None]
    moved = np.arange(of.size)
    x = ends(moved, step)
    while moved.size and step > finest:
        step, before = max(0.5 * step, float(finest)), x[:, moved]
        x[:, moved] = ends(moved, step)
        with np.errstate(all="ignore"):
            moved = moved[~(np.abs(x[:, moved] - before) <= CLOSE * size).all(axis=0)]
    found = problem.channels_at(x, parameters, t1, problem.rows.log[of])
    values = np.where(problem.seen[last, of], (problem.rows.values - fit.drift)[last, of], np.nan)
    return Prediction(horizon, problem.rows.channels, values - found.T, _parts(problem, horizon)[start_of])


def horizons(fit: Fit, wanted: Sequence[float] = (0.2, 0.5, 1.0, 2.0)) -> tuple[float, ...]:
    """Return the prediction horizons for a fit [s].

    The wanted horizons times the tempo, lengthened for slowly sampled logs so that the shortest one spans ten
    rows, without those that are too long for the logs. If none is left, the shortest one is cut to fit.
    """
    slow = max(fit.problem.tempo, 10.0 * fit.problem.shortest / wanted[0])
    longest = max(float(np.ptp(piece.when)) for piece in _pieces(fit.problem))
    most = min(0.8 * longest, float(fit.problem.rows.seconds.sum()) / TIMES)
    return tuple(slow * h for h in wanted if slow * h <= most) or (min(slow * wanted[0], 0.5 * longest),)


@dataclass(frozen=True, eq=False)
class _Piece:
    """Measured rows of an unbroken piece of a log, in order of time.

    Attributes
    ----------
    when : ndarray
        Time of each row [s].
    which : ndarray of int
        Index of each row among all rows of the piece, stretch after stretch.
    stretches : ndarray of int
        Stretches of the piece.
    per_stretch : int
        Number of rows of a stretch.
    """

    when: Array
    which: Indices
    stretches: Indices
    per_stretch: int

    def rows(self, of: Indices) -> Indices:
        """Return row and stretch of the measured rows with indices `of`, shape (2, N)."""
        stretch, row = np.divmod(self.which[of], self.per_stretch)
        return np.stack([row, self.stretches[stretch]])


def _pieces(problem: Problem) -> list[_Piece]:
    """Return the pieces that have measured rows, with one index per row to save memory in very long logs."""
    rows = problem.rows
    seen = np.asarray(problem.seen.any(axis=2))
    found = []
    for number in np.unique(rows.piece):
        own = np.flatnonzero(rows.piece == number)
        which = np.flatnonzero(seen[:, own].T)
        found.append(_Piece(rows.time[:, own].T.ravel()[which], which, own, seen.shape[0]))
    return [piece for piece in found if piece.which.size]


def _parts(problem: Problem, horizon: float) -> Indices:
    """Return the part of the logs of each stretch, shape (W,): as many blocks as twice the horizon lasts."""
    rows = problem.rows
    together = max(1, int(np.ceil(2.0 * horizon / float(np.median(rows.seconds)) - 1e-9)))
    first = np.array([rows.block[rows.piece == p].min() for p in rows.piece])
    return first + (rows.block - first) // together * together
