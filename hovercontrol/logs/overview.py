"""The topics of a log file with their rates, columns and ranges, and a proposal for ``--columns``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from hovercontrol.base.percent import percent
from hovercontrol.base.text_table import aligned
from hovercontrol.logs.log import POSE, VELOCITY
from hovercontrol.logs.proposal import has_fix, proposal
from hovercontrol.logs.required_columns import RequiredColumns
from hovercontrol.logs.source import format_of, open_log
from hovercontrol.logs.topic import Topic, topics_of

#: Maximum number of columns of a topic that are listed with their ranges.
LISTED = 40


def overview(file: Path, wanted: RequiredColumns, options: str = "") -> str | None:
    """Return a list of a file's topics and a proposal for ``--columns``, or None if none is needed.

    Parameters
    ----------
    wanted : RequiredColumns
        The columns of the model: none is needed where the file has its outputs, or its motion, by name.
    options : str, optional
        Further options of the proposed command.

    Raises
    ------
    InputError
        As :func:`hovercontrol.logs.source.open_log`.
    """
    kind = format_of(file).name
    if kind in ("CSV", "Parquet") and not has_fix(open_log(file).header):
        return None
    topics = topics_of(file)
    names = {name for topic in topics for name in topic.header}
    triples = (POSE, VELOCITY) if wanted.motion else [{name} for name in wanted.outputs]
    if any(names.issuperset(triple) for triple in triples):
        return None
    inputs, measured = list(wanted.inputs), POSE if wanted.motion else tuple(wanted.outputs)
    found, frame = proposal(topics, kind, inputs)
    said = {k: v for k, v in found.items() if wanted.motion or k in (*measured, *inputs)}
    lines = [f"{file}: {kind}, {len(topics)} topic{'s' * (len(topics) != 1)}"]
    for topic in topics:
        lines += _listed(topic)
    if not said:
        columns = ",".join(f"{name}=TOPIC/FIELD" for name in measured)
        return "\n".join([*lines, f"No name suggests {', '.join(measured)}: --columns {columns}"])
    options += f" --frame {frame}" if frame else ""
    pairs = ",".join(f"{ours}={theirs}" for ours, theirs in said.items())
    missing = [name for name in (*measured, *inputs) if name not in said]
    hint = f" ({', '.join(missing)}: no name suggests a column)" if missing else ""
    lines += [
        f"{topic.name} has the same body, with the corrections of a localisation"
        for topic in topics
        if " in " in topic.name and said.get("x", "").startswith(f"{topic.name.partition(' in ')[0]}]/")
    ]
    lines += [f"Names suggest{hint}:", f"  hovercontrol check {file} --columns '{pairs}'{options}"]
    return "\n".join(lines)


def _listed(topic: Topic) -> list[str]:
    """Return lines on a topic: rate, clock, and unit, range and missing share of each column that changes."""
    rate = f"{topic.rate:.4g} Hz" if np.isfinite(topic.rate) else "no rate"
    clock = f", time by {topic.clock.rpartition('/')[2]}" if topic.clock else ", no clock"
    lines = [f"  {topic.name}  {topic.rows} rows, {rate}{clock}"]
    names = [name for name in topic.header if name != topic.clock]
    values = topic.values(names)
    if topic.source.said:
        lines.append(f"      read with {topic.source.said}")
    rows: list[tuple[str, ...]] = []
    still: dict[str, list[str]] = {}
    for name in names:
        short, seen = name.removeprefix(f"{topic.name}/"), values[name][np.isfinite(values[name])]
        if not seen.size or np.ptp(seen) == 0.0:
            still.setdefault(f"{seen[0]:.4g}" if seen.size else "empty", []).append(short)
            continue
        missing = 1.0 - seen.size / values[name].size
        share = f"{percent(missing)} missing" if missing else ""
        rows.append(
            (short, topic.source.units.get(name, ""), f"{seen.min():.5g}", f"{seen.max():.5g}", share)
        )
    if rows:
        lines += [f"      {line}" for line in aligned([("column", "unit", "from", "to", ""), *rows[:LISTED]])]
    if len(rows) > LISTED:
        lines.append(f"      and {', '.join(row[0] for row in rows[LISTED:])}")
    for value, own in still.items():
        text = ", ".join(_condensed(own))
        lines += [
            f"      {line}" for line in wrap(f"constant at {value}: {text}", 100, subsequent_indent="  ")
        ]
    return lines


def _condensed(names: Sequence[str]) -> list[str]:
    """Return names with successive elements of an array as one, ``q[0..3]``.

    Examples
    --------
    >>> _condensed(["x", "q[0]", "q[1]", "q[2]", "q[4]", "data[5]"])
    ['x', 'q[0..2]', 'q[4]', 'data[5]']
    """
    spans: list[tuple[str, int, int]] = []
    for name in names:
        element = re.fullmatch(r"(.*)\[(\d+)\]", name)
        stem, at = (element[1], int(element[2])) if element else (name, -1)
        if spans and at > 0 and (spans[-1][0], spans[-1][2]) == (stem, at - 1):
            spans[-1] = (stem, spans[-1][1], at)
        else:
            spans.append((stem, at, at))
    return [
        stem if last < 0 else f"{stem}[{first}]" if first == last else f"{stem}[{first}..{last}]"
        for stem, first, last in spans
    ]
