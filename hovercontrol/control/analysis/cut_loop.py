"""A loop with wires cut, linearised by its exact Jacobians from the wires to where they come back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.backends.friction_slopes import Point as At
from hovercontrol.blocks.backends.friction_slopes import Slope
from hovercontrol.blocks.backends.linear import state_space
from hovercontrol.blocks.backends.linearization import matrices_at, operating_point
from hovercontrol.blocks.backends.trim import Trim
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import MAX_ORDER, delay_values, late_states, pade, undelayed
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal, suffixed

Loop = Block | Sequence[Block]
Point = ArrayLike | Mapping[str, float] | Trim

#: Lag of a delay [rad] up to which its Pade approximation of order 10 is exact to 1e-5.
EXACT_LAG = 8.0

#: What a signal is called where it comes back to the wire that is cut.
RETURNED = "returned"


def _open(loop: Block, at: Point | None, names: Sequence[str]) -> InputError:
    """Return the error for inputs that nothing drives, with the point that gives them their start values.

    A Trim of one Block of the loop is written by the loop's names, ``plant.u``.
    """
    states = {s.name for s in loop.states}
    given: Mapping[str, float] = at if isinstance(at, Mapping) else {}
    if isinstance(at, Trim):
        of = {name: name if name in states else f"{at.block.name}.{name}" for name in at.states}
        given = {of[name]: value for name, value in at.states.items() if value and of[name] in states}
    starts = {s.name: s.start for s in loop.inputs if s.name in names}
    point = ", ".join(f"{name!r}: {value + 0.0:.6g}" for name, value in {**given, **starts}.items())
    return InputError(
        f"{loop.name}: nothing drives {', '.join(map(repr, names))}: a loop to be cut must be closed, or the "
        f"values given, at={{{point}}}"
    )


def cut_blocks(blocks: Sequence[Block], cut: Sequence[str], name: str) -> Block:
    """Return Blocks joined with wires cut: inputs `cut`, then open ones; outputs ``WIRE_returned``."""
    driven = {s.name for block in blocks for s in block.outputs}
    for signal in cut:
        check_known(signal, driven, f"{name}: no block drives {signal!r}")
    parts = []
    for block in blocks:
        own = {s.name: suffixed(s.name, RETURNED) for s in block.outputs if s.name in cut}
        parts.append(rename(block, own) if own else block)
    returned = [suffixed(signal, RETURNED) for signal in cut]
    more = [s.name for s in interconnect(parts, name, outputs=returned).inputs if s.name not in cut]
    return interconnect(parts, name, inputs=[*cut, *more], outputs=returned)


def _cut_whole(loop: Block, cut: Sequence[str]) -> Block:
    """Return a loop that is one Block with wires cut: signals that its equations define."""
    known = {s.name: s for s in loop.definition_signals}
    for name in cut:
        if name not in known:
            shown = {s.name: s.symbol for s in loop.states} | dict(loop.output_expressions)
            hint = (
                f": it is the signal {shown[name]} under this name; give the Blocks of the loop as a list"
                if name in shown
                else did_you_mean(name, known)
            )
            raise InputError(loop.where(f"no signal {name!r} that can be cut{hint}"))
    returned = [known[name].replace(name=suffixed(name, RETURNED)) for name in cut]
    new = {name: signal.name for name, signal in zip(cut, returned, strict=True)}
    signals = tuple(s.replace(name=new.get(s.name, s.name)) for s in loop.definition_signals)
    wires = tuple(_input(known[name]) for name in cut)
    return loop.unchecked(
        inputs=(*wires, *loop.inputs),
        outputs=tuple(returned),
        output_expressions=Expressions((s.name, s.symbol) for s in returned),
        definitions=Expressions((new.get(name, name), e) for name, e in loop.definitions.items()),
        definition_signals=signals,
    )


def _input(signal: Signal) -> Signal:
    return Signal(signal.name, signal.unit, signal.description, nominal=signal.nominal)


class CutLoop:
    """A loop with wires cut, to be linearised at many points.

    Parameters
    ----------
    loop : Block or sequence of Block
        The Blocks of the loop, or the loop that they make.
    wires : str or sequence of str
        Signals that one of the Blocks drives; of a loop in one Block, signals that its equations define.

    Raises
    ------
    InputError
        If nothing drives a signal, or a signal that acts with a delay is sampled.

    Notes
    -----
    A delay is approximated by :func:`.pade` of order 10: its relative error is below 1e-5 up to a frequency
    of 8 over the delay [rad/s].
    """

    def __init__(self, loop: Loop, wires: str | Sequence[str]) -> None:
        cut = [wires] if isinstance(wires, str) else list(wires)
        self._n = len(cut)
        #: Of each state of a delay: its wire, and its value at rest per value of the wire.
        self._late: dict[str, tuple[str, float]] = {}
        self._delayed = [] if isinstance(loop, Block) else [block for block in loop if block.delays]
        if isinstance(loop, Block):
            loop = undelayed(loop)  # inputs of the whole loop: no signal of the loop is late
            self._cut = _cut_whole(loop, cut)
            symbols = Expressions((s.name, s.symbol) for s in self._cut.inputs[: self._n])
            self._closed = loop.unchecked(outputs=self._cut.inputs[: self._n], output_expressions=symbols)
        else:
            driven = {s.name for block in loop for s in block.outputs}
            for block in loop:
                late = late_states(block, MAX_ORDER).items()
                self._late |= {f"{block.name}.{name}": of for name, of in late if of[0] in driven}
            loop = [pade(block, MAX_ORDER) if block.delays else block for block in loop]
            more = {wire for wire, _ in self._late.values()} - set(cut)
            self._cut = cut_blocks(loop, cut, "loop")
            self._closed = interconnect(loop, "loop", outputs=[*cut, *sorted(more)])

    def linearize(
        self,
        at: Point | None = None,
        time: float | None = None,
        params: Mapping[str, float] | None = None,
        *,
        friction: Slope = "smooth",
        amplitude: Mapping[str, float] | None = None,
    ) -> control.StateSpace:
        """Return the linear system from the cut wires to where they come back; feedback is positive.

        Its attribute ``up_to`` is the frequency [rad/s] up to which delays are exact; inf without any.

        Parameters
        ----------
        at : Trim, mapping by name or array_like, optional
            State of the closed loop, a mapping over its start values. Inputs that nothing drives have the
            values of the Trim or the mapping.
        time : float, optional
            [s]; default that of the Trim, or 0.
        params : mapping, optional
            Parameter values by key.
        friction, amplitude
            As for :meth:`hovercontrol.Block.linearize`.

        Raises
        ------
        InputError
            If a name or a number of values is wrong, an input is open and has no value, or parts of the loop
            tick with different periods.
        """
        known = at.inputs if isinstance(at, Trim) else at if isinstance(at, Mapping) else {}
        missing = [s.name for s in self._closed.inputs if s.name not in known]
        if missing:
            if isinstance(at, Mapping):  # raises if a name is misspelt
                operating_point(self._closed, {**dict.fromkeys(missing, 0.0), **at}, None, params, time)
            raise _open(self._closed, at, missing)
        given: Any = {} if at is None else at
        point = operating_point(self._closed, given, None, params, time)
        return self._at(point, friction, amplitude, warn=True)

    def along(
        self, motion: control.TimeResponseData, params: Mapping[str, float] | None = None
    ) -> Iterator[control.StateSpace]:
        """Give the linear systems at each row of a motion of the closed loop, frozen.

        Raises
        ------
        InputError
            If the motion has not all states and inputs of this loop.
        """
        states = _rows(self._closed.states, "state", motion.state_labels, motion.states)
        inputs = _rows(self._closed.inputs, "input", motion.input_labels, motion.inputs)
        for k, time in enumerate(np.asarray(motion.time).tolist()):
            yield self._at(At(time, states[:, k], inputs[:, k], dict(params or {})), "smooth", None)

    def _at(
        self, point: At, friction: Slope, amplitude: Mapping[str, float] | None, *, warn: bool = False
    ) -> control.StateSpace:
        through = self._closed.to_numpy().outputs(*point)
        if self._late:
            at_point = dict(zip((s.name for s in self._closed.outputs), through, strict=True))
            x = [
                at_point[self._late[s.name][0]] * self._late[s.name][1] if s.name in self._late else value
                for s, value in zip(self._closed.states, point.x, strict=True)
            ]
            point = point._replace(x=np.array(x))
        here = point._replace(u=np.concatenate([through[: self._n], point.u]))
        if warn and friction == "smooth":
            matrices_at(self._closed, point)  # warns
        (A, B, C, D), period = matrices_at(self._cut, here, friction, amplitude, warn=False)
        n = self._n
        # python-control's inputs and outputs have no dots, its states may
        wires, returned = (
            [s.name.replace(".", "_") for s in group] for group in (self._cut.inputs[:n], self._cut.outputs)
        )
        states = [s.name for s in self._cut.states]
        labels = {"inputs": wires, "outputs": returned, "states": states}
        line = state_space([A, B[:, :n], C, D[:, :n]], period, **labels)
        late = [
            tau
            for block in self._delayed
            for tau in delay_values(block, block.parameter_values(_own(block, point.params))).values()
        ]
        line.up_to = EXACT_LAG / max(late, default=0.0) if any(late) else math.inf
        return line


def _own(block: Block, params: Mapping[str, float] | None) -> dict[str, float]:
    full = {block.full_key(name): value for name, value in (params or {}).items()}
    return {key: value for key, value in full.items() if key in block.default_parameters}


def _rows(signals: Sequence[Signal], kind: str, labels: Sequence[str] | None, values: Any) -> np.ndarray:
    names = list(labels or [])
    for signal in signals:
        check_known(signal.name, names, f"motion: no {kind} {signal.name!r}")
    rows = np.asarray(values, dtype=float)
    return rows[[names.index(s.name) for s in signals]] if signals else np.zeros((0, rows.shape[-1]))
