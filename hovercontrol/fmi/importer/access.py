"""Variables of an FMU, set and read together: one FMI call per type."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from hovercontrol.fmi.importer.interface import REALS, Variable


class Values:
    """Some variables, set and read together: one FMI call per type."""

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.size = sum(len(v.labels) for v in variables)
        ends = itertools.accumulate(len(v.labels) for v in variables)
        places = [range(end - len(v.labels), end) for v, end in zip(variables, ends, strict=True)]
        self._groups: list[tuple[str, list[int], list[int]]] = []
        for kind in dict.fromkeys(v.kind for v in variables):
            members = [i for i, v in enumerate(variables) if v.kind == kind]
            references = [variables[i].reference for i in members]
            self._groups.append((kind, references, [n for i in members for n in places[i]]))

    def set(self, fmu: Any, values: Sequence[float]) -> None:
        """Set values in the FMU; values of integer types have been checked."""
        for kind, references, places in self._groups:
            chosen: list[Any] = [values[n] for n in places]
            if kind not in REALS:
                chosen = [int(value) for value in chosen]
            getattr(fmu, f"set{kind}")(references, chosen)

    def get(self, fmu: Any, fmi: int) -> list[float]:
        """Return the present values in the FMU."""
        values = [0.0] * self.size
        for kind, references, places in self._groups:
            get = getattr(fmu, f"get{kind}")
            found = get(references) if fmi == 2 else get(references, len(places))
            for n, value in zip(places, found, strict=True):
                values[n] = float(value)
        return values


class Some:
    """Some of the inputs or outputs, with their places among all."""

    def __init__(self, variables: Sequence[Variable], chosen: Sequence[Variable]) -> None:
        self._values, self._places, place = Values(chosen), list[int](), 0
        for v in variables:
            here = range(place, place + len(v.labels))
            self._places += here if v in chosen else []
            place += len(v.labels)

    def set(self, fmu: Any, values: Sequence[float]) -> None:
        """Set those among all values."""
        self._values.set(fmu, self.of(values))

    def get(self, fmu: Any, fmi: int, values: list[float]) -> None:
        """Put the FMU's values among all values."""
        for place, value in zip(self._places, self._values.get(fmu, fmi), strict=True):
            values[place] = value

    def of(self, values: Sequence[float]) -> list[float]:
        """Return those among all values."""
        return [values[place] for place in self._places]
