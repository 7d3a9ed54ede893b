"""Standard output for one JSON value; all other output goes to standard error."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TextIO

#: Standard output as it was, and its descriptor where it is one; empty while nothing is reserved.
_reserved: list[tuple[TextIO, int | None]] = []

was_reserved = False
"""Whether the command that ran last printed one JSON value."""


def reserve() -> None:
    """Reserve standard output for :func:`write`, since a user's Python file may print.

    A file descriptor is redirected to standard error, with the output of C code and other processes.
    """
    global was_reserved
    if _reserved or sys.stdout is None:
        return
    was_reserved = True
    sys.stdout.flush()
    kept = None
    with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or no descriptor
        if (sys.stdout.fileno(), sys.stderr.fileno()) == (1, 2):
            kept = os.dup(1)
            os.dup2(2, 1)
    _reserved.append((sys.stdout, kept))
    sys.stdout = sys.stderr


def release() -> bool:
    """Restore standard output; return whether it was reserved."""
    if not _reserved:
        return False
    sys.stdout, kept = _reserved.pop()
    if kept is not None:
        os.dup2(kept, 1)
        os.close(kept)
    return True


def write(text: str) -> None:
    """Write the result of a command to standard output, reserved or not."""
    if not _reserved:
        sys.stdout.write(text)
        return
    stream, kept = _reserved[-1]
    if kept is None:
        stream.write(text)
        return
    rest = text.encode(stream.encoding, stream.errors or "strict")
    while rest:
        rest = rest[os.write(kept, rest) :]
