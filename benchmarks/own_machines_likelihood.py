"""Maximum likelihood by hand for ``own_machines``: an extended Kalman filter and SciPy's trust region.

Process noise is white, all derivatives are differences (second ones, too), and the unknowns are the
parameters and the logarithms of all noise levels. Nothing of the package is used but its Log. Without process
noise this is the fit of the output error.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import hovercontrol as hc
from benchmarks.own_machines_families import Family, Values

Array = NDArray[np.float64]

#: Sub-steps of the filter's model from row to row; differences of a parameter relative to its value, and of
#: the logarithm of a noise level; least curvature over one, of an unknown that the log hardly shows.
PARTS, OF_PARAMETERS, OF_LEVELS, FLAT = 6, 1e-3, 1e-2, 1e-5

#: Slope in standard errors at which the maximum is reached.
REACHED = 0.01


def by_hand(family: Family, log: hc.Log, start: Values) -> tuple[dict[str, float], float]:
    """Return the parameters that maximise the likelihood of the innovations, and minus twice its logarithm.

    They are sought from `start`.
    """
    noise = [np.log(family.noise * (1.0 if family.law else log[c].std())) for c in family.measured]
    z = np.array([0.0] * len(start) + [np.log(s) for s in family.pushed.values()] + noise)
    d = np.where(np.arange(len(z)) < len(start), OF_PARAMETERS, OF_LEVELS)
    m, e = len(z), np.diag(d)
    pairs = list(itertools.combinations(range(m), 2))

    @lru_cache(maxsize=8)
    def about(at: tuple[float, ...]) -> tuple[float, Array, Array]:
        """Cost, slopes and curvatures."""
        z = np.array(at)
        points = [z, *(z + e), *(z - e), *(z + e[i] + e[j] for i, j in pairs)]
        f = costs(family, log, start, np.array(points).T)
        above, below = f[1 : m + 1], f[m + 1 : 2 * m + 1]
        g, H = (above - below) / (2.0 * d), np.diag((above + below - 2.0 * f[0]) / d**2)
        for (i, j), both in zip(pairs, f[2 * m + 1 :], strict=True):
            H[i, j] = H[j, i] = (both - above[i] - above[j] + f[0]) / (d[i] * d[j])
        return float(f[0]), g, H

    # in units of each unknown's standard error, the others known
    size = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(about(tuple(z))[2])), FLAT / d**2))
    found = minimize(
        lambda x: about(tuple(z + size * x))[0], np.zeros(m), method="trust-exact",
        jac=lambda x: size * about(tuple(z + size * x))[1],
        hess=lambda x: size[:, None] * about(tuple(z + size * x))[2] * size, options={"gtol": REACHED},
    )  # fmt: skip
    z = z + size * found.x
    return {name: value * (1.0 + z[j]) for j, (name, value) in enumerate(start.items())}, float(found.fun)


def costs(family: Family, log: hc.Log, start: Values, z: Array) -> Array:
    """Return minus twice the log likelihood for several sets of unknowns side by side, (M, L) to (L,)."""
    states = list(family.states)
    y = np.stack([log[c] for c in family.measured], axis=1)
    u = np.stack([log[c] for c in family.inputs], axis=1)
    at, n, L = [states.index(c) for c in family.measured], len(states), z.shape[1]
    pushed = [states.index(s) for s in family.pushed]
    first = np.array(family.start or [0.0] * n)
    q, r = np.split(np.exp(2.0 * z[len(start) :]), [len(pushed)])
    # A column for each set, then one for each state, changed a little.
    p = {k: np.repeat(v * (1.0 + z[j]), n + 1) for j, (k, v) in enumerate(start.items())}
    x = np.tile(first[:, None], L)
    P = np.zeros((L, n, n)) + np.diag((10.0 * np.maximum(np.abs(first), 1.0)) ** 2)
    small, total, h = 1e-6 * max(float(np.abs(y).max()), 1e-3), np.zeros(L), family.step / PARTS
    nudges = np.hstack([np.zeros((n, 1)), small * np.eye(n)])
    for k in range(len(y)):
        for c, i in enumerate(at):
            S = P[:, i, i] + r[c]
            e, K = y[k, c] - x[i], P[:, :, i] / S[:, None]
            x, P = x + K.T * e, P - K[:, :, None] * P[:, None, i]
            total += e * e / S + np.log(S)
        X = (x[:, :, None] + nudges[:, None]).reshape(n, -1)
        if family.period:
            X = family.slopes(X, u[k], p)
        for _ in range(0 if family.period else PARTS):
            X = _rk4(family, X, u[k], p, h)
        X = X.reshape(n, L, n + 1)
        A = ((X[:, :, 1:] - X[:, :, :1]) / small).swapaxes(0, 1)
        x = X[:, :, 0]
        G = (A + np.eye(n))[:, :, pushed] / 2.0 if not family.period else np.eye(n)[None][:, :, pushed]
        Q = (G * (q.T * (1.0 if family.period else family.step))[:, None]) @ G.swapaxes(1, 2)
        P = A @ P @ A.swapaxes(1, 2) + Q
    return np.where(np.isfinite(total), total, np.inf)


def _rk4(family: Family, x: Array, v: Array, p: Mapping[str, Array], h: float) -> Array:
    a = family.slopes(x, v, p)
    b = family.slopes(x + 0.5 * h * a, v, p)
    c = family.slopes(x + 0.5 * h * b, v, p)
    return x + h * (a + 2.0 * b + 2.0 * c + family.slopes(x + h * c, v, p)) / 6.0
