"""The Lyapunov function of C17 section VI, its conditions [C17 eq 18, 19] and the decay that it guarantees.

The error equation is read off the loop (:mod:`.normal_form`), V is (17), and W follows from V' = -W along it.
Each axis of the plane obeys the same equation, so that 2 x 2 matrices say it all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arguments import broadcastable
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.control.analysis.byrnes_isidori import (
    ERRORS,
    closed_loop,
    coefficient,
    normal_form,
    once_for_equations,
    symbol,
)
from hovercontrol.control.analysis.regions import as_numbers
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_simulation

#: beta stays this share inside the interval where V is only just definite at its end.
INSIDE = 1e-6


@checked
@dataclass(frozen=True)
class LyapunovFunction:
    """V and W of C17 (17) for one axis, as matrices: V = z'P z, W = z'Q z with z = [z1, z2].

    Attributes
    ----------
    k1, k2, beta : sympy.Symbol
        Positive.
    A : sympy.Matrix
        The error equation z' = A z.
    P, Q : sympy.Matrix
        Q = -(A'P + P A).
    """

    k1: sp.Symbol
    k2: sp.Symbol
    beta: sp.Symbol
    A: sp.ImmutableMatrix
    P: sp.ImmutableMatrix
    Q: sp.ImmutableMatrix

    __repr__ = short_repr

    def condition_18(self) -> sp.Expr:
        """Return the bound below which beta leaves V positive definite: sqrt(k1)."""
        return _largest(self.P, self.beta)

    def condition_19(self) -> sp.Expr:
        """Return the bound below which beta leaves W positive definite: 4 k1 k2/(4 k1 + k2^2)."""
        return _largest(self.Q, self.beta)

    def margin(self) -> sp.Expr:
        """Return (18)^2 - (19)^2, factored: k1 times a square, so that (19) implies (18).

        Examples
        --------
        >>> lyapunov_function().margin()
        k1*(4*k1 - k2**2)**2/(4*k1 + k2**2)**2
        """
        return sp.factor(self.condition_18() ** 2 - self.condition_19() ** 2)

    def numbers(self, matrix: sp.Matrix, k1: ArrayLike, k2: ArrayLike, beta: ArrayLike) -> Array:
        """Return A, P or Q at gains and beta whose shapes broadcast, shape (..., 2, 2).

        Parameters
        ----------
        matrix : sympy.Matrix, shape (2, 2)
            A, P or Q.
        k1, k2, beta : array_like
            Gains [1/s^2, 1/s] and beta [1/s].
        """
        given = broadcastable("LyapunovFunction.numbers", k1=k1, k2=k2, beta=beta)
        shape = np.broadcast_shapes(*(a.shape for a in given))
        entries = sp.lambdify((self.k1, self.k2, self.beta), list(matrix))(*given)
        full = [np.broadcast_to(np.asarray(e, dtype=float), shape) for e in entries]
        return np.stack(full, axis=-1).reshape(*shape, 2, 2)


@lru_cache(maxsize=1)
def lyapunov_function() -> LyapunovFunction:
    """Return V and W of the tracking controller, symbolic in k1, k2 and beta.

    Examples
    --------
    >>> f = lyapunov_function()
    >>> f.Q
    Matrix([
    [  beta*k1,  beta*k2/2],
    [beta*k2/2, -beta + k2]])
    >>> f.condition_18(), f.condition_19()
    (sqrt(k1), 4*k1*k2/(4*k1 + k2**2))
    """
    k1, k2, beta = sp.symbols("k1 k2 beta", positive=True)
    form = normal_form(c17_simulation())
    gains = {coefficient("k1"): k1, coefficient("k2"): k2}
    x_axis = (ERRORS[0], ERRORS[2])  # the y axis has the same: tests say so
    rates = sp.Matrix([form.errors[name].xreplace(gains) for name in x_axis])
    A = sp.ImmutableMatrix(rates.jacobian([symbol(name) for name in x_axis]))
    P = sp.ImmutableMatrix([[k1, beta], [beta, 1]]) / 2  # [C17 eq 17]
    return LyapunovFunction(k1, k2, beta, A, P, -(A.T * P + P * A))


def _largest(matrix: sp.Matrix, beta: sp.Symbol) -> sp.Expr:
    """Return the beta at which a matrix, definite for small beta, stops being so."""
    (bound,) = sp.solve(matrix.det(), beta)  # of the roots only the positive one: beta is positive
    return sp.simplify(bound)


@once_for_equations
def lyapunov_rate(model: Model) -> sp.Expr:
    """Return V' under any commands, C17 (20) [C17 eq 20]: V is (17), the craft's own motion moves z1 and z2.

    Parameters
    ----------
    model : Model

    Returns
    -------
    sympy.Expr
        In the motion, the reference's signals, the force vector ``thrust_x, thrust_y`` (T cos(theta),
        T sin(theta)), the coefficients and gains
        (:func:`~hovercontrol.control.analysis.byrnes_isidori.coefficient`) and ``beta``.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.analysis.normal_form`.
    """
    controller, flow = closed_loop(model, steered=False)
    z = [controller.definitions[name] for name in ERRORS]
    rates = [sum((sp.diff(e, s) * f for s, f in flow.items()), sp.S.Zero) for e in z]
    k1, beta = coefficient("k1"), sp.Symbol("beta", positive=True)
    return sum(
        (
            k1 * z[i] * rates[i]
            + z[i + 2] * rates[i + 2]
            + beta * (rates[i] * z[i + 2] + z[i] * rates[i + 2])
            for i in (0, 1)
        ),
        sp.S.Zero,
    )


@checked
@dataclass(frozen=True, eq=False)
class Decay:
    """What C17's Theorem 3 promises for gains, and what is true; arrays of one shape [C17 theorem 3].

    Attributes
    ----------
    k1, k2, beta : ndarray
        Gains [1/s^2, 1/s] and the beta [1/s] used.
    bound_18, bound_19 : ndarray
        Bounds of beta [1/s].
    guaranteed : ndarray
        Rate [1/s] at which ``exp(-rate t)`` bounds the tracking errors by V and W; negative where beta is
        not admissible.
    true : ndarray
        Rate [1/s] at which the slowest error dies out: the spectral abscissa of the error equation.
    overshoot : ndarray
        Factor before the exponential: ``|z(t)| <= overshoot |z(0)| exp(-guaranteed t)``, with
        z = [k1^(1/2) z1, z2]; infinite where V is not definite.

    Examples
    --------
    >>> found = decay(2.0, [1.0, 2.0], 0.5)
    >>> found.guaranteed.round(3).tolist(), found.true.round(3).tolist()
    ([0.5, 0.465], [0.5, 1.0])
    """

    k1: Array
    k2: Array
    beta: Array
    bound_18: Array
    bound_19: Array
    guaranteed: Array
    true: Array
    overshoot: Array

    __repr__ = short_repr

    @property
    def admissible(self) -> NDArray[np.bool_]:
        """Where beta satisfies (18) and (19)."""
        return (self.beta > 0) & (self.beta < np.minimum(self.bound_18, self.bound_19))


@checked
def fastest_beta(k1: ArrayLike, k2: ArrayLike) -> Array:
    """Return the beta [1/s] whose V guarantees the fastest decay.

    Parameters
    ----------
    k1, k2 : array_like, of shapes that broadcast
        Gains [1/s^2, 1/s], positive.

    Returns
    -------
    ndarray, of their common shape

    Notes
    -----
    ``min(k2/2, 2 k1/k2)``. With beta = k2/2 (k2^2 < 4 k1) W is k2 V; with beta = 2 k1/k2 (k2^2 > 4 k1) the
    smallest eigenvalue of W relative to V is twice the rate of the slower real pole: the guarantee is then
    the true rate, and no V gives more. Where both meet, at k2^2 = 4 k1, V is only just definite and the
    rate is approached, not reached.

    Examples
    --------
    >>> fastest_beta([2.0, 2.0], [2.0, 4.0]).tolist()
    [1.0, 1.0]
    """
    k1, k2 = _gains(k1, k2)
    return np.minimum(k2 / 2, 2 * k1 / k2)


@checked
def decay(k1: ArrayLike, k2: ArrayLike, beta: ArrayLike | None = None) -> Decay:
    """Return the guaranteed and the true decay rate of the tracking errors.

    Parameters
    ----------
    k1, k2 : array_like
        Gains [1/s^2, 1/s], positive; of shapes that broadcast.
    beta : array_like, optional
        Of V [1/s], positive; default the fastest (:func:`fastest_beta`), a millionth inside its bound.

    Returns
    -------
    Decay

    Raises
    ------
    InputError
        If a gain or beta is not positive.

    Examples
    --------
    >>> d = decay(2.0, 2.0)
    >>> round(float(d.guaranteed), 9), round(float(d.true), 9)
    (1.0, 1.0)
    """
    k1, k2 = _gains(k1, k2)
    f = lyapunov_function()
    bound_18, bound_19 = (np.asarray(bound(k1, k2), dtype=float) for bound in _bounds())
    if beta is None:
        used = np.minimum(fastest_beta(k1, k2), (1 - INSIDE) * bound_19)
    else:
        used = _positive(beta, "beta")
    k1, k2, used, bound_18, bound_19 = np.broadcast_arrays(k1, k2, used, bound_18, bound_19)
    P, Q, A = (f.numbers(m, k1, k2, used) for m in (f.P, f.Q, f.A))
    low, high = _relative(P, np.diag([0.5, 0.0]) * k1[..., None, None] + np.diag([0.0, 0.5]))
    definite = used < bound_18
    with np.errstate(divide="ignore", invalid="ignore"):
        overshoot = np.where(definite, np.sqrt(high / np.where(definite, low, 1.0)), np.inf)
    safe = np.where(definite[..., None, None], P, np.eye(2))
    slowest, _ = _relative(Q, safe)
    guaranteed = np.where(definite, slowest / 2, -np.inf)  # V falls twice as fast as its root
    true = -np.linalg.eigvals(A).real.max(axis=-1)
    return Decay(k1, k2, used, bound_18, bound_19, guaranteed, true, overshoot)


@lru_cache(maxsize=1)
def _bounds() -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return (18) and (19) as functions of k1 and k2."""
    f = lyapunov_function()
    return sp.lambdify((f.k1, f.k2), f.condition_18()), sp.lambdify((f.k1, f.k2), f.condition_19())


def _relative(M: Array, N: Array) -> tuple[Array, Array]:
    """Return the smallest and largest eigenvalue of M relative to N, symmetric and N definite."""
    # N = L L': the eigenvalues of M x = lambda N x are those of L^-1 M L^-T
    root = np.linalg.inv(np.linalg.cholesky(N))
    values = np.asarray(np.linalg.eigvalsh(root @ M @ np.swapaxes(root, -1, -2)), dtype=float)
    return values[..., 0], values[..., -1]


def _gains(k1: ArrayLike, k2: ArrayLike) -> tuple[Array, Array]:
    return _positive(k1, "k1"), _positive(k2, "k2")


def _positive(given: ArrayLike, name: str) -> Array:
    values = as_numbers(name, given)
    wrong = ~((values > 0) & np.isfinite(values))
    if wrong.any():
        raise InputError(f"{name} must be positive and finite, found {values[wrong].ravel()[0]:g}")
    return values
