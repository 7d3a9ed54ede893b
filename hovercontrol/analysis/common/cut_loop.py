"""A loop with wires cut, linearised by its exact Jacobians from the wires to where they come back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.core.block import Block
from hovercontrol.core.interconnect import interconnect, rename
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.simulation.given import initial_state

Point = ArrayLike | Mapping[str, float]

#: What a signal is called where it comes back to the wire that is cut.
RETURNED = "_returned"


def break_loop(blocks: Sequence[Block], at: str | Sequence[str], name: str = "loop") -> Block:
    """Return Blocks joined with wires cut: inputs `at`, outputs ``AT_returned``.

    Parameters
    ----------
    blocks : sequence of Block
        That join to a closed loop without inputs.
    at : str or sequence of str
        Signals that one of the Blocks drives.
    name : str, optional

    Raises
    ------
    InputError
        If nothing drives the signal, or the Blocks leave other inputs open.
    """
    cut = [at] if isinstance(at, str) else list(at)
    driven = {s.name for block in blocks for s in block.outputs}
    for signal in cut:
        if signal not in driven:
            raise InputError(f"{name}: no block drives {signal!r}{did_you_mean(signal, driven)}")
    parts = []
    for block in blocks:
        own = {s.name: f"{s.name}{RETURNED}" for s in block.outputs if s.name in cut}
        parts.append(rename(block, own) if own else block)
    whole = interconnect(parts, name, outputs=[f"{signal}{RETURNED}" for signal in cut])
    more = [s.name for s in whole.inputs if s.name not in cut]
    if more:
        raise InputError(f"{name}: nothing drives {more[0]!r}: a loop to be cut must be closed")
    return interconnect(parts, name, inputs=cut, outputs=[f"{signal}{RETURNED}" for signal in cut])


class CutLoop:
    """A loop with wires cut, to be linearised at many points.

    Parameters
    ----------
    blocks, at
        As for :func:`break_loop`.

    Raises
    ------
    InputError
        As there.
    """

    def __init__(self, blocks: Sequence[Block], at: str | Sequence[str]) -> None:
        cut = [at] if isinstance(at, str) else list(at)
        self._cut = break_loop(blocks, cut).to_control()
        self._closed = interconnect(blocks, "loop", outputs=cut)

    def linearize(
        self, x: Point | None = None, time: float = 0.0, params: Mapping[str, float] | None = None
    ) -> control.StateSpace:
        """Return the linear system from the cut wires to where they come back; feedback is positive.

        Parameters
        ----------
        x : array_like or mapping by name, optional
            State of the closed loop, over its start values.
        time : float, optional
            [s]
        params : mapping, optional
            Parameter values by key.

        Raises
        ------
        InputError
            If a name or a number of values is wrong.
        """
        point = initial_state(self._closed, x)
        through = self._closed.to_numpy().outputs(time, point, (), params)
        return self._cut.linearize(point, through, time, params)

    def along(
        self, motion: control.TimeResponseData, params: Mapping[str, float] | None = None
    ) -> Iterator[control.StateSpace]:
        """Give the linear systems at each row of a motion of the closed loop, frozen.

        Raises
        ------
        InputError
            If the motion has not all states of this loop.
        """
        names, labels = [s.name for s in self._closed.states], list(motion.state_labels)
        missing = [name for name in names if name not in labels]
        if missing:
            raise InputError(f"motion: no state {missing[0]!r}{did_you_mean(missing[0], labels)}")
        states = np.asarray(motion.states)[[labels.index(name) for name in names]]
        for time, x in zip(np.asarray(motion.time).tolist(), states.T, strict=True):
            yield self.linearize(x, time, params)
