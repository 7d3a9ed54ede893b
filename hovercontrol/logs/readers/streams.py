"""Bags and MCAP files as streams of raw messages."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Protocol

from hovercontrol.logs.readers.mcap import MAGIC, Channel, McapFile, Messages


class Stream(Protocol):
    """Raw messages of a bag."""

    @property
    def said(self) -> str:
        """Why the bag could not be read to its end; empty if it could."""

    def messages(self, topics: Collection[str] | None) -> Iterator[Messages]:
        """Yield messages of one channel at a time; with None those of all topics."""


def stream_of(file: Path) -> Stream:
    """Return the stream of a bag: MCAP files by their records, others by rosbags."""
    if file.is_dir():
        parts = sorted(file.glob("*.mcap"))
        return _McapFiles(parts) if parts and _is_plain(file) else _Rosbags(file)
    with file.open("rb") as stream:
        return _McapFiles([file]) if stream.read(8) == MAGIC else _Rosbags(file)


def _is_plain(folder: Path) -> bool:
    """Return whether the messages in a folder are not compressed one by one."""
    about = folder / "metadata.yaml"
    lines = about.read_text(errors="replace").splitlines() if about.is_file() else []
    modes = [line.partition(":")[2].strip(" '\"").lower() for line in lines if "compression_mode:" in line]
    return all(mode in ("", "none") for mode in modes)


class _McapFiles:
    """The parts of a recording, one after another."""

    def __init__(self, files: list[Path]) -> None:
        self.parts = [McapFile(file) for file in files]

    @property
    def said(self) -> str:
        broken = [part for part in self.parts if part.broken]
        return "; ".join(
            f"{part.file.name} up to a break: {part.broken} (`mcap recover` mends it)" for part in broken
        )

    def messages(self, topics: Collection[str] | None) -> Iterator[Messages]:
        for part in self.parts:
            yield from part.messages(topics)


class _Rosbags:
    """A bag that rosbags opens."""

    said = ""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._channels: dict[str, Channel] = {}

    def messages(self, topics: Collection[str] | None) -> Iterator[Messages]:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        with AnyReader([self.file], default_typestore=get_typestore(Stores.LATEST)) as reader:
            known = [c for c in reader.connections if topics is None or c.topic in topics]
            channels = {id(c): self._channel(c, reader) for c in known}
            for connection, recorded, raw in reader.messages(connections=known) if known else ():
                yield channels[id(connection)], [recorded], [raw]

    def _channel(self, connection: Any, reader: Any) -> Channel:
        key = f"{connection.topic}\0{connection.id}\0{connection.msgtype}"
        if key not in self._channels:
            encoding = "cdr" if reader.is2 else "ros1"
            self._channels[key] = Channel(
                connection.topic, connection.msgtype, encoding, b"", "", dict(reader.typestore.fielddefs)
            )
        return self._channels[key]
