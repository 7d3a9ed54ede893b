"""The optimal law for a constant delay below one sample, and what it saves over one that ignores the delay.

K06 section 5.3.3 prints it as ``u(k) = -L [x(k); u(k-1)]`` [K06 eq 5.1]: what was commanded last is still on
its way and belongs to the state.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm, solve_discrete_lyapunov

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import number, positive


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """A plant ``x' = A x + B u`` sampled at a period, whose commands act late by less than that.

    Parameters
    ----------
    A : array_like, shape (n, n)
    B : array_like, shape (n, m)
    period : float
        [s]
    delay : float
        From the sample to when its command acts [s], 0 to the period.
    Q : array_like, shape (n, n)
        Weight of the states.
    R : array_like, shape (m, m)
        Weight of the commands.

    Raises
    ------
    InputError
        If shapes do not fit, or the delay is out of its range.

    Examples
    --------
    >>> loop = DelayedLoop([[0.0]], [[1.0]], 1.0, 0.5, [[1.0]], [[1.0]])
    >>> loop.gain().round(3).tolist()
    [[0.667, 0.333]]
    """

    A: Array
    B: Array
    period: float
    delay: float
    Q: Array
    R: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for key in ("A", "B", "Q", "R"):
            object.__setattr__(self, key, np.atleast_2d(np.asarray(getattr(self, key), dtype=float)))
        n, m = self.B.shape
        for key, size in (("A", n), ("Q", n), ("R", m)):
            if getattr(self, key).shape != (size, size):
                raise InputError(f"{key}: expected shape {(size, size)}, found {getattr(self, key).shape}")
        positive("period", self.period)
        if not 0 <= number("delay", self.delay) <= self.period:
            raise InputError(f"delay: expected 0 to the period, {self.period:g} s, found {self.delay:g}")

    def step(self) -> tuple[Array, Array]:
        """Return Phi and Gamma of ``[x; u(k-1)]``, shapes (n + m, n + m) and (n + m, m)."""
        n, m = self.B.shape
        late, rest = (self._held(t) for t in (self.delay, self.period - self.delay))
        turned = expm(self.A * (self.period - self.delay))
        Phi = np.block([[expm(self.A * self.period), turned @ late], [np.zeros((m, n + m))]])
        return Phi, np.vstack([rest, np.eye(m)])

    def _held(self, seconds: float) -> Array:
        """Return what a command of one does to the states in a time."""
        n, m = self.B.shape
        whole: Array = expm(np.block([[self.A, self.B], [np.zeros((m, n + m))]]) * seconds)[:n, n:]
        return whole

    def gain(self, *, knows_delay: bool = True) -> Array:
        """Return L of (5.1), shape (m, n + m); without the delay's knowledge its last columns are zero."""
        n, m = self.B.shape
        if not knows_delay:
            plain = expm(self.A * self.period), self._held(self.period)
            L = np.asarray(control.dlqr(*plain, self.Q, self.R)[0])
            return np.hstack([L, np.zeros((m, m))])
        weight = np.block([[self.Q, np.zeros((n, m))], [np.zeros((m, n + m))]])
        weight[n:, n:] = 1e-9 * np.eye(m)  # what was commanded is paid for when it is commanded
        return np.asarray(control.dlqr(*self.step(), weight, self.R)[0])

    def growth(self, gain: ArrayLike) -> float:
        """Return the spectral radius of the loop under a gain: below 1 it is stable."""
        Phi, Gamma = self.step()
        return float(np.abs(np.linalg.eigvals(Phi - Gamma @ np.asarray(gain))).max())

    def cost(self, gain: ArrayLike) -> float:
        """Return the mean of ``x' Q x + u' R u`` under white noise of unit covariance in x at each sample.

        Infinite if the loop is not stable.
        """
        if self.growth(gain) >= 1:
            return float("inf")
        n, m = self.B.shape
        Phi, Gamma = self.step()
        L = np.asarray(gain, dtype=float)
        noise = np.diag([1.0] * n + [0.0] * m)
        spread = solve_discrete_lyapunov(Phi - Gamma @ L, noise)
        return float(np.trace(self.Q @ spread[:n, :n]) + np.trace(self.R @ L @ spread @ L.T))
