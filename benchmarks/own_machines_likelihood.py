"""Maximum likelihood by hand for ``own_machines``: an extended Kalman filter and SciPy's Nelder-Mead method.

Process noise is white, the derivatives by the states are differences, and the unknowns are the parameters and
the logarithms of all noise levels. Nothing of the package is used but its Log.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import hovercontrol as hc
from benchmarks.own_machines_families import Family, Values

Array = NDArray[np.float64]

#: Sub-steps of the filter's model from row to row.
PARTS = 4


def by_hand(family: Family, log: hc.Log, start: Values) -> dict[str, float]:
    """Return the parameters that maximise the likelihood of the innovations, sought from `start`."""
    names, states = list(family.parameters), list(family.states)
    y = np.stack([log[c] for c in family.measured], axis=1)
    u = np.stack([log[c] for c in family.inputs], axis=1)
    at, n = [states.index(c) for c in family.measured], len(states)
    pushed = [states.index(s) for s in family.pushed]
    first = np.array(family.start or [0.0] * n)
    spread = np.maximum(np.abs(first), 1.0) * 10.0
    h = family.step / PARTS

    def onward(X: Array, v: Array, p: Values) -> Array:
        """Step of several states side by side, (n, N)."""
        if family.period:
            return np.stack([family.slopes(x, v, p) for x in X.T], axis=1)
        for _ in range(PARTS):
            X = np.stack([_rk4(family, x, v, p, h) for x in X.T], axis=1)
        return X

    def cost(z: Array) -> float:
        p = {name: start[name] * (1.0 + z[j]) for j, name in enumerate(names)}
        q, r = np.split(np.exp(2.0 * z[len(names) :]), [len(pushed)])
        x, P, total = first.copy(), np.diag(spread**2), 0.0
        small = 1e-6 * np.maximum(np.abs(y).max(axis=0).max(), 1e-3)
        for k in range(len(y)):
            for c, i in enumerate(at):
                S = P[i, i] + r[c]
                e, K = y[k, c] - x[i], P[:, i] / S
                x, P, total = x + K * e, P - np.outer(K, P[i]), total + e * e / S + np.log(S)
            if not np.isfinite(total):
                return 1e12
            X = onward(np.column_stack([x, x[:, None] + small * np.eye(n)]), u[k], p)
            A = (X[:, 1:] - X[:, :1]) / small
            x = X[:, 0]
            G = (A + np.eye(n))[:, pushed] / 2.0 if not family.period else np.eye(n)[:, pushed]
            P = A @ P @ A.T + (G * q * (1.0 if family.period else family.step)) @ G.T
        return float(total)

    noise = [np.log(family.noise * (1.0 if family.law else y[:, c].std())) for c in range(len(at))]
    begin = np.concatenate([np.zeros(len(names)), [np.log(s) for s in family.pushed.values()], noise])
    steps = np.concatenate([np.full(len(names), 0.02), np.full(len(begin) - len(names), 0.1)])
    simplex = np.vstack([begin, begin + np.diag(steps)])
    limits = {"xatol": 1e-5, "fatol": 1e-4, "maxiter": 150 * len(begin), "adaptive": True}
    options = {**limits, "initial_simplex": simplex}
    found = minimize(cost, begin, method="Nelder-Mead", options=options).x
    return {name: start[name] * (1.0 + found[j]) for j, name in enumerate(names)}


def _rk4(family: Family, x: Array, v: Array, p: Values, h: float) -> Array:
    a = family.slopes(x, v, p)
    b = family.slopes(x + 0.5 * h * a, v, p)
    c = family.slopes(x + 0.5 * h * b, v, p)
    return x + h * (a + 2.0 * b + 2.0 * c + family.slopes(x + h * c, v, p)) / 6.0
