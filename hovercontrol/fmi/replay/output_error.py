"""The fit of an FMU to logs: output error, through events, with residuals whitened.

An FMU is run from the start of a log to its end; measured minus computed outputs are the residuals r. The fit
minimises the sum of squares of the whitened residuals w (:mod:`.whitening`) by the method of Levenberg and
Marquardt. With J = dw/dtheta the covariance of the estimate is (J'J)^-1; where residuals depend on their past
it is widened by the scatter of the scores J'w over blocks of the logs (sandwich), if that is larger than
chance allows (Ljung, System Identification, 2nd ed., 9.4 and 9.6; White, Econometrica 48 (1980)).

This is not the Kalman filter of :mod:`hovercontrol.identification.engine`: a filter linearises from row to
row, and an FMU's events are no smooth map. Process noise is in the autoregression of the residuals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.smoothed import smoothed
from hovercontrol.fmi.replay.step_length import accurate
from hovercontrol.fmi.replay.unknowns import Unknowns
from hovercontrol.fmi.replay.whitening import MOST_ORDER, Whitening, whitening_of

#: First parts of the logs that are fitted before all rows: a long run from poor values is far from the log
#: everywhere, and has local minima.
HEADS = (0.05, 0.15, 0.4)
#: Fewest rows of the longest log for which that is done.
LONG = 100
#: Iterations of a part, and of all rows.
PART_ITERATIONS, ITERATIONS = 8, 40
#: Passes with whitened residuals.
PASSES = 3
#: The fit ends where a step lowers the cost by less than this fraction.
CONVERGED = 1e-7
#: Blocks of all logs together, over which scores, sizes and gains scatter.
BLOCKS = 20
#: Level at which a larger scatter of the scores is chance.
CHANCE = 0.999


@dataclass(frozen=True, eq=False)
class FmuFit:
    """A fitted FMU.

    Attributes
    ----------
    unknowns : Unknowns
    values : ndarray, shape (P,)
    information : ndarray, shape (P, P)
        J'J of all logs; where outputs jump as an unknown changes, the inverse of the covariance.
    S : ndarray, shape (W, P, P)
        J'J of each block of the logs.
    g : ndarray, shape (W, P)
        J'w of each block.
    block_costs : ndarray, shape (W,)
        Twice the negative log likelihood of each block.
    block_log : ndarray of int, shape (W,)
        Index of the log of each block.
    widen : ndarray, shape (P,)
        Factors on the standard errors from the scatter of scores.
    whitening : Whitening
    residuals : tuple of ndarray, shape (K, C)
        Measured minus computed; NaN where nothing was measured.
    converged : bool
    """

    unknowns: Unknowns
    values: Array
    information: Array
    S: Array
    g: Array
    block_costs: Array
    block_log: NDArray[np.intp]
    widen: Array
    whitening: Whitening
    residuals: tuple[Array, ...]
    converged: bool

    @property
    def model(self) -> FmuPlant:
        """The model with the estimates."""
        return self.unknowns.model(self.values)

    @property
    def p(self) -> Array:
        """The values, by the name that :class:`hovercontrol.identification.engine.fit.Fit` gives them."""
        return self.values

    @property
    def cost(self) -> float:
        """Twice the negative log likelihood, and ``log n`` for each coefficient of the autoregression."""
        n = sum(int(np.isfinite(r).sum()) for r in self.residuals)
        return float(self.block_costs.sum()) + sum(self.whitening.orders) * math.log(n)

    @property
    def rms(self) -> Array:
        """Root mean square of the residual of each channel, shape (C,)."""
        every = np.concatenate(self.residuals)
        return np.asarray(np.sqrt(np.nanmean(every**2, axis=0)))


def fit_fmu(plant: FmuPlant, logs: Sequence[Rows], progress: Callable[[str], None] | None = None) -> FmuFit:
    """Fit an FMU to logs from its present values.

    Raises
    ------
    InputError
        If the FMU cannot be run over a log with its present values.
    """
    report = progress or (lambda what: None)
    plant = accurate(plant, logs)
    unknowns = Unknowns(plant, logs)
    try:
        values = unknowns.start()
        unknowns.predict(values)
    except RunFailed as fault:
        raise InputError(f"FMU {plant.name!r} failed on {logs[0].name}: {fault}") from None
    if max(len(rows.time) for rows in logs) >= LONG and len(values):
        for share in HEADS:
            report(f"fitting the first {share:.0%}")
            try:
                part = unknowns.head(share)
                found = minimise(part, values, _white(part, values, most=0), PART_ITERATIONS)[0]
                unknowns.predict(found)
            except RunFailed:  # a short part may lead to values with which a longer run diverges
                continue
            values = found
    report("fitting all rows")
    return refine(unknowns, values, ITERATIONS)


def refine(unknowns: Unknowns, values: Array, iterations: int) -> FmuFit:
    """Return the fit from values that are near: first white, then with whitened residuals."""
    values, converged = minimise(unknowns, values, _white(unknowns, values, most=0), iterations)
    for _ in range(PASSES):
        white = _white(unknowns, values)
        before = values
        values, converged = minimise(unknowns, values, white, iterations)
        if not any(white.orders) and np.allclose(values, before, rtol=1e-6, atol=1e-12):
            break
    white = _white(unknowns, values)
    if unknowns.rough:
        values, C, J = _smoothed(unknowns, values, white)
        white = _white(unknowns, values)
    base = unknowns.predict(values)
    residuals = _residuals(unknowns, base)
    if not unknowns.rough:
        slopes = unknowns.slopes(values, base)
        white = _white(unknowns, values, taken=_taken(slopes, residuals, white))
        J = _whitened(slopes, residuals, white)
    w = [white.apply(r, np.isfinite(r)) for r in residuals]
    parts = _blocks([len(a) for a in J])
    S = np.array([np.einsum("kci,kcj->ij", J[k][rows], J[k][rows]) for k, rows in parts])
    g = np.array([np.einsum("kci,kc->i", J[k][rows], w[k][rows]) for k, rows in parts])
    # -2 log L of n_b residuals of each channel: sum of w^2 + n_b log det Sigma
    channels = residuals[0].shape[1]
    costs = [
        float((w[k][rows] ** 2).sum()) + np.isfinite(residuals[k][rows]).sum() / channels * white.log_det
        for k, rows in parts
    ]
    log = np.array([k for k, _ in parts], dtype=np.intp)
    information = np.asarray(S.sum(axis=0))
    if unknowns.rough:
        information = np.linalg.pinv(C, rcond=1e-12, hermitian=True).astype(float)
    widen = _widening(information, g, white)
    return FmuFit(
        unknowns, values, information, S, g, np.array(costs), log, widen, white, tuple(residuals), converged
    )


def _blocks(lengths: Sequence[int]) -> list[tuple[int, NDArray[np.intp]]]:
    """Return blocks of about equal length: the index of the log and the rows of each."""
    found = []
    for k, length in enumerate(lengths):
        count = max(round(BLOCKS * length / sum(lengths)), 1)
        found += [(k, rows) for rows in np.array_split(np.arange(length), count)]
    return found


def minimise(unknowns: Unknowns, values: Array, white: Whitening, most: int) -> tuple[Array, bool]:
    """Return the values of least whitened squares, within bounds, and whether it converged."""
    if not len(values):
        return values, True
    damping = 1e-3
    base = unknowns.predict(values)
    cost = _cost(unknowns, base, white)
    for _ in range(most):
        g, S = _normal(unknowns, values, base, white)
        free = ~(((values <= unknowns.lower) & (g < 0)) | ((values >= unknowns.upper) & (g > 0)))
        free &= np.diag(S) > 0.0  # one that changes no output keeps its value
        if not free.any():
            return values, True
        scale = np.sqrt(np.maximum(np.diag(S), 1e-300))
        scale = np.maximum(scale, 1e-8 / unknowns.size)
        R = (S / np.outer(scale, scale))[np.ix_(free, free)]
        accepted = False
        for _ in range(12):
            step = np.zeros_like(values)
            step[free] = (
                np.linalg.lstsq(R + damping * np.eye(len(R)), (g / scale)[free], rcond=1e-12)[0] / scale[free]
            )
            new = np.clip(values + step, unknowns.lower, unknowns.upper)
            try:
                there = unknowns.predict(new)
                found = _cost(unknowns, there, white)
            except RunFailed:
                found = math.inf
            if found < cost:
                accepted = True
                break
            if float(g @ step) <= CONVERGED * cost:
                return values, True
            damping = min(damping * 8.0, 1e12)
        if not accepted:
            return values, True
        gain, cost = cost - found, found
        values, base = new, there
        damping = max(damping / 10.0, 1e-9)
        if gain <= CONVERGED * cost:
            return values, True
    return values, False


def _residuals(unknowns: Unknowns, base: Sequence[Array]) -> list[Array]:
    return [rows.values - y for rows, y in zip(unknowns.logs, base, strict=True)]


def _white(
    unknowns: Unknowns, values: Array, *, most: int = MOST_ORDER, taken: Sequence[Array] | None = None
) -> Whitening:
    residuals = _residuals(unknowns, unknowns.predict(values))
    every = np.concatenate([rows.values for rows in unknowns.logs])
    spread = np.maximum(np.nanstd(every, axis=0), 1e-9 * np.nanmax(np.abs(every), axis=0))
    return whitening_of(residuals, np.maximum(spread, 1e-12), most=most, taken=taken)


def _whitened(slopes: Sequence[Array], residuals: Sequence[Array], white: Whitening) -> list[Array]:
    """Return J of each log."""
    return [white.apply(s, np.isfinite(r)) for s, r in zip(slopes, residuals, strict=True)]


def _taken(slopes: Sequence[Array], residuals: Sequence[Array], white: Whitening) -> list[Array]:
    """Return the root L of what the fit took of each log: ``L L' = s C s'``, s the slopes."""
    J = np.concatenate(
        [a.reshape(math.prod(a.shape[:2]), a.shape[2]) for a in _whitened(slopes, residuals, white)]
    )
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0.0] = 1.0
    size, axes = np.linalg.eigh((J / scale).T @ (J / scale))
    kept = size > 1e-12 * size.max(initial=0.0)
    root = axes[:, kept] / np.sqrt(size[kept]) / scale[:, None]
    return [s @ root for s in slopes]


def _cost(unknowns: Unknowns, base: Sequence[Array], white: Whitening) -> float:
    """Return the sum of squares; infinite where a run diverges."""
    with np.errstate(over="ignore"):
        return sum(float((white.apply(r, np.isfinite(r)) ** 2).sum()) for r in _residuals(unknowns, base))


def _normal(
    unknowns: Unknowns, values: Array, base: Sequence[Array], white: Whitening
) -> tuple[Array, Array]:
    """Return J'w and J'J."""
    n = len(values)
    g, S = np.zeros(n), np.zeros((n, n))
    residuals = _residuals(unknowns, base)
    for slope, r in zip(unknowns.slopes(values, base), residuals, strict=True):
        seen = np.isfinite(r)
        J, w = white.apply(slope, seen).reshape(-1, n), white.apply(r, seen).ravel()
        g, S = g + J.T @ w, S + J.T @ J
    return g, S


def _smoothed(unknowns: Unknowns, values: Array, white: Whitening) -> tuple[Array, Array, list[Array]]:
    """Return the estimate, its covariance and J of each log, where outputs jump as an unknown changes."""
    shapes = [rows.values.shape for rows in unknowns.logs]

    def whitened(at: Array) -> Array:
        found = _residuals(unknowns, unknowns.predict(at))
        return np.concatenate([white.apply(r, np.isfinite(r)).ravel() for r in found])

    S = _normal(unknowns, values, unknowns.predict(values), white)[1]
    values, C, J = smoothed(unknowns, values, S, whitened)
    parts = np.split(J, np.cumsum([math.prod(s) for s in shapes])[:-1])
    return values, C, [a.reshape(*s, -1) for a, s in zip(parts, shapes, strict=True)]


def _widening(information: Array, g: Array, white: Whitening) -> Array:
    """Return the factors by which scatter of the scores widens the standard errors.

    With g_b the score of one of B blocks: ``V = S^-1 (sum of g_b g_b') S^-1 B/(B - 1)``, the factor is
    ``sqrt(V_jj / (S^-1)_jj)`` where that exceeds what B blocks show by chance, else 1.
    """
    B, P = g.shape
    if not P or not any(white.orders) or B < 4:
        return np.ones(P)
    C = np.linalg.pinv(information, rcond=1e-12, hermitian=True)
    V = C @ (g.T @ g) @ C * B / (B - 1)
    ratio = np.diag(V) / np.maximum(np.diag(C), 1e-300)
    most = float(chi2.ppf(CHANCE, B - 1)) / (B - 1)
    return np.asarray(np.sqrt(np.where(ratio > most, ratio, 1.0)))
