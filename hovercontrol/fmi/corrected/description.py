"""``modelDescription.xml`` of a corrected FMU: that of the given FMU, changed.

All variables keep their names and value references. The Block's parameters, states and derivatives are added.
A measured output that has a start value is a state or the like: the variable itself becomes the local
``inner.NAME``, and ``NAME`` is a new output.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement

import hovercontrol
from hovercontrol.blocks.signals import Signal
from hovercontrol.fmi.corrected.inner_fmu import InnerFmu, Variable
from hovercontrol.fmi.corrected.joined import Joined
from hovercontrol.fmi.corrected.partials import PARTIALS, differentiable
from hovercontrol.fmi.corrected.structure import KnownsOf, write_structure
from hovercontrol.fmi.exporter.description import xml_bytes
from hovercontrol.fmi.exporter.units import fmi_unit
from hovercontrol.fmi.exporter.variables import ascii_name

_KEPT = (
    *("needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess", "canNotUseMemoryManagementFunctions"),
    *("canGetAndSetFMUstate", "canSerializeFMUstate", "canGetAndSetFMUState", "canSerializeFMUState"),
)
_STEPS = ("canHandleVariableCommunicationStepSize", "fixedInternalStepSize")


@dataclass
class Description:
    """What the C sources need of the description.

    Attributes
    ----------
    first : int
        Value reference of the Block's first own variable.
    measured : list of int
        Value references of the measured outputs.
    """

    first: int
    identifier: str
    measured: list[int] = field(default_factory=list)
    xml: bytes = b""


def description(inner: InnerFmu, joined: Joined, token: str, start: Mapping[str, float]) -> Description:
    """Return the model description of a corrected FMU.

    Parameters
    ----------
    inner : InnerFmu
        Its tree is changed.
    token : str
        FMI 3's instantiationToken, FMI 2's guid.
    start : mapping of str to float
        New start values of the given FMU's variables.
    """
    root, block = inner.root, joined.block
    own = (*block.states, *block.states[: block.n_continuous], *block.parameters)
    found = Description(max(v.reference for v in inner.variables) + 1, f"{inner.identifier}_corrected"[:60])
    knowns = KnownsOf(inner, joined, found.first)  # before the tree changes
    root.set("guid" if inner.version == 2 else "instantiationToken", token)
    root.set("generationTool", f"hovercontrol {hovercontrol.__version__}")
    _abilities(inner, joined, found.identifier)
    for name, value in start.items():
        inner.by_name[name].typed.set("start", repr(float(value)))
    for k, v in enumerate(joined.driven):
        if f"given_{k}" in block.delays:  # as in other FMUs: what is sent at an event arrives at an event
            v.element.set("variability", "discrete")
    _units(inner, own)
    names = {v.name for v in inner.variables}
    _own_variables(inner, joined, found.first, names)
    next_reference = found.first + len(own)
    renamed: dict[int, int] = {}
    states = {s.reference for s, _ in inner.derivatives()}
    for v in joined.measured:
        if v.element.get("initial") in ("exact", "approx") or v.reference in states:
            renamed[v.reference] = next_reference
            _split(inner, v, next_reference, names)
            next_reference += 1
        found.measured.append(renamed.get(v.reference, v.reference))
    write_structure(inner, joined, knowns, found.first, renamed)
    found.xml = xml_bytes(root)
    return found


# ---- abilities ----


def _abilities(inner: InnerFmu, joined: Joined, identifier: str) -> None:
    """Keep what the corrected FMU can do too; Co-Simulation is there in any case."""
    root, exchange, steps = inner.root, inner.exchange, inner.steps
    late = bool(joined.block.delays)
    kept = {k: v for k, v in inner.part.attrib.items() if k in _KEPT}
    if differentiable(inner, joined):
        kept |= {k: v for k, v in inner.part.attrib.items() if k in PARTIALS}
    places = [e for e in (exchange, steps, root.find("ScheduledExecution")) if e is not None]
    at = min(list(root).index(e) for e in places)
    for e in places:
        root.remove(e)
    if exchange is not None:
        needed = exchange.get(
            "completedIntegratorStepNotNeeded" if inner.version == 2 else "needsCompletedIntegratorStep"
        )
        word = "completedIntegratorStepNotNeeded" if inner.version == 2 else "needsCompletedIntegratorStep"
        told = {word: "false" if inner.version == 2 else "true"} if late else {word: needed} if needed else {}
        root.insert(at, Element("ModelExchange", {"modelIdentifier": identifier} | kept | told))
        at += 1
        variable = {"canHandleVariableCommunicationStepSize": "true"}
    else:
        variable = {k: v for k, v in inner.part.attrib.items() if k in _STEPS}
    root.insert(at, Element("CoSimulation", {"modelIdentifier": identifier} | kept | variable))


# ---- variables ----


def _units(inner: InnerFmu, own: Iterable[Signal]) -> None:
    root = inner.root
    definitions = root.find("UnitDefinitions")
    if definitions is None:
        definitions = Element("UnitDefinitions")
        kinds = ("ModelExchange", "CoSimulation", "ScheduledExecution")
        last = max(k for k, e in enumerate(root) if e.tag in kinds)
        root.insert(last + 1, definitions)
    known = {e.get("name") for e in definitions}
    for unit in dict.fromkeys([fmi_unit(s.unit, d) for s in own for d in (False, True)]):
        if unit.name not in known:
            element = SubElement(definitions, "Unit", name=unit.name)
            if unit.exponents is not None:
                SubElement(element, "BaseUnit", {base: str(power) for base, power in unit.exponents})


def _free(name: str, taken: set[str]) -> str:
    name = ascii_name(name)
    while name in taken:
        name += "_2"
    taken.add(name)
    return name


def _add(
    inner: InnerFmu, reference: int, name: str, words: Mapping[str, str], typed: Mapping[str, str]
) -> None:
    parent = inner.root.find("ModelVariables")
    assert parent is not None
    head = {"name": name, "valueReference": str(reference), **words}
    if inner.version == 2:
        SubElement(SubElement(parent, "ScalarVariable", head), "Real", dict(typed))
    else:
        SubElement(parent, "Float64", {**head, **typed})


def _own_variables(inner: InnerFmu, joined: Joined, first: int, names: set[str]) -> None:
    block, reference = joined.block, first
    fixed = {s for e in block.delays.values() for s in e.free_symbols}
    states = {}
    for k, s in enumerate(block.states):
        kind = "continuous" if k < block.n_continuous else "discrete"
        words = {"causality": "local", "variability": kind, "initial": "exact", "description": s.description}
        states[s.name] = _free(s.name, names)
        _add(inner, reference, states[s.name], words, _typed(s, start=s.start))
        reference += 1
    listed = len(list(inner.variables)) if inner.version == 2 else 0
    for k, s in enumerate(block.states[: block.n_continuous]):
        words = {"causality": "local", "variability": "continuous", "initial": "calculated"}
        of = str(listed + k + 1) if inner.version == 2 else str(first + k)
        typed = {"unit": fmi_unit(s.unit, per_second=True).name, "derivative": of}
        _add(inner, reference, _free(f"der({states[s.name]})", names), words, typed)
        reference += 1
    for s in block.parameters:
        kind = "fixed" if s.symbol in fixed else "tunable"
        words = {
            "causality": "parameter",
            "variability": kind,
            "initial": "exact",
            "description": s.description,
        }
        name = _free(block.parameter_key(s.name).removeprefix("around."), names)
        _add(inner, reference, name, words, _typed(s, start=s.start, bounds=True))
        reference += 1


def _typed(s: Signal, start: float, bounds: bool = False) -> dict[str, str]:
    found = {"unit": fmi_unit(s.unit).name}
    if bounds:
        ends = {"min": s.lower, "max": s.upper}
        found |= {k: repr(float(v)) for k, v in ends.items() if abs(v) < float("inf")}
    if s.nominal != 1.0:
        found["nominal"] = repr(float(s.nominal))
    return found | {"start": repr(float(start))}


def _split(inner: InnerFmu, v: Variable, reference: int, names: set[str]) -> None:
    """Make a variable the local ``inner.NAME``, and an output of its name beside it."""
    name = v.name
    head = {k: x for k, x in v.element.attrib.items() if k == "description"}
    head |= {"causality": "output", "variability": "continuous", "initial": "calculated"}
    about = ("declaredType", "quantity", "unit", "displayUnit", "relativeQuantity", "nominal")
    _add(inner, reference, name, head, {k: x for k, x in v.typed.attrib.items() if k in about})
    v.element.set("name", _free(f"inner.{name}", names))
    v.element.set("causality", "local")
