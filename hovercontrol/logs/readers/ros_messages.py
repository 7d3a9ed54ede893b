"""The layouts of serialised ROS messages, by which all messages of one layout are decoded at once.

A message is a sequence of numbers, texts and arrays (CDR in ROS 2, packed in ROS 1). Where its numbers are
depends only on the lengths of its texts and arrays: messages that agree in these have one layout.

Elements of an array are columns ``data[0]``. If a message names them (``name`` of a JointState), the names
are in place of the index, ``position[rudder]``. An array of structs that name themselves
(``child_frame_id`` of a transform) gives a row for each of them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

LONGEST = 64
"""Elements of an array that are columns."""

STAMP = "stamp"
"""Type of a time: seconds and nanoseconds."""

_SIZES = {
    "bool": "u1", "byte": "u1", "char": "u1", "octet": "u1", "int8": "i1", "uint8": "u1", "int16": "i2",
    "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4",
    "float64": "f8",
}  # fmt: skip

#: Fields that name the elements of the arrays beside them, and those by which a struct names itself.
_NAMES = re.compile(r"(.*_)?names?$")
_OWN_NAME = re.compile(r"child_frame_id$|(.*_)?name$|id$")

#: The struct that a row describes: its own name and the frame that it is given in.
Key = tuple[str, str]


@dataclass
class Block:
    """Decoded rows of one key.

    Attributes
    ----------
    key : tuple of str
        Own name of the struct, and its parent frame; empty for a whole message.
    names : frozenset of str
        Names of the elements of arrays.
    header : sequence of str
        All columns of the rows.
    rows : ndarray of int
        For each row the number of its message.
    columns : mapping of str to ndarray
        Those that are wanted.
    """

    key: Key
    names: frozenset[str]
    header: Sequence[str]
    rows: Any
    columns: Mapping[str, Any]


@dataclass
class _Row:
    key: Key = ("", "")
    names: frozenset[str] = frozenset()
    fields: dict[str, tuple[int, str]] = field(default_factory=dict)


@dataclass
class _Layout:
    """The rows of a message, and the positions and values of the bytes that determine them."""

    rows: list[_Row]
    places: Any
    values: Any


class RosMessages:
    """Decodes the messages of one type; layouts are kept.

    Parameters
    ----------
    definitions : mapping
        The fields of each type, as in `rosbags`' type stores.
    kind : str
        Name of the type of the messages.
    cdr : bool
        Whether they are CDR (ROS 2); else the serialisation of ROS 1.
    """

    def __init__(self, definitions: Mapping[str, Any], kind: str, *, cdr: bool) -> None:
        self.definitions, self.kind, self.cdr = definitions, kind, cdr
        self._layouts: dict[int, list[_Layout]] = {}
        self.damaged = 0

    def blocks(self, raws: Sequence[bytes], wanted: Collection[str]) -> Iterator[Block]:
        """Yield the rows of messages with the wanted columns."""
        by_length: dict[int, list[int]] = {}
        for k, raw in enumerate(raws):
            by_length.setdefault(len(raw), []).append(k)
        for length, members in by_length.items():
            index = np.array(members)
            matrix = np.frombuffer(b"".join([raws[k] for k in members]), dtype=np.uint8)
            matrix = matrix.reshape(len(members), length)
            left = np.arange(len(members))
            known = self._layouts.setdefault(length, [])
            for layout in known:
                if left.size:
                    left = yield from self._fitting(layout, matrix, index, left, wanted)
            while left.size:
                new = self._layout(raws[members[left[0]]])
                if new is None:
                    left = left[1:]
                    continue
                known.append(new)
                left = yield from self._fitting(new, matrix, index, left, wanted)

    def _fitting(
        self, layout: _Layout, matrix: Any, index: Any, left: Any, wanted: Collection[str]
    ) -> Generator[Block, None, Any]:
        part = matrix if left.size == len(matrix) else matrix[left]
        fits = (part[:, layout.places] == layout.values).all(axis=1)
        if fits.any():
            data, rows = part if fits.all() else part[fits], index[left[fits]]
            for row in layout.rows:
                columns = {
                    name: _decoded(data, *place) for name, place in row.fields.items() if name in wanted
                }
                yield Block(row.key, row.names, list(row.fields), rows, columns)
        return left[~fits]

    def _layout(self, raw: bytes) -> _Layout | None:
        """Return the layout of a message, or None if it is damaged."""
        walk = _Walk(self.definitions, raw, cdr=self.cdr)
        try:
            rows = walk.message(self.kind)
        except (IndexError, ValueError, KeyError):
            self.damaged += 1
            return None
        places = np.concatenate([np.arange(a, b) for a, b in walk.fixed] or [np.zeros(0, dtype=int)])
        places = places.astype(int)
        return _Layout(rows, places, np.frombuffer(raw, dtype=np.uint8)[places])


def _decoded(data: Any, at: int, kind: str) -> Any:
    """Return the numbers at one place of all messages."""
    if kind.endswith(STAMP):
        order = kind.removesuffix(STAMP)
        seconds = _decoded(data, at, f"{order}i4").astype(np.int64)
        return seconds * 10**9 + _decoded(data, at + 4, f"{order}u4")
    dtype = np.dtype(kind)
    values = np.ascontiguousarray(data[:, at : at + dtype.itemsize]).view(dtype)[:, 0]
    return values.astype(dtype.newbyteorder("="), copy=False)


class _Walk:
    """One walk through a message."""

    def __init__(self, definitions: Mapping[str, Any], raw: bytes, *, cdr: bool) -> None:
        self.definitions, self.raw, self.cdr = definitions, raw, cdr
        self.order = ">" if cdr and not raw[1] & 1 else "<"
        self.start = self.at = 4 if cdr else 0
        self.fixed: list[tuple[int, int]] = [(0, 4)] if cdr else []
        self.rows: list[_Row] = []

    def message(self, kind: str) -> list[_Row]:
        row = _Row()
        self._struct(kind, "", row, ())
        stamp = row.fields.get("header.stamp")
        for part in self.rows:
            if stamp and "header.stamp" not in part.fields:
                part.fields["header.stamp"] = stamp
        return [*([row] if row.fields else []), *self.rows]

    def _number(self, size: int) -> int:
        """Return the place of the next number; numbers of CDR are aligned to their size."""
        if self.cdr:
            self.at += -(self.at - self.start) % size
        at = self.at
        self.at += size
        if self.at > len(self.raw):
            raise ValueError("the message ends before its last field")
        return at

    def _count(self) -> int:
        at = self._number(4)
        self.fixed.append((at, at + 4))
        return int.from_bytes(self.raw[at : at + 4], "big" if self.order == ">" else "little")

    def _text(self, *, matters: bool = False) -> str:
        size = self._count()
        at, self.at = self.at, self.at + size
        if self.at > len(self.raw):
            raise ValueError("the message ends within a text")
        if matters:
            self.fixed.append((at, self.at))
        return self.raw[at : self.at].decode("utf-8", errors="replace").rstrip("\0") if matters else ""

    def _struct(self, kind: str, prefix: str, row: _Row, names: Sequence[str], texts: Any = None) -> None:
        """Walk through a struct; `texts` receives the texts by which it names itself."""
        fields = self.definitions[kind][1]
        if [name for name, _ in fields] == ["sec", "nanosec"]:
            at = self._number(4)
            row.fields[prefix.removesuffix(".")] = (at, f"{self.order}{STAMP}")
            row.fields |= {
                f"{prefix}sec": (at, f"{self.order}i4"),
                f"{prefix}nanosec": (self._number(4), f"{self.order}u4"),
            }
            return
        for name, (node, what) in fields:
            full = f"{prefix}{name}"
            if int(node) == 1 and what[0] in ("string", "wstring"):
                own = texts is not None and (_OWN_NAME.match(full) or full == "header.frame_id")
                text = self._text(matters=bool(own))
                if own:
                    texts[full] = text
            elif int(node) == 1:
                self._value(what[0], full, row)
            elif int(node) == 2:
                self._struct(what, f"{full}.", row, names, texts)
            else:
                inner, size = what
                count = size if int(node) == 3 else self._count()
                if int(inner[0]) == 1 and inner[1][0] in ("string", "wstring"):
                    found = [self._text(matters=bool(_NAMES.match(name))) for _ in range(count)]
                    names = found if _NAMES.match(name) and len(set(found)) == count else names
                else:
                    self._array(inner, count, full, row, names)

    def _value(self, kind: str, name: str, row: _Row) -> None:
        code = _SIZES[kind]
        row.fields[name] = (self._number(int(code[1])), f"{self.order}{code}")

    def _array(self, inner: Any, count: int, name: str, row: _Row, names: Sequence[str]) -> None:
        node, what = inner
        if int(node) == 1:
            size = int(_SIZES[what[0]][1])
            if count > LONGEST:
                self._number(size)
                self.at += size * (count - 1)
                return
            label = names if names and len(names) == count else range(count)
            if label is names:
                row.names |= frozenset(names)
            for k in label:
                self._value(what[0], f"{name}[{k}]", row)
            return
        known = {n for n, (kind, _) in self.definitions[what][1] if int(kind) == 1}
        named = any(_OWN_NAME.match(n) and n in known and self._is_text(what, n) for n in known)
        for k in range(count):
            if not named:
                self._struct(what, f"{name}[{k}].", row if k < LONGEST else _Row(), names)
                continue
            own, texts = _Row(), dict[str, str]()
            self._struct(what, "", own, (), texts)
            parent = texts.pop("header.frame_id", "")
            own.key = (next(iter(texts.values())), parent if "child_frame_id" in texts else "")
            self.rows.append(own)

    def _is_text(self, kind: str, name: str) -> bool:
        return next(what[0] for n, (_, what) in self.definitions[kind][1] if n == name) in (
            "string",
            "wstring",
        )
