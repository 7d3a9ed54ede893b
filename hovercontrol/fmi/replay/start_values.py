"""Estimated values for other tools: start values as CSV and SSV, a copy of the FMU, the effects around it."""

from __future__ import annotations

import csv
import json
import math
import re
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import readable, reason, write_atomically
from hovercontrol.fmi.around import Around
from hovercontrol.fmi.corrected.corrected import corrected_fmu
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.ssp.names import SSV

_DESCRIPTION = "modelDescription.xml"


def save_csv(plant: FmuPlant, path: str | Path) -> Path:
    """Write the values of parameters that differ from the FMU's, and those fitted: name, value, unit."""

    def write(temporary: Path) -> None:
        with temporary.open("w", newline="", encoding="utf-8") as file:
            out = csv.writer(file)
            out.writerow(["name", "value", "unit"])
            out.writerows([n, repr(v), plant.parameters[n].unit] for n, v in _changed(plant).items())

    return write_atomically(path, write)


def read_csv(path: str | Path) -> dict[str, float]:
    """Return the values of a file of :func:`save_csv`, by name.

    Raises
    ------
    InputError
        If the file cannot be read, or is not such a file; the line says where.
    """
    try:
        with readable(path, "start values of an FMU (name, value)").open(
            newline="", encoding="utf-8"
        ) as file:
            rows = csv.DictReader(file)
            if not {"name", "value"} <= set(rows.fieldnames or ()):
                raise InputError(
                    f"{path}: expected columns name and value, as in start_values.csv of identify"
                )
            found: dict[str, float] = {}
            for k, row in enumerate(rows, start=2):
                if row["name"] in found:
                    raise InputError(f"{path}, line {k}: {row['name']!r} is given twice")
                found[row["name"]] = _number(row["value"], f"{path}, line {k}: {row['name']}")
    except (OSError, UnicodeDecodeError, csv.Error) as fault:
        raise InputError(
            f"{path}: not readable as CSV: {reason(fault) if isinstance(fault, OSError) else fault}"
        ) from None
    return found


def _number(text: str | None, where: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a number, found {text!r}")
    return value


def save_ssv(plant: FmuPlant, path: str | Path) -> Path:
    """Write the same values as a parameter set of SSP 1.0 (System Structure Parameter Values)."""
    ElementTree.register_namespace("ssv", SSV)
    root = ElementTree.Element(f"{{{SSV}}}ParameterSet", version="1.0", name=plant.name)
    inside = ElementTree.SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in _changed(plant).items():
        one = ElementTree.SubElement(inside, f"{{{SSV}}}Parameter", name=name)
        ElementTree.SubElement(one, f"{{{SSV}}}Real", value=repr(value))

    def write(temporary: Path) -> None:
        ElementTree.ElementTree(root).write(temporary, encoding="UTF-8", xml_declaration=True)

    return write_atomically(path, write)


def save_copy(plant: FmuPlant, path: str | Path) -> Path:
    """Write a copy of the FMU whose model description has the new start values; nothing else is changed.

    The FMU's binary is the same. FMI leaves it to the importing tool to set start values of the description
    that the binary does not have by itself; a tool that does not do so takes the file of :func:`save_ssv`.
    """
    changed = _changed(plant)

    def write(temporary: Path) -> None:
        with zipfile.ZipFile(plant.path) as old, zipfile.ZipFile(temporary, "w") as new:
            for info in old.infolist():
                data = old.read(info)
                new.writestr(info, described(data, changed) if info.filename == _DESCRIPTION else data)

    return write_atomically(path, write)


def save_corrected(plant: FmuPlant, path: str | Path) -> Path:
    """Write an FMU with the given one inside, its effects around it and the values as start values.

    Raises
    ------
    InputError
        If it cannot be built; see :func:`hovercontrol.fmi.corrected_fmu`.
    """
    around = plant.around
    return corrected_fmu(
        plant.path,
        path,
        before=around.before,
        after=around.after,
        added=around.added,
        kind=plant.interface.kind,
        start=_changed(plant),
    )


def save_around(around: Around, path: str | Path) -> Path:
    """Write the effects around the FMU as JSON: place, name, numbers with units, equations."""

    def write(temporary: Path) -> None:
        temporary.write_text(json.dumps(around_json(around), indent=2) + "\n", encoding="utf-8")

    return write_atomically(path, write)


def around_json(around: Around) -> dict[str, object]:
    """Return the effects around an FMU as what JSON holds."""
    places = (("before", around.at_inputs), ("after", around.at_outputs), ("added", around.in_equations))
    effects = [
        {
            "place": place,
            "name": e.name,
            "numbers": {k: {"value": v, "unit": type(e).numbers[k].unit} for k, v in e.values.items()},
        }
        for place, group in places
        for e in group
    ]
    blocks = {"before": around.before, "after": around.after}
    equations: dict[str, object] = {k: None if b is None else b.equations() for k, b in blocks.items()}
    equations["added"] = {name: block.equations() for name, block in around.added.items()}
    return {"effects": effects, "equations": equations}


def described(data: bytes, values: Mapping[str, float]) -> bytes:
    """Return a model description with other start values; all other bytes are the same.

    Raises
    ------
    InputError
        If a variable is not found.
    """
    places: dict[str, int] = {}
    open_variable: list[str] = []
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag == "ScalarVariable":
            open_variable[:] = [attributes.get("name", "")]
        elif tag == "Real" and open_variable:
            places[open_variable[0]] = parser.CurrentByteIndex
        elif tag in ("Float64", "Float32") and "name" in attributes:
            places[attributes["name"]] = parser.CurrentByteIndex

    def end(tag: str) -> None:
        if tag == "ScalarVariable":
            open_variable.clear()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(data, True)
    by_variable: dict[str, dict[str, float]] = {}
    for label, value in values.items():
        name = label if label in places else label.rpartition("[")[0]
        if name not in places:
            raise InputError(f"modelDescription.xml has no real variable {label!r}")
        by_variable.setdefault(name, {})[label.removeprefix(name)] = value
    for name in sorted(by_variable, key=lambda n: -places[n]):  # from the end: places before stay
        begin = places[name]
        close = _end_of_tag(data, begin)
        data = data[:begin] + _with_start(data[begin:close], by_variable[name]) + data[close:]
    return data


def _end_of_tag(data: bytes, begin: int) -> int:
    quote = b""
    for i in range(begin, len(data)):
        c = data[i : i + 1]
        if quote:
            quote = b"" if c == quote else quote
        elif c in (b'"', b"'"):
            quote = c
        elif c == b">":
            return i + 1
    return len(data)


def _with_start(tag: bytes, values: Mapping[str, float]) -> bytes:
    """Return a tag with its start attribute set; of an array by index ``[2]``."""
    found = re.search(rb"(\sstart\s*=\s*)([\"'])(.*?)\2", tag, re.DOTALL)
    text = found.group(3).decode() if found else ""
    new = _starts(text.split(), values)
    if found:
        return tag[: found.start(3)] + new.encode() + tag[found.end(3) :]
    at = len(tag) - (2 if tag.endswith(b"/>") else 1)
    return tag[:at].rstrip() + f' start="{new}"'.encode() + tag[at:]


def _starts(old: Sequence[str], values: Mapping[str, float]) -> str:
    parts = list(old) or [""]
    for index, value in values.items():
        place = int(index.strip("[]")) - 1 if index and "," not in index else 0
        if index and (len(parts) <= place or "," in index):
            raise InputError(f"start value {index}: expected an array with one index")
        parts[place] = repr(float(value))
    return " ".join(parts)


def _changed(plant: FmuPlant) -> dict[str, float]:
    names = dict.fromkeys((*plant.fit, *plant.values))
    return {name: plant.value(name) for name in names}
