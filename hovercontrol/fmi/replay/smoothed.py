"""The last steps of a fit to an FMU whose outputs jump as its parameters change.

An FMU for Co-Simulation may take an event at the end of one of its internal steps. A parameter then moves the
event by whole steps: outputs jump, short differences see nothing or a jump, and the sum of squares has many
minima. Two things replace the step by derivatives.

Regression over runs around the estimate (derivatives by secants: Ralston and Jennrich, Technometrics 20
(1978)), by least squares for each unknown j, h a part of its standard error::

    r(theta + k h e_j) = r_j - J_j k h + q_j k^2,    k = -5, ..., 5

The mean of the r_j replaces the residual in the step of Gauss and Newton, ``d = (J'J)^-1 J'r``.

Mean and covariance of ``exp(-r'r/2)`` over values drawn around that estimate from normal distributions with
density q (importance sampling; Cappe et al., Journal of Computational and Graphical Statistics 13 (2004))::

    w_i = exp(-r_i'r_i/2) / q(theta_i),   theta = sum of w_i theta_i / sum of w_i
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.fmi.replay.runs import RunFailed
from hovercontrol.fmi.replay.unknowns import ROUGH_STEP, Unknowns

#: Whitened residuals of all logs at given values, one after another.
Residuals = Callable[[Array], Array]

#: Runs on each side, and how far the last is away in standard errors.
SIDE, REACH = 5, 3.0
#: Steps at most; the last is shorter than this, in standard errors.
STEPS, SHORT = 8, 0.1
#: Rounds of draws, draws in a round, and the proposal's covariance over the present one.
ROUNDS, DRAWS, WIDER = 3, 80, 3.0
#: Fewest draws that count, for each unknown, to take their covariance.
COUNT = 3.0


def smoothed(unknowns: Unknowns, values: Array, S: Array, residuals: Residuals) -> tuple[Array, Array, Array]:
    """Return the estimate, its covariance, and the derivatives of the whitened outputs, shape (n, P).

    Parameters
    ----------
    unknowns : Unknowns
    values : ndarray, shape (P,)
        Near the estimate.
    S : ndarray, shape (P, P)
        J'J there.
    residuals : callable
    """
    J = np.zeros((0, len(values)))
    for _ in range(STEPS):
        J, r = _regression(unknowns, values, _spacing(unknowns, values, S), residuals)
        S = J.T @ J
        step = np.linalg.lstsq(S, J.T @ r, rcond=1e-12)[0]
        values = np.clip(values + step, unknowns.lower, unknowns.upper)
        if float(step @ S @ step) <= SHORT**2 * len(step):
            break
    C = np.linalg.pinv(S, rcond=1e-12, hermitian=True).astype(float)
    return *_drawn(unknowns, values, C, residuals), J


def _drawn(unknowns: Unknowns, values: Array, C: Array, residuals: Residuals) -> tuple[Array, Array]:
    """Return mean and covariance of the values by importance sampling."""
    random = np.random.default_rng(0)
    places: list[Array] = []
    logs: list[float] = []
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    mean, wide = values, C
    for _ in range(ROUNDS):
        R = wide / np.outer(size, size)
        L = np.linalg.cholesky(WIDER * R + 1e-9 * np.eye(len(R)))
        for z in random.standard_normal((DRAWS, len(R))):
            there = mean + size * (L @ z)
            if ((there < unknowns.lower) | (there > unknowns.upper)).any():
                continue
            with contextlib.suppress(RunFailed):
                density = -0.5 * float(z @ z) - float(np.log(np.diag(L)).sum())
                logs.append(-0.5 * float((residuals(there) ** 2).sum()) - density)
                places.append(there)
        if not places:
            return values, C
        w = np.exp(np.array(logs) - max(logs))
        w /= w.sum()
        found = np.array(places)
        mean, count = w @ found, 1.0 / float(w @ w)
        if count >= COUNT * len(mean):
            away = found - mean
            wide = (away.T * w) @ away + C / count
    return np.asarray(mean), np.asarray(wide)


def _spacing(unknowns: Unknowns, values: Array, S: Array) -> Array:
    """Return h of each unknown: REACH standard errors over SIDE runs."""
    std = np.sqrt(np.maximum(np.diag(np.linalg.pinv(S, rcond=1e-12, hermitian=True)), 0.0))
    size = np.maximum(np.abs(values), 0.1 * unknowns.size)
    return np.asarray(np.clip(REACH * std, 0.1 * ROUGH_STEP * size, 10.0 * ROUGH_STEP * size) / SIDE)


def _regression(
    unknowns: Unknowns, values: Array, spacing: Array, residuals: Residuals
) -> tuple[Array, Array]:
    """Return J and the smoothed residual."""
    first = residuals(values)
    J, levels = np.zeros((len(first), len(values))), []
    for j, h in enumerate(spacing):
        places, found = [0.0], [first]
        for k in (*range(-SIDE, 0), *range(1, SIDE + 1)):
            moved = values.copy()
            moved[j] += k * h
            if not unknowns.lower[j] <= moved[j] <= unknowns.upper[j]:
                continue
            try:
                there = residuals(moved)
            except RunFailed:
                continue
            places.append(float(k))
            found.append(there)
        degree = min(2, len(places) - 1)
        powers = np.vander(places, degree + 1, increasing=True)
        coefficients = np.linalg.lstsq(powers, np.array(found), rcond=None)[0]
        levels.append(coefficients[0])
        if degree:
            J[:, j] = -coefficients[1] / h
    return J, np.mean(levels, axis=0)
