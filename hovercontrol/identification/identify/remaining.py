"""Accelerations that a fitted model leaves unexplained, compared with the observed accelerations."""

from __future__ import annotations

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.noise import averaged, averaging_time
from hovercontrol.identification.identify.result import Remaining


def remaining(fit: Fit) -> tuple[Remaining, ...]:
    """Return the process noise of each equation on which forces act, as an acceleration."""
    problem, over = fit.problem, averaging_time(fit.problem)
    found, free = [], _forceless(fit)
    for j, rms in zip(problem.driven, averaged(fit.noise, over).tolist(), strict=True):
        i = problem.free[j]
        state = problem.block.states[i]
        found.append(Remaining(f"{state.name}'", rms, _seen(fit, i, free[i], over), over, _rate(state.unit)))
    return tuple(found)


def _forceless(fit: Fit) -> Array:
    """Return derivatives of the states without forces (rotation of the body only), shape (n_states, K, W)."""
    problem = fit.problem
    own = {problem.block.parameter(name).name for name in problem.model.linear_coefficients()}
    values = problem.parameters(fit.p)
    values = [0.0 if s.name in own else v for s, v in zip(problem.block.parameters, values, strict=True)]
    shape = problem.rows.time.shape
    u, x = np.zeros((len(problem.block.inputs), *shape)), np.moveaxis(fit.path, 2, 0)
    with np.errstate(all="ignore"):
        slopes = problem.block.to_numpy().array_derivatives(problem.rows.time, x, u, values)
    found = np.array([np.broadcast_to(s, shape) for s in slopes])
    return np.where(np.isfinite(found), found, 0.0)


def _seen(fit: Fit, i: int, free: Array, over: float) -> float:
    """Return the root mean square of a state's mean slope over some time, minus the slope without forces."""
    # RMS over t of (x(t + T) - x(t) - integral of f_0 from t to t + T) / T, with f_0 = free and T = over.
    time, x = fit.problem.rows.time, fit.path[..., i]
    gone = np.concatenate(
        [np.zeros((1, time.shape[1])), np.cumsum(np.diff(time, axis=0) * free[:-1], axis=0)]
    )
    slopes = []
    for t, own in zip(time.T, (x - gone).T, strict=True):
        last = np.minimum(np.searchsorted(t, t + 0.999 * over), t.size - 1)
        wide = t[last] - t
        whole = wide >= 0.9 * over
        slopes.append((own[last] - own)[whole] / wide[whole])
    every = np.concatenate(slopes)
    return float(np.sqrt(np.mean(every**2))) if every.size else 0.0


def _rate(unit: str) -> str:
    return f"{unit.removesuffix('/s')}/s^2" if unit.endswith("/s") else f"{unit}/s"
