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
        self.log = np.tile(rows.log, len(rows.time) - 1)
        self.each = np.broadcast_to(np.asarray(pieces, dtype=np.intp), self._dt.size)
        self.pieces = int(self.each.max())
        self._alike = [(int(n), np.flatnonzero(self.each == n)) for n in np.unique(self.each)]
        self._held: dict[tuple[float, bool], list[SubSteps]] = {}

    def finest(self, parameters: Sequence[float]) -> SubSteps:
        """Return all steps in as many sub-steps as that which is in most."""
        return self._sub_steps(parameters, self.pieces, np.arange(self._dt.size), False)

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


def in_order(of_steps: Array, windows: int) -> Array:
    """Return numbers of sub-steps, shape (..., S, steps * W), in the order of time, (..., steps * S, W)."""
    *before, S, N = of_steps.shape
    found = of_steps.reshape(*before, S, N // windows, windows).swapaxes(-3, -2)
    return found.reshape(*before, -1, windows)
