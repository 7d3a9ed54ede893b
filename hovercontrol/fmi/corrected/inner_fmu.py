"""The FMU inside a corrected FMU: its files, and its model description as a tree that can be changed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast
from xml.etree.ElementTree import Element, fromstring

from hovercontrol.base.errors import InputError, check_known
from hovercontrol.fmi.exporter.binaries import PLATFORMS, Platform, folder_of
from hovercontrol.fmi.exporter.sources import Version
from hovercontrol.fmi.importer.archive import LIMITS, check_xml, open_archive
from hovercontrol.fmi.importer.interface import Kind

DESCRIPTION = "modelDescription.xml"


@dataclass(frozen=True)
class Variable:
    """A variable of a model description; its elements belong to the tree.

    Attributes
    ----------
    element, typed : Element
        With name and causality; with the type's attributes. In FMI 3 one element is both.
    size : int
        Number of elements of an array; 1 for a scalar.
    """

    element: Element
    typed: Element
    reference: int
    size: int

    @property
    def name(self) -> str:
        """Return its name."""
        return self.element.get("name", "")

    @property
    def is_real(self) -> bool:
        """Return whether it is a double."""
        return self.typed.tag in ("Real", "Float64")


class InnerFmu:
    """An FMU's description and files.

    Parameters
    ----------
    path : Path
    kind : {"ModelExchange", "CoSimulation"}, optional
        The interface that is used; default: Model Exchange if it has that.

    Raises
    ------
    InputError
        If it is not an FMU of FMI 2.0 or 3.0 with such an interface, or has clocks.
    """

    def __init__(self, path: Path, kind: Kind | None = None) -> None:
        self.path = path
        with open_archive(path) as archive:
            data = archive.read(DESCRIPTION, LIMITS.description)
            header = check_xml(data, f"{path}: {DESCRIPTION}")
            self.files = {n: archive.read(n, LIMITS.total) for n in archive.names if n != DESCRIPTION}
        self.description = data
        fmi = header.attributes.get("fmiVersion", "")
        if header.tag != "fmiModelDescription" or not (fmi == "2.0" or fmi.startswith("3.")):
            raise InputError(f"{path} is not an FMU of FMI 2.0 or 3.0")
        self.version = cast(Version, int(fmi[0]))
        self.root = fromstring(data)
        self.exchange, self.steps = self.root.find("ModelExchange"), self.root.find("CoSimulation")
        if kind == "CoSimulation" and self.exchange is not None:
            self.root.remove(self.exchange)
            self.exchange = None
        part = self.exchange if self.exchange is not None or kind == "ModelExchange" else self.steps
        if part is None:
            raise InputError(f"{path} has no interface for {kind or 'ModelExchange or CoSimulation'}")
        self.part = part
        self.identifier = part.get("modelIdentifier", "")
        if not re.fullmatch(r"[A-Za-z_]\w*", self.identifier):
            raise InputError(f"{path}: the model identifier {self.identifier!r} is not an identifier of C")
        self.token = self.root.get("guid" if self.version == 2 else "instantiationToken", "")
        self.variables = self._read()
        self.by_name = {v.name: v for v in self.variables}
        self._derivatives = self._pairs()

    def _read(self) -> list[Variable]:
        listed = self.root.find("ModelVariables")
        elements = [] if listed is None else list(listed)
        if self.version == 2:
            typed = [next(t for t in e if t.tag != "Annotations") for e in elements]
            return [
                Variable(e, t, int(e.get("valueReference", "0")), 1)
                for e, t in zip(elements, typed, strict=True)
            ]
        starts = {e.get("valueReference"): e.get("start", "") for e in elements}
        found = []
        for e in elements:
            if e.tag == "Clock" or e.get("clocks"):
                raise InputError(
                    f"{self.path}: an FMU with clocks cannot be corrected; {e.get('name')!r} has one"
                )
            sizes = [int(d.get("start") or starts[d.get("valueReference")]) for d in e.iter("Dimension")]
            found.append(Variable(e, e, int(e.get("valueReference", "0")), math.prod(sizes)))
        return found

    def variable(self, name: str, what: str, causality: str = "") -> Variable:
        """Return a scalar real variable by name.

        Parameters
        ----------
        what : str
            Beginning of the message: what asks for it.
        causality : str, optional
            That it must have.

        Raises
        ------
        InputError
            If there is no such variable.
        """
        fitting = [
            n
            for n, v in self.by_name.items()
            if v.is_real and v.size == 1 and (not causality or v.element.get("causality") == causality)
        ]
        check_known(
            name, fitting, f"{what}: {self.path} has no scalar real {causality or 'variable'} {name!r}"
        )
        return self.by_name[name]

    def derivatives(self) -> list[tuple[Variable, Variable]]:
        """Return states and their derivatives, in the order of the ModelStructure as it was given."""
        return self._derivatives

    def _pairs(self) -> list[tuple[Variable, Variable]]:
        if self.exchange is None:
            return []
        structure = self.root.find("ModelStructure")
        assert structure is not None
        by_reference = {v.reference: v for v in reversed(self.variables)}
        if self.version == 2:
            listed = [
                self.variables[int(u.get("index", "0")) - 1] for u in structure.findall("Derivatives/Unknown")
            ]
            return [(self.variables[int(d.typed.get("derivative", "0")) - 1], d) for d in listed]
        listed = [
            by_reference[int(u.get("valueReference", "0"))]
            for u in structure.findall("ContinuousStateDerivative")
        ]
        pairs = [(by_reference[int(d.typed.get("derivative", "0"))], d) for d in listed]
        if any(s.size != 1 for s, _ in pairs):
            raise InputError(f"{self.path}: states that are arrays are not supported around an FMU")
        return pairs

    @property
    def indicators(self) -> int:
        """Return the number of event indicators."""
        if self.version == 2:
            return int(self.root.get("numberOfEventIndicators", "0"))
        return len(self.root.findall("ModelStructure/EventIndicator"))

    def binaries(self, wanted: Platform) -> dict[str, bytes]:
        """Return the files of a platform's folder; empty if it has no library for it."""
        folder = f"binaries/{folder_of(wanted, self.version)}/"
        if f"{folder}{self.identifier}{wanted.suffix}" not in self.files:
            return {}
        return {n: data for n, data in self.files.items() if n.startswith(folder)}

    def platforms(self) -> list[str]:
        """Return the names of the platforms it has a library for."""
        return [p.name for p in PLATFORMS.values() if self.binaries(p)]

    def starts(self, start: Mapping[str, float], what: str) -> dict[str, Variable]:
        """Return the variables that are to start at other values.

        Raises
        ------
        InputError
            If one is unknown, computes its value, or is not a real number.
        """
        found = {name: self.variable(name, what) for name in start}
        for name, v in found.items():
            if v.typed.get("start") is None or not math.isfinite(start[name]):
                raise InputError(f"{what}: {name!r} of {self.path} cannot start at {start[name]!r}")
        return found
