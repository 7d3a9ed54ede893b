"""An FMU as a model: parameters to fit, effects around it, and runs over logs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import Effect
from hovercontrol.fmi.around import Around
from hovercontrol.fmi.importer.interface import Interface
from hovercontrol.fmi.importer.unpacked import Source
from hovercontrol.fmi.replay.added import Added
from hovercontrol.fmi.replay.parameters import Parameter, parameters_of
from hovercontrol.fmi.replay.runs import RunFailed, Runs
from hovercontrol.fmi.replay.signals import driven, through

#: Longest step of Model Exchange, and of Co-Simulation where the FMU names none [s].
STEP = 0.01

#: Parts of the time between two rows in which an input that is lagged before a Model Exchange FMU is held.
FINE = 12

#: Parts of that time in which the outputs are computed where a lag follows them: between two values an output
#: is taken as linear, so a lag T errs by (h/T)^2/12 of the rise for values h apart.
FINE_AFTER = 3


@checked
@dataclass(frozen=True, eq=False)
class FmuPlant:
    """An FMU as a model that ``check``, ``identify`` and ``diagnose`` take; made by :func:`fmu_plant`.

    Attributes
    ----------
    name : str
    source : Source
        The checked archive.
    runs : Runs
        The running FMU; shared by copies with other values.
    fit : tuple of str
        Parameters that a fit estimates, by the FMU's names.
    values : mapping of str to float
        Parameters whose value differs from the FMU's start value.
    around : Around
        Effects around the FMU.
    free_start : bool
        Whether the continuous states at the first row of each log are estimated too (Model Exchange). If
        not, a log begins at the FMU's start.
    laws_in : tuple of str
        Continuous states to whose derivatives ``diagnose`` may add laws.
    pieces : int
        Steps from row to row of a log; 0: as many as ``STEP`` or the FMU's own step needs.

    Examples
    --------
    >>> plant = fmu_plant("plant.fmu", fit=["mass"])  # doctest: +SKIP
    >>> plant.value("mass")  # doctest: +SKIP
    2.0
    """

    name: str
    source: Source
    runs: Runs
    fit: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    around: Around = field(default_factory=lambda: Around((), ()))
    free_start: bool = True
    laws_in: tuple[str, ...] = ()
    pieces: int = 0

    def __repr__(self) -> str:
        return "\n".join([f"FmuPlant {self.name} ({self.source.path})", *map(repr, self.around.effects)])

    @property
    def interface(self) -> Interface:
        """The FMU's interface."""
        return self.source.interface

    @property
    def path(self) -> Path:
        """The FMU's file."""
        return self.source.path

    @property
    def inputs(self) -> tuple[Signal, ...]:
        """The FMU's inputs."""
        return self.around.inputs

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """The FMU's outputs."""
        return self.around.outputs

    @property
    def states(self) -> tuple[Signal, ...]:
        """The FMU's continuous states; empty for Co-Simulation."""
        return self.around.states

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """The FMU's parameters that are real numbers, by name."""
        return parameters_of(self.source)

    @cached_property
    def reading(self) -> Block:
        """A Block with the FMU's signals, to read logs with; it has no equations."""
        names = {s.name for s in self.inputs}
        states = dict.fromkeys(s for s in (*self.outputs, *self.states) if s.name not in names)
        first = {s.name: s for s in states}
        return Block(
            self.name,
            states=tuple(first.values()),
            inputs=self.inputs,
            outputs=tuple(s for s in self.outputs if s.name in first),
            derivatives=dict.fromkeys(first, sp.S.Zero),
        )

    def value(self, name: str) -> float:
        """Return a parameter's value.

        Parameters
        ----------
        name : str
            The FMU's name of it.

        Raises
        ------
        InputError
            If the FMU has no such parameter; the message names the nearest.
        """
        check_known(name, self.parameters, f"{self.path}: no parameter {name!r} that is a real number")
        return self.values.get(name, self.parameters[name].start)

    def with_values(self, values: Mapping[str, float]) -> FmuPlant:
        """Return the model with other values of parameters, or of numbers around the FMU.

        Parameters
        ----------
        values : mapping of str to float
            By the FMU's name of a parameter, or by a key of ``around.values``.

        Raises
        ------
        InputError
            If a name is unknown.
        """
        around = {key: value for key, value in values.items() if key in self.around.values}
        own = {key: value for key, value in values.items() if key not in around}
        for name in own:
            self.value(name)
        return replace(
            self,
            values={**self.values, **own},
            around=self.around.with_values(around) if around else self.around,
        )

    def with_effects(
        self,
        before: Sequence[Effect] = (),
        after: Sequence[Effect] = (),
        added: Sequence[Effect] = (),
    ) -> FmuPlant:
        """Return the model with effects added.

        Parameters
        ----------
        before, after, added : sequence of Effect, optional
            Before the inputs, after the outputs, to the derivatives.

        Raises
        ------
        InputError
            If an effect cannot act there, or is already present.
        """
        old = self.around
        around = replace(
            old,
            at_inputs=(*old.at_inputs, *before),
            at_outputs=(*old.at_outputs, *after),
            in_equations=(*old.in_equations, *added),
        )
        return replace(self, around=around)

    def pieces_of(self, time: Array) -> int:
        """Return the number of steps from row to row.

        Parameters
        ----------
        time : ndarray, shape (K,)
            [s]
        """
        if self.pieces:
            return self.pieces
        longest = float(np.diff(time).max(initial=0.0))
        step = STEP if self.interface.kind == "ModelExchange" else (self.interface.step or STEP)
        if (fixed := self.interface.fixed_step) is not None:
            step = fixed
        return max(1, math.ceil(longest / step - 1e-6))

    def fine(self, time: Array, inputs: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return times and inputs at which the outputs are computed, and the places of the rows among them.

        Where an effect after the FMU has states, there are times between the rows. Of Co-Simulation only
        those at which a step ends.

        Parameters
        ----------
        time : ndarray, shape (K,)
            [s]
        inputs : ndarray, shape (K, n_inputs)
            Held from row to row.
        """
        parts, after = self._parts(time), structure(self.around)[1]
        if parts == 1 or after is None or not after.states:
            return time, inputs, np.arange(len(time))
        places = parts * np.arange(len(time))
        grid = np.interp(np.arange(places[-1] + 1), places, time)
        return grid, np.repeat(inputs, parts, axis=0)[: len(grid)], places

    def _parts(self, time: Array) -> int:
        pieces = self.pieces_of(time)
        if self.interface.kind == "ModelExchange":
            return FINE_AFTER
        if self.interface.fixed_step is not None:
            return 1
        return next(n for n in range(FINE_AFTER, 0, -1) if pieces % n == 0)

    def at(self, time: Array, inputs: Array, states: Sequence[float] | None) -> Array:
        """Return the measured outputs, and the states, at the rows.

        Parameters
        ----------
        time : ndarray, shape (K,)
            [s]
        inputs : ndarray, shape (K, n_inputs)
            As they are given; held from row to row.
        states : sequence of float, optional
            Continuous states at the first row; None: the FMU's.

        Returns
        -------
        ndarray, shape (K, n_outputs + n_states)

        Raises
        ------
        RunFailed
        """
        grid, u, places = self.fine(time, inputs)
        parts = (len(grid) - 1) // max(len(time) - 1, 1)
        return np.asarray(self.seen(grid, self.raw(grid, u, states, parts))[places])

    def raw(self, time: Array, inputs: Array, states: Sequence[float] | None, parts: int = 1) -> Array:
        """Return the FMU's outputs and states at the rows, before the effects after it.

        Parameters
        ----------
        time : ndarray, shape (K,)
            [s]
        inputs : ndarray, shape (K, n_inputs)
            As they are given; held from row to row.
        states : sequence of float, optional
            Continuous states at the first row; None: the FMU's.
        parts : int, optional
            Parts into which each interval was divided: there are as many fewer steps in each.

        Raises
        ------
        RunFailed
            If the FMU refuses, crashes, hangs, or answers a value that is not a number.
        """
        before, _, added = structure(self.around)
        numbers = [self._numbers(block) for _, block in added.blocks] if added else []
        grid, u, places = time, inputs, np.arange(len(time))
        pieces = math.ceil((self.pieces or parts * self.pieces_of(time)) / parts)
        if before is not None and self.interface.kind == "ModelExchange":
            grid, u, places = driven(before, self._numbers(before), time, inputs, FINE)
            pieces = max(1, math.ceil(pieces / FINE)) if before.states else pieces
        elif before is not None:
            u = through(before, self._numbers(before), time, inputs, held=True)
        found = self.runs.run(grid, u, self._in_order(), states, pieces, added, numbers)[places]
        if not np.isfinite(found).all():
            row, column = np.argwhere(~np.isfinite(found))[0]
            name = (*self.outputs, *self.states)[column].name
            raise RunFailed(f"{name!r} is {found[row, column]} at t = {time[row]:.9g} s")
        return found

    def seen(self, time: Array, raw: Array) -> Array:
        """Return the measured outputs, and the states.

        Parameters
        ----------
        time : ndarray, shape (K,)
            [s]
        raw : ndarray, shape (K, n_outputs + n_states)
            Of :meth:`raw`.
        """
        after = structure(self.around)[1]
        if after is None:
            return raw
        n = len(self.outputs)
        return np.hstack([through(after, self._numbers(after), time, raw[:, :n], held=False), raw[:, n:]])

    def initial(self, inputs: Sequence[float]) -> list[float]:
        """Return the continuous states after initialisation with the present values.

        Parameters
        ----------
        inputs : sequence of float
            At the start.
        """
        return self.runs.initial(self._in_order(), inputs)

    def close(self) -> None:
        """Free the FMU; also of all copies."""
        self.runs.close()

    def _numbers(self, block: Block) -> list[float]:
        """Return the values of a Block's parameters."""
        values = self.around.values
        return [values[s.name] for s in block.parameters]

    def _in_order(self) -> list[float | None]:
        labels = (label for v in self.interface.parameters for label in v.labels)
        return [self.values.get(label) for label in labels]


_STRUCTURES: dict[tuple[object, ...], tuple[Block | None, Block | None, Added | None]] = {}


def structure(around: Around) -> tuple[Block | None, Block | None, Added | None]:
    """Return the Blocks before and after an FMU and the laws added; cached, whatever the effects' numbers."""
    key = (
        around.inputs,
        around.outputs,
        around.states,
        *(tuple(map(type, group)) for group in (around.at_inputs, around.at_outputs, around.in_equations)),
    )
    if key not in _STRUCTURES:
        if len(_STRUCTURES) > 500:
            _STRUCTURES.clear()
        places = {d: i for i, (_, d) in enumerate(around.derivatives)}
        added = Added.of(around.added, places) if around.in_equations else None
        _STRUCTURES[key] = around.before, around.after, added
    return _STRUCTURES[key]
