"""The estimator of C17 (sections III, V) for sampled data: a discrete Kalman filter on the regressors.

Its step is that of :mod:`.sampled_step`. Intensities are defined as in
:func:`~hovercontrol.control.observers.kalman_bucy.kalman_bucy`, to which this filter converges as dt goes to
zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.control.observers.diagonal import diagonal
from hovercontrol.control.observers.regression import regression
from hovercontrol.control.observers.regressors import Regressors
from hovercontrol.control.observers.sampled_step import Plain, corrected, initialised, predicted, rates

_PLAIN = Plain()


@checked
class SampledEstimator:
    """A discrete Kalman filter for chosen coefficients of a Block, advanced sample by sample.

    Parameters
    ----------
    block : Block
        Its values of the coefficients are the first estimate (``with_values`` changes them).
    estimate : sequence of str, optional
        Coefficients to estimate (default: all in which the Block is linear); the others keep the
        Block's values.
    dt : float
        Nominal sample time [s]; that of a sampled Block is its period.
    R : array_like, scalar or shape (n,), optional
        Intensities of the measurement noise of the n states that the coefficients act on; the noise of a
        sample has covariance R/dt.
    Q : array_like, scalar or shape (n + m,), optional
        Intensities of the disturbances of those states and of the m coefficients; an interval of
        length d adds covariance Q d.
    P0 : array_like, scalar or shape (n + m,), optional
        Initial variances.
    x0 : sequence of float, shape (n,), optional
        Expected states at the first sample, with variances P0[:n]. By default the first sample gives the
        states, with covariance R/dt.

    Attributes
    ----------
    names, measured, inputs : tuple of str
        The coefficients, and the measured signals and inputs of :meth:`step`, in order.
    covariance : ndarray, shape (n + m, n + m)
        Covariance of the errors of states and coefficients.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.observers.kalman_bucy.kalman_bucy`; or if dt is not positive, or not
        the period of a sampled Block.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> e = SampledEstimator(hoverdemon().plant().with_values({"plant.thrust": 0.5}), dt=0.01)
    >>> for k in range(300):  # 2 N straight ahead give 2/2.6 m/s^2
    ...     c = e.step(0.01 * k, [0.01 * k * 2 / 2.6, 0.0, 0.0], [2.0, 0.0])
    >>> {name: round(value, 3) for name, value in e.coefficients.items()}
    {'thrust': 0.385, 'rudder_torque': 3.333}
    """

    def __init__(
        self,
        block: Block,
        estimate: Sequence[str] | None = None,
        *,
        dt: float,
        R: ArrayLike = 1e-5,
        Q: ArrayLike = 1e-2,
        P0: ArrayLike = 1e-2,
        x0: Sequence[float] | None = None,
    ) -> None:
        if not 0 < dt < math.inf:
            raise InputError(f"dt must be positive, found {dt!r}")
        self._period = block.period
        self._check_step("dt", dt)
        model = regression(block, estimate)
        n, m = model.G.shape
        self.model, self.dt, self.names = model, float(dt), model.names
        self._regressors = Regressors(model)
        self.measured, self.inputs = self._regressors.measured, self._regressors.inputs
        self._own = [self.measured.index(s.name) for s in model.states]
        self._n = n
        self._Rd = np.array(diagonal("R", R, n, positive=True)) / self.dt
        self._Q = np.diag(diagonal("Q", Q, n + m))
        self.covariance: Array = np.diag(diagonal("P0", P0, n + m))
        self._xi = np.array([0.0] * n + [c.start for c in model.coefficients])
        if x0 is not None:
            if len(x0) != n or not np.isfinite(x0).all():
                names = ", ".join(s.name for s in model.states)
                raise InputError(f"x0: expected {n} finite values ({names}), found {list(x0)}")
            self._xi[:n] = x0
        self._expected = x0 is not None
        self._before: list[float] | None = None

    def __repr__(self) -> str:
        names, measured = ", ".join(self.names), ", ".join(self.measured)
        return f"SampledEstimator of {names}, every {self.dt:g} s, from {measured}"

    @property
    def coefficients(self) -> dict[str, float]:
        """The estimates by name."""
        return dict(zip(self.names, self._xi[self._n :].tolist(), strict=True))

    @property
    def states(self) -> dict[str, float]:
        """The filtered states by name."""
        return {s.name: float(v) for s, v in zip(self.model.states, self._xi, strict=False)}

    @property
    def std(self) -> dict[str, float]:
        """Standard deviations of the estimates by name."""
        variances = np.diag(self.covariance)[self._n :]
        return dict(zip(self.names, np.sqrt(variances).tolist(), strict=True))

    def step(
        self, t: float, measured: Sequence[float], inputs: Sequence[float], dt: float | None = None
    ) -> Array:
        """Update the estimate with one sample.

        Parameters
        ----------
        t : float
            Time of the sample [s].
        measured : sequence of float
            Values measured at t, in the order of ``measured``.
        inputs : sequence of float
            Inputs held **since the previous sample**, in the order of ``inputs`` (ignored at the first
            sample). A controller can therefore step the estimator first and use its result.
        dt : float, optional
            Time since the previous sample [s] (default: the nominal sample time).

        Returns
        -------
        ndarray, shape (m,)
            The coefficients, in the order of ``names``.

        Raises
        ------
        InputError
            If the number of values is wrong, a value is not finite or dt is not positive. The
            estimate is then unchanged.
        """
        y, u = [float(v) for v in measured], [float(v) for v in inputs]
        step = self.dt if dt is None else dt
        self._check(t, y, u, step)
        n, own = self._n, np.array([y[i] for i in self._own])
        if self._before is not None:
            f = self._regressors
            start = f.at(t - step, self._before + u)
            if self._period:
                before = np.array([self._before[i] for i in self._own])
                start = end = rates(start, before, step)
            else:
                end = f.at(t, y + u)
            x, P = predicted(self._xi, self.covariance, start, end, self._Q, step, _PLAIN)
            x, P = corrected(x, P, own, self._Rd, _PLAIN)
        elif self._expected:
            x, P = corrected(self._xi, self.covariance, own, self._Rd, _PLAIN)
        else:
            x, P = initialised(self._xi, self.covariance, own, self._Rd)
        self._xi, self.covariance, self._before = x, 0.5 * (P + P.T), y
        return self._xi[n:].copy()

    def pause(self, seconds: float) -> None:
        """Bridge a gap in the samples.

        The states are initialised again from the next sample, and the covariance of the coefficients grows:
        ``P_xc = 0``, ``P_cc`` increases by ``Q_cc`` times the length of the gap.

        Parameters
        ----------
        seconds : float
            Length of the gap [s].
        """
        n, P = self._n, self.covariance
        P[:n, n:], P[n:, :n] = 0.0, 0.0
        P[n:, n:] += seconds * self._Q[n:, n:]
        self._before, self._expected = None, False

    def _check(self, t: float, y: list[float], u: list[float], dt: float) -> None:
        for kind, values, names in (("measured", y, self.measured), ("input", u, self.inputs)):
            if len(values) != len(names):
                text = f"{len(names)} {kind} values ({', '.join(names)}), found {len(values)}"
                raise InputError(f"estimator: expected {text}")
            if not all(map(math.isfinite, values)):
                bad = [name for name, v in zip(names, values, strict=True) if not math.isfinite(v)]
                raise InputError(f"estimator: {', '.join(bad)} not finite at t = {t:.6g} s")
        if not 0 < dt < math.inf:
            raise InputError(f"estimator: dt must be positive, found {dt!r} at t = {t:.6g} s")
        self._check_step(f"estimator: at t = {t:.6g} s dt", dt)

    def _check_step(self, what: str, dt: float) -> None:
        if self._period and not 0.7 * self._period < dt < 1.3 * self._period:
            raise InputError(f"{what}: expected the period of the block, {self._period:g} s, found {dt:g}")
