"""Checks that only the user can write or replace a file."""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

#: Permission to write, of the group and of all others.
_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def make_private_folder(folder: Path) -> None:
    """Make a folder and the parents it lacks, for the user alone, for any umask."""
    if not folder.parent.exists():
        make_private_folder(folder.parent)
    folder.mkdir(mode=0o700, exist_ok=True)


def distrust(folder: Path, within: Path | None = None) -> str:
    """Return why others can write into a folder; empty if they cannot.

    Parameters
    ----------
    folder : Path
        There already. It must be the user's own, not writable by others, and no symbolic link; so must what
        it lies in, which may also be the system's (root's), or sticky as ``/tmp`` is.
    within : Path, optional
        A folder above it that is trusted already.

    Notes
    -----
    Windows keeps other users out of a user's folders by itself; nothing is checked there.
    """
    if os.name == "nt":
        return ""
    for place in (folder, *folder.parents):
        if place == within:
            break
        found = os.lstat(place)
        if stat.S_ISLNK(found.st_mode):
            return f"{place} is a symbolic link"
        if found.st_uid != os.getuid() and (place == folder or found.st_uid != 0):
            return f"{place} belongs to another user"
        sticky = place != folder and found.st_mode & stat.S_ISVTX
        if found.st_mode & _OTHERS and not sticky:
            return f"others may write to {place}"
    return ""


def trusted_bytes(file: Path) -> bytes | None:
    """Return the content of a regular file that is the user's own and writable by nobody else, or None."""
    with contextlib.suppress(OSError):
        descriptor = os.open(file, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(descriptor, "rb") as stream:
            found = os.fstat(descriptor)
            own = os.name == "nt" or (found.st_uid == os.getuid() and not found.st_mode & _OTHERS)
            if own and stat.S_ISREG(found.st_mode):
                return stream.read()
    return None
