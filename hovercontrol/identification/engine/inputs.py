"""The commands of several logs as inputs of one Block: their means, and the states that follow from them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from hovercontrol.base.arrays import Array, Indices
from hovercontrol.blocks.block import Block
from hovercontrol.identification.engine.commands import Arrival, by_trial, command_times, input_states
from hovercontrol.identification.engine.measure import Measured
from hovercontrol.identification.engine.subject import Subject, timing


class Inputs:
    """The commands of several logs, each value held from its row to the next.

    Parameters
    ----------
    model : Model or BlockModel
        The model of the Block.
    tempo : float, optional
        As for :class:`.Arrival`.

    Attributes
    ----------
    known : tuple of int
        States of the Block that follow from the commands alone.
    unsure : list of ndarray
        For each log, the times of commands whose time of change is uncertain [s]; empty if there are none.
    """

    def __init__(self, block: Block, model: Subject, logs: Sequence[Measured], tempo: float = 1.0) -> None:
        motion, self._sampled = model.motion, model.period > 0.0
        self._take(block, model)
        times = [(t - m.origin, std) for m, (t, std) in ((m, command_times(m)) for m in logs)]
        self._likely = [
            Arrival(block, *by_trial(m, t), motion, tempo) for m, (t, _) in zip(logs, times, strict=True)
        ]
        unsure = any((std > 0).any() for _, std in times)
        self.unsure = [t[std > 0] for t, std in times if unsure]
        self._late = [
            Arrival(block, *by_trial(m, t + std), motion, tempo)
            for m, (t, std) in zip(logs, times, strict=True)
            if unsure
        ]

    def _take(self, block: Block, model: Subject) -> None:
        keys = [p.name for p in block.parameters]
        self.block, self._timing = block, [keys.index(name) for name in timing(model) if name]
        self.known = input_states(block, model.motion)

    def of(self, block: Block, model: Subject) -> Inputs:
        """Return the same commands as inputs of another model's Block."""
        other = copy(self)
        other._take(block, model)
        other._likely, other._late = (
            [one.of(block, model.motion) for one in arrivals] for arrivals in (self._likely, self._late)
        )
        return other

    def delay(self, parameters: Sequence[float]) -> float:
        """Return the delay of the commands [s]."""
        return sum(parameters[at] for at in self._timing)

    def numbers(self, parameters: Sequence[float]) -> tuple[float, ...]:
        """Return the parameters on which the states that follow from the commands depend."""
        return self._likely[0].numbers(parameters)

    def arrivals(self, late: bool = False) -> list[Arrival]:
        """Return the commands of each log; if `late`, uncertain ones one standard deviation later."""
        return self._late if late else self._likely

    def at(self, parameters: Sequence[float], t: Array, log: Indices) -> Array:
        """Return the inputs at given times, shape (n_inputs, ...).

        Parameters
        ----------
        t, log : ndarray, shape (...)
            Time since the start of the log [s], and index of the log.
        """
        u = np.empty((len(self.block.inputs), *t.shape))
        for k, arrival in enumerate(self._likely):
            own = log == k
            u[:, own] = arrival.at(t[own], self.delay(parameters))
        return u

    def between(
        self, parameters: Sequence[float], t: Array, h: Array, log: Indices, *, late: bool = False
    ) -> tuple[Array, dict[int, Array]]:
        """Return the means of inputs, and of states that follow from them, in S consecutive sub-steps.

        Parameters
        ----------
        t : ndarray, shape (S, N)
            Begins of the sub-steps, since the start of each log [s].
        h : ndarray, shape (S, N) or (N,)
            Lengths of the sub-steps [s]; the means over a length of 0 are 0.
        log : ndarray of int, shape (N,)
            Index of the log.
        late : bool, optional
            Whether commands whose time of change is uncertain act one standard deviation later.

        Returns
        -------
        ndarray, shape (n_inputs, S, N)
        dict of int to ndarray, shape (S, N)
        """
        means = self.means(self.delay(parameters), t, h, log, late=late)
        return means, self.lagged(parameters, t, h, log, late=late)

    def means(self, delay: float, t: Array, h: Array, log: Indices, *, late: bool = False) -> Array:
        """Return the means of the inputs, delayed by `delay` [s]; see :meth:`between`."""
        # mean of u over [t, t + h] = (U(t + h) - U(t)) / h, with the integral U of the delayed input
        u, edges, width = np.empty((len(self.block.inputs), *t.shape)), *_edges(t, h)
        for k, arrival in enumerate(self.arrivals(late)):
            own = np.flatnonzero(log == k)
            u[..., own] = np.diff(arrival.integral(edges[:, own], delay), axis=1) / width[:, own]
        return u

    def lagged(
        self, parameters: Sequence[float], t: Array, h: Array, log: Indices, *, late: bool = False
    ) -> dict[int, Array]:
        """Return the means of the states that follow from the commands, by index; see :meth:`between`.

        A sampled model sees their values at its ticks, the begins of the sub-steps.
        """
        found = {i: np.empty(t.shape) for i in self.known}
        if not found:
            return found
        delay, (edges, width) = self.delay(parameters), _edges(t, h)
        for k, arrival in enumerate(self.arrivals(late)):
            own = np.flatnonzero(log == k)
            if self._sampled:
                for i, values in arrival.lagged_at(t[:, own], parameters, delay).items():
                    found[i][:, own] = values
                continue
            for i, values in arrival.lagged_integral(edges[:, own], parameters, delay).items():
                found[i][:, own] = np.diff(values, axis=0) / width[:, own]
        return found


def _edges(t: Array, h: Array) -> tuple[Array, Array]:
    """Return the edges of the sub-steps, shape (S + 1, N), and their lengths, inf for 0, shape (S, N)."""
    h = np.broadcast_to(h, t.shape)
    edges = np.concatenate([t, t[-1:] + h[-1:]])
    return edges, np.where(h > 0, h, np.inf)
