"""Write files and folders of results atomically, and check paths before reading or writing.

A file has the temporary name ``.writing-HOST-PROCESS-...`` until it is complete. Temporary files of killed
runs are removed by the next run that writes to the folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
import platform
import re
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from hovercontrol.base.errors import InputError, did_you_mean

#: What this process wrote last, for who is asked whether anything was.
placed: list[Path] = []

#: Where the command that runs keeps what it has done so far, and how to go on from there.
kept: list[str] = []

#: Files of a folder that are looked at for the nearest name.
MOST_BESIDE = 1000

unfinished: set[Path] = set()
_NAME = re.compile(r"\.(writing|placing)-([0-9a-f]{8})-(\d+)-.*")


def reason(error: BaseException) -> str:
    """Return the reason of a system error, in one line."""
    if _has_null(error):  # each version of Python has words of its own
        return "embedded null byte"
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())


def _has_null(error: BaseException) -> bool:
    return isinstance(error, ValueError) and "embedded null" in str(error)


def readable(path: str | Path, wanted: str = "a file") -> Path:
    """Return the path of a file; raise if it is not a regular file.

    Parameters
    ----------
    wanted : str, optional
        Name of the file in messages.

    Raises
    ------
    InputError
        If it is not a regular file, its name is impossible, or symbolic links form a circle.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"expected the path of {wanted}, found {path!r}")
    file = Path(path)
    try:
        mode = file.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"{file}: expected {wanted}, there is no such file{_beside(file)}") from None
    except (OSError, ValueError, RuntimeError) as error:  # a NUL in the name; a circle of links; too long
        raise InputError(f"{shortened(file)}: expected {wanted}: {reason(error)}") from None
    if not stat.S_ISREG(mode):
        found = "a folder" if stat.S_ISDIR(mode) else "not a regular file"
        raise InputError(f"{file}: expected {wanted}, found {found}")
    return file


def _beside(file: Path) -> str:
    """Return the end of an error line: the nearest file name with the same suffix in that folder."""
    try:
        names = [
            f.name for f in itertools.islice(file.parent.iterdir(), MOST_BESIDE) if f.suffix == file.suffix
        ]
    except (OSError, ValueError):
        return ""
    hint = did_you_mean(file.name, names)
    return hint if hint.startswith("; did you mean") else ""


def check_folder(folder: str | Path) -> None:
    """Raise if a folder for results cannot be created or written, before any work is done.

    Raises
    ------
    InputError
        The line names the path.
    """
    if not isinstance(folder, str | os.PathLike):
        raise InputError(f"expected the path of a folder, found {folder!r}")
    target = Path(folder).absolute()
    try:
        there = next(p for p in (target, *target.parents) if os.path.lexists(p))
        is_folder = stat.S_ISDIR(there.stat().st_mode)
        for part in target.relative_to(there).parts if is_folder else ():  # the names that it would have
            with contextlib.suppress(FileNotFoundError):
                os.lstat(there / part)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{shortened(Path(folder))}: cannot write there: {reason(error)}") from None
    if not is_folder:
        raise InputError(f"{folder}: cannot write there: {there} is a file, not a folder")
    if not os.access(there, os.W_OK):
        raise InputError(f"{folder}: cannot write there: no permission for {there}")


def write_atomically(path: str | Path, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then rename it in one step.

    Parameters
    ----------
    path : path
        Where the file is to stand; its folder is made if it is not there.
    write : callable
        Called with the temporary path, which has the same suffix.

    Raises
    ------
    InputError
        If the system refuses it (no permission, no space); an older file is left as it is.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_atomically(Path(folder) / "a.txt", lambda file: file.write_text("whole")).read_text()
    'whole'
    """
    target = write_quietly(path, write)
    tell(target)
    return target


def write_new(path: Path, write: Callable[[Path], object]) -> bool:
    """Write like :func:`write_atomically` unless the name exists; return whether the file was written."""
    try:
        write_quietly(path, write, place=_place_new)
    except _TakenError:
        return False
    tell(path)
    return True


def write_quietly(
    path: str | Path,
    write: Callable[[Path], object],
    *,
    mode: int = 0o666,
    place: Callable[[Path, Path], object] | None = None,
) -> Path:
    """Write like :func:`write_atomically`, for a cache: the file is not listed as a result.

    The file gets the permissions `mode` less those of the umask; `place` gives it its name, instead of any
    older file.
    """
    target = Path(path)
    with refusals(target), make_folder(target.parent):
        clear_dead(target.parent)
        handle, name = tempfile.mkstemp(prefix=temporary_prefix(), suffix=target.suffix, dir=target.parent)
        os.close(handle)
        with removed_at_last(Path(name)) as temporary:
            write(temporary)
            os.chmod(temporary, mode & ~umask())
            (place or os.replace)(temporary, target)
    return target


@contextmanager
def make_folder(folder: Path) -> Iterator[None]:
    """Make a folder and its parents for a ``with``; if the body fails, remove the folders that were made."""
    new = [p for p in (folder, *folder.parents) if not os.path.lexists(p)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for made in new:
            with contextlib.suppress(OSError):  # never made, or no longer empty
                made.rmdir()
        raise


def clear_dead(folder: Path) -> None:
    """Remove unfinished files of killed runs in a folder; complete their interrupted moves."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            found = _NAME.fullmatch(name)
            if not found or found[2] != _host() or _alive(int(found[3])) or not _own(folder / name):
                continue
            if found[1] == "placing":
                place_files(folder / name, folder)
            _remove(folder / name)


def clear_own() -> None:
    """Remove the unfinished files of this process."""
    for path in list(unfinished):
        _remove(path)


# ---- how ----------------------------------------------------------------------------------------------


class _TakenError(Exception):
    """The name already exists."""


def _place_new(temporary: Path, target: Path) -> None:
    """Move a file to an unused name."""
    try:
        try:
            os.link(temporary, target)
        except FileExistsError:
            raise
        except OSError:  # a file system without links
            os.close(os.open(target, os.O_CREAT | os.O_EXCL))
            os.replace(temporary, target)
    except FileExistsError:
        raise _TakenError from None


@contextmanager
def refusals(target: Path) -> Iterator[None]:
    """Raise system errors inside a ``with`` as one line that names the target."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:
        if not isinstance(error, OSError) and not _has_null(error) and "loop" not in str(error):
            raise
        if _is_part(target):  # who writes the whole says where that was to be
            raise
        raise InputError(f"{shortened(target)}: cannot be written: {reason(error)}") from None


def resolved(target: Path) -> Path:
    """Return a path without symbolic links."""
    with refusals(target):
        return target.resolve()


@contextmanager
def removed_at_last(temporary: Path) -> Iterator[Path]:
    """Remove a temporary path at the end of a ``with``, or when a signal ends the process."""
    unfinished.add(temporary)
    try:
        yield temporary
    finally:
        _remove(temporary)
        unfinished.discard(temporary)


def _own(path: Path) -> bool:
    """Return whether a path belongs to this user and is no link: in shared folders others create names."""
    found = os.lstat(path)
    return not stat.S_ISLNK(found.st_mode) and (os.name == "nt" or found.st_uid == os.getuid())


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()


def tell(target: Path) -> None:
    """Record a written file, unless it is part of a folder being written."""
    if not _is_part(target):
        placed[:] = [target]


def _is_part(target: Path) -> bool:
    return any(_NAME.fullmatch(part.name) for part in (target, *target.parents))


def place_files(ready: Path, target: Path) -> None:
    """Move complete files one by one."""
    for file in sorted(ready.iterdir()):
        os.replace(file, target / file.name)
    ready.rmdir()


def temporary_prefix() -> str:
    """Return the prefix of the names of this process' unfinished files."""
    return f".writing-{_host()}-{os.getpid()}-"


@cache
def _host() -> str:
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def _alive(process: int) -> bool:
    if os.name == "nt":  # asking there ends the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def shortened(path: Path) -> str:
    """Return a path for an error line: shortened and printable."""
    text = str(path).replace("\0", "\\0")
    return text if len(text) <= 200 else f"{text[:100]}...{text[-60:]}"


def umask() -> int:
    """Return the permissions mask of new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
