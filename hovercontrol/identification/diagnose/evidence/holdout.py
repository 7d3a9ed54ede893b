"""Comparison of models on held-out logs, by likelihood and by predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import Fit, estimate, first_noise
from hovercontrol.identification.engine.prediction import horizons, predict
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.subject import Subject


@dataclass(frozen=True)
class Ahead:
    """The prediction error of one channel at one horizon, without and with the added effects.

    Attributes
    ----------
    horizon : float
        [s]
    channel, unit : str
    before, after : float
        Root mean square.
    t : float
        Reduction of the squared error over its standard error over blocks; negative if the error rises.
    """

    horizon: float
    channel: str
    unit: str
    before: float
    after: float
    t: float


@dataclass(frozen=True)
class Gap:
    """Errors of a model that predicts logs `horizon` seconds ahead.

    Attributes
    ----------
    horizon : float
    rms : dict of str to float
        Root mean square error of each channel, in its unit.
    nrmse : dict of str to float
        The same over the standard deviation of the channel.
    floor : dict of str to float
        The measurement noise over the standard deviation of the channel: no model can do better.
    """

    horizon: float
    rms: dict[str, float]
    nrmse: dict[str, float]
    floor: dict[str, float]


def held_fit(model: Subject, data: Data, near: Fit | None = None) -> Fit:
    """Return the fit of a model to held-out logs: path and noise are fitted, coefficients are fixed.

    Parameters
    ----------
    near : Fit, optional
        Fit of another model to the same data, from whose noise levels and path this fit starts.
    """
    problem = Problem(model, data)
    path = problem.path_of(near.problem.block, near.path, problem.start) if near else None
    noise = near.noise if near else first_noise(problem)
    prior, gate = prior_of(problem, model), near is None
    return estimate(problem, prior, noise, path=path, frozen=True, gate=gate)


@dataclass(frozen=True)
class Gained:
    """The gain of an effect on a log that it was not fitted to.

    Attributes
    ----------
    gain : float
        Reduction of twice the negative log likelihood, with fixed coefficients and the likeliest noise on
        both sides.
    scatter : float
        Standard error of the gain, from disjoint blocks; zero if there are fewer than three.
    """

    gain: float
    scatter: float

    @property
    def t(self) -> float:
        """The gain over its standard error; zero if that is not known."""
        return self.gain / self.scatter if self.scatter else 0.0


class Blockwise(Protocol):
    """A fit with the cost of each block of its logs."""

    @property
    def block_costs(self) -> Array:
        """Twice the negative log likelihood of each block, shape (W,)."""


def gained(less: Blockwise, more: Blockwise) -> Gained:
    """Return the gain of further effects on a held-out log, from the costs of its blocks.

    With d_w the reduction of the cost of block w of W, the gain is ``sum d_w``, its standard error
    ``W^(1/2) std(d_w)``.

    Parameters
    ----------
    less, more : Fit
        Fits to the same log (:func:`held_fit`), without and with these effects.
    """
    fall = less.block_costs - more.block_costs
    scatter = float(np.sqrt(fall.size) * fall.std(ddof=1)) if fall.size > 2 else 0.0
    return Gained(float(fall.sum()), scatter)


@dataclass(frozen=True)
class Horizons:
    """Errors of two models at several horizons.

    Attributes
    ----------
    each : tuple of Ahead
        By horizon and channel.
    together : tuple of float
        By horizon: mean reduction of the squared errors of all channels, relative to the mean square error of
        each channel, over its standard error over blocks.
    taken : tuple of float
        By horizon: fraction of the mean square error that the second model removes, averaged over channels.
        Unlike `together` it does not depend on the number of blocks without an error: an event counts as much
        among calm blocks as alone.
    """

    each: tuple[Ahead, ...] = ()
    together: tuple[float, ...] = ()
    taken: tuple[float, ...] = ()


def ahead(before: Fit, after: Fit, wanted: Sequence[float] = (0.2, 0.5, 1.0, 2.0)) -> Horizons:
    """Return the errors of two models on the same rows, at each horizon and channel.

    With the errors e1, e2 of the two models, the means over rows of each channel c, and means over channels::

        together   mean over c of (e1^2 - e2^2) / (mean of (e1^2 + e2^2) / 2), as a t statistic over blocks
        taken      1 - mean over c of (mean e2^2 / mean e1^2)
    """
    found, together, taken = [], [], []
    for horizon in horizons(before, wanted):
        one, two = predict(before, horizon), predict(after, horizon)
        if one is None or two is None:
            continue
        fall = one.errors**2 - two.errors**2
        together.append(fall_of_errors(one.errors, two.errors, one.block))
        first = np.nanmean(one.errors**2, axis=0)
        with np.errstate(all="ignore"):
            left = np.nanmean(two.errors**2, axis=0) / first
        taken.append(float(1.0 - np.nanmean(left)) if np.isfinite(left).any() else 0.0)
        for c, channel in enumerate(one.channels):
            known = np.isfinite(fall[:, c])
            if not known.any():
                continue
            unit = before.problem.block.signal(channel).unit
            t = _over_blocks(fall[known, c], one.block[known])
            found.append(Ahead(horizon, channel, unit, one.rms[channel], two.rms[channel], t))
    return Horizons(tuple(found), tuple(together), tuple(taken))


def fall_of_errors(before: Array, after: Array, block: NDArray[np.intp]) -> float:
    """Return the fall of the squared errors of all channels, in standard errors over blocks.

    Parameters
    ----------
    before, after : ndarray, shape (K, C)
        Errors of two models; NaN where nothing was measured.
    block : ndarray of int, shape (K,)
    """
    fall = before**2 - after**2
    seen = np.isfinite(fall)
    squares = np.where(seen, 0.5 * (before**2 + after**2), 0.0)
    size = squares.sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    pooled = np.where(seen, fall / np.maximum(size, 1e-300), 0.0).sum(axis=1)
    known = seen.any(axis=1)
    return _over_blocks(pooled[known] / seen[known].sum(axis=1), block[known])


def _over_blocks(values: Array, block: NDArray[np.intp]) -> float:
    """Return the mean of block means over its standard error, blocks taken as independent; 0 below three."""
    means = np.array([values[block == w].mean() for w in np.unique(block)])
    if means.size < 3:
        return 0.0
    spread = float(means.std(ddof=1)) / np.sqrt(means.size)
    return float(means.mean()) / max(spread, 1e-300)


def gap(fit: Fit, horizon: float = 1.0) -> Gap:
    """Return the prediction errors of a fitted model at its longest horizon up to `horizon` [s].

    `horizon` is multiplied by the tempo.
    """
    chosen = [h for h in horizons(fit) if h <= 1.001 * max(horizon * fit.problem.tempo, horizons(fit)[0])][-1]
    found = predict(fit, chosen)
    problem = fit.problem
    rms = found.rms if found else dict.fromkeys(problem.rows.channels, float("nan"))
    nrmse, floor = {}, {}
    for c, channel in enumerate(problem.rows.channels):
        own = problem.rows.values[..., c][problem.seen[..., c]]
        size = float(np.std(own)) or 1.0
        nrmse[channel] = rms[channel] / size
        floor[channel] = float(fit.noise.measured[c]) / size
    return Gap(chosen, rms, nrmse, floor)
