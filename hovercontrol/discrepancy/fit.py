"""Maximum likelihood of a model's unknowns over windows, given the noise: Gauss-Newton, damped."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.data import Data
from hovercontrol.discrepancy.noise import Noise, estimate, whiten
from hovercontrol.discrepancy.prior import Prior
from hovercontrol.discrepancy.reduce import Normal, reduce, scaled_inverse
from hovercontrol.discrepancy.response import Response
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.windowed import Windowed
from hovercontrol.errors import InputError
from hovercontrol.identify.solve import bounded_step

Array = NDArray[np.float64]

#: Iterations at most; fits that come to an end take four to six.
MOST = 15

#: A fall of twice the log likelihood that means nothing, and one that a fit taken to its very end may leave.
SMALL, TINY = 0.5, 0.005

#: A fall in parts of the cost and of a misfit that is far beyond noise, where `small` is SMALL.
RELATIVE, GROSS = 1e-6, 1e-3

#: Steps in a row, each more timid, that may be refused: dry friction has kinks that no slope describes.
REFUSED = 3


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model.

    Attributes
    ----------
    windowed : Windowed
    p : ndarray, shape (P,)
    x0 : ndarray, shape (n_states, W)
    noise : Noise
    prior : ndarray, shape (P,)
        Precision of the weak prior.
    cost : float
        Minus twice the log likelihood, but for a constant.
    chi2_per_dof : float
        Against the measurement noise alone.
    converged : bool
    point : _Point
        Where it ended: what is derived there is computed when first asked for.
    """

    windowed: Windowed
    p: Array
    x0: Array
    noise: Noise
    prior: Array
    cost: float
    chi2_per_dof: float
    converged: bool
    point: _Point

    @property
    def residual(self) -> Array:
        """Measured minus simulated, shape (W, K, C); zero where nothing was measured."""
        return self.point.residual

    @property
    def jacobian(self) -> Array:
        """Of the channels by the free initial states and the unknowns, shape (W, K, C, n + P)."""
        return self.point.jacobian()

    @property
    def moves(self) -> Array:
        """Of the channels by the free initial states alone, shape (W, K, C, n)."""
        return self.point.jacobian(unknowns=False)[..., : len(self.windowed.free)]

    @cached_property
    def normal(self) -> Normal:
        """The normal equations at the end, initial states eliminated."""
        return reduce(self.point.columns(), len(self.windowed.free))

    @property
    def response(self) -> Response:
        """The linearised motion along the runs."""
        return self.point.response

    @property
    def model(self) -> Subject:
        """The model with the values found."""
        w = self.windowed
        inside = np.clip(self.p, w.lower, w.upper)  # a step to a bound may end a rounding error beyond it
        return w.model.with_coefficients(w.coefficients(inside))

    @property
    def left(self) -> Array:
        """The residual less the likeliest drift of a navigation that wrote logs, shape (W, K, C)."""
        errors = self.windowed.errors
        return errors.without(self.residual) if errors else self.residual

    @property
    def starts(self) -> int:
        """How many of the windows' initial states show in what was measured."""
        return int((self.moves != 0.0).any(axis=(1, 2)).sum())

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
    finer: int = 1,
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
        The fall of the cost at which it ends; with SMALL a millionth of the cost ends it too.
    frozen : bool, optional
        Whether the unknowns stay, and only the windows' initial states are fitted.
    finer : int, optional
        Into how many parts the sub-steps of `near` are cut at least.
    """
    w = Windowed(model, data, length, near.windowed.tracks() if near else None)
    if noise is None:
        noise = Noise(data.noise, np.zeros(len(w.free)))
    elif len(noise.process) != len(w.free):
        noise = noise.but(process=np.zeros(len(w.free)))
    prior = Prior(w, prior_model or model)
    p = np.clip(w.start, w.lower, w.upper)
    x0 = w.cut.start.copy()
    n = len(w.free)
    w.set_step(
        p,
        x0,
        finer * near.windowed.pieces if near else 1,
        enough=near is not None and near.windowed.length == length,
    )
    now = _Point(w, p, x0, noise, prior)
    if not np.isfinite(now.cost):
        raise InputError(
            f"model {model.name!r}: the simulation runs away within windows of {length:g} s at the "
            "start values: is the model of this craft, and are all units SI?"
        )
    damping, converged, refused, stuck = 0.0, False, 0, np.zeros(len(w.ranges))
    count = int(w.seen.sum())
    for _ in range(MOST):
        white = now.columns(unknowns=not frozen)
        normal = reduce(white, n, stuck)
        dx, B = normal.back
        dp = np.zeros_like(p)
        if not frozen:
            S = normal.S + np.diag(prior.precision(p))
            g = normal.g - prior.slope(p)
            low, high = w.lower - p, w.upper - p
            low = np.where(w.is_width, np.maximum(low, -0.5 * p), low)
            high = np.where(w.is_width, np.minimum(high, p), high)
            dp = bounded_step(S, g, low, high, w.size, damping)
            dx = dx - B @ dp
        moved = x0.copy()
        moved[w.free] += dx.T
        told = _told(white, dx, dp[: B.shape[-1]])
        hoped = float(told.sum()) + prior.cost(p) - prior.cost(p + dp)
        misfit = float((white[..., 0] ** 2).sum()) - count
        enough = small * max(1.0, RELATIVE * abs(now.cost) / SMALL, GROSS * misfit / SMALL)
        if hoped < enough:
            converged = True
            break
        new = _Point(w, p + dp, moved, noise, prior)
        fall = now.cost - new.cost
        off = told - (now.each - new.each)  # how much worse each window became than was told
        wild = ~(off <= (0.1 if refused else 1.0) + 0.5 * told)
        if fall >= -1e-9 * abs(now.cost):
            converged, refused = fall < enough and damping < 1.0, 0
            p, x0, now = p + dp, moved, new
            poor = fall < 0.25 * hoped
            damping = max(4 * damping, 1e-2) if poor else (damping / 10 if damping > 1e-6 else 0.0)
            stuck = np.where(wild, np.maximum(10 * stuck, 1e-2), np.where(stuck > 1e-4, stuck / 10, 0.0))
            if converged:
                break
        else:
            refused += 1
            if refused > REFUSED:
                break
            few = refused == 1 and 0 < wild.sum() <= 0.1 * len(wild)
            stuck = np.where(wild, np.maximum(10 * stuck, 1e-1), stuck)
            damping = damping if few else max(10 * damping, 1e-2)
    w.x = now.x
    dof = max(count - n * len(w.ranges) - len(p), 1)
    plain = float((w.plainly_white(now.residual) ** 2).sum()) / dof
    return Fit(w, p, x0, noise, prior.precision(p), now.cost, plain, converged, now)


class _Point:
    """Where a fit stands: unknowns and initial states, the windows' costs there, and slopes if asked for."""

    def __init__(self, w: Windowed, p: Array, x0: Array, noise: Noise, prior: Prior) -> None:
        self._w, self._noise, self._p, self._x0 = w, noise, p, x0
        self.residual, _ = w.linearise(p, x0, jacobian=False)
        self.x = w.x
        bad: NDArray[np.bool_] = np.logical_not(np.isfinite(self.residual).all(axis=(1, 2)))
        self._jacobian: tuple[Array, NDArray[np.bool_]] | None = None
        self._columns: Array | None = None
        self.each = np.full(len(bad), np.inf)
        if not bad.all():
            r = np.where(bad[:, None, None], 0.0, self.residual)
            white, det = whiten(r[..., None], w.seen, noise, self._coloured, w.errors)
            self.each = np.where(bad, np.inf, (white**2).sum(axis=(1, 2, 3)) + det)
        self.cost = float(self.each.sum()) + prior.cost(p)

    @cached_property
    def response(self) -> Response:
        self._w.x = self.x
        return Response(self._w, self._p)

    @property
    def _coloured(self) -> Response | None:
        return self.response if self._noise.has_process or self._noise.clock else None

    def jacobian(self, *, unknowns: bool = True) -> Array:
        """Return slopes, by the initial states alone or also by the unknowns; zero where it runs away."""
        return self._sloped(unknowns)[0]

    def columns(self, *, unknowns: bool = True) -> Array:
        """Return residual and Jacobian, whitened; windows in which it runs away say nothing."""
        J, good = self._sloped(unknowns)
        if self._columns is None:
            both = np.concatenate([np.where(good, self.residual[..., None], 0.0), J], axis=-1)
            self._columns, _ = whiten(both, self._w.seen, self._noise, self._coloured, self._w.errors)
        return self._columns

    def _sloped(self, unknowns: bool) -> tuple[Array, NDArray[np.bool_]]:
        n = len(self._w.free)
        if self._jacobian is None or (unknowns and self._jacobian[0].shape[-1] == n and len(self._p)):
            _, J = self._w.linearise(self._p, self._x0, unknowns=unknowns)
            good: NDArray[np.bool_] = np.asarray(np.isfinite(J).all(axis=(1, 2, 3), keepdims=True))
            self._jacobian, self._columns = (np.where(good, J, 0.0), good), None
        return self._jacobian


def _told(white: Array, dx: Array, dp: Array) -> Array:
    """Return by how much each window's cost falls with a step, were all linear, shape (W,)."""
    W = len(white)
    step = np.concatenate([dx, np.broadcast_to(dp, (W, len(dp)))], axis=1)
    columns = white.reshape(W, -1, white.shape[-1])
    r = columns[..., 0]
    left = r - (columns[..., 1:] @ step[..., None])[..., 0]
    return np.asarray((r**2).sum(axis=1) - (left**2).sum(axis=1))


def forced_states(f: Fit) -> list[int]:
    """Return which free states' derivatives hold a coefficient: there forces act."""
    w = f.windowed
    symbols = {w.block.parameter(name).symbol for name in w.model.linear_coefficients()}
    return [
        k
        for k, i in enumerate(w.free)
        if w.block.expand(w.block.derivatives[w.block.states[i].name]).free_symbols & symbols
    ]


def noise_of(f: Fit, *, rough: bool = False) -> Noise:
    """Return the noise that fits the residuals of a fit best, process noise included.

    Roughly, and faster, the unknowns stay.
    """
    w = f.windowed
    columns = np.concatenate([f.left[..., None], f.moves if rough else f.jacobian], axis=-1)
    return estimate(columns, w.seen, len(w.free), f.noise, f.response, forced_states(f), rough=rough)[0]
