"""Shooting: a Block simulated over many windows of logs at once, for many perturbed copies at once.

Classical Runge-Kutta of fourth order with fixed sub-steps between the rows of a log; inputs hold
from row to row. One call of the Block's vectorised right-hand side advances all windows and all
copies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.identify.measure import Measured

Array = NDArray[np.float64]

#: Longest sub-step [s]: at a yaw rate of 16 rad/s the path is right to one part in ten thousand.
STEP = 0.01

#: Shortest sub-step [s], whatever the friction.
SHORTEST = 0.001


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of logs side by side, the shorter ones padded with their last row.

    Attributes
    ----------
    time : ndarray, shape (W, K)
        Seconds since the start of the log each window is from.
    inputs : ndarray, shape (n_inputs, W, K)
    values : ndarray, shape (n_channels, W, K)
        Measurements; NaN where there is none, and in the padding.
    start : ndarray, shape (n_states, W)
        A guess of the states at the first row.
    rows : ndarray of int, shape (W,)
        Rows of each window.
    """

    time: Array
    inputs: Array
    values: Array
    start: Array
    rows: NDArray[np.intp]


def cut(
    logs: Sequence[Measured],
    states: Sequence[Array],
    channels: Sequence[str],
    ranges: Sequence[tuple[int, int, int]],
) -> Windows:
    """Cut windows out of logs.

    Parameters
    ----------
    logs : sequence of Measured
    states : sequence of ndarray, shape (n_states, n)
        The states of each log, every one finite (:func:`known_states`).
    channels : sequence of str
        Rows of ``values``; a log that lacks one has NaN there.
    ranges : sequence of (int, int, int)
        Of each window: index of the log, first row, row behind the last.
    """
    rows = np.array([stop - first for _, first, stop in ranges], dtype=np.intp)
    K = int(rows.max())
    time = np.empty((len(ranges), K))
    inputs = np.empty((len(logs[0].inputs), len(ranges), K))
    values = np.full((len(channels), len(ranges), K), np.nan)
    start = np.empty((len(states[0]), len(ranges)))
    for w, (i, first, stop) in enumerate(ranges):
        log, at = logs[i], np.minimum(np.arange(first, first + K), stop - 1)
        time[w] = log.time[at] - log.origin
        inputs[:, w] = log.inputs[:, at]
        for c, channel in enumerate(channels):
            if channel in log.channels:
                measured = log.values[log.channels.index(channel), first:stop]
                values[c, w, : stop - first] = measured
        start[:, w] = states[i][:, first]
    return Windows(time, inputs, values, start, rows)


class Shooter:
    """Simulates a Block over windows; the schedule of sub-steps is made once.

    Parameters
    ----------
    block : Block
    windows : Windows
    channels : sequence of str
        States or outputs of the Block, to be computed.
    step : float
        Longest sub-step [s].
    """

    def __init__(self, block: Block, windows: Windows, channels: Sequence[str], step: float) -> None:
        self.block, self.windows = block, windows
        self._derivatives, self._outputs = block.to_numpy().vector
        states = [s.name for s in block.states]
        outputs = [s.name for s in block.outputs]
        self._pick = [(states.index(c), True) if c in states else (outputs.index(c), False) for c in channels]
        self._schedule(step)

    def _schedule(self, step: float) -> None:
        dt = np.diff(self.windows.time, axis=1)
        pieces = np.ceil(dt / step - 1e-9).astype(int)
        W, S = len(dt), int(pieces.sum(axis=1).max(initial=0))
        self._interval = np.zeros((S, W), dtype=np.intp)
        self._h, self._t = np.zeros((S, W)), np.zeros((S, W))
        row = np.full((S, W), -1)
        for w, count in enumerate(pieces):
            k = np.repeat(np.arange(count.size), count)
            inside = np.arange(k.size) - np.repeat(np.cumsum(count) - count, count)
            h = (dt[w] / np.maximum(count, 1))[k]
            self._interval[: k.size, w], self._h[: k.size, w] = k, h
            self._t[: k.size, w] = self.windows.time[w, k] + h * inside
            row[: k.size, w] = np.where(inside == count[k] - 1, k + 1, -1)
        self._rows = [self._record(r) for r in row]

    @staticmethod
    def _record(row: NDArray[np.intp]) -> int | tuple[NDArray[np.intp], NDArray[np.intp]] | None:
        """Return where states go after a sub-step: one row for all, rows and windows, nowhere."""
        w = np.flatnonzero(row >= 0)
        if not w.size:
            return None
        same = w.size == row.size and (row == row[0]).all()
        return int(row[0]) if same else (row[w], w)

    def states(self, x0: Array, parameters: Sequence[float | Array]) -> Array:
        """Return the states at every row.

        Parameters
        ----------
        x0 : ndarray, shape (n_states, L, W)
            At the first row of each window, in L copies.
        parameters : sequence of float or ndarray of shape (L, 1)
            Every parameter of the Block, in order.

        Returns
        -------
        ndarray, shape (K, n_states, L, W)
            Infinite or NaN where the simulation runs away.
        """
        X = np.empty((self.windows.time.shape[1], *x0.shape))
        X[:] = x0
        x = x0.copy()
        columns = np.arange(x0.shape[2])
        with np.errstate(all="ignore"):
            steps = zip(self._h, self._t, self._interval, self._rows, strict=True)
            for h, t, interval, row in steps:
                u = self.windows.inputs[:, columns, interval]
                k1 = self._slope(t, x, u, parameters)
                k2 = self._slope(t + h / 2, x + (h / 2) * k1, u, parameters)
                k3 = self._slope(t + h / 2, x + (h / 2) * k2, u, parameters)
                k4 = self._slope(t + h, x + h * k3, u, parameters)
                k2 += k3
                k2 *= 2.0
                k2 += k1
                k2 += k4
                x = x + (h / 6) * k2
                if isinstance(row, int):
                    X[row] = x
                elif row is not None:
                    X[row[0], :, :, row[1]] = np.moveaxis(x[:, :, row[1]], 2, 0)
        return X

    def _slope(self, t: Array, x: Array, u: Array, parameters: Sequence[float | Array]) -> Array:
        k = np.empty_like(x)
        for i, value in enumerate(self._derivatives(t, x, u, parameters)):
            k[i] = value
        return k

    def channels(self, x0: Array, parameters: Sequence[float | Array]) -> Array:
        """Return the channels at every row, (K, n_channels, L, W); arguments as for `states`."""
        X = self.states(x0, parameters)
        Y = np.empty((X.shape[0], len(self._pick), *X.shape[2:]))
        computed: Sequence[Array] = ()
        if not all(is_state for _, is_state in self._pick):
            time = self.windows.time.T[:, None, :]
            u = np.moveaxis(self.windows.inputs, 2, 1)[:, :, None, :]
            with np.errstate(all="ignore"):
                computed = self._outputs(time, np.moveaxis(X, 1, 0), u, parameters)
        for c, (i, is_state) in enumerate(self._pick):
            Y[:, c] = X[:, i] if is_state else computed[i]
        return Y


def known_states(block: Block, log: Measured, parameters: Sequence[float], step: float = STEP) -> Array:
    """Return all states at every row of a log: measured ones as they are, others simulated.

    States that the log does not tell (a fan that lags) start from their start value at the
    beginning of each segment and follow the Block's equations while the others are held to the
    measurement.

    Returns
    -------
    ndarray, shape (n_states, n)
    """
    known = np.array([not np.isnan(row).any() for row in log.states], dtype=bool)
    start = np.array([s.start for s in block.states])
    states = np.where(known[:, None], log.states, start[:, None])
    if known.all() or not block.states:
        return states
    rest = np.flatnonzero(~known)
    slope = block.to_numpy().vector[0]
    with np.errstate(all="ignore"):
        for first, stop in log.segments:
            x = states[:, first].copy()
            for k in range(first, stop - 1):
                x[known] = states[known, k]
                t, dt = log.time[k] - log.origin, log.time[k + 1] - log.time[k]
                u = log.inputs[:, k]
                count = int(np.ceil(dt / step - 1e-9))
                for i in range(count):
                    h = dt / count
                    k1 = np.array(slope(t + i * h, x, u, parameters), dtype=float)
                    middle = x + h / 2 * k1
                    k2 = np.array(slope(t + (i + 0.5) * h, middle, u, parameters), dtype=float)
                    x = x + h * k2
                states[rest, k + 1] = np.where(np.isfinite(x[rest]), x[rest], start[rest])
                x[rest] = states[rest, k + 1]
    return states


def stable_step(block: Block, windows: Windows, parameters: Sequence[float], longest: float) -> float:
    """Return a sub-step [s] at which Runge-Kutta neither chatters nor smears in stiff dry friction.

    One over the largest eigenvalue of the Block's state Jacobian at the windows' starts, and there
    with each state that changes sign set to zero, where the slope of regularised friction is
    largest.
    """
    x = windows.start
    u, t = windows.inputs[:, :, 0], windows.time[:, 0]
    some = np.unique(np.linspace(0, len(t) - 1, 200).astype(int))
    x, u, t = x[:, some], u[:, some], t[some]
    crossing = np.flatnonzero((x.min(axis=1) < 0) & (x.max(axis=1) > 0))
    points = [x]
    for i in crossing:
        at_zero = x.copy()
        at_zero[i] = 0.0
        points.append(at_zero)
    params = dict(zip(block.default_parameters, parameters, strict=True))
    fastest = 0.0
    for point in points:
        J = block.to_numpy().jacobian(t, point, u, params)
        J = np.moveaxis(J.reshape(*J.shape[:2], -1), 2, 0)
        J = J[np.isfinite(J).all(axis=(1, 2))]
        if J.size:
            fastest = max(fastest, float(np.abs(np.linalg.eigvals(J)).max()))
    return float(np.clip(1.0 / max(fastest, 1e-12), min(SHORTEST, longest), longest))
