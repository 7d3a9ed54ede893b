"""A coefficient of many craft: its mean, its scatter between craft and between logs, each craft's value.

Log k of craft i gives an estimate with a known variance::

    y_ik = mu + b_i + w_ik + e_ik,    b_i ~ N(0, tau^2),  w_ik ~ N(0, omega^2),  e_ik ~ N(0, s_ik^2)

With d_ik = s_ik^2 + omega^2 the logs of a craft are one estimate y_i = v_i sum_k y_ik / d_ik of the variance
v_i = 1 / sum_k 1/d_ik. Given tau and omega all else is closed form (weights w_i = 1 / (tau^2 + v_i))::

    mu  = sum w_i y_i / sum w_i,    -2 log L = sum_ik log d_ik + sum_ik y_ik^2 / d_ik - sum_i y_i^2 / v_i
                                    + sum_i log(1 + tau^2 / v_i) + sum_i w_i (y_i - mu)^2 + log sum_i w_i
    c_i = mu + B_i (y_i - mu),      var c_i = B_i v_i + (1 - B_i)^2 / sum w_i,    B_i = tau^2 w_i

L is the restricted likelihood (Patterson and Thompson, Biometrika 58 (1971)). tau and omega are integrated
out on a grid under uniform priors (Gelman, Bayesian Analysis 1 (2006)): with few craft their estimates are
uncertain, and intervals at the likeliest tau, often zero, would be too short.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from hovercontrol.base.arrays import Array

#: Points of the grid over each standard deviation, and how often it is refined about its peak.
POINTS, REFINED = 24, 3

#: Fewest craft of which the scatter can be told, and fewest other craft beside which one can be judged.
LEAST, OTHERS = 3, 4

#: Level of the tests, shared among all of one kind by the false discovery rate (Benjamini and Hochberg,
#: J. R. Stat. Soc. B 57 (1995)).
LEVEL = 0.05


@dataclass(frozen=True, eq=False)
class Craftwise:
    """One coefficient of all craft.

    Attributes
    ----------
    mean, mean_std : float
        Mean of the craft that belong together, with its standard error.
    between, within : float
        Standard deviation between craft (NaN for fewer than three) and between logs of a craft, beyond the
        logs' standard errors.
    own, own_std : ndarray, shape (m,)
        Estimate of each craft from its logs alone.
    value, std : ndarray, shape (m,)
        Shrunk towards the mean; of a craft that does not belong its own.
    p : ndarray, shape (m,)
        Probability of a craft so far from all others by chance; NaN beside fewer than four others.
    belongs : ndarray of bool, shape (m,)
    p_differ : float
        Probability of these differences between craft if all had the same value.
    """

    mean: float
    mean_std: float
    between: float
    within: float
    own: Array
    own_std: Array
    value: Array
    std: Array
    p: Array
    belongs: NDArray[np.bool_]
    p_differ: float


def flagged(p: Array) -> NDArray[np.bool_]:
    """Return which tests are significant at the false discovery rate :data:`LEVEL`; NaN counts as no test.

    Examples
    --------
    >>> flagged(np.array([0.001, 0.04, 0.9, np.nan])).tolist()
    [True, False, False, False]
    """
    return q_values(p) <= LEVEL


def q_values(p: Array) -> Array:
    """Return p-values adjusted for their number (Benjamini-Hochberg); NaN stays."""
    found = np.full(p.shape, np.nan)
    known = np.isfinite(p)
    if known.any():
        found[known] = stats.false_discovery_control(p[known])
    return found


def random_effects(
    y: Array, variance: Array, craft: NDArray[np.intp], varies: NDArray[np.bool_]
) -> Craftwise:
    """Return mean, scatter and each craft's value of a coefficient.

    Parameters
    ----------
    y, variance : ndarray, shape (n,)
        Estimate of each log and its variance.
    craft : ndarray of int, shape (n,)
        Number of the craft, 0 to m - 1; each has a log.
    varies : ndarray of bool, shape (n,)
        Whether the scatter between logs is still to be added to the variance.
    """
    order = np.argsort(craft, kind="stable")
    logs = _Logs(y[order], variance[order], craft[order], varies[order])
    repeated = int(varies.sum()) - np.unique(craft[varies]).size
    within = logs.scatter() if repeated >= LEAST else 0.0
    belongs = logs.near(within**2)
    for _ in range(10):
        grid = logs.posterior(belongs, within, estimable=repeated >= LEAST)
        p = grid.p_values()
        now = ~flagged(p)
        if (now == belongs).all():
            break
        belongs = now
    grid = logs.posterior(belongs, within, estimable=repeated >= LEAST)
    return grid.result(repeated)


class _Logs:
    """Estimates of logs, sorted by craft."""

    def __init__(self, y: Array, variance: Array, craft: NDArray[np.intp], varies: NDArray[np.bool_]) -> None:
        self.offset = float(np.median(y))
        self.y, self.variance, self.varies = y - self.offset, variance, varies.astype(float)
        self.first = np.flatnonzero(np.r_[True, np.diff(craft) > 0])

    def sums(self, x: Array) -> Array:
        """Return sums over the logs of each craft, (..., n) to (..., m)."""
        return np.asarray(np.add.reduceat(x, self.first, axis=-1))

    def scatter(self) -> float:
        """Return the scatter between logs of a craft, by moments about the craft's means."""
        # E sum (y - mean)^2 / s^2 = (n - m) + omega^2 (sum 1/s^2 - sum_i sum s^-4 / sum s^-2)
        w = self.varies / self.variance
        a, b = np.maximum(self.sums(w), 1e-300), self.sums(w * self.y)
        Q = float((self.sums(w * self.y**2) - b**2 / a).sum())
        dof = float(self.varies.sum() - (self.sums(self.varies) > 0).sum())
        return float(np.sqrt(max((Q - dof) / max(float((a - self.sums(w**2) / a).sum()), 1e-300), 0.0)))

    def near(self, within: float) -> NDArray[np.bool_]:
        """Return the craft near the median, by a scatter that a few others do not spoil: where to begin."""
        d = self.variance + within * self.varies
        v = 1.0 / self.sums(1.0 / d)
        y = v * self.sums(self.y / d)
        off = np.abs(y - np.median(y))
        tau = max((1.4826 * float(np.median(off))) ** 2 - float(np.median(v)), 0.0)
        return 2.0 * stats.norm.sf(off / np.sqrt(tau + v)) > 0.02 * LEVEL / off.size

    def posterior(self, belongs: NDArray[np.bool_], within: float, estimable: bool) -> _Grid:
        """Return the posterior of both scatters on a grid about its peak."""
        size = float(np.sqrt(np.median(self.variance)))
        scale = (max(float(np.std(self.sums(self.y) / self.sums(np.ones_like(self.y)))), size), size + within)
        # sigma = scale q / (1 - q), q in (0, 1):  d sigma = scale / (1 - q)^2 dq
        ends = [(0.0, 1.0), (0.0, 1.0)]
        for _ in range(REFINED):
            tau, omega = (a + (b - a) * (np.arange(POINTS) + 0.5) / POINTS for a, b in ends)
            tau = tau if belongs.sum() >= LEAST else np.array([0.5])
            omega = omega if estimable else np.array([0.0])
            grid = _Grid(self, belongs, tau, omega, scale)
            for k, (q, axis) in enumerate(((tau, 0), (omega, 1))):
                there = np.flatnonzero(grid.weight.sum(axis=axis) > 1e-4 / POINTS)
                step = (ends[k][1] - ends[k][0]) / POINTS
                ends[k] = (max(q[there[0]] - step, 0.0), min(q[there[-1]] + step, 1.0))
        return grid


class _Grid:
    """Posterior weights of omega (rows) and tau (columns), and what follows from them."""

    def __init__(
        self, logs: _Logs, belongs: NDArray[np.bool_], tau: Array, omega: Array, scale: tuple[float, float]
    ) -> None:
        self.logs, self.belongs = logs, belongs
        self.tau, self.omega = scale[0] * tau / (1.0 - tau), scale[1] * omega / (1.0 - omega)
        d = logs.variance + self.omega[:, None] ** 2 * logs.varies  # W, n
        self.v = 1.0 / logs.sums(1.0 / d)  # W, m
        self.y = self.v * logs.sums(logs.y / d)
        own = logs.sums(np.log(d) + logs.y**2 / d) - self.y**2 / self.v
        T = self.tau[None, :, None] ** 2
        self.w = 1.0 / (T + self.v[:, None, :])  # W, T, m
        self.own = own[:, None, :] + np.log1p(T / self.v[:, None, :])
        self.prior = -2.0 * np.log1p(-omega)[:, None] - 2.0 * np.log1p(-tau)
        inside = self.w * belongs
        y = self.y[:, None, :]
        self.sums = (
            inside.sum(-1),
            (inside * y).sum(-1),
            (inside * y**2).sum(-1),
            (self.own * belongs).sum(-1),
        )
        self.weight = self._weight(*self.sums)

    def _weight(self, w: Array, wy: Array, wyy: Array, own: Array) -> Array:
        """Return normalised posterior weights, (W, T) or (W, T, m)."""
        prior = self.prior if w.ndim == 2 else self.prior[..., None]
        log = prior - 0.5 * (own + wyy - wy**2 / w + np.log(w))
        weight = np.exp(log - log.max(axis=(0, 1)))
        return np.asarray(weight / weight.sum(axis=(0, 1)))

    def p_values(self) -> Array:
        """Return for each craft the probability of a value so far from that of the others that belong."""
        m = self.belongs.size
        if self.belongs.sum() <= OTHERS:
            return np.full(m, np.nan)
        # as in sums, without the craft that is judged
        y, inside = self.y[:, None, :], self.w * self.belongs
        parts = (inside, inside * y, inside * y**2, self.own * self.belongs)
        w, wy, wyy, own = (s[..., None] - part for s, part in zip(self.sums, parts, strict=True))
        weight = self._weight(w, wy, wyy, own)
        far = np.abs(y - wy / w) / np.sqrt(1.0 / self.w + 1.0 / w)
        return np.asarray((weight * 2.0 * stats.norm.sf(far)).sum(axis=(0, 1)))

    def result(self, repeated: int) -> Craftwise:
        """Return means over the grid."""
        w, wy = self.sums[0], self.sums[1]
        mean, weight, of_omega = wy / w, self.weight, self.weight.sum(axis=1)
        mu = float((weight * mean).sum())
        mu_var = float((weight * (1.0 / w + (mean - mu) ** 2)).sum())
        own = of_omega @ self.y
        own_var = of_omega @ (self.v + (self.y - own) ** 2)
        B = self.tau[None, :, None] ** 2 * self.w
        known = self.belongs.sum() >= LEAST
        value, var = own, own_var
        if known:
            c = mean[..., None] + B * (self.y[:, None, :] - mean[..., None])
            each = B * self.v[:, None, :] + (1.0 - B) ** 2 / w[..., None]
            shrunk = np.einsum("wt,wtm->m", weight, c)
            shrunk_var = np.einsum("wt,wtm->m", weight, each + (c - shrunk) ** 2)
            value = np.where(self.belongs, shrunk, own)
            var = np.where(self.belongs, shrunk_var, own_var)
        within = float(of_omega @ self.omega)
        d = self.logs.variance + within**2 * self.logs.varies
        v = 1.0 / self.logs.sums(1.0 / d)
        y = v * self.logs.sums(self.logs.y / d)
        m, offset = y.size, self.logs.offset
        Q = float(((y - (y / v).sum() / (1.0 / v).sum()) ** 2 / v).sum())
        differ = stats.f.sf(Q / max(m - 1, 1), max(m - 1, 1), repeated) if within else stats.chi2.sf(Q, m - 1)
        return Craftwise(
            mean=mu + offset,
            mean_std=float(np.sqrt(mu_var)),
            between=float(weight.sum(axis=0) @ self.tau) if known else float("nan"),
            within=within,
            own=own + offset,
            own_std=np.sqrt(own_var),
            value=value + offset,
            std=np.sqrt(var),
            p=self.p_values(),
            belongs=self.belongs,
            p_differ=float(differ) if m > 1 else float("nan"),
        )
