"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from hovercontrol.errors import InputError


def write_whole(path: str | Path, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then put it in place in one step.

    Parameters
    ----------
    path : path
        Where the file is to stand; its folder is made if it is not there.
    write : callable
        Called with the temporary path, which has the same suffix.

    Returns
    -------
    Path
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
    return target


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def check_folder(folder: str | Path) -> None:
    """Refuse a folder for results that cannot be made or written, before any work is done for it.

    Raises
    ------
    InputError
        The line names the path.
    """
    target = Path(folder).absolute()
    there = next(p for p in (target, *target.parents) if p.exists())
    if not there.is_dir():
        raise InputError(f"{folder}: cannot write there: {there} is a file, not a folder")
    if not os.access(there, os.W_OK):
        raise InputError(f"{folder}: cannot write there: no permission for {there}")


def write_folder(folder: str | Path, write: Callable[[Path], object]) -> list[Path]:
    """Let `write` fill a temporary folder beside `folder`, then put its files in place.

    Parameters
    ----------
    folder : path
        Where the files are to stand; made if it is not there. Other files in it are left alone.
    write : callable
        Called with the temporary folder.

    Returns
    -------
    list of Path
        The files, sorted.
    """
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        temporary = tempfile.mkdtemp(prefix=".writing-", dir=target)
    except OSError as error:
        raise InputError(f"{target}: cannot write there: {error.strerror}") from None
    try:
        write(Path(temporary))
        files = sorted(Path(temporary).iterdir())
        for file in files:
            os.replace(file, target / file.name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return [target / file.name for file in files]
