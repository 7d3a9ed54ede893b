"""Names of the standard, and its units.

A .ssp file is a ZIP archive: ``SystemStructure.ssd`` names the components, their connectors, connections and
parameter files (.ssv, mapped by .ssm); FMUs and these files lie in ``resources/``.
Source: System Structure and Parameterization 2.0, Modelica Association. Its namespaces are those of 1.0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple
from xml.etree.ElementTree import Element

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.units import BASE, conversion, dimension, unit_text

_SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV, SSM = (
    f"{_SPACE}{part}" for part in ("Description", "Common", "ParameterValues", "ParameterMapping")
)
#: Attributes of BaseUnit by the unit's name.
Definitions = dict[str, Mapping[str, str]]
FMU = "application/x-fmu-sharedlibrary"
#: The one file that every system has.
STRUCTURE = "SystemStructure.ssd"


class Unit(NamedTuple):
    """A unit in SI: number in base units = factor * number + offset."""

    exponents: tuple[float, ...]  # of hovercontrol.blocks.units.BASE; radians are numbers
    factor: float
    offset: float


def local(element: Element) -> str:
    """Return an element's name without its namespace."""
    return element.tag.rpartition("}")[2]


def units_of(root: Element) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Yield the units that a file defines: name, attributes of BaseUnit (alike in SSP, FMI 2 and FMI 3)."""
    for element in root.iter():
        if local(element) == "Unit":
            for child in element:
                if local(child) == "BaseUnit":
                    yield element.get("name", ""), child.attrib


def unit(name: str, defined: Definitions) -> Unit | None:
    """Return a unit by the file's definition, else by its name, or None if neither says what it is."""
    if name in defined:
        numbers = {key: float(value) for key, value in defined[name].items()}
        exponents = tuple(numbers.get(base, 0.0) for base in BASE)
        return Unit(exponents, numbers.get("factor", 1.0), numbers.get("offset", 0.0))
    try:
        dims = dimension(name)
        return Unit(tuple(float(power) for power in dims), *conversion(name, unit_text(dims)))
    except InputError:
        return None
