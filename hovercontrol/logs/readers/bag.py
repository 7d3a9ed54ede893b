"""ROS 1 and 2 bags and MCAP files: ``/odom/pose.pose.position.x``, ``/tf[base_link]/...``.

The clock of a topic is the stamp in the header of its messages if it agrees with the time at which they were
recorded (``/odom/time``), else that time. If the stamps of no topic agree with it, the bag is of a simulation
or of a machine with a clock of its own. Then stamps are the clock, and ``/cmd/clock`` gives the times of
messages without stamps on it, by a topic that has both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.mcap import Channel, Messages
from hovercontrol.logs.readers.messages import STAMPS, decoder_of
from hovercontrol.logs.readers.ros_messages import Block, Key
from hovercontrol.logs.readers.streams import stream_of
from hovercontrol.logs.readers.tables import Table, Tables, faults, library
from hovercontrol.logs.readers.transforms import Link, composed

LATE = 10_000_000_000
"""Largest difference [ns] of a header's stamp from the time of recording: more means another clock."""

FLUSH = 2**24
"""Bytes of messages decoded at a time."""


def bag(file: Path) -> Tables:
    """Open a bag: a file, or the folder into which ROS 2 records.

    Raises
    ------
    InputError
        If rosbags is missing, or the bag is damaged or contains no numbers.
    """
    library(file, "rosbags.highlevel", "ROS bags")
    with faults(file, "ROS bag"):
        found = _Bag(file)
        parts = found.parts()
        tables = found.tables(parts)
    if not tables:
        raise InputError(f"{file}: a ROS bag without messages that hold numbers{found.unread()}")
    return Tables(file, tables, found.aliases(parts))


@dataclass
class _Part:
    """The rows of a topic that become one table.

    Attributes
    ----------
    topic : str
    key : tuple of str
        The struct that the rows describe, see :class:`~hovercontrol.logs.readers.ros_messages.Block`.
    names : set of str
        Names of elements of arrays; a part has all rows that share a name.
    header : dict of str
        Columns in order.
    stamp : str
        The column with the stamp of a row, or an empty text.
    recorded, stamps : ndarray of int
        Times of recording and stamps of the rows [ns].
    """

    topic: str
    key: Key
    names: set[str] = field(default_factory=set)
    header: dict[str, None] = field(default_factory=dict)
    stamp: str = ""
    recorded: Any = None
    stamps: Any = None

    def has(self, topic: str, block: Block) -> bool:
        """Return whether the rows of a block belong to this part."""
        same = self.topic == topic and self.key == block.key
        return same and (bool(self.names & block.names) or self.names == block.names)

    @property
    def rows(self) -> Any:
        """The rows that are used: all, or those with a stamp if some have none."""
        known = self.stamps > 0 if self.stamp else np.zeros(0, dtype=bool)
        return known if known.any() else np.ones(self.recorded.size, dtype=bool)

    @property
    def stamped(self) -> bool:
        """Whether the rows have stamps that change."""
        return bool(self.stamp) and self.recorded.size > 0 and bool(np.ptp(self.stamps[self.rows]) > 0)

    @property
    def agrees(self) -> bool:
        """Whether the stamps are times of the clock of the recording."""
        rows = self.rows
        off = np.abs(self.stamps[rows] - self.recorded[rows]) if self.stamp else np.zeros(0)
        return bool(off.size and np.median(off) < LATE)


class _Bag:
    """A bag and the decoders of its channels."""

    def __init__(self, file: Path) -> None:
        self.file, self.stream = file, stream_of(file)
        self._decoders: dict[int, tuple[Channel, Any]] = {}

    def unread(self) -> str:
        """Return which topics could not be decoded, in words; empty if all were."""
        left = sorted({f"{c.topic} ({c.encoding})" for c, decoder in self._decoders.values() if not decoder})
        return f"; not read: {', '.join(left[:5])}" if left else ""

    def _decoder(self, channel: Channel) -> Any:
        if id(channel) not in self._decoders:
            self._decoders[id(channel)] = (channel, decoder_of(channel, self.file))
        return self._decoders[id(channel)][1]

    def blocks(
        self, topics: Collection[str] | None, wanted: Collection[str]
    ) -> Iterator[tuple[str, Block, Any]]:
        """Yield topic, decoded rows and times of recording [ns] of each row."""
        waiting: dict[int, Messages] = {}
        sizes: dict[int, int] = {}
        for channel, recorded, raws in self.stream.messages(topics):
            key = id(channel)
            if key not in waiting:
                waiting[key], sizes[key] = (channel, [], []), 0
            waiting[key][1].extend(recorded)
            waiting[key][2].extend(raws)
            sizes[key] += sum(map(len, raws))
            if sizes[key] > FLUSH:
                yield from self._decoded(*waiting.pop(key), wanted)
        for each in waiting.values():
            yield from self._decoded(*each, wanted)

    def _decoded(
        self, channel: Channel, recorded: list[int], raws: list[bytes], wanted: Collection[str]
    ) -> Iterator[tuple[str, Block, Any]]:
        decoder = self._decoder(channel)
        times = np.array(recorded, dtype=np.int64)
        for block in decoder.blocks(raws, wanted) if decoder else ():
            yield channel.topic, block, times[block.rows]

    def parts(self) -> list[_Part]:
        """Return the parts of the bag with their clocks; one pass through the file."""
        parts: list[_Part] = []
        clocks: list[list[tuple[Any, Any]]] = []
        for topic, block, recorded in self.blocks(None, STAMPS):
            stamp = next((name for name in STAMPS if name in block.header), "")
            stamps = np.nan_to_num(block.columns[stamp]).astype(np.int64) if stamp else 0 * recorded
            own = [k for k, part in enumerate(parts) if part.has(topic, block)]
            if not own:
                own = [len(parts)]
                parts.append(_Part(topic, block.key))
                clocks.append([])
            first, *others = own
            for k in reversed(others):  # the block has names of several parts
                parts[first].names |= parts[k].names
                parts[first].header |= parts.pop(k).header
                clocks[first] += clocks.pop(k)
            part = parts[first]
            part.names |= block.names
            part.header |= dict.fromkeys(block.header)
            part.stamp = part.stamp or stamp
            clocks[first].append((recorded, stamps))
        for part, pairs in zip(parts, clocks, strict=True):
            recorded, stamps = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
            order = np.argsort(recorded, kind="stable")
            part.recorded, part.stamps = recorded[order], stamps[order]
        return sorted(parts, key=lambda part: part.topic)

    def read(self, part: _Part, wanted: Sequence[str]) -> dict[str, Any]:
        """Return columns of a part in the order of recording; values missing in a message are NaN."""
        times: list[Any] = []
        pieces: dict[str, list[Any]] = {name: [] for name in wanted}
        for topic, block, recorded in self.blocks([part.topic], set(wanted)):
            if part.has(topic, block):
                times.append(recorded)
                for name, piece in pieces.items():
                    missing = np.full(recorded.size, np.nan)
                    piece.append(block.columns.get(name, missing))
        order = np.argsort(np.concatenate(times), kind="stable")
        return {name: np.concatenate(piece)[order] for name, piece in pieces.items()}

    def tables(self, parts: Sequence[_Part]) -> list[Table]:
        """Return the tables of the bag."""
        stamped = [part for part in parts if part.stamped]
        own_clock = bool(stamped) and not any(part.agrees for part in stamped)
        both = max(stamped, key=lambda part: (part.topic == "/clock", part.recorded.size), default=None)
        tables = [
            (part, self._table(part, _label(part, parts), both if own_clock else None))
            for part in parts
            if len(part.header) > bool(part.stamp)
        ]
        frames = Counter(part.key[0] for part, _ in tables if _is_transform(part))
        links = {
            part.key[0]: Link(part.key[1], table, part.topic)
            for part, table in tables
            if _is_transform(part) and frames[part.key[0]] == 1
        }
        return [*(table for _, table in tables), *composed(self.file, links)]

    def _table(self, part: _Part, label: str, both: _Part | None) -> Table:
        """Return the table of a part; `both` has times of recording and stamps of a clock of its own."""
        name = f"{part.topic}{label}"
        columns = {_full(part, name, short): short for short in part.header}
        recorded, stamp, clock = f"{name}/time", f"{name}/{part.stamp}", f"{name}/clock"
        rows = part.rows
        known: dict[str, Any] = {recorded: part.recorded[rows]}
        known |= {stamp: part.stamps[rows]} if part.stamp else {}
        units = dict.fromkeys(known, "ns")
        said = [text for text in (self.stream.said, _clock_text(part, both)) if text]
        if (~rows).any():
            said.append(f"{name}: {(~rows).sum()} messages without a stamp left out")
        if damaged := sum(d.damaged for c, d in self._decoders.values() if d and c.topic == part.topic):
            said.append(f"{part.topic}: {damaged} damaged messages left out")
        own = recorded
        if part.stamped and (part.agrees or both):
            own = stamp
        elif both:
            known[clock], units[clock], own = _converted(known[recorded], both), "ns", clock

        def load(names: Sequence[str]) -> dict[str, Any]:
            wanted = [columns[name] for name in names if name not in known]
            found = self.read(part, wanted) if wanted else {}
            return {n: known[n] if n in known else found[columns[n]][rows] for n in names}

        header = list(dict.fromkeys([*known, *columns]))
        table = Table(self.file, name, header, int(rows.sum()), load, own, units)
        table.said = "; ".join(said)
        return table

    def aliases(self, parts: Sequence[_Part]) -> dict[str, str]:
        """Return the columns of named elements by their index in the first message, ``position[0]``."""
        found: dict[str, str] = {}
        for part in parts:
            count: dict[str, int] = {}
            for short in part.header if part.names else ():
                stem, _, name = short.partition("[")
                if name.removesuffix("]") in part.names:
                    found.setdefault(f"{part.topic}/{stem}[{count.get(stem, 0)}]", f"{part.topic}/{short}")
                    count[stem] = count.get(stem, 0) + 1
        return found


def _is_transform(part: _Part) -> bool:
    return bool(part.key[0]) and "transform.translation.x" in part.header


def _label(part: _Part, parts: Sequence[_Part]) -> str:
    """Return what follows the topic in the name of a table: ``[base_link]``, ``[base_link in map]``."""
    name, parent = part.key
    others = [p for p in parts if p.topic == part.topic and p is not part]
    if name:
        several = any(p.key[0] == name for p in others)
        return f"[{name} in {parent}]" if several else f"[{name}]"
    return f"[{min(part.names)}]" if part.names and any(p.names for p in others) else ""


def _full(part: _Part, table: str, short: str) -> str:
    """Return the name of a column; that of a named element needs no name of a table."""
    named = short.partition("[")[2].removesuffix("]") in part.names
    return f"{part.topic if named else table}/{short}"


def _converted(recorded: Any, both: _Part) -> Any:
    """Return times of recording [ns] as stamps, by a part that has both; beyond its ends at its rate."""
    rows = both.rows
    x, y = both.recorded[rows], both.stamps[rows]
    x, first = np.unique(x, return_index=True)
    y = y[first]
    rate = float(y[-1] - y[0]) / float(x[-1] - x[0])
    inside = np.interp((recorded - x[0]).astype(float), (x - x[0]).astype(float), (y - y[0]).astype(float))
    beyond = rate * (np.minimum(recorded - x[0], 0) + np.maximum(recorded - x[-1], 0))
    return y[0] + np.rint(inside + beyond).astype(np.int64)


def _clock_text(part: _Part, both: _Part | None) -> str:
    """Return a text on the clocks of a part, if its stamps are not on that of the recording."""
    if both is None and (not part.stamped or part.agrees):
        return ""
    rows = (both or part).rows
    stamps, recorded = (both or part).stamps[rows], (both or part).recorded[rows]
    rate = float(np.ptp(stamps)) / max(float(np.ptp(recorded)), 1.0)
    speeds = f"stamps run at {rate:.3g} of the speed of the clock of the recording"
    if both is None:
        return f"{part.topic}: {speeds} and are far from it: time of recording used"
    return f"{both.topic}: {speeds}: time by the stamps"
