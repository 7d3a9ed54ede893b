"""ROS 1 and 2 bags and MCAP files, read by rosbags: ``/odom/pose.pose.position.x``, ``/scan/ranges[0]``.

The clock of a topic is the stamp in the header of its messages if it agrees with the time at which they
were recorded (``/odom/time``). Otherwise the time of recording is the clock.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library

LATE = 10_000_000_000
"""Largest difference [ns] of a header's stamp from the time of recording: more means another clock."""

LONGEST = 64
"""Elements of an array that are columns."""

#: Returns one number of a message.
Getter = Callable[[Any], Any]


def bag(file: Path) -> Tables:
    """Open a bag: a file, or the folder into which ROS 2 records.

    Raises
    ------
    InputError
        If rosbags is missing, or the bag is damaged or contains no numbers.
    """
    library(file, "rosbags.highlevel", "ROS bags")
    tables = []
    with faults(file, "ROS bag"), _opened(file) as reader:
        for topic in sorted({connection.topic for connection in reader.connections}):
            table = _table(file, reader, topic)
            if table:
                tables.append(table)
    if not tables:
        raise InputError(f"{file}: a ROS bag without messages that hold numbers")
    return Tables(file, tables)


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([file], default_typestore=get_typestore(Stores.LATEST)) as reader:
        yield reader


def _table(file: Path, reader: Any, topic: str) -> Table | None:
    """Return the table of a topic with columns as in its first message; None if it contains no numbers."""
    connections = [c for c in reader.connections if c.topic == topic]
    first = next(iter(reader.messages(connections=connections)), None)
    if first is None:
        return None
    try:
        message = reader.deserialize(first[2], first[0].msgtype)
    except Exception:  # a type that the bag does not define
        return None
    getters = {f"{topic}/{name}": get for name, get in _numbers("", message)}
    if not getters:
        return None
    recorded, stamp = f"{topic}/time", f"{topic}/header.stamp"
    units = {name: "ns" for name, get in getters.items() if getattr(get, "__name__", "") == "stamp"} | {
        recorded: "ns"
    }
    agrees = stamp in getters and abs(getters[stamp](message) - first[1]) < LATE
    rows = sum(int(connection.msgcount) for connection in connections)
    table = Table(
        file, topic, [recorded, *getters], rows, lambda names: {}, stamp if agrees else recorded, units
    )
    table.load = lambda names: _read(table, topic, {name: getters.get(name) for name in names})
    return table


def _read(table: Table, topic: str, getters: dict[str, Getter | None]) -> dict[str, Any]:
    """Return columns of all messages of a topic; elements missing in a message are NaN."""
    columns: list[list[Any]] = [[] for _ in getters]
    plan = [(column.append, get) for column, get in zip(columns, getters.values(), strict=True)]
    decode = any(get for get in getters.values())
    with _opened(table.file) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        for connection, time, raw in reader.messages(connections=connections):
            message = reader.deserialize(raw, connection.msgtype) if decode else None
            for keep, get in plan:
                try:
                    keep(time if get is None else get(message))
                except (IndexError, AttributeError):
                    keep(float("nan"))
    found = {name: np.array(column) for name, column in zip(getters, columns, strict=True)}
    table.rows = len(next(iter(found.values())))
    return {n: v.astype(np.uint8) if v.dtype.kind == "b" else v for n, v in found.items()}


def _numbers(prefix: str, value: Any) -> Iterator[tuple[str, Getter]]:
    """Yield the names of the numbers in a message, each with a function that returns it."""
    for field in fields(value):
        if field.name.startswith("__"):
            continue
        yield from _inside(f"{prefix}{field.name}", getattr(value, field.name))


def _inside(name: str, value: Any) -> Iterator[tuple[str, Getter]]:
    if isinstance(value, bool | int | float | np.number):
        yield name, _getter(name)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        for k in range(min(len(value), LONGEST)):
            yield f"{name}[{k}]", _getter(f"{name}[{k}]")
    elif isinstance(value, Sequence) and not isinstance(value, str | bytes):
        for k, one in enumerate(value[:LONGEST]):
            yield from _inside(f"{name}[{k}]", one)
    elif is_dataclass(value):
        if hasattr(value, "sec") and hasattr(value, "nanosec"):
            yield name, _stamp(name)
        yield from _numbers(f"{name}.", value)


def _getter(path: str) -> Getter:
    """Return a function of a message that returns the number at a path like ``a.b[2].c``."""
    steps: list[Getter] = [
        itemgetter(int(index)) if index else attrgetter(names.strip("."))
        for names, index in re.findall(r"([^\[\]]+)|\[(\d+)\]", path)
    ]
    if len(steps) == 1:
        return steps[0]

    def get(message: Any) -> Any:
        for step in steps:
            message = step(message)
        return message

    return get


def _stamp(path: str) -> Getter:
    sec, nanosec = _getter(f"{path}.sec"), _getter(f"{path}.nanosec")

    def stamp(message: Any) -> int:
        return int(sec(message)) * 10**9 + int(nanosec(message))

    return stamp
