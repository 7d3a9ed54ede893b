"""Systems of FMUs, written from Blocks and FMUs that are connected by name."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.files import check_folder, write_atomically
from hovercontrol.blocks.block import Block
from hovercontrol.fmi.exporter.description import xml_bytes
from hovercontrol.fmi.exporter.export import export_fmu
from hovercontrol.fmi.exporter.package import packed
from hovercontrol.fmi.exporter.variables import Interface
from hovercontrol.fmi.importer.interface import REALS, Variable
from hovercontrol.fmi.importer.interface import Interface as Described
from hovercontrol.fmi.importer.unpacked import DESCRIPTION, describe
from hovercontrol.fmi.ssp.names import FMU, SSC, SSD, SSV, STRUCTURE, Definitions, units_of


@dataclass(frozen=True)
class Component:
    """An FMU of a system: its bytes, its signals, its units, and the parameters to set."""

    name: str
    content: bytes
    interface: Described
    units: Definitions
    values: tuple[Variable, ...]


@checked
def export_ssp(
    parts: Sequence[Block | str | Path],
    path: str | Path,
    *,
    name: str = "system",
    version: Literal[2, 3] = 2,
    platforms: str | None = None,
    step: float = 0.01,
    stop: float = 10.0,
    outputs: Sequence[str] = (),
) -> Path:
    """Write Blocks and FMUs, connected by signal name, as a system: SSP 1.0, or 2.0 with an FMU of FMI 3.

    Parameters
    ----------
    parts : sequence of Block or path
        Each becomes a component; a path is an FMU of any tool, which keeps its bytes. An input is connected
        to the output of the same name; inputs without one are inputs of the system.
    path : path
        File name with the suffix ``.ssp``.
    name : str, optional
        Of the system.
    version : {2, 3}, optional
        FMI version of the Blocks' FMUs.
    platforms : str, optional
        As for :func:`export_fmu`.
    step, stop : float, optional
        Default communication step and end of the experiment [s].
    outputs : sequence of str, optional
        Outputs of components that are outputs of the system too. Tools that make one FMU of a system need
        them; libcosim 0.10 refuses a system that has any.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If two parts have one name, two outputs have one name, or an argument is wrong.

    Examples
    --------
    >>> import tempfile, zipfile
    >>> import hovercontrol as hc
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = export_ssp([hc.circle(1.0)], Path(folder) / "circle.ssp")
    ...     sorted(zipfile.ZipFile(file).namelist())[0]
    'SystemStructure.ssd'
    """
    target = Path(path)
    if target.suffix != ".ssp":
        raise InputError(f"{path}: expected a file name that ends in .ssp")
    if not parts:
        raise InputError("export_ssp: expected one or more parts, found none")
    check_folder(target.parent)
    components = []
    with tempfile.TemporaryDirectory() as folder:
        for part in parts:
            if isinstance(part, Block):
                file = Path(folder) / f"{Interface(part).identifier}.fmu"
                as_fmu: dict[str, Any] = {"version": version, "platforms": platforms}
                part = export_fmu(part, file, step=step, stop=stop, **as_fmu)
            components.append(_component(Path(part), with_values=Path(part).parent == Path(folder)))
    names = [c.name for c in components]
    for c in components:
        if names.count(c.name) > 1:
            raise InputError(f"export_ssp: two parts have the name {c.name!r}")
    two = any(c.interface.fmi == 3 for c in components)
    files = {STRUCTURE: _structure(components, name, stop, outputs, "2.0" if two else "1.0")}
    for c in components:
        files[f"resources/{c.name}.fmu"] = c.content
        if c.values:
            files[f"resources/{c.name}.ssv"] = _parameter_set(c, name, "2.0" if two else "1.0")
    content = packed(files)
    return write_atomically(target, lambda temporary: temporary.write_bytes(content))


def _component(path: Path, with_values: bool) -> Component:
    with tempfile.TemporaryDirectory() as folder:
        interface = describe(path, Path(folder), "CoSimulation", strict=False)
        units = dict(units_of(ElementTree.parse(Path(folder, DESCRIPTION)).getroot()))
    values = interface.parameters if with_values else ()
    return Component(path.stem.replace(".", "_"), path.read_bytes(), interface, units, values)


def _structure(
    components: Sequence[Component], name: str, stop: float, outputs: Sequence[str], version: str
) -> bytes:
    source = _sources(components)
    for label in outputs:
        if label not in source:
            raise InputError(f"export_ssp: unknown output {label!r}{did_you_mean(label, source)}")
    for prefix, space in (("ssd", SSD), ("ssc", SSC)):
        ElementTree.register_namespace(prefix, space)
    root = Element(f"{{{SSD}}}SystemStructureDescription", name=name, version=version)
    system = SubElement(root, f"{{{SSD}}}System", name=name)
    units: Definitions = {}
    free = {v.name: (c, v) for c in reversed(components) for v in c.interface.inputs if v.name not in source}
    outside = [(*free[label], "input") for label in dict.fromkeys(_inputs(components)) if label in free]
    outside += [(*source[label], "output") for label in outputs]
    _connectors(system, outside, units)
    elements = SubElement(system, f"{{{SSD}}}Elements")
    for c in components:
        about = {"name": c.name, "type": FMU, "source": f"resources/{c.name}.fmu"}
        element = SubElement(elements, f"{{{SSD}}}Component", about)
        own = [(c, v, "input") for v in c.interface.inputs] + [(c, v, "output") for v in c.interface.outputs]
        _connectors(element, own, units)
        if c.values:
            bindings = SubElement(element, f"{{{SSD}}}ParameterBindings")
            file = {"type": "application/x-ssp-parameter-set", "source": f"resources/{c.name}.ssv"}
            SubElement(bindings, f"{{{SSD}}}ParameterBinding", file)
    wires = [
        {"startElement": source[v.name][0].name} | _between(v.name, endElement=c.name)
        for c in components
        for v in c.interface.inputs
        if v.name in source
    ]
    wires += [
        _between(v.name, endElement=c.name)
        for c in components
        for v in c.interface.inputs
        if v.name not in source
    ]
    wires += [{"startElement": source[label][0].name} | _between(label) for label in outputs]
    connections = SubElement(system, f"{{{SSD}}}Connections") if wires else system
    for wire in wires:
        SubElement(connections, f"{{{SSD}}}Connection", wire)
    listed = SubElement(root, f"{{{SSD}}}Units") if units else root
    for unit, base in units.items():
        SubElement(SubElement(listed, f"{{{SSC}}}Unit", name=unit), f"{{{SSC}}}BaseUnit", dict(base))
    SubElement(root, f"{{{SSD}}}DefaultExperiment", startTime="0.0", stopTime=repr(float(stop)))
    return xml_bytes(root)


def _inputs(components: Sequence[Component]) -> list[str]:
    return [v.name for c in components for v in c.interface.inputs]


def _between(label: str, **more: str) -> dict[str, str]:
    return {"startConnector": label, **more, "endConnector": label}


def _sources(components: Sequence[Component]) -> dict[str, tuple[Component, Variable]]:
    """Return the component and the variable of each output."""
    source: dict[str, tuple[Component, Variable]] = {}
    for c in components:
        for v in c.interface.outputs:
            if v.name in source:
                both = f"{source[v.name][0].name!r} and {c.name!r}"
                raise InputError(f"export_ssp: {both} both have the output {v.name!r}")
            source[v.name] = c, v
    return source


def _connectors(
    parent: Element, connectors: Sequence[tuple[Component, Variable, str]], units: Definitions
) -> None:
    """Write connectors, and note the units that they need."""
    group = SubElement(parent, f"{{{SSD}}}Connectors") if connectors else parent
    for c, v, kind in connectors:
        connector = SubElement(group, f"{{{SSD}}}Connector", name=v.name, kind=kind)
        element = SubElement(connector, f"{{{SSC}}}{v.kind}")
        own = v.units[0] if v.units else ""
        if v.kind in REALS and own in c.units and units.setdefault(own, c.units[own]) == c.units[own]:
            element.set("unit", own)
        for n in v.shape:
            SubElement(connector, f"{{{SSC}}}Dimension", size=str(n))


def _parameter_set(c: Component, name: str, version: str) -> bytes:
    """Return the values of a part; all sets have the name of the system: Ecos applies those of one name."""
    ElementTree.register_namespace("ssv", SSV)
    root = Element(f"{{{SSV}}}ParameterSet", version=version, name=name)
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for v in c.values:
        parameter = SubElement(parameters, f"{{{SSV}}}Parameter", name=v.name)
        SubElement(parameter, f"{{{SSV}}}{v.kind}", value=" ".join(map(repr, v.start)))
    return xml_bytes(root)
