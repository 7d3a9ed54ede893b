"""Lines of text as they come from a pipe or a file that grows; None while nothing comes."""

from __future__ import annotations

import contextlib
import os
import queue
import stat
import threading
import time
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from typing import TextIO

from hovercontrol.identification.monitor.notes import Note

#: Time between two looks at a source that gives nothing [s].
PAUSE = 0.05

#: Longest line [bytes]; of a longer one only the beginning is given, marked as cut.
LONGEST = 2**20

#: Bytes read at a time, and blocks of a pipe that are read ahead.
BLOCK, AHEAD = 2**16, 16

#: The last bytes of a file that are looked at again, to see whether it was written anew.
LOOKED_AT = 64


class Lines:
    r"""Cuts blocks of bytes into lines.

    Examples
    --------
    >>> lines = Lines()
    >>> list(lines.take(b"a,b\r\n1,")), list(lines.take(b"2\n3"))
    (['a,b\r\n'], ['1,2\n'])
    >>> list(lines.end())
    ['3']
    """

    def __init__(self) -> None:
        self._part, self._cut = bytearray(), False

    def take(self, block: bytes) -> Iterator[str]:
        """Give the lines that are complete after a block."""
        for piece in block.splitlines(keepends=True):
            self._part += piece[: LONGEST - len(self._part)]
            self._cut |= len(self._part) >= LONGEST
            if piece.endswith((b"\n", b"\r")):
                yield from self.end()

    def end(self) -> Iterator[str]:
        """Give the last line, which has no end."""
        if self._part:
            text = self._part.decode("utf-8", errors="replace")
            yield f"{text[:40]}..." if self._cut else text
        self._part, self._cut = bytearray(), False


def lines_of(stream: TextIO) -> Iterator[str | None]:
    """Give the lines of a pipe as they come, to its end.

    A thread reads it, past Python's own buffer: a wait for bytes can then be ended, on every system.
    """
    blocks: queue.Queue[bytes] = queue.Queue(AHEAD)
    ended = threading.Event()

    def read() -> None:
        block = b"-"
        while block and not ended.is_set():
            try:
                block = os.read(stream.fileno(), BLOCK)
            except (OSError, ValueError):  # the other end broke off, or the stream is closed
                block = b""
            blocks.put(block)

    threading.Thread(target=read, name="standard input", daemon=True).start()
    lines = Lines()
    try:
        while True:
            try:
                block = blocks.get(timeout=PAUSE)
            except queue.Empty:
                yield None
                continue
            if not block:
                break
            yield from lines.take(block)
        yield from lines.end()
    finally:
        ended.set()


def growing_lines(path: Path) -> Iterator[str | Note | None]:
    """Give the lines of a file and those appended to it, without end.

    The name is followed: a file that takes the place of the one that is read is read once it has content, and
    one that is emptied or written anew is read from its start.
    """
    file, lines, seen = path.open("rb", buffering=0), Lines(), b""
    try:
        while True:
            if not _goes_on(file, seen):
                yield from (f"{line}..." for line in lines.end())
                yield Note("file", f"{path} was written anew: it is read from its start")
                file.seek(0)
                seen = b""
            if block := file.read(BLOCK):
                yield from lines.take(block)
                seen = (seen + block)[-LOOKED_AT:]
            elif (other := _successor(path, file)) is not None:
                yield from lines.end()
                yield Note("file", f"another file has the name {path}: it is read from its start")
                file.close()
                file, seen = other, b""
            else:
                yield None
                time.sleep(PAUSE)
    finally:
        file.close()


def _goes_on(file: FileIO, seen: bytes) -> bool:
    """Return whether the bytes before the present place are still those that were read."""
    at = file.tell()
    file.seek(at - len(seen))
    same = file.read(len(seen)) == seen
    file.seek(at)
    return same


def _successor(path: Path, file: FileIO) -> FileIO | None:
    """Return the file that has the name now, if it is another one and has content."""
    with contextlib.suppress(OSError):
        own, its = os.fstat(file.fileno()), path.stat()
        if stat.S_ISREG(its.st_mode) and its.st_size and not os.path.samestat(own, its):
            return path.open("rb", buffering=0)
    return None
