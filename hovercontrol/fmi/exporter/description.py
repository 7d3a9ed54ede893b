"""``modelDescription.xml`` of FMI 2.0 and 3.0, from one table of variables and one structure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import hovercontrol
from hovercontrol.fmi.exporter.arrays import ELEMENTS, Array, as_one
from hovercontrol.fmi.exporter.sources import Version
from hovercontrol.fmi.exporter.structure import Structure, Unknown
from hovercontrol.fmi.exporter.units import DEGREES, Unit
from hovercontrol.fmi.exporter.variables import Interface, Variable

CATEGORIES = {
    "logEvents": "friction that sticks or slips, switches at given times",
    "logStatusWarning": "calls that return a warning",
    "logStatusDiscard": "calls that return discard: a step that the solver cannot take",
    "logStatusError": "calls that return an error",
    "logAll": "all messages",
}

#: What the runtime can do, by version of FMI and interface; what is not named it cannot.
_ABILITIES: dict[tuple[int, str], dict[str, str]] = {
    (2, "ModelExchange"): {
        "completedIntegratorStepNotNeeded": "false",  # it sees a sticking velocity that was moved
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    },
    (2, "CoSimulation"): {
        "maxOutputDerivativeOrder": "1",
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    },
    (3, "ModelExchange"): {
        "needsCompletedIntegratorStep": "true",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    },
    (3, "CoSimulation"): {
        "maxOutputDerivativeOrder": "1",
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
        "hasEventMode": "true",
        "mightReturnEarlyFromDoStep": "true",
        "providesIntermediateUpdate": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
    },
}


@dataclass(frozen=True)
class Experiment:
    """The default experiment: from 0 to `stop` [s], communicating every `step` [s], at tolerance `rtol`."""

    stop: float
    step: float
    rtol: float


def model_description(
    interface: Interface,
    version: Version,
    token: str,
    experiment: Experiment,
    text: str,
    source_files: Iterable[str] = (),
    model_name: str = "",
) -> bytes:
    """Return ``modelDescription.xml``.

    Parameters
    ----------
    version : {2, 3}
    token : str
        FMI 3's instantiationToken, FMI 2's guid.
    text : str
        Description of the model, one sentence.
    source_files : iterable of str, optional
        Files to compile; FMI 2 lists them here, FMI 3 in ``buildDescription.xml``.
    model_name : str, optional
        What tools show as the model's name (default: the Block's).
    """
    root = Element("fmiModelDescription", fmiVersion="2.0" if version == 2 else "3.0")
    root.set("modelName", model_name or interface.block.name)
    root.set("guid" if version == 2 else "instantiationToken", token)
    root.set("description", text)
    root.set("generationTool", f"hovercontrol {hovercontrol.__version__}")
    root.set("variableNamingConvention", "structured")
    if version == 2:
        root.set("numberOfEventIndicators", str(len(interface.frictions)))
    for kind in ("ModelExchange", "CoSimulation"):
        abilities = {
            key: value
            for key, value in _ABILITIES[version, kind].items()
            if interface.differentiable or not key.endswith(("Derivative", "Derivatives"))
        }
        element = SubElement(root, kind, {"modelIdentifier": interface.identifier} | abilities)
        if version == 2:
            files = SubElement(element, "SourceFiles")
            for name in source_files:
                SubElement(files, "File", name=name)
    listed = [v for v in interface.variables if version == 3 or v.kind != "event"]
    _units(root, listed)
    types = _types(root, listed, version)
    categories = SubElement(root, "LogCategories")
    for name, description in CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=description)
    numbers = {"startTime": 0.0, "stopTime": experiment.stop, "tolerance": experiment.rtol}
    times = {key: _text(value) for key, value in numbers.items()}
    SubElement(root, "DefaultExperiment", times | {"stepSize": _text(experiment.step)})
    variables = SubElement(root, "ModelVariables")
    arrays = {v.reference: a for a in interface.arrays for v in a.elements}
    for v in listed:
        if version == 2:
            _variable_2(variables, v, types)
        elif v.reference not in arrays:
            _variable_3(variables, v, types)
        elif v.reference == arrays[v.reference].reference:
            _array(variables, arrays[v.reference], types)
    _structure(SubElement(root, "ModelStructure"), interface, version)
    return xml_bytes(root)


def xml_bytes(root: Element) -> bytes:
    """Return an XML document, indented, the same bytes for the same content."""
    indent(root)
    text = tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _text(value: float) -> str:
    return repr(float(value))


def _used_units(listed: Iterable[Variable]) -> list[Unit]:
    return list(dict.fromkeys(v.unit for v in listed if v.unit is not None))


def _units(root: Element, listed: Iterable[Variable]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for unit in _used_units(listed):
        element = SubElement(definitions, "Unit", name=unit.name)
        if unit.exponents is not None:
            SubElement(element, "BaseUnit", {base: str(power) for base, power in unit.exponents})
        if unit.display:
            SubElement(element, "DisplayUnit", name=unit.display, factor=_text(DEGREES))


def _types(root: Element, listed: list[Variable], version: Version) -> dict[Unit | None, str]:
    """Write a type for each unit and one for friction modes; return their names."""
    taken = {v.name for v in listed}
    definitions = SubElement(root, "TypeDefinitions")
    names: dict[Unit | None, str] = {}

    def free(name: str) -> str:
        while name in taken:
            name += "Type"
        taken.add(name)
        return name

    def add(name: str, kind: str, description: str, attributes: dict[str, str]) -> None:
        if version == 3:  # without the description, which FMPy 0.3.20 refuses
            SubElement(definitions, f"{kind}Type", {"name": name} | attributes)
        else:
            element = SubElement(definitions, "SimpleType", name=name, description=description)
            SubElement(element, {"Float64": "Real", "Int32": "Integer"}[kind], attributes)

    for unit in _used_units(listed):
        names[unit] = free(unit.quantity)
        add(names[unit], "Float64", f"in {unit.name}", {"quantity": unit.quantity, **_unit(unit)})
    if any(v.kind == "mode" for v in listed):
        names[None] = free("FrictionMode")
        add(names[None], "Int32", "-1 and 1: slipping that way; 0: sticking", {"min": "-1", "max": "1"})
    return names


def _unit(unit: Unit) -> dict[str, str]:
    return {"unit": unit.name} | ({"displayUnit": unit.display} if unit.display else {})


def _head(v: Variable) -> dict[str, str]:
    head = {"name": v.name, "valueReference": str(v.reference)}
    head |= {"description": v.description} if v.description else {}
    head |= {"causality": v.causality, "variability": v.variability}
    return head | ({"initial": v.initial} if v.initial else {})


def _value(v: Variable, types: dict[Unit | None, str], number: Callable[[float], str]) -> dict[str, str]:
    found = {"declaredType": types[v.unit]} if v.unit or v.kind == "mode" else {}
    found |= _unit(v.unit) if v.unit else {}
    found |= {"min": number(v.lower)} if math.isfinite(v.lower) else {}
    found |= {"max": number(v.upper)} if math.isfinite(v.upper) else {}
    found |= {"nominal": number(v.nominal)} if v.nominal != 1.0 else {}
    return found | ({"start": number(v.start)} if v.start is not None else {})


def _variable_3(parent: Element, v: Variable, types: dict[Unit | None, str]) -> Element:
    whole = v.kind == "mode"
    element = SubElement(parent, "Int32" if whole else "Float64", _head(v))
    element.attrib |= _value(v, types, (lambda x: str(int(x))) if whole else _text)
    if v.derivative_of is not None:
        element.set("derivative", str(v.derivative_of))
    if v.reinit:
        element.set("reinit", "true")
    return element


def _array(parent: Element, array: Array, types: dict[Unit | None, str]) -> None:
    element = _variable_3(parent, as_one(array), types)
    if element.get("start"):
        element.set("start", " ".join(_text(v.start or 0.0) for v in array.elements))
    annotation = SubElement(SubElement(element, "Annotations"), "Annotation", type=ELEMENTS)
    for v in array.elements:
        about = {"name": v.name, "unit": v.unit.name if v.unit else "", "description": v.description}
        SubElement(annotation, "Element", {key: text for key, text in about.items() if text})
    for n in array.shape:
        SubElement(element, "Dimension", start=str(n))


def _variable_2(parent: Element, v: Variable, types: dict[Unit | None, str]) -> None:
    whole = v.kind == "mode"
    outer = SubElement(parent, "ScalarVariable", _head(v))
    value = _value(v, types, (lambda x: str(int(x))) if whole else _text)
    element = SubElement(outer, "Integer" if whole else "Real", value)
    if v.derivative_of is not None:  # an index from 1, not a value reference; time is the first variable
        element.set("derivative", str(v.derivative_of + 1))
    if v.reinit:
        element.set("reinit", "true")


def _structure(parent: Element, interface: Interface, version: Version) -> None:
    structure = Structure(interface)
    computed = {v.reference for v in interface.variables if v.initial == "calculated"}
    unknowns = (*structure.derivatives, *structure.outputs)
    initial = [_at_initialization(u) for u in unknowns if u.reference in computed]
    held = set(interface.held.values())
    lists: dict[str, Iterable[Unknown]]
    if version == 3:
        lists = {
            "Output": [_without(u, held) for u in structure.outputs],
            "ContinuousStateDerivative": [_without(u, held) for u in structure.derivatives],
            "InitialUnknown": initial,
            "EventIndicator": [_without(u, held) for u in structure.events],
        }
        for name, found in lists.items():
            for u in _by_array(found, interface):
                SubElement(parent, name, {"valueReference": str(u.reference)} | _knowns(u, {}))
        return
    index = {v.reference: k for k, v in enumerate((v for v in interface.variables if v.kind != "event"), 1)}
    others = held | {v.reference for v in interface.of("parameter")}
    lists = {
        "Outputs": [_without(u, others) for u in structure.outputs],
        "Derivatives": [_without(u, others) for u in structure.derivatives],
        "InitialUnknowns": sorted(initial, key=lambda u: u.reference),
    }
    for name, found in lists.items():
        if found:
            element = SubElement(parent, name)
            for u in found:
                SubElement(element, "Unknown", {"index": str(index[u.reference])} | _knowns(u, index))


def _by_array(found: Iterable[Unknown], interface: Interface) -> Iterable[Unknown]:
    """Yield unknowns of FMI 3: an array depends on all that its elements depend on."""
    arrays = {v.reference: a.reference for a in interface.arrays for v in a.elements}
    merged: dict[int, dict[int, str]] = {}
    for u in found:
        reference = arrays.get(u.reference, u.reference)
        kinds = merged.setdefault(reference, {})
        for known, kind in u.knowns:
            of_array = known in arrays or u.reference in arrays
            kinds[arrays.get(known, known)] = "dependent" if of_array else kind
    for reference, kinds in merged.items():
        yield Unknown(reference, tuple(sorted(kinds.items())))


def _without(u: Unknown, left_out: set[int]) -> Unknown:
    """In FMI 2 knowns are inputs, states and time; parameters are knowns at initialization only."""
    return Unknown(u.reference, tuple(k for k in u.knowns if k[0] not in left_out))


def _at_initialization(u: Unknown) -> Unknown:
    """There are no tunable or discrete factors there: a factor that is not constant is dependent."""
    kinds = ((r, kind if kind == "constant" else "dependent") for r, kind in u.knowns)
    return Unknown(u.reference, tuple(kinds))


def _knowns(u: Unknown, index: dict[int, int]) -> dict[str, str]:
    references = " ".join(str(index.get(r, r)) for r, _ in u.knowns)
    return {"dependencies": references, "dependenciesKind": " ".join(kind for _, kind in u.knowns)}
