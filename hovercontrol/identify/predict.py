"""How well a model predicts a log: running free over all of it, and some seconds ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from hovercontrol.block import Block
from hovercontrol.errors import InputError
from hovercontrol.expressions import Expressions
from hovercontrol.identify.measure import Array, Measured, measure
from hovercontrol.identify.shooting import STEP, Shooter, Windows, cut, known_states, stable_step
from hovercontrol.logs import Log, Span
from hovercontrol.model import Model

#: Rows of all predictions together, and starts, at most.
MOST_PREDICTED, MOST_STARTS = 400_000, 2000


@dataclass(frozen=True, eq=False)
class FreeRun:
    """A log beside the model's simulation from the log's inputs alone.

    Attributes
    ----------
    model, log : str
        Names.
    time : ndarray, shape (n,)
    channels : tuple of str
        What was measured, and states that the smoother saw.
    units : mapping
        Of each channel.
    measured, simulated : ndarray, shape (n_channels, n)
        NaN where nothing was measured, or not simulated.
    starts : tuple of float
        Times [s] at which the simulation was set to the measurement.
    rejected : tuple of Span
        Samples that are no motion.
    rms, nrmse : mapping
        Root mean square error of each channel in its unit, and over the root mean square of the
        channel about its mean (which says something of velocities, nothing of a heading that
        winds up); infinite where the simulation runs away.
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


@dataclass(frozen=True)
class Prediction:
    """The error of a model some seconds ahead.

    Attributes
    ----------
    horizon : float
        How far ahead [s].
    starts : int
        From how many rows.
    units, rms, nrmse : mapping
        Of each channel: its unit; root mean square of predicted minus measured; that over the root
        mean square of the channel about its mean.
    trivial, share : mapping
        Of each channel: the error, likewise, of the trivial prediction from the same starts, that
        velocities stay as they are and the pose moves on with them; the model's error over it.
    """

    horizon: float
    starts: int
    units: Mapping[str, str]
    rms: Mapping[str, float]
    nrmse: Mapping[str, float]
    trivial: Mapping[str, float]

    @property
    def share(self) -> Mapping[str, float]:
        """Error of each channel over that of the trivial prediction: above 1 it is worse."""
        return {c: e / self.trivial[c] if self.trivial[c] > 0 else np.inf for c, e in self.rms.items()}


def free_run(model: Model | Block, log: Log | Measured, *, restart: bool = False) -> FreeRun:
    """Simulate a model over a log from the first row that is known, on the log's inputs alone.

    Parameters
    ----------
    model : Model or Block
    log : Log
    restart : bool, optional
        Start again from the measurement behind every break (a gap, a loss of sight). Without it
        only behind the cuts of a log too long to be taken whole.

    Returns
    -------
    FreeRun

    Raises
    ------
    InputError
        As :func:`~hovercontrol.identify.measure.measure`, or if nothing in the log is known.

    Examples
    --------
    >>> from hovercontrol.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=1.0)
    >>> decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 21)
    >>> free_run(decay, Log("demo", t, {"v": np.exp(-t)})).rms["v"] < 1e-9
    True
    """
    block, data, states = _prepare(model, log)
    if restart:
        ranges = [(0, a, b) for a, b in data.segments if b - a > 1]
    else:
        known = [
            min((a for a, _ in data.segments if first <= a < stop), default=stop)
            for first, stop in data.stretches
        ]
        ranges = [(0, a, stop) for a, (_, stop) in zip(known, data.stretches, strict=True) if stop - a > 1]
    if not ranges:
        raise InputError(f"{data.name}: nothing is known from which a simulation could start")
    names, reference = _reference(block, data)
    cuts = cut([data], [states], data.channels, ranges)
    Y = _simulate(block, cuts, names, _probes(data, states))
    simulated = np.full(reference.shape, np.nan)
    for w, (_, a, b) in enumerate(ranges):
        simulated[:, a:b] = Y[: b - a, :, w].T
    ran = np.zeros(data.time.size, dtype=bool)
    for _, a, b in ranges:
        ran[a:b] = True
    rms, nrmse = _errors(names, simulated[:, ran], reference[:, ran])
    return FreeRun(
        model.name,
        data.name,
        data.time,
        names,
        {c: block.signal(c).unit for c in names},
        reference,
        simulated,
        tuple(float(data.time[a]) for _, a, _ in ranges),
        data.rejected,
        rms,
        nrmse,
    )


def window_prediction(model: Model | Block, log: Log | Measured, horizon: float = 1.0) -> Prediction:
    """Return the error of a model `horizon` seconds ahead of the measured or smoothed state.

    Every row of the log is a start (of a long log, 2000 rows spread evenly) from which `horizon`
    seconds follow without a break. States that were not measured are those that the model itself
    gives.

    Parameters
    ----------
    model : Model or Block
    log : Log
    horizon : float, optional
        How far ahead [s].

    Returns
    -------
    Prediction

    Raises
    ------
    InputError
        As :func:`~hovercontrol.identify.measure.measure`, or if the log is shorter than the
        horizon.
    """
    block, data, states = _prepare(model, log)
    ranges = []
    for a, b in data.segments:
        time = data.time[a:b]
        half = np.median(np.diff(time)) / 2 if time.size > 1 else 0.0
        ends = np.searchsorted(time, time + (horizon - half))
        ranges += [(0, a + i, a + int(end) + 1) for i, end in enumerate(ends) if i < end < b - a]
    if not ranges:
        raise InputError(f"{data.name}: no stretch of {horizon:g} s without a break to predict")
    longest = max(b - a for _, a, b in ranges)
    keep = min(len(ranges), MOST_STARTS, max(1, MOST_PREDICTED // longest))
    ranges = [ranges[int(i)] for i in np.linspace(0, len(ranges) - 1, keep)]
    names, reference = _reference(block, data)
    cuts = cut([data], [states], data.channels, ranges)
    ends = np.array([b - 1 for _, _, b in ranges])
    last = np.array([b - a - 1 for _, a, b in ranges])

    def errors(of: Block) -> tuple[dict[str, float], dict[str, float]]:
        Y = _simulate(of, cuts, names, _probes(data, states))
        return _errors(names, Y[last, :, np.arange(len(ranges))].T, reference[:, ends])

    rms, nrmse = errors(block)
    trivial, _ = errors(coasting(block))
    units = {c: block.signal(c).unit for c in names}
    return Prediction(horizon, len(ranges), units, rms, nrmse, trivial)


def coasting(block: Block) -> Block:
    """Return the Block in which every state stays, but those that follow from others by geometry alone.

    Those are the states whose derivative holds neither a parameter nor an input: a pose moves on
    with velocities that stay.

    Examples
    --------
    >>> from hovercontrol.vehicles import hoverdemon
    >>> print(coasting(hoverdemon().plant()).equations())
    x' = u*cos(psi) - v*sin(psi)
    y' = u*sin(psi) + v*cos(psi)
    psi' = r
    u' = 0
    v' = 0
    r' = 0
    """
    driven = {s.symbol for s in (*block.parameters, *block.inputs)}
    return block.unchecked(
        derivatives=Expressions(
            (name, sp.Integer(0) if block.expand(e).free_symbols & driven else e)
            for name, e in block.derivatives.items()
        )
    )


def _prepare(model: Model | Block, log: Log | Measured) -> tuple[Block, Measured, Array]:
    block = model.plant() if isinstance(model, Model) else model
    data = log if isinstance(log, Measured) else measure(block, log)
    return block, data, known_states(block, data, block.parameter_values())


def _reference(block: Block, data: Measured) -> tuple[tuple[str, ...], Array]:
    """Return what predictions are compared with: measured channels, then smoothed states."""
    seen = np.zeros(data.time.size, dtype=bool)
    for a, b in data.segments:
        seen[a:b] = True
    names, rows = list(data.channels), list(data.values)
    for state, row in zip(block.states, data.states, strict=True):
        if state.name not in names and not np.isnan(row).any():
            names.append(state.name)
            rows.append(np.where(seen, row, np.nan))
    return tuple(names), np.array(rows)


def _probes(data: Measured, states: Array) -> Windows:
    """Return up to 200 rows spread over a log, at which the sub-step is chosen."""
    rows = np.unique(np.linspace(0, data.time.size - 1, 200).astype(int))
    return cut([data], [states], (), [(0, int(k), int(k) + 1) for k in rows])


def _simulate(block: Block, windows: Windows, names: Sequence[str], probes: Windows) -> Array:
    """Return the channels over windows, shape (K, n_channels, W)."""
    parameters = block.parameter_values()
    step = stable_step(block, probes, parameters, STEP)
    shooter = Shooter(block, windows, names, step)
    return shooter.channels(windows.start[:, None, :], parameters)[:, :, 0]


def _errors(
    names: Sequence[str], simulated: Array, reference: Array
) -> tuple[dict[str, float], dict[str, float]]:
    rms, nrmse = {}, {}
    for name, y, z in zip(names, simulated, reference, strict=True):
        seen = np.isfinite(z)
        y, z = y[seen], z[seen]
        finite = z.size > 0 and np.isfinite(y).all()
        rms[name] = float(np.sqrt(np.mean((y - z) ** 2))) if finite else np.inf
        spread = float(np.std(z)) if z.size else 0.0
        nrmse[name] = rms[name] / spread if spread > 0 else np.inf
    return rms, nrmse
