"""Decoders of messages: ROS, JSON and Protobuf."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.logs.readers.mcap import Channel
from hovercontrol.logs.readers.ros_messages import LONGEST, Block, RosMessages
from hovercontrol.logs.readers.tables import library

#: Columns that are the stamp of a message, the first that there is.
STAMPS = ("header.stamp", "timestamp", "stamp")

#: Names of seconds and nanoseconds in the times of ROS, Foxglove and Protobuf.
_TIMES = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"))


def decoder_of(channel: Channel, file: Path) -> RosMessages | TreeMessages | None:
    """Return what decodes the messages of a channel, or None if their encoding or type is unknown.

    Raises
    ------
    InputError
        If a library is missing.
    """
    if channel.encoding in ("cdr", "ros1"):
        definitions = channel.definitions or _definitions(channel)
        kind = _normal(channel.kind)
        return RosMessages(definitions, kind, cdr=channel.encoding == "cdr") if kind in definitions else None
    if channel.encoding == "json":
        return TreeMessages(json.loads)
    if channel.encoding == "protobuf":
        return TreeMessages(_protobuf(channel, file))
    return None


def _normal(kind: str) -> str:
    """Return the name of a type as ROS 2 writes it, ``nav_msgs/msg/Odometry``."""
    package, _, name = kind.rpartition("/")
    return kind if package.endswith(("/msg", "/action", "/srv")) else f"{package}/msg/{name}"


def _definitions(channel: Channel) -> Mapping[str, Any]:
    """Return the fields of the types in a schema; without a schema those of the current ROS 2."""
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    known: dict[str, Any] = dict(get_typestore(Stores.LATEST).fielddefs)
    text = channel.schema.decode("utf-8", errors="replace")
    if channel.language in ("ros2idl", "omgidl"):
        line = "=" * 80 + "\n"
        for part in text.split(line) if line in text else [text]:
            known |= get_types_from_idl(part.partition("\n")[2] if part.startswith("IDL: ") else part)
    elif text:
        known |= get_types_from_msg(text, channel.kind)
    return known


def _protobuf(channel: Channel, file: Path) -> Any:
    """Return a function that decodes a message by the descriptors in its schema."""
    library(file, "google.protobuf", "Protobuf messages", "logs-all", package="protobuf")
    from google.protobuf import descriptor_pool, message_factory
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    pool = descriptor_pool.DescriptorPool()
    files = {one.name: one for one in FileDescriptorSet.FromString(channel.schema).file}

    def add(name: str) -> None:
        if one := files.pop(name, None):
            for other in one.dependency:
                add(other)
            pool.Add(one)

    for name in list(files):
        add(name)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel.kind))
    return lambda raw: _fields(kind.FromString(raw))


def _fields(message: Any) -> dict[str, Any]:
    """Return the fields of a Protobuf message, those that have their default value, too."""
    found: dict[str, Any] = {}
    for one in message.DESCRIPTOR.fields:
        value = getattr(message, one.name)
        if one.message_type and _is_list(value):
            found[one.name] = [_fields(each) for each in value] if not hasattr(value, "items") else None
        elif one.message_type:
            found[one.name] = _fields(value) if message.HasField(one.name) else None
        elif _is_list(value):
            found[one.name] = None if hasattr(value, "items") else list(value[: LONGEST + 1])
        else:
            found[one.name] = value
    return found


def _is_list(value: Any) -> bool:
    return hasattr(value, "__len__") and not isinstance(value, str | bytes)


class TreeMessages:
    """Decodes messages that are trees of names and values, one by one.

    Parameters
    ----------
    load : callable
        Returns the tree of a message as dictionaries, lists and values.
    """

    def __init__(self, load: Any) -> None:
        self.load = load
        self.damaged = 0

    def blocks(self, raws: Sequence[bytes], wanted: Collection[str]) -> Iterator[Block]:
        """Yield the rows of messages with the wanted columns; missing values are NaN."""
        rows, found = [], []
        for k, raw in enumerate(raws):
            try:
                found.append(dict(_leaves("", self.load(raw))))
                rows.append(k)
            except Exception:  # whatever the library raises on a damaged message
                self.damaged += 1
        header = list(dict.fromkeys(name for each in found for name in each))
        columns = {name: _column([each.get(name) for each in found]) for name in header if name in wanted}
        if header:
            yield Block(("", ""), frozenset(), header, np.array(rows), columns)


def _column(values: Sequence[Any]) -> Any:
    if all(isinstance(v, int) for v in values):
        found = np.array(values)
        return found.astype(np.uint8) if found.dtype.kind == "b" else found
    return np.array([np.nan if v is None else v for v in values], dtype=float)


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the numbers in a tree by name, and times as nanoseconds."""
    if isinstance(value, dict):
        for sec, nano in _TIMES:
            if value.keys() == {sec, nano}:
                yield name, int(value[sec]) * 10**9 + int(value[nano])
                return
        for key, inside in value.items():
            yield from _leaves(f"{name}.{key}" if name else key, inside)
    elif isinstance(value, list):
        if len(value) <= LONGEST:
            for k, inside in enumerate(value):
                yield from _leaves(f"{name}[{k}]", inside)
    elif isinstance(value, bool | int | float):
        yield name, value
