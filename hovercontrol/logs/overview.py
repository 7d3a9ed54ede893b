"""The topics of a log file with their rates and columns, and a proposal for ``--columns``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from hovercontrol.errors import InputError
from hovercontrol.logs.log import POSE, VELOCITY
from hovercontrol.logs.readers.tables import Table, Tables
from hovercontrol.logs.source import Source, format_of, open_log
from hovercontrol.logs.wanted import Wanted

#: Topics with setpoints instead of measurements, and with a simulator's ground truth.
_WANTED = re.compile(r"set_?point|desired|target|reference|groundtruth|_sp\b", re.IGNORECASE)
_COMMAND = re.compile(
    r"cmd|command|actuator|motor|servo|rc_?ou|throttle|thrust|rudder|pwm|fan|esc", re.IGNORECASE
)
_NO_POSITION = re.compile(
    r"vel|acc|gyr|angular|linear|orient|quat|twist|mag|rot|del|\bv[xy]$|var|ref_", re.IGNORECASE
)

#: Suffixes of the names of x and y of a position, of a heading, of a yaw rate, and of body velocities.
_POSITIONS = ((r"x", "y"), (r"\bPN", "PE"), (r"pos\[0\]", "pos[1]"), (r"position\[0\]", "position[1]"))
_HEADING = re.compile(r"(^|[./_])(heading|yaw|psi)$", re.IGNORECASE)
_RATE = re.compile(
    r"(angular(_velocity)?\.z|angular_velocity/xyz\[2\]|GyrZ|yaw_?rate|yawspeed|(^|[./])r)$", re.IGNORECASE
)
_QUATERNIONS = (
    ("orientation.x", "orientation.y", "orientation.z", "orientation.w"),
    ("rotation.x", "rotation.y", "rotation.z", "rotation.w"),
    ("qx", "qy", "qz", "qw"),
    ("/q[1]", "/q[2]", "/q[3]", "/q[0]"),  # PX4: the scalar first
    (".rx", ".ry", ".rz"),
)

#: Maximum number of proposed commands if no model gives the number of its inputs.
MOST_COMMANDS = 4

#: Formats whose frame is north-east-down.
_NED = ("PX4 ULog", "ArduPilot log")


@dataclass(frozen=True)
class Topic:
    """A table of a file, as listed in the overview."""

    name: str
    header: list[str]
    rows: int
    clock: str
    source: Source

    def values(self, names: Sequence[str]) -> dict[str, Any]:
        """Return columns as floats."""
        parts: dict[str, list[Any]] = {name: [] for name in names}
        for batch in self.source.batches(list(names)):
            for name in names:
                column = batch.column(name).cast(pa.float64(), safe=False)
                parts[name].append(column.to_numpy(zero_copy_only=False))
        return {name: np.concatenate(found) if found else np.zeros(0) for name, found in parts.items()}

    @property
    def rate(self) -> float:
        """The usual rate [Hz]; NaN if there is no clock."""
        clock = self.clock
        if not clock or self.rows < 2:
            return float("nan")
        unit = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}.get(self.source.units.get(clock, "s"), 1.0)
        step = float(np.median(np.diff(self.values([clock])[clock]))) * unit
        return 1.0 / step if step > 0.0 else float("nan")


def overview(file: Path, wanted: Wanted, options: str = "") -> str | None:
    """Return a list of a file's topics and a proposal for ``--columns``, or None if none is needed.

    Parameters
    ----------
    wanted : Wanted
        The columns of the model: none is needed where the file has its outputs, or its motion, by name.
    options : str, optional
        Further options of the proposed command.

    Raises
    ------
    InputError
        As :func:`hovercontrol.logs.source.open_log`.
    """
    kind = format_of(file).name
    if kind in ("CSV", "Parquet"):
        return None
    topics = _topics(file)
    names = {name for topic in topics for name in topic.header}
    triples = (POSE, VELOCITY) if wanted.motion else [{name} for name in wanted.outputs]
    if any(names.issuperset(triple) for triple in triples):
        return None
    inputs, measured = list(wanted.inputs), POSE if wanted.motion else tuple(wanted.outputs)
    said = {k: v for k, v in proposal(topics, inputs).items() if wanted.motion or k in (*measured, *inputs)}
    lines = [f"{file}: {kind}, {len(topics)} topic{'s' * (len(topics) != 1)}"]
    for topic in topics:
        rate = f"{topic.rate:.4g} Hz" if np.isfinite(topic.rate) else "no rate"
        prefix = f"{topic.name}/"
        lines.append(f"  {topic.name}  {topic.rows} rows, {rate}")
        lines += [f"      {text}" for text in _wrapped([n.removeprefix(prefix) for n in topic.header])]
    if not said:
        columns = ",".join(f"{name}=TOPIC/FIELD" for name in measured)
        return "\n".join([*lines, f"No name suggests {', '.join(measured)}: --columns {columns}"])
    if kind == "Motive (OptiTrack) CSV":  # y is up there, unless it was exported otherwise
        said |= {"y": f"{said['y'].removesuffix('.y')}.z:-"} if "y" in said else {}
        said |= {"psi": f"{said['psi']}:y-up"} if "," in said.get("psi", "") else {}
    options += " --frame ned" if kind in _NED else ""
    pairs = ",".join(f"{ours}={theirs}" for ours, theirs in said.items())
    missing = [name for name in (*measured, *inputs) if name not in said]
    hint = f" ({', '.join(missing)}: no name suggests a column)" if missing else ""
    return "\n".join(
        [*lines, f"Names suggest{hint}:", f"  hovercontrol check {file} --columns '{pairs}'{options}"]
    )


def _topics(file: Path) -> list[Topic]:
    opened = open_log(file)
    tables: Sequence[Table | Source] = opened.tables if isinstance(opened, Tables) else [opened]
    found = []
    for table in tables:
        if isinstance(table, Table):
            found.append(Topic(table.name, table.header, table.rows, table.clock, table))
        else:
            header = [name for name in table.header if name]
            rows = sum(batch.num_rows for batch in table.batches(["time"]))
            found.append(Topic(file.name, header, rows, "time" if "time" in header else "", table))
    return found


def _wrapped(names: Sequence[str], width: int = 100) -> list[str]:
    """Return the names wrapped into lines, with array elements as ``q[0..3]``."""
    last: dict[str, int] = {}
    for name in names:
        stem, bracket, rest = name.partition("[")
        if bracket and rest.endswith("]") and rest[:-1].isdigit():
            last[stem] = max(last.get(stem, 0), int(rest[:-1]))
        else:
            last[name] = -1
    lines = [""]
    for stem, most in last.items():
        text = stem if most < 0 else f"{stem}[0..{most}]" if most else f"{stem}[0]"
        if len(lines[-1]) + len(text) > width:
            lines.append("")
        lines[-1] += f"{text} "
    return [line.rstrip() for line in lines]


def proposal(topics: Sequence[Topic], inputs: Sequence[str] = ()) -> dict[str, str]:
    """Return columns by signal name, as far as the file's names suggest them.

    Parameters
    ----------
    inputs : sequence of str, optional
        The model's inputs; without them up to four changing commands are proposed.
    """
    measured = [topic for topic in topics if not _WANTED.search(topic.name)]
    found: dict[str, str] = {}
    poses = [pose for topic in measured if (pose := _pose(topic))]
    if poses:
        # prefer a pose with the heading in the same topic, then the pose with most rows
        found = max(poses, key=lambda pair: ("psi" in pair[0], pair[1].rows))[0]
        if "psi" not in found:
            headings = [psi for topic in measured if (psi := _heading(topic.header))]
            found |= {"psi": headings[0]} if headings else {}
    rates = [
        name
        for topic in measured
        for name in topic.header
        if _RATE.search(name) and not _COMMAND.search(name)
    ]
    found |= {"r": rates[0]} if rates else {}
    return found | _commands(topics, inputs, set(found.values()))


def _pose(topic: Topic) -> tuple[dict[str, str], Topic] | None:
    header = set(topic.header)
    for first, second in _POSITIONS:
        for name in topic.header:
            end = re.search(f"(^|[./_]|){first}$", name)
            if not end or _COMMAND.search(name):
                continue
            plain = first.replace("\\b", "").replace("\\", "")
            stem = name[: len(name) - len(plain)]
            alone = not stem or stem[-1] in "./_" or len(plain) > 1
            if (
                alone
                and f"{stem}{second}" in header
                and not _NO_POSITION.search(stem.removeprefix(topic.name))
            ):
                pose = {"x": name, "y": f"{stem}{second}"}
                psi = _heading(topic.header)
                return ({**pose, "psi": psi} if psi else pose), topic
    return None


def _heading(header: Sequence[str]) -> str:
    """Return the column of the heading, or the columns of a rotation; empty if there are none."""
    there = set(header)
    for name in header:
        if _HEADING.search(name):
            return name
    for ends in _QUATERNIONS:
        for name in header:
            if name.endswith(ends[0]):
                stem = name[: len(name) - len(ends[0])]
                if all(f"{stem}{end}" in there for end in ends):
                    return ",".join(f"{stem}{end}" for end in ends)
    return ""


def _commands(topics: Sequence[Topic], inputs: Sequence[str], taken: set[str]) -> dict[str, str]:
    """Return the commands: first by the names of the model's inputs, then changing columns in order."""
    found: dict[str, str] = {}
    names = [name for topic in topics for name in topic.header if name not in taken]
    for ours in inputs:
        plain = ours.lower()
        alike = [n for n in names if re.split(r"[./]", n)[-1].lower() == plain]
        alike = alike or [n for n in names if plain in re.split(r"[./]", n)[-1].lower()]
        if alike:
            found[ours] = alike[0]
    open_inputs = [name for name in inputs if name not in found]
    if inputs and not open_inputs:
        return found
    changing = [
        n for topic in topics if _COMMAND.search(topic.name) for n in _changing(topic) if n not in taken
    ]
    changing = [name for name in changing if name not in found.values()]
    if inputs:
        return found | dict(zip(open_inputs, changing, strict=False))
    own = [re.sub(r"\W+", "_", re.split("/", name)[-1]).strip("_") for name in changing[:MOST_COMMANDS]]
    return {
        ours: theirs for ours, theirs in zip(own, changing, strict=False) if ours not in (*POSE, *VELOCITY)
    }


def _changing(topic: Topic) -> list[str]:
    """Return the columns of a topic that are not its clocks and that change."""
    clocks = re.compile(r"(time|stamp|timestamp\w*|TimeUS|TimeMS|sec|nanosec|seq)$")
    names = [name for name in topic.header if name != topic.clock and not clocks.search(name)]
    try:
        values = topic.values(names)
    except InputError:
        return []
    return [n for n in names if np.isfinite(values[n]).any() and np.nanmax(values[n]) > np.nanmin(values[n])]
