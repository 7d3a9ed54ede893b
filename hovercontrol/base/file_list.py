"""List of the files that this package wrote into a folder, with the digest of each.

Only what the list names, unchanged since, is replaced or removed. All other files
belong to the user and are kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
from collections.abc import Mapping
from fnmatch import fnmatch
from pathlib import Path

from hovercontrol.base.errors import InputError

#: The list's own name. A folder that holds one was written, or at least filled, by this package.
LIST = ".hovercontrol.json"

_ABOUT = "files written by hovercontrol, which replaces or removes only these, and only while unchanged"
_LARGEST = 2**22


def listed(folder: Path) -> dict[str, str] | None:
    """Return the digests of the files that this package wrote into a folder, None without a list.

    A folder or a list that is a symbolic link counts as none: it may lead to anything.
    """
    try:
        if not stat.S_ISDIR(os.lstat(folder).st_mode):
            return None
        descriptor = os.open(folder / LIST, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
        with os.fdopen(descriptor, encoding="utf-8") as file:
            content = json.loads(file.read(_LARGEST))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(content, dict) or content.get("about") != _ABOUT:
        return None
    files = content.get("sha256")
    return {str(k): str(v) for k, v in files.items()} if isinstance(files, dict) else None


def write_list(folder: Path, files: Mapping[str, str]) -> None:
    """Write the list of a folder: names and digests."""
    content = {"about": _ABOUT, "sha256": dict(sorted(files.items()))}
    (folder / LIST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def digest(file: Path) -> str:
    """Return the SHA-256 of a file's content, empty if it is not a readable regular file."""
    with contextlib.suppress(OSError):
        if stat.S_ISREG(os.lstat(file).st_mode):
            with file.open("rb") as stream:
                return hashlib.file_digest(stream, "sha256").hexdigest()
    return ""


def users_files(folder: Path, new: Mapping[str, str]) -> list[str]:
    """Return which files of a folder that `new` ones would replace are the user's, or changed by the user.

    Parameters
    ----------
    new : mapping of str to str
        Names and digests of what is to be written; a file with the same content may be replaced.
    """
    ours = listed(folder) or {}
    there = {name: digest(folder / name) for name in new if os.path.lexists(folder / name)}
    return [name for name, found in there.items() if not found or found not in (ours.get(name), new[name])]


def stale_files(folder: Path, patterns: tuple[str, ...]) -> list[str]:
    """Return the files of earlier runs that match one of the patterns and are unchanged."""
    ours = listed(folder) or {}
    return [
        name
        for name, known in ours.items()
        if any(fnmatch(name, pattern) for pattern in patterns) and known == digest(folder / name)
    ]


def free_name(folder: Path, name: str) -> str:
    """Return the name under which a user's file is kept: the first of ``NAME.kept-1.SUFFIX`` that is free."""
    stem, dot, suffix = name.rpartition(".")
    stem, end = (stem, dot + suffix) if stem else (name, "")
    number = 1
    while os.path.lexists(folder / f"{stem}.kept-{number}{end}"):
        number += 1
    return f"{stem}.kept-{number}{end}"


def refuse_others(folder: Path) -> bool:
    """Return whether a working folder of this package exists; raise if the name is used otherwise.

    Raises
    ------
    InputError
        If there is something of the user's, or a symbolic link.
    """
    if not os.path.lexists(folder):
        return False
    if listed(folder) is None:
        found = "a symbolic link" if folder.is_symlink() else "files of other origin"
        raise InputError(f"{folder}: expected a folder of unfinished results, found {found}; move it away")
    inner = [entry.path for entry in os.scandir(folder) if entry.is_symlink()]
    if inner:
        raise InputError(f"{inner[0]}: expected unfinished results, found a symbolic link; move it away")
    return True


def remove_own(folder: Path, pattern: str) -> None:
    """Remove a working folder of this package: its list, and the files that match the pattern.

    A folder without a list and all other files are kept.
    """
    if listed(folder) is None:
        return
    for inner in [entry for entry in os.scandir(folder) if entry.is_dir(follow_symlinks=False)]:
        for entry in list(os.scandir(inner)):
            if fnmatch(entry.name, pattern) and entry.is_file(follow_symlinks=False):
                os.unlink(entry)
        with contextlib.suppress(OSError):  # something of the user's is in it
            os.rmdir(inner)
    os.unlink(folder / LIST)
    with contextlib.suppress(OSError):
        os.rmdir(folder)
