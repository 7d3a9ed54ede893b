"""The elements, wires and values of a system, nested systems included, from its files.

Elements are named by their path from the root: ``("drive", "motor")`` lies in the system ``drive``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, get_args
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hovercontrol.base.errors import InputError, shown
from hovercontrol.fmi.importer.archive import LIMITS, check_xml, open_archive
from hovercontrol.fmi.importer.interface import Kind
from hovercontrol.fmi.ssp.names import FMU, SSC, SSD, SSM, SSV, STRUCTURE, Definitions, local, units_of

Place = tuple[str, ...]
_TYPES = {"application/x-ssp-definition", "application/x-ssp-package"}
_ENDS = ("source", "target")
_TRUTH = {"true": "1", "false": "0"}


class End(NamedTuple):
    """A connector: its element's path and its name; of a system, its own."""

    place: Place
    name: str

    def text(self) -> str:
        """Return the connector's name for messages."""
        return repr(".".join([*self.place, self.name]))


@dataclass(frozen=True)
class Map:
    """A map of numbers: by a table, where it has the number, else ``factor x + offset``."""

    factor: float = 1.0
    offset: float = 0.0
    table: Mapping[float, float] = field(default_factory=dict)

    def of(self, x: float) -> float:
        """Return the mapped number."""
        return self.table.get(x, self.factor * x + self.offset)


class Wire(NamedTuple):
    """A connection in the system at `place`, or an entry of a parameter mapping."""

    place: Place
    ends: tuple[End, End]
    map: Map | None
    converts: bool  # units


class Value(NamedTuple):
    """A value of a parameter set for a name below a system or component."""

    numbers: tuple[float, ...]
    unit: str | None
    units: Definitions
    wire: Wire | None  # its mapping


@dataclass
class Component:
    """An FMU of the system."""

    place: Place
    file: Path
    kind: Kind | None


@dataclass
class Structure:
    """All of a system.

    Attributes
    ----------
    connectors : dict
        Kind and unit (None if not given) of each connector that the files declare.
    values : list of (Place, str, Value)
        By the place at which the set is bound; later ones prevail.
    """

    components: list[Component] = field(default_factory=list)
    systems: list[Place] = field(default_factory=list)
    connectors: dict[End, tuple[str, str | None]] = field(default_factory=dict)
    units: dict[Place, Definitions] = field(default_factory=dict)
    wires: list[Wire] = field(default_factory=list)
    values: list[tuple[Place, str, Value]] = field(default_factory=list)


def read_structure(path: Path, folder: Path) -> Structure:
    """Unpack a .ssp file into an empty folder and return what its system is.

    Raises
    ------
    InputError
        If it is not a system of FMUs, or has a part that is not supported.
    """
    found = Structure()
    _Reader(found, str(path)).package(path, folder, ())
    # A set that is bound higher prevails; at one level the later one.
    found.values.sort(key=lambda v: -len(v[0]))
    return found


class _Reader:
    def __init__(self, found: Structure, where: str) -> None:
        self._found, self._where = found, where

    def package(self, path: Path, folder: Path, place: Place) -> Element:
        """Read a .ssp file."""
        with open_archive(path) as archive:
            if STRUCTURE not in archive.names:
                raise InputError(
                    f"{self._where}: expected a system of FMUs, found an archive without {STRUCTURE}"
                )
            archive.unpack(folder, lambda name: name.endswith((".ssd", ".ssv", ".ssm", ".ssp", ".fmu")))
        return self.definition(folder / STRUCTURE, folder, place)

    def definition(self, file: Path, folder: Path, place: Place) -> Element:
        """Read a .ssd file and return its system."""
        root = self._parsed(file)
        system = root.find(f"{{{SSD}}}System")
        if system is None:
            raise InputError(f"{self._where}: {file.name} has no System")
        self._system(system, place, _Files(file.parent, folder, dict(units_of(root))))
        return system

    def _parsed(self, file: Path) -> Element:
        data = file.read_bytes()
        if len(data) > LIMITS.description:
            raise InputError(f"{self._where}: {file.name} is larger than {LIMITS.description} bytes")
        check_xml(data, f"{self._where}: {file.name}")
        return ElementTree.fromstring(data)

    def _system(self, system: Element, place: Place, files: _Files) -> None:
        self._found.systems.append(place)
        self._element(system, place, files)
        names: set[str] = set()
        for element in system.iterfind(f"{{{SSD}}}Elements/*"):
            name, tag = element.get("name", ""), local(element)
            if name in names:
                raise InputError(f"{self._where}: two elements have the name {name!r}")
            names.add(name)
            inner = (*place, name)
            if tag == "System":
                self._system(element, inner, files)
            elif tag == "Component":
                self._component(element, inner, files)
            else:
                raise InputError(f"{self._where}: element {name!r}: a {tag} is not supported")
        for wire in system.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
            ends = _end(wire, "start", place), _end(wire, "end", place)
            self._found.wires.append(_wire(wire, place, ends))

    def _component(self, element: Element, place: Place, files: _Files) -> None:
        kind = element.get("type", FMU)
        source = self._file(element, files, place[-1])
        if kind == FMU:
            implementation = element.get("implementation")
            chosen: Kind | None = next((k for k in get_args(Kind) if k == implementation), None)
            self._found.components.append(Component(place, source, chosen))
        elif kind not in _TYPES:
            raise InputError(f"{self._where}: component {place[-1]!r}: expected an FMU, found {shown(kind)}")
        elif source.suffix == ".ssp":
            folder = source.with_name(f"{source.name}.unpacked")
            folder.mkdir()
            self.package(source, folder, place)
        else:
            self.definition(source, files.folder, place)
        self._element(element, place, files)

    def _element(self, element: Element, place: Place, files: _Files) -> None:
        """Read what systems and components have: connectors and parameter bindings."""
        self._found.units.setdefault(place, files.units)
        for connector in element.iterfind(f"{{{SSD}}}Connectors/{{{SSD}}}Connector"):
            units = (e.get("unit") for e in connector if e.tag.startswith(f"{{{SSC}}}"))
            about = connector.get("kind", ""), next(units, None)
            self._found.connectors[End(place, connector.get("name", ""))] = about
        for binding in element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
            self._binding(binding, place, files)

    def _binding(self, binding: Element, place: Place, files: _Files) -> None:
        own, prefix = place[-1] if place else "the system", binding.get("prefix", "")
        given = self._parsed(self._file(binding, files, own)) if binding.get("source") else binding
        mapping = binding.find(f"{{{SSD}}}ParameterMapping")
        if mapping is not None and mapping.get("source"):
            mapping = self._parsed(self._file(mapping, files, own))
        units = dict(units_of(given))
        for parameter in given.iter(f"{{{SSV}}}Parameter"):
            name = prefix + parameter.get("name", "")
            number = next((e for e in parameter if e.get("value") is not None), None)
            if number is None or local(number) in ("String", "Binary", "Enumeration"):
                continue
            words = (number.get("value") or "").split()
            numbers = tuple(self._number(word, parameter.get("name", "")) for word in words)
            about = numbers, number.get("unit"), units
            for target, wire in _mapped(mapping, name):
                self._found.values.append((place, target, Value(*about, wire)))

    def _number(self, word: str, name: str) -> float:
        try:
            return float(_TRUTH.get(word, word))
        except ValueError:
            raise InputError(
                f"{self._where}: parameter {name!r}: expected a number, found {shown(word)}"
            ) from None

    def _file(self, element: Element, files: _Files, owner: str) -> Path:
        source = element.get("source", "")
        file = (files.base / unquote(source)).resolve()
        if element.get("sourceBase", "SSD") != "SSD" or not file.is_file():
            raise InputError(f"{self._where}: {owner}: it holds no file {shown(source)}")
        if not file.is_relative_to(files.folder.resolve()):
            raise InputError(f"{self._where}: {owner}: {shown(source)} lies outside the archive")
        return file


class _Files(NamedTuple):
    """Where relative names begin, the folder that they may not leave, and the file's units."""

    base: Path
    folder: Path
    units: Definitions


def _mapped(mapping: Element | None, name: str) -> Iterator[tuple[str, Wire | None]]:
    """Yield the names to which a parameter's value goes."""
    if mapping is None:
        yield name, None
        return
    for entry in mapping.iter(f"{{{SSM}}}MappingEntry"):
        if entry.get("source") == name:
            target = entry.get("target", "")
            yield target, _wire(entry, (), (End((), name), End((), target)))


def _end(wire: Element, which: str, place: Place) -> End:
    name, indices = wire.get(f"{which}Connector", ""), wire.get(f"{which}Indices")
    element = wire.get(f"{which}Element")
    label = f"{name}[{','.join(indices.split())}]" if indices else name
    return End(place if element is None else (*place, element), label)


def _wire(element: Element, place: Place, ends: tuple[End, End]) -> Wire:
    """Return a connection or a mapping entry.

    SSP 2.0, 4.5.2: target = factor source + offset, after units are converted.
    """
    found = None
    for child in element:
        if local(child) == "LinearTransformation":
            found = Map(float(child.get("factor", 1.0)), float(child.get("offset", 0.0)))
        elif local(child) in ("BooleanMappingTransformation", "IntegerMappingTransformation"):
            pairs = (
                [_TRUTH.get(e.get(key, ""), e.get(key, "")) for key in ("source", "target")] for e in child
            )
            found = Map(table={float(a): float(b) for a, b in pairs})
        elif local(child) == "EnumerationMappingTransformation":
            raise InputError(f"connection to {ends[1].name!r}: expected no EnumerationMappingTransformation")
    return Wire(place, ends, found, element.get("suppressUnitConversion") not in ("true", "1"))
