"""The variables of an FMU: one table from which descriptions, C tables and documentation are made.

Value references are the same in FMI 2 and 3, in this order: time; states; derivatives; inputs; parameters;
outputs; event indicators; friction modes (``hc_instance.h`` counts them the same way). States set by ticks
are the last states; they have no derivative, but a value reference is reserved for one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, count
from typing import Literal

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.friction import DryFriction, Friction, dry_frictions
from hovercontrol.blocks.signals import Signal
from hovercontrol.fmi.exporter.arrays import Array, arrays_of
from hovercontrol.fmi.exporter.units import Unit, fmi_unit

Kind = Literal["time", "state", "derivative", "input", "parameter", "output", "event", "mode"]


@dataclass(frozen=True)
class Variable:
    """One variable as an importer sees it; the words are those of the FMI standards.

    ``start`` is None where the FMU computes the value. A mode is an integer, all others are real numbers.
    """

    reference: int
    kind: Kind
    name: str
    causality: str
    variability: str
    initial: str | None
    unit: Unit | None
    description: str = ""
    start: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    nominal: float = 1.0
    derivative_of: int | None = None
    reinit: bool = False
    room: float = 0.0
    saturates: bool = False


class Interface:
    """All variables of a Block's FMU.

    Parameters
    ----------
    block : Block
        A sampled Block is replaced by an equivalent hybrid Block.
    friction : {"events", "smooth"}
    arrays : bool, optional
        Whether FMI 3 lists vectors and matrices as arrays.

    Raises
    ------
    InputError
        If `friction` is unknown, there is nothing to export, or FMI cannot express a value.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> [v.name for v in Interface(hoverdemon().plant(), "events").variables][:4]
    ['time', 'x', 'y', 'psi']
    """

    def __init__(self, block: Block, friction: Friction = "smooth", *, arrays: bool = False) -> None:
        if friction not in ("events", "smooth"):
            raise InputError(f"friction must be 'events' or 'smooth', found {friction!r}")
        if not block.outputs and not block.states:
            raise InputError(
                f"block {block.name!r} has neither states nor outputs: there is nothing to export"
            )
        block = block.in_continuous_time
        self.block, self.friction = block, friction
        self.frictions: tuple[DryFriction, ...] = dry_frictions(block) if friction == "events" else ()
        self.identifier = ascii_name(block.name)
        sizes = (1, *[len(block.states)] * 2, len(block.inputs), len(block.parameters), len(block.outputs))
        sizes += (len(self.frictions),) * 2
        self._first = [sum(sizes[:k]) for k in range(len(sizes))]
        self._taken: set[str] = set()
        self._with_arrays = arrays

    def first(self, kind: Kind) -> int:
        """Return the value reference of the first variable of a kind."""
        order = ("time", "state", "derivative", "input", "parameter", "output", "event", "mode")
        return self._first[order.index(kind)]

    @property
    def differentiable(self) -> bool:
        """Whether the FMU gives partial derivatives; a Block that only ticks has none."""
        return self.block.n_continuous > 0 or not self.block.ticks

    @cached_property
    def held(self) -> dict[str, int]:
        """States set by ticks, with their value references."""
        n = self.block.n_continuous
        return {s.name: self.first("state") + n + k for k, s in enumerate(self.block.states[n:])}

    @cached_property
    def merged(self) -> dict[str, int]:
        """Outputs that are states of the same name, with the state's value reference."""
        states = {s.name: self.first("state") + k for k, s in enumerate(self.block.states)}
        return {s.name: states[s.name] for s in self.block.outputs if s.name in states}

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """The listed variables by value reference; an output equal to the state of its name is that state."""
        return tuple(self._listed())

    @cached_property
    def arrays(self) -> tuple[Array, ...]:
        """The arrays of FMI 3, by value reference; FMI 2 has scalars only."""
        return arrays_of(self.variables) if self._with_arrays else ()

    def of(self, *kinds: Kind) -> tuple[Variable, ...]:
        """Return the listed variables of some kinds."""
        return tuple(v for v in self.variables if v.kind in kinds)

    @cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """One variable for each of the Block's outputs, in its order."""
        by_reference = {v.reference: v for v in self.variables}
        first = self.first("output")
        return tuple(
            by_reference[self.merged.get(s.name, first + k)] for k, s in enumerate(self.block.outputs)
        )

    def _listed(self) -> Iterator[Variable]:
        block, velocities = self.block, {f.state for f in self.frictions}
        names = {s.name: self._name(s.name) for s in (*block.states, *block.inputs)}
        keys = [self._name(block.parameter_key(s.name)) for s in block.parameters]
        fixed = {symbol for e in block.delays.values() for symbol in e.free_symbols}
        yield Variable(
            0, "time", self._name("time"), "independent", "continuous", None, fmi_unit("s"), "simulation time"
        )
        for k, s in enumerate(block.states, self.first("state")):
            causality = "output" if s.name in self.merged else "local"
            held = s.name in self.held
            variability = "discrete" if held else "continuous"
            yield self._known(k, "state", names[s.name], s, causality, variability, s.name in velocities)
        for k, s in enumerate(block.states[: block.n_continuous]):
            reference = self.first("derivative") + k
            text = f"time derivative of {names[s.name]}"
            unit = fmi_unit(s.unit, per_second=True)
            name = self._name(f"der({names[s.name]})")
            computed = ("local", "continuous", "calculated", unit, text)
            yield Variable(reference, "derivative", name, *computed, derivative_of=self.first("state") + k)
        for k, s in enumerate(block.inputs, self.first("input")):
            late = s.name in block.delays
            yield self._known(k, "input", names[s.name], s, "input", "discrete" if late else "continuous")
        for k, (key, s) in enumerate(zip(keys, block.parameters, strict=True), self.first("parameter")):
            yield self._known(
                k, "parameter", key, s, "parameter", "fixed" if s.symbol in fixed else "tunable"
            )
        for k, s in enumerate(block.outputs, self.first("output")):
            if s.name not in self.merged:
                name = self._name(s.name, "out")
                limits = (None, s.lower, s.upper, s.nominal)
                computed = ("output", "continuous", "calculated", fmi_unit(s.unit), s.description)
                yield Variable(k, "output", name, *computed, *limits)
        for k, f in enumerate(self.frictions, self.first("event")):
            text = f"zero crossing where the dry friction of {names[f.state]} sticks or slips"
            name = self._name(_beside(names[f.state], "event_indicator"))
            yield Variable(k, "event", name, "local", "continuous", "calculated", None, text)
        for k, f in enumerate(self.frictions, self.first("mode")):
            text = f"dry friction of {names[f.state]}: -1 and 1 slipping that way, 0 sticking"
            name = self._name(_beside(names[f.state], "friction_mode"))
            of_mode = ("local", "discrete", "calculated", None, text)
            yield Variable(k, "mode", name, *of_mode, lower=-1.0, upper=1.0)

    def _known(
        self,
        reference: int,
        kind: Kind,
        name: str,
        s: Signal,
        causality: str,
        variability: str = "continuous",
        reinit: bool = False,
    ) -> Variable:
        if not math.isfinite(s.start):
            raise InputError(
                f"block {self.block.name!r}: {s.name} starts at {s.start:g}, FMI needs a finite number"
            )
        return Variable(
            reference,
            kind,
            name,
            causality,
            variability,
            "exact" if kind != "input" else None,  # FMI 2 and 3: an input has none
            fmi_unit(s.unit),
            s.description,
            s.start,
            s.lower,
            s.upper,
            s.nominal,
            reinit=reinit,
            room=s.room,
            saturates=s.saturates,
        )

    def _name(self, name: str, suffix: str = "") -> str:
        """Return a name of FMI's structured naming convention that no other variable has."""
        plain = ascii_name(name)
        stem, bracket, index = plain.partition("[")
        endings = chain([""], [f"_{suffix}"] if suffix else [], (f"_{k}" for k in count(2)))
        found = next(n for n in (f"{stem}{e}{bracket}{index}" for e in endings) if n not in self._taken)
        self._taken.add(found)
        return found


def ascii_name(name: str) -> str:
    """Return a name with letters outside ASCII written as their code points.

    Examples
    --------
    >>> ascii_name("plant.\u03c8[0,1]")
    'plant.u03c8[0,1]'
    """
    return re.sub(r"[^\x00-\x7f]", lambda found: f"u{ord(found[0]):04x}", name)


def _beside(name: str, what: str) -> str:
    """Return the name of a quantity that belongs to a state: ``plant.u`` gives ``plant.friction_mode_u``."""
    owner, dot, last = name.rpartition(".")
    return f"{owner}{dot}{what}_{last}"
