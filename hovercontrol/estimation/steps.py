"""Steps from row to row in sub-steps, as many as each needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.commands import divided
from hovercontrol.estimation.inputs import Inputs
from hovercontrol.estimation.rows import Rows

Array = NDArray[np.float64]
Counts = NDArray[np.intp]

#: Delays whose sub-steps are kept, at most.
HELD = 4


@dataclass(frozen=True, eq=False)
class SubSteps:
    """Steps from row to row in pieces: S of each of N steps.

    Attributes
    ----------
    t, h : ndarray, shape (S, N)
        Begin and length [s].
    u : ndarray, shape (n_inputs, S, N)
        Means of the inputs.
    lagged : dict of int to ndarray, shape (S, N)
        Means of states that follow from the inputs.
    """

    t: Array
    h: Array
    u: Array
    lagged: dict[int, Array]


@dataclass(frozen=True, eq=False)
class Group:
    """Steps that are in equally many sub-steps, and where these are among all of their stretch.

    Attributes
    ----------
    at : ndarray of int, shape (N,)
        Which steps.
    steps : SubSteps
        In S sub-steps each.
    place : ndarray of int, shape (S, N)
        Of each sub-step in its stretch.
    stretch : ndarray of int, shape (N,)
    """

    at: Counts
    steps: SubSteps
    place: Counts
    stretch: Counts


@dataclass(frozen=True, eq=False)
class InTime(SubSteps):
    """All sub-steps of W stretches in order of time, M each: shorter ones end in sub-steps of length zero.

    Attributes
    ----------
    begin : ndarray of int, shape (K, W)
        The first sub-step of each step from row to row, and behind the last row's the number of all.
    groups : tuple of Group
    """

    begin: Counts
    groups: tuple[Group, ...]

    def between(self, path: Array) -> Array:
        """Return a path in the middles of sub-steps, straight from row to row, (n, M, W) of (K, W, n)."""
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
    rows : Rows
    inputs : Inputs
    pieces : int or ndarray, shape (N,)
        In how many sub-steps all are, or each.

    Attributes
    ----------
    each : ndarray of int, shape (N,)
        In how many sub-steps each is.
    pieces : int
        The largest of these.
    log : ndarray of int, shape (N,)
        In which log each is.
    """

    def __init__(self, rows: Rows, inputs: Inputs, pieces: int | Counts) -> None:
        self.inputs = inputs
        self._begin, self._dt = rows.time[:-1].ravel(), np.diff(rows.time, axis=0).ravel()
        self._end, self._stretches = rows.time[-1], rows.time.shape[1]
        self.log = np.tile(rows.log, len(rows.time) - 1)
        self.each = np.broadcast_to(np.asarray(pieces, dtype=np.intp), self._dt.size)
        self.pieces = int(self.each.max())
        self._alike = [(int(n), np.flatnonzero(self.each == n)) for n in np.unique(self.each)]
        self._held: dict[tuple[float, bool], list[SubSteps]] = {}

    def divided(self, parameters: Sequence[float], late: bool = False) -> list[tuple[Counts, SubSteps]]:
        """Return steps that are in equally many sub-steps: which, and these.

        Means of inputs change with the delay alone: those of the last few are kept.

        Parameters
        ----------
        parameters : sequence of float
        late : bool, optional
            Whether commands act later by what is not sure of when they changed.
        """
        key = self.inputs.delay(parameters), late
        if key in self._held:
            parts = [
                replace(s, lagged=self.inputs.lagged(parameters, s.t, s.h, self.log[at], late=late))
                for s, (_, at) in zip(self._held[key], self._alike, strict=True)
            ]
        else:
            parts = [self._sub_steps(parameters, *alike, late) for alike in self._alike]
            while len(self._held) >= HELD:
                del self._held[next(iter(self._held))]
            self._held[key] = parts
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
        """Return sub-steps. Two meet where commands change most in a step: held inputs are exact then."""
        begin, dt, log = self._begin[steps], self._dt[steps], self.log[steps]
        part, delay = np.full(dt.shape, np.nan), self.inputs.delay(parameters)
        if pieces > 1:
            for k, arrival in enumerate(self.inputs.arrivals(late)):
                own = np.flatnonzero((log == k) & (dt > 0))
                part[own] = arrival.largest_change(begin[own], dt[own], delay, pieces)
        t, h = divided(pieces, part)
        t, h = begin + t * dt, h * dt
        return SubSteps(t, h, *self.inputs.between(parameters, t, h, log, late=late))
