"""An FMU's interface from its ``modelDescription.xml``.

FMPy parses it after :mod:`hovercontrol.fmi.importer.archive` has looked through it; this module selects the
part for one kind of simulation, expands arrays into elements, and reports what cannot be used.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fmpy.model_description import (  # type: ignore[import-untyped]
    ValidationError,
    read_model_description,
)

from hovercontrol.base.errors import InputError
from hovercontrol.fmi.exporter.arrays import ELEMENTS
from hovercontrol.fmi.importer.archive import Header
from hovercontrol.fmi.importer.clocks import Clock, clocks_of
from hovercontrol.fmi.importer.interface import REALS, WHOLE, Interface, Kind, Variable

WORDS = {"CoSimulation": "Co-Simulation", "ModelExchange": "Model Exchange"}
#: Elements of all signals and parameters together; more is no control system.
MOST_ELEMENTS = 100_000
#: Name, unit and description of each element, by the array's name.
#: Of a structural parameter: value reference, type, size.
Size = tuple[int, str, int]
Elements = dict[str, list[tuple[str, str, str]]]


def read_interface(
    path: Path,
    header: Header,
    where: str,
    kind: Kind | None = None,
    strict: bool = True,
    params: Mapping[str, float] | None = None,
) -> Interface:
    """Return the interface in a model description.

    Parameters
    ----------
    path : Path
        ``modelDescription.xml``, already checked.
    header : Header
        Its first element.
    where : str
        Prefix of messages: the FMU's file.
    kind : {"CoSimulation", "ModelExchange"}, optional
        Default: Co-Simulation if the FMU has it.
    strict : bool, optional
        Whether a description that violates the standard is refused; if not, `findings` has what does.
    params : mapping of str to float, optional
        Of these, structural parameters are set, in the file too: arrays have other sizes then.

    Raises
    ------
    InputError
        If it is not of FMI 2 or 3, has not that kind, violates the standard, or is too large.
    """
    version = header.attributes.get("fmiVersion", "")
    if header.tag != "fmiModelDescription" or not version:
        raise InputError(f"{where}: modelDescription.xml is not an FMI model description")
    if version != "2.0" and not version.startswith("3."):
        raise InputError(f"{where} is an FMU of FMI {version}; expected FMI 2.0 or 3.0")
    try:
        root = ElementTree.parse(path).getroot()
        sizes = _sizes(root, params or {}, where)
        if sizes:
            ElementTree.ElementTree(root).write(path, "utf-8", xml_declaration=True)
        # Given the XML file and not its folder, FMPy opens no other file.
        described, findings = _read(path, strict and not sizes)
    except InputError:
        raise
    except ValidationError as error:
        raise InputError(
            f"{where}: modelDescription.xml violates FMI {version}: {_first(error.problems)}; "
            "load(..., strict=False) reads it all the same"
        ) from None
    except Exception as error:  # FMPy raises what its parser and its own look-ups raise
        raise InputError(f"{where}: modelDescription.xml cannot be read: {_first([str(error)])}") from None
    try:
        found = _interface(described, root, where, kind, () if sizes and strict else findings, sizes)
        # FMPy 0.3.32 reads FMI 2's attribute alone.
        element = root.find(found.kind)
        ability = None if element is None else element.get("providesDirectionalDerivatives")
        return replace(found, directional=True) if ability in ("true", "1") else found
    except InputError:
        raise
    except Exception as error:
        if strict:
            raise
        raise InputError(f"{where}: modelDescription.xml cannot be used: {_first([str(error)])}") from None


def _sizes(root: ElementTree.Element, params: Mapping[str, float], where: str) -> dict[str, Size]:
    """Give structural parameters the user's values, and return those."""
    found: dict[str, Size] = {}
    for v in root.iterfind("ModelVariables/*[@causality='structuralParameter']"):
        name = v.get("name", "")
        given = [value for key, value in params.items() if key == name or key.endswith(f".{name}")]
        if given:
            size = given[-1]
            if not isinstance(size, (int, float)) or size != int(size) or size < 0:
                raise InputError(f"{where}: structural parameter {name!r}: expected a size, found {size!r}")
            found[name] = int(v.get("valueReference", "0")), v.tag, int(size)
            v.set("start", str(int(size)))
        elif v.get("start") is None:
            raise InputError(f"{where}: structural parameter {name!r} has no start value; give one in params")
    return found


def _read(path: Path, strict: bool) -> tuple[Any, tuple[str, ...]]:
    """Return what FMPy reads, and its findings where they are tolerated."""
    try:
        return read_model_description(str(path), validate=True), ()
    except ValidationError as error:
        if strict:
            raise
        return read_model_description(str(path), validate=False), tuple(error.problems)


def _part(described: Any, where: str, kind: Kind | None) -> tuple[Any, Kind]:
    """Return the part of a kind, and the kind."""
    parts = {"CoSimulation": described.coSimulation, "ModelExchange": described.modelExchange}
    chosen: Kind = kind or ("CoSimulation" if parts["CoSimulation"] else "ModelExchange")
    if parts[chosen] is None:
        others = [WORDS[k] for k, part in parts.items() if part] or ["Scheduled Execution"]
        wanted = WORDS[chosen] if kind else "Co-Simulation or Model Exchange"
        raise InputError(f"{where} is an FMU for {others[0]} only; expected one for {wanted}")
    return parts[chosen], chosen


def _interface(
    described: Any,
    root: ElementTree.Element,
    where: str,
    kind: Kind | None,
    findings: tuple[str, ...],
    sizes: dict[str, Size],
) -> Interface:
    fmi, own = int(described.fmiVersion[0]), _own_elements(root)
    part, kind = _part(described, where, kind)
    clocks = clocks_of(root, kind) if fmi == 3 else ()
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", part.modelIdentifier or ""):
        raise InputError(f"{where}: the model identifier {part.modelIdentifier!r} is not an identifier of C")
    experiment = described.defaultExperiment
    internal = _positive(getattr(part, "fixedInternalStepSize", None))
    states, derivatives = _states(described, fmi, where, own) if kind == "ModelExchange" else ((), ())
    tolerance = _positive(experiment.tolerance) if experiment else None
    step = (_positive(experiment.stepSize) if experiment else None) or internal
    step = step or min((clock.interval for clock in clocks), default=None)
    (inputs, outputs, parameters), left_out = _signals(described, fmi, where, own, clocks, bool(sizes))
    return Interface(
        fmi=fmi,
        identifier=part.modelIdentifier,
        token=described.guid or "",
        step=step,
        duration=_duration(experiment),
        tolerance=tolerance,
        fixed_step=None if getattr(part, "canHandleVariableCommunicationStepSize", True) else internal,
        inputs=inputs,
        outputs=outputs,
        parameters=parameters,
        structural=tuple(v.name for v in described.modelVariables if v.causality == "structuralParameter"),
        feedthrough=_feedthrough(described, inputs, outputs),
        has_states=part.canGetAndSetFMUstate,
        once_per_process=part.canBeInstantiatedOnlyOncePerProcess,
        left_out=left_out,
        kind=kind,
        states=states,
        derivatives=derivatives,
        indicators=int(described.numberOfEventIndicators or 0),
        directional=bool(part.providesDirectionalDerivative),
        findings=findings,
        clocks=clocks,
        sizes=sizes,
    )


def _signals(
    described: Any, fmi: int, where: str, own: Elements, clocks: Sequence[Clock], resized: bool
) -> tuple[list[tuple[Variable, ...]], tuple[str, ...]]:
    """Return inputs, outputs and parameters, and why inputs and outputs are left out."""
    chosen: dict[str, list[Variable]] = {"input": [], "output": [], "parameter": []}
    left_out: list[str] = []
    elements, ticking = 0, {clock.reference for clock in clocks}
    for variable in described.modelVariables:
        if variable.causality not in chosen or getattr(variable, "alias", None) is not None:
            continue
        if variable.type == "Clock" and variable.valueReference in ticking:
            continue
        if reason := _unusable(variable, clocks):
            if variable.causality != "parameter":  # parameters that are no numbers keep their start values
                left_out.append(f"{variable.causality} {variable.name!r} ({reason})")
            continue
        elements += math.prod(variable.shape or ())
        if elements > MOST_ELEMENTS:
            raise InputError(f"{where} has more than {MOST_ELEMENTS} signals and parameters")
        chosen[variable.causality].append(_variable(variable, fmi, where, own, resized))
    for variables in chosen.values():
        _distinct(variables, where)
    return [tuple(variables) for variables in chosen.values()], tuple(left_out)


def _states(
    described: Any, fmi: int, where: str, own: Elements
) -> tuple[tuple[Variable, ...], tuple[Variable, ...]]:
    """Return the continuous states and their derivatives, in the order of the ModelStructure."""
    listed = [unknown.variable for unknown in described.derivatives]
    pairs = [(d.derivative, d) for d in listed if d is not None and d.derivative is not None]
    if len(pairs) < len(listed):
        raise InputError(f"{where}: a derivative of the ModelStructure names no state")
    made = [[_variable(v, fmi, where, own, resized=True) for v in pair] for pair in pairs]
    return tuple(pair[0] for pair in made), tuple(pair[1] for pair in made)


def _unusable(variable: Any, clocks: Sequence[Clock]) -> str | None:
    if variable.type not in (*REALS, *WHOLE, "Enumeration"):
        return f"of type {variable.type}, not a number"
    ticking = {clock.reference for clock in clocks}
    for clock in variable.clocks or ():
        if clock.valueReference not in ticking:
            return f"clocked by {clock.name!r}, which is not ticked here"
    return None


def _variable(variable: Any, fmi: int, where: str, own: Elements, resized: bool) -> Variable:
    kind = variable.type
    if kind == "Enumeration":
        kind = "Integer" if fmi == 2 else "Int64"
    shape = variable.shape or ()
    indices = itertools.product(*(range(1, n + 1) for n in shape))
    labels = [variable.name + (f"[{','.join(map(str, index))}]" if index else "") for index in indices]
    start = _start(variable, len(labels), where, resized)
    unit = variable.unit or (variable.declaredType.unit if variable.declaredType else None) or ""
    texts = [(label, unit, variable.description or "") for label in labels]
    told = own.get(variable.name, [])
    if len(told) == len(labels) > 1:
        texts = told
    listed = variable.declaredType.items if variable.type == "Enumeration" else ()
    return Variable(
        variable.name,
        variable.valueReference,
        kind,
        tuple(label for label, _, _ in texts),
        tuple(start),
        tuple(of for _, of, _ in texts),
        tuple(text for _, _, text in texts),
        tuple((int(item.value), item.name) for item in listed),
        kind not in REALS or variable.variability == "discrete",
        tuple(clock.valueReference for clock in variable.clocks or ()),
        tuple(shape),
    )


def _start(variable: Any, elements: int, where: str, resized: bool) -> list[float]:
    """Return the start value of each element; one value stands for all of them."""
    words = {"true": 1.0, "false": 0.0}
    start = [float(words.get(word, word)) for word in (variable.start or "").split()]
    if len(start) == 1:
        start *= elements
    if (start or variable.causality == "parameter") and len(start) != elements:
        if not resized:
            raise InputError(
                f"{where}: {variable.name!r} has {elements} elements and {len(start)} start values"
            )
        start = [math.nan] * elements if variable.causality == "parameter" else []
    return start


def _own_elements(root: ElementTree.Element) -> Elements:
    """Return what our own exports say of the elements of arrays, by the array's name."""
    found: Elements = {}
    for v in root.iterfind("ModelVariables/*"):
        for annotation in v.iterfind("Annotations/Annotation"):
            if annotation.get("type") == ELEMENTS:
                about = [[e.get(key, "") for key in ("name", "unit", "description")] for e in annotation]
                if all(name for name, _, _ in about):
                    found[v.get("name", "")] = [(name, unit, text) for name, unit, text in about]
    return found


def _distinct(variables: Iterable[Variable], where: str) -> None:
    seen: set[str] = set()
    for label in itertools.chain.from_iterable(v.labels for v in variables):
        if label in seen:
            raise InputError(f"{where}: two signals have the name {label!r}")
        seen.add(label)


def _feedthrough(
    described: Any, inputs: Sequence[Variable], outputs: Sequence[Variable]
) -> dict[str, tuple[str, ...]]:
    """Return for each output its declared dependencies on inputs; all inputs if nothing is declared."""
    everything = tuple(v.name for v in inputs)
    stated = {
        unknown.variable.name: tuple(v.name for v in unknown.dependencies if v.name in everything)
        for unknown in described.outputs
        if unknown.variable is not None and unknown.dependencies is not None
    }
    return {v.name: stated.get(v.name, everything) for v in outputs}


def _duration(experiment: Any) -> float | None:
    """Return the duration of the default experiment, if given."""
    if not experiment or experiment.stopTime is None:
        return None
    return _positive(float(experiment.stopTime) - float(experiment.startTime or 0.0))


def _positive(text: str | float | None) -> float | None:
    """Return a number of the description if it is positive, else None."""
    value = float(text) if text is not None else 0.0
    return value if math.isfinite(value) and value > 0 else None


def _first(problems: Sequence[str]) -> str:
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return " ".join(problems[0].split())[:300] + more
