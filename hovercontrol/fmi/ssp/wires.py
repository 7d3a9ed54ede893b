"""Where each input and parameter of a component comes from, and how the number changes on the way."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from typing import Any

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.fmi.importer.interface import Interface, Variable
from hovercontrol.fmi.ssp.names import Definitions, unit
from hovercontrol.fmi.ssp.structure import End, Map, Place, Structure, Value, Wire

_GIVES = {True: ("input", "parameter", "structuralParameter"), False: ("output", "local", "constant")}
_EITHER = ("inout", "unspecified", "")


class Wires:
    """The connections and values of a system.

    Raises
    ------
    InputError
        If a connection has an unknown end, joins two inputs or two outputs, two lead into one, or units that
        it joins have different dimensions.
    """

    def __init__(self, where: str, structure: Structure, described: Mapping[Place, Interface]) -> None:
        self._where, self._structure = where, structure
        self._kinds = {end: kind for end, (kind, _) in structure.connectors.items()}
        self._units = {end: own for end, (_, own) in structure.connectors.items() if own}
        self._described = described
        for place, interface in described.items():
            for kind, v in _variables(interface):
                own = self._units.get(End(place, v.name)) or next(iter(v.units), "")
                for name in (v.name, *v.labels):
                    self._kinds[End(place, name)] = kind
                    if own:
                        self._units[End(place, name)] = own
        self._into: dict[End, Wire] = {}
        for wire in structure.wires:
            self._add(wire)
        self._values = self._taken()

    def _add(self, wire: Wire) -> None:
        a, b = (self._gives(wire, end) for end in wire.ends)
        if a is b and a is not None:
            what = "outputs" if a else "inputs"
            raise InputError(
                f"{self._where}: {wire.ends[0].text()} and {wire.ends[1].text()}: a connection of two {what}"
            )
        if a is False or b is True:
            wire = wire._replace(ends=wire.ends[::-1])
        target = wire.ends[1]
        if target in self._into:
            raise InputError(f"{self._where}: two connections lead into {target.text()}")
        self._into[target] = wire

    def _gives(self, wire: Wire, end: End) -> bool | None:
        """Return whether a wire's end is where its numbers come from; None if its kind does not say."""
        if end not in self._kinds:
            known = [e.name for e in self._kinds if e.place == end.place]
            hint = did_you_mean(end.name, known)
            raise InputError(f"{self._where}: a connection of unknown connector {end.text()}{hint}")
        kind = self._kinds[end]
        return None if kind in _EITHER else kind in _GIVES[end.place == wire.place]

    def traced(self, end: End) -> tuple[End, list[Map]]:
        """Return the connector from which one's number comes, and the maps along the wires."""
        chain: list[Wire] = []
        while end in self._into:
            chain.append(self._into[end])
            end = chain[-1].ends[0]
            if len(chain) > len(self._into):
                raise InputError(f"{self._where}: the connections of {end.text()} form a circle")
        maps: list[Map] = []
        known = self._units.get(end), self._structure.units.get(end.place, {})
        for wire in reversed(chain):
            target = wire.ends[1]
            own = self._units.get(target), self._structure.units.get(target.place, {})
            if wire.converts:
                maps += self._conversion(known, own, target)
            maps += [wire.map] if wire.map else []
            known = own if own[0] or not wire.converts else known
        return end, maps

    def origin(self, place: Place, v: Variable, k: int) -> tuple[End | float, list[Map], int | None]:
        """Return where an element of a component's input comes from.

        That is a connector (an output of a component, or an input of the system) or a value; the maps on the
        way; and which element it is, None of a scalar.
        """
        label = End(place, v.labels[k])
        single = label in self._into
        end, maps = self.traced(label if single else End(place, v.name))
        of_part = end.place in self._described
        if (of_part and self._kinds[end] == "output") or (not end.place and self._kinds[end] == "input"):
            return end, maps, None if single or len(v.labels) == 1 else k
        outside = self._values.get(end) if end.place != place else None
        inside = self._values.get(label) or self._values.get(End(place, v.name)) or v.start
        numbers = outside or inside or (0.0,)
        return numbers[k if k < len(numbers) else 0], maps if outside else [], None

    def parameters(self, place: Place) -> dict[str, float]:
        """Return the values for a component's parameters, by their names in the FMU."""
        found = {}
        for v in self._described[place].parameters:
            for k, label in enumerate(v.labels):
                end, maps = self.traced(End(place, v.name))
                value = self._values.get(End(place, label), self._values.get(end))
                if value is not None:
                    number = value[k if k < len(value) else 0]
                    for m in maps:
                        number = m.of(number)
                    found[label] = number
        return found

    def _taken(self) -> dict[End, tuple[float, ...]]:
        """Return the values of parameter sets by connector; others are ignored (SSP 5.3.3)."""
        ends: dict[str, list[End]] = {}
        for end in self._kinds:
            ends.setdefault(".".join([*end.place, end.name]), []).append(end)
        found: dict[End, tuple[float, ...]] = {}
        unknown = []
        for place, name, value in self._structure.values:
            full = ".".join([*place, name])
            unknown += [] if full in ends else [full]
            for end in ends.get(full, []):
                found[end] = tuple(self._converted(value, end))
        if unknown:
            warnings.warn(f"{self._where}: values for nothing: {', '.join(unknown)}", stacklevel=6)
        return found

    def _converted(self, value: Value, end: End) -> Iterable[float]:
        own = self._units.get(end), self._structure.units.get(end.place, {})
        convert = value.wire is None or value.wire.converts
        maps = self._conversion((value.unit, value.units), own, end) if convert else []
        maps += [value.wire.map] if value.wire and value.wire.map else []
        for number in value.numbers:
            for m in maps:
                number = m.of(number)
            yield number

    def _conversion(
        self, given: tuple[str | None, Definitions], wanted: tuple[str | None, Definitions], end: End
    ) -> list[Map]:
        """Return the map from one unit to another.

        In base units x is factor x + offset, so ``y = (factor_a x + offset_a - offset_b) / factor_b``.
        """
        if not given[0] or not wanted[0]:
            return []
        a, b = unit(given[0], given[1]), unit(wanted[0], wanted[1])
        if a == b:
            return []
        if a is None or b is None:
            if given[0] != wanted[0]:
                text = f"{given[0]!r} and {wanted[0]!r}, of which one is not defined"
                warnings.warn(f"{self._where}: {end.text()}: not converted between {text}", stacklevel=7)
            return []
        if a.exponents != b.exponents and not (any(a.exponents) and any(b.exponents)):
            return []  # a plain number takes and gives any unit
        if a.exponents != b.exponents:
            raise InputError(
                f"{self._where}: {end.text()} is in {wanted[0]}, what is connected to it in {given[0]}"
            )
        return [Map(a.factor / b.factor, (a.offset - b.offset) / b.factor)]


def _variables(interface: Interface) -> Iterable[tuple[str, Any]]:
    groups = {"input": interface.inputs, "output": interface.outputs, "parameter": interface.parameters}
    return ((kind, v) for kind, group in groups.items() for v in group)
