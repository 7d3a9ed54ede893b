"""Systems of FMUs in one file (SSP 1.0): written from Blocks and FMUs that are connected by name, and read.

A .ssp file is a ZIP archive: ``SystemStructure.ssd`` names the components, their connectors, connections and
parameter files; ``resources/`` holds an FMU and a parameter file (.ssv) for each component.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.base.files import check_folder, write_atomically
from hovercontrol.blocks.block import Block
from hovercontrol.fmi.exporter.description import xml_bytes
from hovercontrol.fmi.exporter.export import export_fmu
from hovercontrol.fmi.exporter.package import packed
from hovercontrol.fmi.exporter.variables import Interface

if TYPE_CHECKING:
    import control

_SPACE = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV = (f"{_SPACE}{part}" for part in ("Description", "Common", "ParameterValues"))
_FMU = "application/x-fmu-sharedlibrary"
#: The one file that every system has.
STRUCTURE = "SystemStructure.ssd"


@dataclass(frozen=True)
class Component:
    """An FMU of a system: its bytes, its signals, and parameter values to set."""

    name: str
    content: bytes
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: Mapping[str, float]


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
) -> Path:
    """Write Blocks and FMUs, connected by signal name, as a system (SSP 1.0).

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

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If two parts have one name, two outputs have one name, or an argument is wrong.

    Notes
    -----
    Source: System Structure and Parameterization 1.0, Modelica Association, 2019.

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
    for part in parts:
        if isinstance(part, Block):
            components.append(_from_block(part, version, platforms, step, stop))
        else:
            components.append(_from_file(Path(part)))
    names = [c.name for c in components]
    for c in components:
        if names.count(c.name) > 1:
            raise InputError(f"export_ssp: two parts have the name {c.name!r}")
    files = {STRUCTURE: _structure(components, name, stop)}
    for c in components:
        files[f"resources/{c.name}.fmu"] = c.content
        if c.parameters:
            files[f"resources/{c.name}.ssv"] = _parameter_set(c)
    content = packed(files)
    return write_atomically(target, lambda temporary: temporary.write_bytes(content))


def _from_block(
    block: Block, version: Literal[2, 3], platforms: str | None, step: float, stop: float
) -> Component:
    interface = Interface(block)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "part.fmu"
        # SSP 1.0 has no connectors and no parameters that are arrays.
        content = export_fmu(
            block, file, version=version, platforms=platforms, step=step, stop=stop, arrays=False
        ).read_bytes()
    values = {v.name: v.start for v in interface.of("parameter") if v.start is not None}
    inputs, outputs = interface.of("input"), interface.outputs
    return Component(
        interface.identifier, content, tuple(v.name for v in inputs), tuple(v.name for v in outputs), values
    )


def _from_file(path: Path) -> Component:
    from hovercontrol.fmi.importer.unpacked import open_source  # needs FMPy

    source = open_source(path, "CoSimulation", strict=False)
    source.unpacked.release()
    found = source.interface
    inputs, outputs = (tuple(v.name for v in group) for group in (found.inputs, found.outputs))
    return Component(path.stem.replace(".", "_"), path.read_bytes(), inputs, outputs, {})


def _wires(components: Sequence[Component]) -> tuple[dict[str, str], list[tuple[str, str]]]:
    """Return the component of each output, and the inputs (component, name) that nothing feeds."""
    source: dict[str, str] = {}
    for c in components:
        for label in c.outputs:
            if label in source:
                raise InputError(
                    f"export_ssp: {source[label]!r} and {c.name!r} both have the output {label!r}"
                )
            source[label] = c.name
    return source, [(c.name, i) for c in components for i in c.inputs if i not in source]


def _structure(components: Sequence[Component], name: str, stop: float) -> bytes:
    source, free = _wires(components)
    ElementTree.register_namespace("ssd", SSD)
    ElementTree.register_namespace("ssc", SSC)
    root = Element(f"{{{SSD}}}SystemStructureDescription", name=name, version="1.0")
    system = SubElement(root, f"{{{SSD}}}System", name=name)
    # Outputs are those of the components: libcosim 0.10 refuses connections to connectors of the system.
    outside = SubElement(system, f"{{{SSD}}}Connectors") if free else system
    for label in dict.fromkeys(label for _, label in free):
        _connector(outside, label, "input")
    elements = SubElement(system, f"{{{SSD}}}Elements")
    for c in components:
        about = {"name": c.name, "type": _FMU, "source": f"resources/{c.name}.fmu"}
        element = SubElement(elements, f"{{{SSD}}}Component", about)
        connectors = SubElement(element, f"{{{SSD}}}Connectors")
        for kind, labels in (("input", c.inputs), ("output", c.outputs)):
            for label in labels:
                _connector(connectors, label, kind)
        if c.parameters:
            bindings = SubElement(element, f"{{{SSD}}}ParameterBindings")
            file = {"type": "application/x-ssp-parameter-set", "source": f"resources/{c.name}.ssv"}
            SubElement(bindings, f"{{{SSD}}}ParameterBinding", file)
    wires = SubElement(system, f"{{{SSD}}}Connections")
    for c in components:
        for label in c.inputs:
            if label in source:
                ends = {"startElement": source[label], "startConnector": label}
                SubElement(
                    wires, f"{{{SSD}}}Connection", ends | {"endElement": c.name, "endConnector": label}
                )
    for owner, label in free:
        ends = {"startConnector": label, "endElement": owner, "endConnector": label}
        SubElement(wires, f"{{{SSD}}}Connection", ends)
    SubElement(root, f"{{{SSD}}}DefaultExperiment", startTime="0.0", stopTime=repr(float(stop)))
    return xml_bytes(root)


def _connector(parent: Element, label: str, kind: str) -> None:
    SubElement(SubElement(parent, f"{{{SSD}}}Connector", name=label, kind=kind), f"{{{SSC}}}Real")


def _parameter_set(c: Component) -> bytes:
    ElementTree.register_namespace("ssv", SSV)
    root = Element(f"{{{SSV}}}ParameterSet", version="1.0", name=c.name)
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for key, value in c.parameters.items():
        parameter = SubElement(parameters, f"{{{SSV}}}Parameter", name=key)
        SubElement(parameter, f"{{{SSV}}}Real", value=repr(float(value)))
    return xml_bytes(root)


def load_ssp(path: Path, load: Callable[..., Any], **options: Any) -> control.InterconnectedSystem:
    """Return a system of FMUs as one python-control system; :func:`hovercontrol.fmi.load` calls this.

    Parameters
    ----------
    load : callable
        :func:`hovercontrol.fmi.load`.
    **options
        Its arguments for each FMU.

    Raises
    ------
    InputError
        If it is not a system of FMUs, or an FMU cannot be loaded.
    """
    import control

    from hovercontrol.fmi.importer.archive import LIMITS, check_xml, open_archive

    with open_archive(path) as archive, tempfile.TemporaryDirectory() as folder:

        def parsed(name: str) -> Element:
            data = archive.read(name, LIMITS.description)
            check_xml(data, f"{path}: {name}")
            return ElementTree.fromstring(data)

        system = parsed(STRUCTURE).find(f"{{{SSD}}}System")
        if system is None:
            raise InputError(f"{path}: {STRUCTURE} has no System")
        archive.unpack(Path(folder), lambda name: name.startswith("resources/"))
        parts = []
        try:
            for element in system.iterfind(f"{{{SSD}}}Elements/{{{SSD}}}Component"):
                file = Path(folder, element.get("source", "")).resolve()
                if not file.is_relative_to(Path(folder).resolve()) or not file.is_file():
                    raise InputError(f"{path}: it holds no FMU {element.get('source')!r}")
                values = _values(element, parsed)
                parts.append(load(file, name=element.get("name", ""), params=values, **options))
        except BaseException:
            for part in parts:
                part.close()
            raise
    outputs = [(part.name, label) for part in parts for label in part.output_index]
    return control.interconnect(parts, name=path.stem, **_connections(system, outputs))


def _values(element: Element, parsed: Any) -> dict[str, float]:
    values = {}
    for binding in element.iterfind(f"{{{SSD}}}ParameterBindings/{{{SSD}}}ParameterBinding"):
        file = binding.get("source")
        found = parsed(file) if file else binding
        for parameter in found.iter(f"{{{SSV}}}Parameter"):
            number = next((e.get("value") for e in parameter if e.get("value") is not None), None)
            if number is not None:
                key = parameter.get("name", "")
                try:
                    values[key] = float({"true": 1, "false": 0}.get(number, number))
                except ValueError:
                    raise InputError(f"parameter {key!r}: expected a number, found {shown(number)}") from None
    return values


def _connections(system: Element, outputs: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """Return the arguments of ``control.interconnect`` for a system's connections.

    Outputs are those of the system or, where it has none, of its components.
    """
    inner: dict[tuple[str, str], list[tuple[str, str]]] = {}
    into: dict[str, list[tuple[str, str]]] = {}
    out: dict[str, tuple[str, str]] = {}
    for wire in system.iterfind(f"{{{SSD}}}Connections/{{{SSD}}}Connection"):
        get = wire.get
        start = (get("startElement", ""), get("startConnector", ""))
        end = (get("endElement", ""), get("endConnector", ""))
        if start[0] and end[0]:
            inner.setdefault(end, []).append(start)
        elif end[0]:
            into.setdefault(start[1], []).append(end)
        elif start[0]:
            out[end[1]] = start
    labels = [label for _, label in outputs]
    named = {
        label if labels.count(label) == 1 else f"{part}_{label}": (part, label) for part, label in outputs
    }
    out = out or named
    return {
        "connections": [[end, *starts] for end, starts in inner.items()] or False,
        "inplist": list(into.values()),
        "inputs": list(into),
        "outlist": list(out.values()),
        "outputs": list(out),
    }
