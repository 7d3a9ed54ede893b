"""An FMU's parameters that are real numbers, from its model description."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from hovercontrol.base.errors import InputError
from hovercontrol.fmi.importer.interface import REALS
from hovercontrol.fmi.importer.unpacked import Source


@dataclass(frozen=True)
class Parameter:
    """A parameter of an FMU: from its model description."""

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    description: str

    def check(self, value: float, name: str = "") -> float:
        """Return a value that is within the bounds.

        Raises
        ------
        InputError
            If it is outside.
        """
        if self.lower <= value <= self.upper:
            return value
        bounds = f"[{self.lower:g}, {self.upper:g}]"
        raise InputError(f"{name or self.name} = {value:.9g} {self.unit} is out of its bounds {bounds}")


def parameters_of(source: Source) -> dict[str, Parameter]:
    """Return the parameters by name; elements of arrays by their labels."""
    bounds = bounds_of(source.unpacked.folder / "modelDescription.xml")
    found = {}
    for v in source.interface.parameters:
        if v.kind in REALS:
            texts = zip(v.labels, v.start, v.units, v.descriptions, strict=True)
            for label, start, unit, description in texts:
                lower, upper = bounds.get(v.reference, (-math.inf, math.inf))
                found[label] = Parameter(label, unit, start, lower, upper, description)
    return found


def bounds_of(path: Path) -> dict[int, tuple[float, float]]:
    """Return the bounds of real variables by value reference, from the model description."""
    found = {}
    for element in ElementTree.parse(path).getroot().iterfind("ModelVariables/*"):
        reference = element.get("valueReference", "")
        real = element.find("Real")
        place = element if real is None else real
        if reference.isdigit():
            lower, upper = float(place.get("min", "-inf")), float(place.get("max", "inf"))
            found[int(reference)] = (lower, upper)
    return found
