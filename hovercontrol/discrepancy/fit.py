"""Maximum likelihood of a model's unknowns over windows, given the noise: Gauss-Newton, damped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.noise import Noise, whiten
from hovercontrol.discrepancy.reduce import Normal, reduce, scaled_inverse
from hovercontrol.discrepancy.response import Response
from hovercontrol.discrepancy.windowed import Data, Subject, Windowed
from hovercontrol.errors import InputError
from hovercontrol.identify.solve import bounded_step

Array = NDArray[np.float64]

#: Relative standard deviation of the coefficients' weak prior about the model's own values.
PRIOR = 0.3

#: Iterations at most; fits that come to an end take four to six.
MOST = 15

#: A fall of twice the log likelihood that means nothing.
SMALL = 0.1


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model.

    Attributes
    ----------
    windowed : Windowed
    p : ndarray, shape (P,)
    x0 : ndarray, shape (n_states, W)
    residual, jacobian : ndarray
        At p and x0 (:meth:`Windowed.linearise`).
    noise : Noise
    normal : Normal
    prior : ndarray, shape (P,)
        Precision of the weak prior.
    cost : float
        Minus twice the log likelihood, but for a constant.
    chi2_per_dof : float
        Against the measurement noise alone.
    response : Response
    converged : bool
    """

    windowed: Windowed
    p: Array
    x0: Array
    residual: Array
    jacobian: Array
    noise: Noise
    normal: Normal
    prior: Array
    cost: float
    chi2_per_dof: float
    response: Response
    converged: bool

    @property
    def model(self) -> Subject:
        """The model with the values found."""
        w = self.windowed
        inside = np.clip(self.p, w.lower, w.upper)  # a step to a bound may end a rounding error beyond it
        return w.model.with_coefficients(dict(zip(w.names, inside.tolist(), strict=True)))

    @property
    def movable(self) -> NDArray[np.intp]:
        """Places of the unknowns that are not held by a bound, shape (m,): a drag at zero goes no lower."""
        w, g, near = self.windowed, self.normal.g, 1e-6 * self.windowed.size
        held = ((self.p <= w.lower + near) & (g < 0.0)) | ((self.p >= w.upper - near) & (g > 0.0))
        return np.flatnonzero(~held)

    @property
    def covariance(self) -> Array:
        """Of the unknowns, shape (P, P).

        With process noise windows depend on their neighbours, which gusts outlast: each variance is then
        raised to what the scatter of the scores from stretch to stretch makes it (Huber 1967), where that
        is more.
        """
        C = scaled_inverse(self.normal.S + np.diag(self.prior))
        if not self.noise.has_process:
            return C
        blocks = self.windowed.blocks()
        sums = np.zeros((int(blocks.max()) + 1, len(C)))
        np.add.at(sums, blocks, self.normal.scores)
        scatter = np.einsum("ij,bj->bi", C, sums)
        own = np.diag(C)
        raised = np.sqrt(np.maximum((scatter**2).sum(axis=0) / np.where(own > 0, own, 1.0), 1.0))
        return C * np.outer(raised, raised)


def fit(
    model: Subject,
    data: Data,
    length: float,
    noise: Noise | None = None,
    *,
    prior_model: Subject | None = None,
    near: Fit | None = None,
    small: float = SMALL,
    frozen: bool = False,
) -> Fit:
    """Fit a model's unknowns.

    Parameters
    ----------
    model : Model or BlockModel
        Its values start the fit.
    data : Data
    length : float
        Of the windows [s].
    noise : Noise, optional
        By default that of the measurements alone.
    prior_model : Model, optional
        About whose coefficients the weak prior lies; default `model`.
    near : Fit, optional
        A fit of these data whose states start this one's.
    small : float, optional
        The fall of the cost at which it ends; a millionth of the cost ends it too.
    frozen : bool, optional
        Whether the unknowns stay, and only the windows' initial states are fitted.
    """
    w = Windowed(model, data, length, near.windowed.tracks() if near else None)
    if noise is None:
        noise = Noise(data.noise, np.zeros(len(w.free)))
    elif len(noise.process) != len(w.free):
        noise = noise.but(process=np.zeros(len(w.free)))
    centre, precision = _prior(w, prior_model or model)
    p = np.clip(w.start, w.lower, w.upper)
    x0 = w.cut.start.copy()
    n = len(w.free)
    w.set_step(
        p,
        x0,
        near.windowed.pieces if near else 1,
        enough=near is not None and near.windowed.length == length,
    )

    def evaluate(p: Array, x0: Array) -> tuple[Array, Array, Array, float]:
        """Return residual, Jacobian, each window's cost and the whole."""
        r, J = w.linearise(p, x0)
        good = np.isfinite(r).all(axis=(1, 2)) & np.isfinite(J).all(axis=(1, 2, 3))
        bad: NDArray[np.bool_] = np.logical_not(good).reshape(-1)
        if bad.all():
            return r, J, np.full(len(r), np.inf), np.inf
        white, det = whiten(np.where(bad[:, None, None], 0.0, r)[..., None], w.seen, noise, response_at(p))
        each = np.where(bad, np.inf, (white**2).sum(axis=(1, 2, 3)) + det)
        return r, J, each, float(each.sum() + precision @ (p - centre) ** 2)

    def response_at(p: Array) -> Response | None:
        return Response(w, p) if noise.has_process or noise.clock else None

    r, J, each, cost = evaluate(p, x0)
    if not np.isfinite(cost):
        raise InputError(
            f"model {model.name!r}: the simulation runs away within windows of {length:g} s at the "
            "start values: is the model of this craft, and are all units SI?"
        )
    damping, converged, stuck = 0.0, False, np.zeros(len(r))
    for _ in range(MOST):
        white, _ = whiten(np.concatenate([r[..., None], J], axis=-1), w.seen, noise, response_at(p))
        normal = reduce(white, n, stuck)
        S = normal.S + np.diag(precision)
        g = normal.g - precision * (p - centre)
        low, high = w.lower - p, w.upper - p
        low = np.where(w.is_width, np.maximum(low, -0.5 * p), low)
        high = np.where(w.is_width, np.minimum(high, p), high)
        dp = np.zeros_like(p) if frozen else bounded_step(S, g, low, high, w.size, damping)
        a, B = normal.back
        moved = x0.copy()
        moved[w.free] += (a - B @ dp).T
        new_r, new_J, new_each, new_cost = evaluate(p + dp, moved)
        worse = new_each > each + 1e-9 * np.abs(each)
        if new_cost <= cost + 1e-9 * abs(cost):
            converged = cost - new_cost < max(small, 1e-6 * abs(new_cost))
            p, x0, r, J, each, cost = p + dp, moved, new_r, new_J, new_each, new_cost
            damping = damping / 10 if damping > 1e-6 else 0.0
            stuck = np.where(worse, np.maximum(10 * stuck, 1e-2), np.where(stuck > 1e-4, stuck / 10, 0.0))
            if converged:
                break
        else:
            if damping > 1e3:
                break
            wild = worse & (new_each - each > 0.5 * (new_each - each)[worse].max(initial=0.0))
            few = wild.sum() <= 0.1 * len(wild)
            stuck = np.where(wild if few else worse, np.maximum(10 * stuck, 1e-1), stuck)
            damping = damping if few else max(10 * damping, 1e-3)
    w.linearise(p, x0, jacobian=False)
    response = Response(w, p)
    white, det = whiten(np.concatenate([r[..., None], J], axis=-1), w.seen, noise, response)
    normal = reduce(white, n)
    dof = max(int(w.seen.sum()) - n * len(w.ranges) - len(p), 1)
    plain = float(((r / data.noise) ** 2).sum()) / dof
    total = float((white[..., 0] ** 2).sum() + det.sum() + precision @ (p - centre) ** 2)
    return Fit(w, p, x0, r, J, noise, normal, precision, total, plain, response, converged)


def _prior(w: Windowed, model: Subject) -> tuple[Array, Array]:
    """Return centre and precision: weak on the model's own coefficients, none on what was added."""
    own = {k: v for k, v in model.coefficients().items()}
    linear = set(model.linear_coefficients())
    centre = np.array([own.get(name, value) for name, value in zip(w.names, w.start, strict=True)])
    size = PRIOR * np.maximum(np.abs(centre), 1e-3 * w.size)
    precision = np.where([name in linear for name in w.names], 1.0 / size**2, 0.0)
    return centre, precision


def forced_states(f: Fit) -> list[int]:
    """Return which free states' derivatives hold a coefficient: there forces act."""
    w = f.windowed
    symbols = {w.block.parameter(name).symbol for name in w.model.linear_coefficients()}
    return [
        k
        for k, i in enumerate(w.free)
        if w.block.expand(w.block.derivatives[w.block.states[i].name]).free_symbols & symbols
    ]
