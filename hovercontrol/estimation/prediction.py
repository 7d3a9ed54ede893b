"""How well a fitted model predicts: simulated from the smoothed path at many rows, compared with the log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.fit import Fit
from hovercontrol.targets.shoot import shoot

Array = NDArray[np.float64]

#: Rows from which predictions start, at most.
STARTS = 600

#: Longest sub-step [s].
STEP = 0.01


@dataclass(frozen=True, eq=False)
class Prediction:
    """Errors some time ahead.

    Attributes
    ----------
    horizon : float
        [s]
    channels : tuple of str
    errors : ndarray, shape (N, C)
        Measured, less the drift of a navigation, minus predicted; NaN where not measured.
    block : ndarray of int, shape (N,)
        In which block each prediction starts.
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
    """Return the errors of a fitted model `horizon` seconds ahead; None if no block is that long.

    Parameters
    ----------
    fit : Fit
    horizon : float
        [s]; the row nearest to it is predicted.
    starts : int, optional
        Predictions at most, spread evenly.
    """
    problem = fit.problem
    time = problem.rows.time
    half = 0.5 * problem.shortest
    begin, end, block = [], [], []
    seen = np.asarray(problem.seen.any(axis=2))
    for w in range(time.shape[1]):
        rows = np.flatnonzero(seen[:, w])
        ahead = np.searchsorted(time[rows, w], time[rows, w] + horizon - half)
        good = ahead < rows.size
        begin.append(rows[good])
        end.append(rows[ahead[good]])
        block.append(np.full(int(good.sum()), w))
    first, last, of = (np.concatenate(a).astype(np.intp) for a in (begin, end, block))
    if not first.size:
        return None
    keep = np.unique(np.linspace(0, first.size - 1, min(starts, first.size)).astype(int))
    first, last, of = first[keep], last[keep], of[keep]
    t0, t1 = time[first, of], time[last, of]
    finest = min(STEP, float(np.max(problem.h)) or STEP)
    S = max(1, int(np.ceil(float((t1 - t0).max()) / finest)))
    h = (t1 - t0) / S
    t = t0 + np.arange(S)[:, None] * h
    parameters = problem.parameters(fit.p)
    u, lagged = problem.commands_at(parameters, t, np.maximum(h, 1e-12), problem.rows.log[of])
    start = np.moveaxis(fit.path[first, of], 1, 0)[:, None, :]
    known = {i: v[:, None, None, :] for i, v in lagged.items()}
    with np.errstate(all="ignore"):
        x = shoot(
            problem.block, t[:, None, :], h[None], u[:, :, None, None, :], known,
            np.array(parameters)[:, None], start,
        )[1][:, 0]  # fmt: skip
    found = problem.channels_at(x, parameters, t1, problem.rows.log[of])
    values = np.where(problem.seen[last, of], (problem.rows.values - fit.drift)[last, of], np.nan)
    return Prediction(horizon, problem.rows.channels, values - found.T, problem.rows.block[of])


def horizons(fit: Fit, wanted: Sequence[float] = (0.2, 0.5, 1.0, 2.0)) -> tuple[float, ...]:
    """Return how far ahead a model is judged [s]: as wanted, or as many rows of a slower machine."""
    slow = max(1.0, 10.0 * fit.problem.shortest / wanted[0])
    longest = float(fit.problem.rows.seconds.max())
    return tuple(slow * h for h in wanted if slow * h < 0.8 * longest) or (0.5 * longest,)
