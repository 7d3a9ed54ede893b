"""Steps from row to row, each divided into as many sub-steps as it needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.commands import divided
from hovercontrol.identification.engine.inputs import Inputs
from hovercontrol.identification.engine.rows import Rows

Counts = NDArray[np.intp]

#: Maximum number of delays whose sub-steps are cached.
HELD = 4


@dataclass(frozen=True, eq=False)
class SubSteps:
    """N steps from row to row, each divided into S sub-steps.

    Attributes
    ----------
    t, h : ndarray, shape (S, N)
        Begin and length of each sub-step [s].
    u : ndarray, shape (n_inputs, S, N)
        Means of the inputs.
    lagged : dict of int to ndarray, shape (S, N)
        Means of the states that follow from the inputs, by index of the state.
    """

    t: Array
    h: Array
    u: Array
    lagged: dict[int, Array]


@dataclass(frozen=True, eq=False)
class Group:
    """Steps with the same number of sub-steps, and the positions of these within their stretch.

    Attributes
    ----------
    at : ndarray of int, shape (N,)
        Indices of the steps.
    steps : SubSteps
        S sub-steps of each.
    place : ndarray of int, shape (S, N)
        Position of each sub-step in its stretch.
    stretch : ndarray of int, shape (N,)
        Stretch of each step.
    """

    at: Counts
    steps: SubSteps
    place: Counts
    stretch: Counts


@dataclass(frozen=True, eq=False)
class InTime(SubSteps):
    """All sub-steps of W stretches in order of time, M for each stretch.

    Stretches with fewer sub-steps are padded with sub-steps of length zero.

    Attributes
    ----------
    begin : ndarray of int, shape (K, W)
        The first sub-step of each step from row to row; the last row holds the number of all sub-steps.
    groups : tuple of Group
    """

    begin: Counts
    groups: tuple[Group, ...]

    def between(self, path: Array) -> Array:
        """Return a path, (K, W, n), interpolated linearly at the middles of the sub-steps, (n, M, W)."""
        x = np.moveaxis(path, 2, 0)
        found = np.broadcast_to(x[:, -1:], (len(x), *self.t.shape)).copy()
        for g in self.groups:
            row = g.at // path.shape[1]
            part = (np.arange(len(g.place))[:, None] + 0.5) / len(g.place)
            before, after = (x[:, r, g.stretch][:, None] for r in (row, row + 1))
            found[:, g.place, g.stretch] = before + part * (after - before)
        return found


class Steps:
    """All N steps from row to row.

    Parameters
    ----------
    pieces : int or ndarray, shape (N,)
        Number of sub-steps of all steps, or of each.

    Attributes
    ----------
    each : ndarray of int, shape (N,)
        Number of sub-steps of each step.
    pieces : int
        The largest of these numbers.
    log : ndarray of int, shape (N,)
        Index of the log of each step.
    """

    def __init__(self, rows: Rows, inputs: Inputs, pieces: int | Counts) -> None:
        self.inputs = inputs
        self._begin, self._dt = rows.time[:-1].ravel(), np.diff(rows.time, axis=0).ravel()
        self._end, self._stretches = rows.time[-1], rows.time.shape[1]
        self.log = np.tile(rows.log, len(rows.time) - 1)
        self.each = np.broadcast_to(np.asarray(pieces, dtype=np.intp), self._dt.size)
        self.pieces = int(self.each.max())
        self._alike = [(int(n), np.flatnonzero(self.each == n)) for n in np.unique(self.each)]
        self._held: dict[tuple[float, bool], tuple[tuple[float, ...], list[SubSteps]]] = {}

    def divided(self, parameters: Sequence[float], late: bool = False) -> list[tuple[Counts, SubSteps]]:
        """Return, for each number of sub-steps, the indices of its steps and their sub-steps.

        The means of the inputs depend on the delay alone, those of the states that follow from them on a few
        parameters. They are cached for the last few delays.

        Parameters
        ----------
        late : bool, optional
            Whether commands whose time of change is uncertain act one standard deviation later.
        """
        key, numbers = (self.inputs.delay(parameters), late), self.inputs.numbers(parameters)
        before, parts = self._held.pop(key, (numbers, []))
        if not parts:
            parts = [self._sub_steps(parameters, *alike, late) for alike in self._alike]
        elif before != numbers:
            parts = [
                replace(s, lagged=self.inputs.lagged(parameters, s.t, s.h, self.log[at], late=late))
                for s, (_, at) in zip(parts, self._alike, strict=True)
            ]
        while len(self._held) >= HELD:
            del self._held[next(iter(self._held))]
        self._held[key] = numbers, parts
        return [(at, s) for (_, at), s in zip(self._alike, parts, strict=True)]

    def in_time(self, parameters: Sequence[float]) -> InTime:
        """Return all sub-steps in order of time."""
        each = self.each.reshape(-1, self._stretches)
        begin = np.concatenate([np.zeros_like(each[:1]), np.cumsum(each, axis=0)])
        shape = int(begin[-1].max()), self._stretches
        t, h = np.broadcast_to(self._end, shape).copy(), np.zeros(shape)
        parts = self.divided(parameters)
        u = np.zeros((len(parts[0][1].u), *shape))
        lagged = {i: np.zeros(shape) for i in parts[0][1].lagged}
        groups = []
        for at, steps in parts:
            row, stretch = np.divmod(at, self._stretches)
            place = begin[row, stretch] + np.arange(len(steps.t))[:, None]
            t[place, stretch], h[place, stretch], u[:, place, stretch] = steps.t, steps.h, steps.u
            for i, values in steps.lagged.items():
                lagged[i][place, stretch] = values
            groups.append(Group(at, steps, place, stretch))
        return InTime(t, h, u, lagged, begin, tuple(groups))

    def _sub_steps(self, parameters: Sequence[float], pieces: int, steps: Counts, late: bool) -> SubSteps:
        """Return the sub-steps of `steps`.

        Two sub-steps meet at the largest change of the commands in a step, so that inputs held constant over
        each sub-step are exact there.
        """
        begin, dt, log = self._begin[steps], self._dt[steps], self.log[steps]
        part, delay = np.full(dt.shape, np.nan), self.inputs.delay(parameters)
        if pieces > 1:
            for k, arrival in enumerate(self.inputs.arrivals(late)):
                own = np.flatnonzero((log == k) & (dt > 0))
                part[own] = arrival.largest_change(begin[own], dt[own], delay, pieces)
        t, h = divided(pieces, part)
        t, h = begin + t * dt, h * dt
        return SubSteps(t, h, *self.inputs.between(parameters, t, h, log, late=late))
