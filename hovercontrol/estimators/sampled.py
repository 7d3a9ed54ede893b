"""The estimator of C17 (sections III, V) for samples: a discrete Kalman filter on its regressors.

Between two samples ``x[k+1] = x[k] + dt (h + G c)``, with h and G the mean of their values at both
ends (the states are measured there, the inputs are held), and ``c[k+1] = c[k]``. Intensities mean
what they mean in :func:`~hovercontrol.estimators.kalman_bucy.kalman_bucy`, to which this filter
tends as dt goes to zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from hovercontrol.block import Block
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimators.kalman_bucy import _diagonal
from hovercontrol.estimators.regression import Regression, regression
from hovercontrol.logs.log import gap_rows
from hovercontrol.signals import Signal, time
from hovercontrol.targets.numpy import call_scalar, numpy_functions

Array = NDArray[np.float64]


class Regressors:
    """h and G of a regression ``x' = h + G c`` as compiled functions of time and signals.

    Parameters
    ----------
    model : Regression
    drift : bool, optional
        False leaves h out (it is returned as zero) and asks only for the signals that G needs.

    Attributes
    ----------
    measured, inputs : tuple of str
        The Block's states and inputs that are needed, in its order; with drift also the states x.

    Examples
    --------
    >>> from hovercontrol.vehicles import hoverdemon
    >>> f = Regressors(regression(hoverdemon().plant()))
    >>> f.measured, f.inputs
    (('u', 'v', 'r'), ('thrust', 'rudder'))
    >>> f.at(0.0, [0.5, 0.0, 1.0, 2.0, 0.0])[:2]  # columns h, thrust, rudder_torque
    array([[ 0. ,  2. ,  0. ],
           [-0.5,  0. ,  0. ]])
    """

    def __init__(self, model: Regression, drift: bool = True) -> None:
        n, m = model.G.shape
        rates = [f"({s.unit})/s" for s in model.states]
        entries = {(i, 0): (Signal(f"h[{i}]", rates[i]), e)
                   for i, e in enumerate(model.h) if drift and e != 0}
        for i in range(n):
            for j, c in enumerate(model.coefficients):
                if model.G[i, j] != 0:
                    signal = Signal(f"G[{i},{j}]", f"{rates[i]}/({c.unit})")
                    entries[i, j + 1] = (signal, model.G[i, j])
        used = set().union(*(e.free_symbols for _, e in entries.values())) - {time}
        own = set(model.states) if drift else set()
        measured = [s for s in model.block.states if s.symbol in used or s in own]
        inputs = [s for s in model.block.inputs if s.symbol in used]
        block = Block(
            model.block.name,
            inputs=(*measured, *inputs),
            outputs=tuple(s for s, _ in entries.values()),
            parameters=tuple(p for p in model.block.parameters if p.symbol in used),
            output_expressions={s.name: e for s, e in entries.values()},
        )
        self.model = model
        self.measured = tuple(s.name for s in measured)
        self.inputs = tuple(s.name for s in inputs)
        self._shape = (n, m + 1)
        self._places = np.array([i * (m + 1) + j for i, j in entries], dtype=int)
        self._functions = numpy_functions(block)
        self._pair = self._functions.scalar_pair("outputs")
        self._values = block.parameter_values()

    def at(self, t: float, signals: Sequence[float]) -> Array:
        """Return ``[h G]``, shape (n, 1 + m), at time t [s]; signals: measured, then inputs."""
        table = np.zeros(self._shape)
        table.ravel()[self._places] = call_scalar(self._pair, t, (), signals, self._values)
        return table

    def series(self, t: Array, signals: Mapping[str, ArrayLike]) -> Array:
        """Return ``[h G]`` over times [s], shape (n, 1 + m, len(t)); errors as :meth:`columns`."""
        table = np.zeros((self._shape[0] * self._shape[1], len(t)))
        table[self._places] = self._functions.outputs(t, (), self.columns(t, signals))
        return table.reshape(*self._shape, len(t))

    def columns(self, t: Array, signals: Mapping[str, ArrayLike]) -> Array:
        """Return the needed signals, shape (number, len(t)), measured first.

        Raises
        ------
        InputError
            If time does not increase or signals are missing, of another length or not finite; all
            missing ones are named.
        """
        if t.ndim != 1 or len(t) < 2 or not np.isfinite(t).all() or not (np.diff(t) > 0).all():
            raise InputError("time must be two or more finite, increasing numbers")
        names = (*self.measured, *self.inputs)
        missing = [name for name in names if name not in signals]
        if missing:
            hint = did_you_mean(missing[0], signals)
            raise InputError(
                f"block {self.model.block.name!r}: missing signals {', '.join(missing)} "
                f"(needed: {', '.join(names)}){hint}"
            )
        rows = np.empty((len(names), len(t)))
        for k, name in enumerate(names):
            row = np.asarray(signals[name], dtype=float)
            if row.shape != t.shape:
                text = f"expected {len(t)} values, found shape {row.shape}"
                raise InputError(f"signal {name!r}: {text}")
            bad = np.flatnonzero(~np.isfinite(row))
            if bad.size:
                where = f"at t = {t[bad[0]]:.6g} s (row {bad[0]})"
                raise InputError(f"signal {name!r}: not finite {where}")
            rows[k] = row
        return rows


class SampledEstimator:
    """A discrete Kalman filter for chosen coefficients of a Block, to be stepped sample by sample.

    Parameters
    ----------
    block : Block
        Its start values of the coefficients are the first estimate (``with_values`` changes them).
    estimate : sequence of str, optional
        Which coefficients are estimated (default: all in which the Block is linear); the others
        keep the Block's values.
    dt : float
        Nominal sample time [s].
    R : array_like, scalar or shape (n,), optional
        Intensities of the measurement noise of the n states that the coefficients act on; a sample
        has covariance R/dt.
    Q : array_like, scalar or shape (n + m,), optional
        Intensities of the disturbances of those states and of the m coefficients; an interval of
        length d adds covariance Q d.
    P0 : array_like, scalar or shape (n + m,), optional
        Initial variances.
    x0 : sequence of float, shape (n,), optional
        States expected at the first sample, with variances P0[:n]. By default they are taken from
        that sample, with its covariance R/dt.

    Attributes
    ----------
    names, measured, inputs : tuple of str
        Coefficients, and the signals that :meth:`step` takes, in order.
    covariance : ndarray, shape (n + m, n + m)
        Of the error of states and coefficients.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.estimators.kalman_bucy.kalman_bucy`; or if dt is not positive.

    Examples
    --------
    >>> from hovercontrol.vehicles import hoverdemon
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
        model = regression(block, estimate)
        n, m = model.G.shape
        self.model, self.dt, self.names = model, float(dt), model.names
        self._regressors = Regressors(model)
        self.measured, self.inputs = self._regressors.measured, self._regressors.inputs
        self._own = [self.measured.index(s.name) for s in model.states]
        self._n = n
        self._Rd = np.diag(_diagonal("R", R, n, positive=True)) / self.dt
        self._Q = np.diag(_diagonal("Q", Q, n + m))
        self.covariance: Array = np.diag(_diagonal("P0", P0, n + m))
        self._xi = np.array([0.0] * n + [c.start for c in model.coefficients])
        if x0 is not None:
            if len(x0) != n or not np.isfinite(x0).all():
                names = ", ".join(s.name for s in model.states)
                raise InputError(f"x0: expected {n} finite values ({names}), found {list(x0)}")
            self._xi[:n] = x0
        self._expected = x0 is not None
        self._before: list[float] | None = None
        self._F, self._unit = np.eye(n + m), np.eye(n + m)

    @property
    def coefficients(self) -> dict[str, float]:
        """The estimates by name."""
        return dict(zip(self.names, self._xi[self._n:].tolist(), strict=True))

    @property
    def states(self) -> dict[str, float]:
        """The filtered states by name."""
        return {s.name: float(v) for s, v in zip(self.model.states, self._xi, strict=False)}

    @property
    def std(self) -> dict[str, float]:
        """Standard deviations of the estimates by name."""
        variances = np.diag(self.covariance)[self._n:]
        return dict(zip(self.names, np.sqrt(variances).tolist(), strict=True))

    def step(
        self, t: float, measured: Sequence[float], inputs: Sequence[float], dt: float | None = None
    ) -> Array:
        """Take in one sample.

        Parameters
        ----------
        t : float
            Time of the sample [s].
        measured : sequence of float
            What is measured at t, in the order of ``measured``.
        inputs : sequence of float
            What was held **since the sample before**, in the order of ``inputs`` (at the first one
            they do not matter). So a controller may step the estimator first and use its answer.
        dt : float, optional
            Time since the sample before [s] (default: the nominal sample time).

        Returns
        -------
        ndarray, shape (m,)
            The coefficients, in the order of ``names``.

        Raises
        ------
        InputError
            If a number of values is wrong, a value is not finite or dt is not positive; the
            estimate is then as before.
        """
        y, u = [float(v) for v in measured], [float(v) for v in inputs]
        step = self.dt if dt is None else dt
        self._check(t, y, u, step)
        n, own = self._n, np.array([y[i] for i in self._own])
        if self._before is not None:
            f = self._regressors
            table = 0.5 * (f.at(t - step, self._before + u) + f.at(t, y + u))
            self._F[:n, n:] = step * table[:, 1:]
            self._xi = self._F @ self._xi
            self._xi[:n] += step * table[:, 0]
            self.covariance = self._F @ self.covariance @ self._F.T + step * self._Q
        if self._before is not None or self._expected:
            self._correct(own)
        else:
            self._xi[:n] = own
            self.covariance[:n, :n] = self._Rd
        self._before = y
        return self._xi[n:].copy()

    def pause(self, seconds: float) -> None:
        """Bridge a gap [s]: the states are forgotten, the coefficients' variance grows."""
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

    def _correct(self, y: Array) -> None:
        """Measure the states: Joseph's form, which keeps the covariance positive semi-definite."""
        n, P = self._n, self.covariance
        gain = np.linalg.solve(P[:n, :n] + self._Rd, P[:n]).T
        self._xi = self._xi + gain @ (y - self._xi[:n])
        keep = self._unit.copy()
        keep[:, :n] -= gain
        P = keep @ P @ keep.T + gain @ self._Rd @ gain.T
        self.covariance = 0.5 * (P + P.T)


@dataclass(frozen=True, eq=False)
class CoefficientHistory:
    """Estimated coefficients over time.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds.
    coefficients, std : dict of str to ndarray, shape (n,)
        Estimate and its standard deviation, by name.
    units : dict of str to str
    """

    time: Array
    coefficients: dict[str, Array]
    std: dict[str, Array]
    units: dict[str, str]

    @property
    def values(self) -> Array:
        """The estimates side by side, shape (n, m)."""
        return np.column_stack(list(self.coefficients.values()))

    def table(self) -> str:
        """Return the last estimates as text, one line a coefficient."""
        wide = max(len(name) for name in self.coefficients)
        return "\n".join(
            f"{name:{wide}}  {values[-1]:10.4g} +- {self.std[name][-1]:<8.2g} {self.units[name]}"
            for name, values in self.coefficients.items()
        )

    def plot(self) -> Figure:
        """Return a figure: every coefficient over time, with a band of two standard deviations."""
        rows = -(-len(self.coefficients) // 2)
        figure = Figure(figsize=(9.0, 1.0 + 1.6 * rows), layout="constrained")
        axes = figure.subplots(rows, 2, sharex=True, squeeze=False).ravel()
        for ax, (name, values) in zip(axes, self.coefficients.items(), strict=False):
            band = 2 * self.std[name]
            ax.fill_between(self.time, values - band, values + band, alpha=0.25, linewidth=0)
            ax.plot(self.time, values)
            ax.set(title=name, ylabel=f"[{self.units[name]}]")
        for ax in axes[len(self.coefficients):]:
            ax.set_visible(False)
        figure.supxlabel("time [s]")
        return figure


def estimate_from_log(
    block: Block,
    time: ArrayLike,
    signals: Mapping[str, ArrayLike],
    estimate: Sequence[str] | None = None,
    *,
    hold: Literal["zero", "linear"] = "zero",
    R: ArrayLike = 1e-5,
    Q: ArrayLike = 1e-2,
    P0: ArrayLike = 1e-2,
    x0: Sequence[float] | None = None,
) -> CoefficientHistory:
    """Return the coefficients estimated along a log.

    Parameters
    ----------
    block : Block
    time : array_like, shape (n,)
        Increasing times [s]; steps may differ, the median is the nominal sample time. Behind a gap
        (as :class:`~hovercontrol.logs.Log` has them) the states are taken afresh.
    signals : mapping of str to array_like, shape (n,)
        The states and inputs that h and G need, by name; more are ignored.
    hold : {"zero", "linear"}, optional
        An input holds from its row to the next, or goes there in a line.
    estimate, R, Q, P0, x0
        As for :class:`SampledEstimator`.

    Raises
    ------
    InputError
        As :class:`SampledEstimator`; or if time does not increase, hold is unknown, or signals are
        missing (all are named), of another length or not finite.

    Examples
    --------
    >>> from hovercontrol.vehicles import hoverdemon
    >>> t = np.arange(0.0, 3.0, 0.01)
    >>> signals = {"u": t * 2 / 2.6, "v": 0 * t, "r": 0 * t, "thrust": 0 * t + 2, "rudder": 0 * t}
    >>> plant = hoverdemon().plant().with_values({"plant.thrust": 0.5})
    >>> print(estimate_from_log(plant, t, signals, ["thrust"]).table())
    thrust      0.3848 +- 0.073    m/s^2/N
    """
    if hold not in ("zero", "linear"):
        raise InputError(f"hold must be 'zero' or 'linear', found {hold!r}")
    t = np.asarray(time, dtype=float)
    model = regression(block, estimate)
    rows = Regressors(model).columns(t, signals)
    e = SampledEstimator(block, estimate, dt=float(np.median(np.diff(t))), R=R, Q=Q, P0=P0, x0=x0)
    k, m = len(e.measured), len(e.names)
    values, variances = np.empty((len(t), m)), np.empty((len(t), m))
    steps, gaps = np.diff(t, prepend=t[0] - e.dt), set(gap_rows(t).tolist())
    before = np.roll(rows[k:], 1, axis=1)
    inputs = before if hold == "zero" else 0.5 * (before + rows[k:])
    samples, held = rows[:k].T.tolist(), inputs.T.tolist()
    for i, now in enumerate(t.tolist()):
        if i in gaps:
            e.pause(float(steps[i]))
        values[i] = e.step(now, samples[i], held[i], float(steps[i]))
        variances[i] = np.diag(e.covariance)[-m:]
    return CoefficientHistory(
        t,
        dict(zip(e.names, values.T, strict=True)),
        dict(zip(e.names, np.sqrt(variances).T, strict=True)),
        {name: c.unit for name, c in zip(e.names, model.coefficients, strict=True)},
    )
