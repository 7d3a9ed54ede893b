"""MCAP files as channels and raw messages; what follows a break, as after a power loss, is left out.

The records are those of the MCAP specification: an opcode, a length of 8 bytes, and the content.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

from hovercontrol.base.errors import InputError

MAGIC = b"\x89MCAP0\r\n"

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 3, 4, 5, 6, 15


@dataclass
class Channel:
    """A channel of messages of one type.

    Attributes
    ----------
    topic, kind : str
        Topic, and name of the type of its messages.
    encoding : str
        Of the messages: ``cdr``, ``ros1``, ``json``, ``protobuf``.
    schema : bytes
        Definition of the type, in the language `language`.
    definitions : mapping, optional
        The fields of each type, where they are known.
    """

    topic: str
    kind: str
    encoding: str
    schema: bytes
    language: str
    definitions: Mapping[str, Any] | None = None


#: A channel, and times of recording [ns] and contents of messages.
Messages = tuple[Channel, list[int], list[bytes]]


class McapFile:
    """Channels and messages of an MCAP file, in the order of the file.

    Attributes
    ----------
    channels : dict of int to Channel
        Filled while messages are read.
    broken : str
        Why the file could not be read to its end; empty if it could.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.channels: dict[int, Channel] = {}
        self._schemas: dict[int, tuple[str, str, bytes]] = {}
        self.broken = ""

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Messages]:
        """Yield messages of a channel, those of a chunk together; with None those of all topics."""
        self.broken = ""
        with self.file.open("rb") as stream:
            if stream.read(8) != MAGIC:
                raise InputError(f"{self.file}: expected an MCAP file, found another beginning")
            size = self.file.stat().st_size
            while True:
                head = stream.read(9)
                if len(head) < 9 or head[0] == 0:
                    self.broken = f"it ends at byte {stream.tell():,} without a footer"
                    return
                length = int.from_bytes(head[1:], "little")
                if head[0] == _DATA_END:
                    return
                if stream.tell() + length > size:
                    content = stream.read()  # a chunk that was being written
                    self.broken = f"its last record is cut at byte {size:,}"
                    if head[0] != _CHUNK:
                        return
                else:
                    content = stream.read(length)
                try:
                    yield from self._record(head[0], content, topics)
                except (struct.error, ValueError, RuntimeError, OSError, EOFError, IndexError) as error:
                    self.broken = f"a record before byte {stream.tell():,} is damaged ({error})"
                    return
                if self.broken:
                    return

    def _record(self, code: int, content: bytes, topics: Collection[str] | None) -> Iterator[Messages]:
        if code == _CHUNK:
            yield from self._chunk(content, topics)
        elif code == _MESSAGE:
            number, _, recorded, _ = struct.unpack_from("<HIQQ", content)
            channel = self.channels.get(number)
            if channel and (topics is None or channel.topic in topics):
                yield channel, [recorded], [content[22:]]
        elif code == _SCHEMA:
            (number,) = struct.unpack_from("<H", content)
            name, at = _text(content, 2)
            language, at = _text(content, at)
            (size,) = struct.unpack_from("<I", content, at)
            self._schemas[number] = (name, language, content[at + 4 : at + 4 + size])
        elif code == _CHANNEL:
            number, schema = struct.unpack_from("<HH", content)
            topic, at = _text(content, 4)
            encoding, at = _text(content, at)
            if number not in self.channels:
                kind, language, text = self._schemas.get(schema, ("", "", b""))
                self.channels[number] = Channel(topic, kind, encoding, text, language)

    def _chunk(self, content: bytes, topics: Collection[str] | None) -> Iterator[Messages]:
        _, _, size, check = struct.unpack_from("<QQQI", content)
        compression, at = _text(content, 28)
        data = _decompressed(content[at + 8 :], compression, size)
        if check and len(data) == size and crc32(data) != check:
            raise ValueError("its checksum differs")
        unpack, at, end = struct.Struct("<BQHIQ").unpack_from, 0, len(data)
        found: dict[int, Messages | None] = {}
        whole = True
        while at + 9 <= end:
            # opcode and length of the record; channel, sequence number and log time if it is a message
            code, length, number, _, recorded = unpack(data, at) if at + 23 <= end else (data[at], 0, 0, 0, 0)
            length = length or int.from_bytes(data[at + 1 : at + 9], "little")
            after = at + 9 + length
            if after > end:
                whole = False
                break
            if code != _MESSAGE:
                yield from self._record(code, data[at + 9 : after], topics)
            else:
                if number not in found:
                    channel = self.channels.get(number)
                    wanted = channel and (topics is None or channel.topic in topics)
                    found[number] = (channel, [], []) if channel and wanted else None
                if own := found[number]:
                    own[1].append(recorded)
                    own[2].append(data[at + 31 : after])
            at = after
        yield from (own for own in found.values() if own)
        if not whole:
            raise ValueError("it ends within a message")


def _text(content: bytes, at: int) -> tuple[str, int]:
    """Return a text with its length before it, and the place after it."""
    (size,) = struct.unpack_from("<I", content, at)
    if at + 4 + size > len(content):
        raise ValueError("a text is longer than its record")
    return content[at + 4 : at + 4 + size].decode("utf-8", errors="replace"), at + 4 + size


def _decompressed(data: bytes, compression: str, size: int) -> bytes:
    """Return the content of a chunk; of one that is cut off, as much as there is."""
    if compression == "":
        return data
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        found: bytes = LZ4FrameDecompressor().decompress(data, max_length=size)
        return found
    if compression == "zstd":
        found = _zstd().ZstdDecompressor().decompress(data, size)
        return found
    raise ValueError(f"its compression {compression!r} is unknown")


def _zstd() -> Any:
    try:
        from compression import zstd  # type: ignore[import-not-found, unused-ignore]
    except ImportError:
        from backports import zstd
    return zstd
