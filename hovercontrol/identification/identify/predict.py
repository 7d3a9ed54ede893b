"""Prediction errors of a model on a log: free-running over the whole log, and over a fixed horizon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.text_table import aligned
from hovercontrol.blocks.backends.shoot import shoot
from hovercontrol.blocks.block import Block
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.engine.coasting import coasting
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import Fit, estimate, first_noise
from hovercontrol.identification.engine.measure import Measured, measure
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.logs import Log, Span

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Maximum number of starts of predictions.
MOST_STARTS = 2000


@checked
@dataclass(frozen=True, eq=False)
class FreeRun:
    """A log and the model's free-running simulation, which uses only the log's inputs.

    Attributes
    ----------
    model, log : str
        Names.
    time : ndarray, shape (n,)
    channels : tuple of str
        Measured channels, and states that the smoother estimated.
    units : mapping
        Unit of each channel.
    measured, simulated : ndarray, shape (n_channels, n)
        NaN where nothing was measured, or nothing was simulated.
    starts : tuple of float
        Times [s] at which the simulation was initialised from the smoothed state.
    rejected : tuple of Span
        Samples rejected as not being motion.
    rms, nrmse : mapping
        Root mean square error of each channel in its unit, and divided by the channel's standard
        deviation. The latter is meaningful for velocities, but not for a heading that winds up. Both are
        infinite if the simulation diverges.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 21)
    >>> found = free_run(decay, Log("demo", t, {"v": np.exp(-t)}))
    >>> found.channels, found.simulated.shape
    (('v',), (1, 21))
    >>> found  # doctest: +ELLIPSIS
    free run of decay over demo
    channel  rms error  unit  fit
    v        ... m/s   100 %
    """

    model: str
    log: str
    time: Array
    channels: tuple[str, ...]
    units: Mapping[str, str]
    measured: Array
    simulated: Array
    starts: tuple[float, ...]
    rejected: tuple[Span, ...]
    rms: Mapping[str, float]
    nrmse: Mapping[str, float]

    def __repr__(self) -> str:
        rows = [("channel", "rms error", "unit", "fit")]
        rows += [(c, f"{self.rms[c]:.3g}", self.units[c], f"{fit:.3g} %") for c, fit in self.fit.items()]
        return "\n".join([f"free run of {self.model} over {self.log}", *aligned(rows)])

    @property
    def fit(self) -> Mapping[str, float]:
        """Fit of each channel [%], as MATLAB's ``compare`` prints it: 100 (1 - nrmse)."""
        return {channel: 100 * (1 - error) for channel, error in self.nrmse.items()}

    def plot(self) -> Figure:
        """Return a figure of the simulation over the measurement."""
        from hovercontrol.identification.identify.display import free_run_figure

        return open_in_pyplot(free_run_figure(self))


@checked
@dataclass(frozen=True)
class Prediction:
    """The prediction error of a model over a horizon.

    Attributes
    ----------
    horizon : float
        Prediction horizon [s].
    starts : int
        Number of rows from which predictions start.
    units, rms, nrmse : mapping
        For each channel: its unit; the root mean square of predicted minus measured; and this divided by the
        channel's standard deviation.
    trivial, share : mapping
        For each channel: the root mean square error of the trivial prediction from the same starts, which
        keeps the velocities constant and moves the pose with them; and the model's error divided by it.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 21)
    >>> found = window_prediction(decay, Log("demo", t, {"v": np.exp(-t)}), horizon=0.5)
    >>> found.horizon, found.starts, dict(found.units)
    (0.5, 16, {'v': 'm/s'})
    """

    horizon: float
    starts: int
    units: Mapping[str, str]
    rms: Mapping[str, float]
    nrmse: Mapping[str, float]
    trivial: Mapping[str, float]

    def __repr__(self) -> str:
        title = f"rms error {self.horizon:g} s ahead from {self.starts} rows, beside that of constant states"
        rows = [("channel", "error", "trivial", "unit", "share")]
        for name, share in self.share.items():
            rows.append(
                (name, f"{self.rms[name]:.3g}", f"{self.trivial[name]:.3g}", self.units[name], f"{share:.3g}")
            )
        return "\n".join([title, *aligned(rows)])

    @property
    def share(self) -> Mapping[str, float]:
        """Error of each channel divided by that of the trivial prediction; above 1 the model is worse."""
        return {c: e / self.trivial[c] if self.trivial[c] > 0 else np.inf for c, e in self.rms.items()}


@checked
def free_run(model: AnyModel, log: Log | Measured, *, restart: bool = False) -> FreeRun:
    """Simulate a model over a log with the log's inputs, from the smoothed state at the first known row.

    Parameters
    ----------
    model : Model, BlockModel or Block
    log : Log
    restart : bool, optional
        Restart after every break (a gap or a loss of sight). By default the simulation restarts only
        after the cuts of a log that is too long to be used as a whole.

    Returns
    -------
    FreeRun

    Raises
    ------
    InputError
        As :func:`~hovercontrol.identification.engine.measure.measure`, or if the log has no known state to
        start from.

    Examples
    --------
    >>> from hovercontrol.blocks.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 21)
    >>> free_run(decay, Log("demo", t, {"v": np.exp(-t)})).rms["v"] < 1e-6
    True
    """
    return run_of(model.name, smoothed(model, log), 0, restart=restart)


def run_of(name: str, fit: Fit, k: int = 0, *, restart: bool = False) -> FreeRun:
    """Return the free run, named `name`, of a fitted model over the k-th of the logs it was fitted to."""
    problem, data = fit.problem, fit.problem.logs[k]
    states = _path(fit, k)
    known = np.asarray(np.isfinite(states).all(axis=0))
    parts = data.segments if restart else data.stretches
    begun = [(first + np.flatnonzero(known[first:stop]), stop) for first, stop in parts]
    ranges = [(int(rows[0]), stop) for rows, stop in begun if rows.size and stop - rows[0] > 1]
    if not ranges:
        raise InputError(f"{data.name}: no measured state from which a simulation could start")
    names, reference = _reference(fit, k)
    simulated, ran = np.full(reference.shape, np.nan), np.zeros(data.time.size, dtype=bool)
    longest = problem.longest_piece
    for a, b in ranges:
        time = data.time[a:b] - data.origin
        pieces = np.ceil(np.diff(time) / longest - 1e-9).astype(int).clip(1)
        at = np.concatenate([[0], np.cumsum(pieces)])
        h = np.repeat(np.diff(time) / pieces, pieces)
        t = np.repeat(time[:-1], pieces) + h * (np.arange(h.size) - np.repeat(at[:-1], pieces))
        x = _simulate(fit, problem.block, states[:, a : a + 1], t[:, None], h[:, None], np.array([k]))[
            at, :, 0
        ].T
        simulated[:, a:b] = _channels(fit, k, names, x, time)
        ran[a:b] = True
    rms, nrmse = _errors(names, simulated[:, ran], reference[:, ran])
    units = {c: problem.block.signal(c).unit for c in names}
    starts = tuple(float(data.time[a]) for a, _ in ranges)
    return FreeRun(
        name, data.name, data.time, names, units, reference, simulated, starts, data.rejected, rms, nrmse
    )


@checked
def window_prediction(model: AnyModel, log: Log | Measured, horizon: float = 1.0) -> Prediction:
    """Return the error of predictions over `horizon` seconds from the smoothed state.

    Predictions start from every row that is followed by `horizon` seconds without a break; in a long log,
    from 2000 evenly spaced rows.

    Parameters
    ----------
    model : Model, BlockModel or Block
    log : Log
    horizon : float, optional
        Prediction horizon [s].

    Returns
    -------
    Prediction

    Raises
    ------
    InputError
        As :func:`~hovercontrol.identification.engine.measure.measure`, or if the log is shorter than the
        horizon.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 21)
    >>> window_prediction(decay, Log("demo", t, {"v": np.exp(-t)}), horizon=0.5).rms["v"] < 1e-6
    True
    """
    return prediction(smoothed(model, log), horizon)


def prediction(fit: Fit, horizon: float, k: int | None = None) -> Prediction:
    """Return the prediction error of a fitted model over `horizon` seconds on its k-th log, or on all."""
    problem = fit.problem
    which = range(len(problem.logs)) if k is None else (k,)
    begin, states, t0, t1, reference = [], [], [], [], []
    names = tuple(dict.fromkeys(c for i in which for c in _reference(fit, i)[0]))
    for i in which:
        data, path = problem.logs[i], _path(fit, i)
        first, last = _starts(data, path, horizon)
        own, seen = _reference(fit, i)
        rows = dict(zip(own, seen[:, last], strict=True))
        begin.append(np.full(first.size, i))
        states.append(path[:, first])
        t0.append(data.time[first] - data.origin)
        t1.append(data.time[last] - data.origin)
        reference.append(np.array([rows.get(c, np.full(last.size, np.nan)) for c in names]))
    log, x0, y = np.concatenate(begin), np.concatenate(states, axis=1), np.concatenate(reference, axis=1)
    if not log.size:
        logs = ", ".join(problem.logs[i].name for i in which)
        raise InputError(f"{logs}: no stretch of {horizon:g} s without a break to predict")
    keep = np.unique(np.linspace(0, log.size - 1, min(log.size, MOST_STARTS)).astype(int))
    log, x0, y = log[keep], x0[:, keep], y[:, keep]
    start, stop = np.concatenate(t0)[keep], np.concatenate(t1)[keep]
    t, h = problem.divided(start, stop)

    def errors(of: Block) -> tuple[dict[str, float], dict[str, float]]:
        x = _simulate(fit, of, x0, t, h, log)[-1]
        found = np.empty(y.shape)
        for i in np.unique(log).tolist():
            own = log == i
            found[:, own] = _channels(fit, i, names, x[:, own], stop[own])
        return _errors(names, found, y)

    rms, nrmse = errors(problem.block)
    trivial, _ = errors(coasting(problem.block))
    units = {c: problem.block.signal(c).unit for c in names}
    return Prediction(horizon, log.size, units, rms, nrmse, trivial)


def smoothed(model: AnyModel, log: Log | Measured) -> Fit:
    """Return the fit of a model with fixed coefficients to a log: only path and noise levels are fitted.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.identification.engine.measure.measure`, or if there are too few rows or the
        model diverges.
    """
    subject = as_model(model)
    block = subject.plant()
    data = gather(subject, [log if isinstance(log, Measured) else measure(block, log)])
    problem = Problem(subject, data, ())
    with threadpool_limits(1, "blas"):
        try:
            prior = prior_of(problem, subject)
            return estimate(problem, prior, first_noise(problem), frozen=True, gate=True)
        except FloatingPointError:  # the model diverges: smooth with constant velocities instead
            plain = copy(problem)
            plain.block = coasting(problem.block)
            found = estimate(plain, prior_of(plain, subject), first_noise(plain), frozen=True, gate=True)
            own = copy(found.problem)
            own.block = problem.block
            return replace(found, problem=own)


def _path(fit: Fit, k: int) -> Array:
    """Return the smoothed states at the rows of a log, shape (n_states, n); NaN where there are none."""
    rows = fit.problem.rows
    states = np.full((fit.path.shape[2], fit.problem.logs[k].time.size), np.nan)
    for w in np.flatnonzero(rows.log == k):
        own = rows.at[:, w] >= 0
        states[:, rows.at[own, w]] = fit.path[own, w].T
    return states


def _starts(data: Measured, path: Array, horizon: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows from which predictions over `horizon` can start, and the rows at which they end."""
    first, last = [], []
    for a, b in data.segments:
        time = data.time[a:b]
        half = float(np.median(np.diff(time))) / 2 if time.size > 1 else 0.0
        ends = np.searchsorted(time, time + (horizon - half))
        good = (ends < b - a) & (ends > np.arange(b - a)) & np.isfinite(path[:, a:b]).all(axis=0)
        first.append(a + np.flatnonzero(good))
        last.append(a + ends[good])
    none = np.zeros(0, dtype=np.intp)
    return np.concatenate([none, *first]), np.concatenate([none, *last])


def _reference(fit: Fit, k: int) -> tuple[tuple[str, ...], Array]:
    """Return the reference for predictions: measured channels without outliers, then smoothed states."""
    problem, data = fit.problem, fit.problem.logs[k]
    values = data.values.copy()
    for w in np.flatnonzero(problem.rows.log == k):
        own = problem.rows.at[:, w] >= 0
        for c, channel in enumerate(data.channels):
            out = own & ~problem.seen[:, w, problem.rows.channels.index(channel)]
            values[c, problem.rows.at[out, w]] = np.nan
    unbroken = np.zeros(data.time.size, dtype=bool)
    for a, b in data.segments:
        unbroken[a:b] = True
    names, rows = list(data.channels), list(values)
    for state, row in zip(problem.block.states, data.states, strict=False):
        if state.name not in names and not np.isnan(row).any():
            names.append(state.name)
            rows.append(np.where(unbroken, row, np.nan))
    return tuple(names), np.array(rows)


def _channels(fit: Fit, k: int, names: Sequence[str], x: Array, t: Array) -> Array:
    """Return channels and states by name, computed from states of a log, shape (len(names), N)."""
    problem = fit.problem
    log = np.full(t.size, k)
    found = dict(zip([s.name for s in problem.block.states], x, strict=True))
    measured = problem.channels_at(x, problem.parameters(fit.p), t, log)
    found |= dict(zip(problem.rows.channels, measured, strict=True))
    return np.array([found[c] for c in names])


def _simulate(fit: Fit, block: Block, x0: Array, t: Array, h: Array, log: NDArray[np.intp]) -> Array:
    """Return the states at the start and after each sub-step, shape (S + 1, n_states, N).

    Parameters
    ----------
    fit : Fit
        Source of the coefficients and the logs' inputs.
    x0 : ndarray, shape (n_states, N)
        Initial states.
    t, h : ndarray, shape (S, N)
        Start time and length of each sub-step [s].
    log : ndarray of int, shape (N,)
    """
    problem, shape = fit.problem, (1, *t.shape)
    parameters = problem.parameters(fit.p)
    u, lagged = problem.inputs.between(parameters, t.reshape(1, -1), h.ravel(), np.tile(log, len(t)))
    known = {i: v.reshape(shape) for i, v in lagged.items()}
    with np.errstate(all="ignore"):
        return shoot(block, t[None], h, u.reshape(len(u), *shape), known, parameters, x0, euler=problem.euler)


def _errors(
    names: Sequence[str], simulated: Array, reference: Array
) -> tuple[dict[str, float], dict[str, float]]:
    # rms = sqrt(mean (y - z)^2),  nrmse = rms / std(z), with y simulated and z measured.
    rms, nrmse = {}, {}
    for name, y, z in zip(names, simulated, reference, strict=True):
        seen = np.isfinite(z)
        y, z = y[seen], z[seen]
        finite = z.size > 0 and np.isfinite(y).all()
        rms[name] = float(np.sqrt(np.mean((y - z) ** 2))) if finite else np.inf
        spread = float(np.std(z)) if z.size else 0.0
        nrmse[name] = rms[name] / spread if spread > 0 else np.inf
    return rms, nrmse
