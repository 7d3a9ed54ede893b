"""Write files and folders of results atomically, and check paths before reading or writing.

What is being written has a name of its own, ``.writing-HOST-PROCESS-...``, until it is complete. A run that
was killed leaves that behind; the next that writes beside it clears it.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import hashlib
import itertools
import os
import platform
import re
import shutil
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io import written

#: What this process wrote last, for who is asked whether anything was.
placed: list[Path] = []

#: Where the command that runs keeps what it has done so far, to go on from there.
kept: list[Path] = []

#: Files of a folder that are looked at for the nearest name.
MOST_BESIDE = 1000

_unfinished: set[Path] = set()
_NAME = re.compile(r"\.(writing|placing)-([0-9a-f]{8})-(\d+)-.*")


def reason(error: BaseException) -> str:
    """Return why the system refused something, in one line."""
    if _has_null(error):  # each version of Python has words of its own
        return "embedded null byte"
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())


def _has_null(error: BaseException) -> bool:
    return isinstance(error, ValueError) and "embedded null" in str(error)


def readable(path: str | Path, wanted: str = "a file") -> Path:
    """Return the path of a file, or raise if it is something else.

    Parameters
    ----------
    path : path
    wanted : str, optional
        What error lines call the file.

    Raises
    ------
    InputError
        If it is no regular file, its name is impossible, or symbolic links lead in a circle.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"expected the path of {wanted}, found {path!r}")
    file = Path(path)
    try:
        mode = file.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"{file}: expected {wanted}, there is no such file{_beside(file)}") from None
    except (OSError, ValueError, RuntimeError) as error:  # a NUL in the name; a circle of links; too long
        raise InputError(f"{_short(file)}: expected {wanted}: {reason(error)}") from None
    if not stat.S_ISREG(mode):
        found = "a folder" if stat.S_ISDIR(mode) else "no regular file"
        raise InputError(f"{file}: expected {wanted}, found {found}")
    return file


def _beside(file: Path) -> str:
    """Return the end of an error line: the file of the same kind in that folder whose name is nearest."""
    try:
        names = [
            f.name for f in itertools.islice(file.parent.iterdir(), MOST_BESIDE) if f.suffix == file.suffix
        ]
    except (OSError, ValueError):
        return ""
    hint = did_you_mean(file.name, names)
    return hint if hint.startswith("; did you mean") else ""


def check_folder(folder: str | Path) -> None:
    """Refuse a folder for results that cannot be made or written, before any work is done for it.

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
        raise InputError(f"{_short(Path(folder))}: cannot write there: {reason(error)}") from None
    if not is_folder:
        raise InputError(f"{folder}: cannot write there: {there} is a file, not a folder")
    if not os.access(there, os.W_OK):
        raise InputError(f"{folder}: cannot write there: no permission for {there}")


def write_atomically(path: str | Path, write: Callable[[Path], object]) -> Path:
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
    _tell(target)
    return target


def write_new(path: Path, write: Callable[[Path], object]) -> bool:
    """Do as :func:`write_atomically` where nothing has that name; return whether the file was written."""
    try:
        write_quietly(path, write, place=_place_new)
    except _TakenError:
        return False
    _tell(path)
    return True


def write_quietly(
    path: str | Path,
    write: Callable[[Path], object],
    *,
    mode: int = 0o666,
    place: Callable[[Path, Path], object] | None = None,
) -> Path:
    """Do as :func:`write_atomically`, for what is no result (a cache): it is not listed as written.

    The file gets the permissions `mode` less those of the umask; `place` gives it its name, instead of any
    older file.
    """
    target = Path(path)
    with _refusals(target), folder_made(target.parent):
        clear_dead(target.parent)
        handle, name = tempfile.mkstemp(prefix=_prefix(), suffix=target.suffix, dir=target.parent)
        os.close(handle)
        with _removed_at_last(Path(name)) as temporary:
            write(temporary)
            os.chmod(temporary, mode & ~_umask())
            (place or os.replace)(temporary, target)
    return target


def write_folder(
    folder: str | Path, write: Callable[[Path], object], stale: Sequence[str] = ()
) -> list[Path]:
    """Let `write` fill a temporary folder beside `folder`, then put it in place in one step.

    Parameters
    ----------
    folder : path
        Where the files are to stand; made if it is not there. Other files in it are kept, and so is a file
        of the same name that this package did not write, or that was changed since: under another name,
        with a warning.
    write : callable
        Called with the temporary folder.
    stale : sequence of str, optional
        Patterns of names (``free_run_*.png``): what an earlier run wrote and this one does not is removed.

    Returns
    -------
    list of Path
        The files, sorted.

    Raises
    ------
    InputError
        If the system refuses it (no permission, no space); what was there is left as it is.

    Notes
    -----
    A folder that cannot be exchanged (one is working in it, it is a mount point, it has folders of its own)
    gets its files one by one. Should the run be killed just then, the next one completes that.
    """
    target = Path(folder)
    real = _resolved(target)
    with _refusals(target), folder_made(real.parent):
        for place in (real.parent, real):
            clear_dead(place)
        as_one = _exchangeable(real)
        if not as_one:
            real.mkdir(exist_ok=True)
        with _removed_at_last(
            Path(tempfile.mkdtemp(prefix=_prefix(), dir=real.parent if as_one else real))
        ) as temporary:
            write(temporary)
            files = sorted(file for file in temporary.iterdir() if file.name != written.LIST)
            made = {file.name: written.digest(file) for file in files}
            gone = [name for name in written.stale_files(real, tuple(stale)) if name not in made]
            kept = {name: written.free_name(real, name) for name in written.users_files(real, made)}
            written.write_list(temporary, _all_listed(real, gone) | made)
            os.chmod(temporary, real.stat().st_mode & 0o7777 if real.exists() else 0o777 & ~_umask())
            if as_one:
                _keep_others(real, temporary, [*made, *gone], kept)
                _exchange(temporary, real)
            else:
                _refuse_folders(real, made)
                for name, other in kept.items():
                    os.rename(real / name, real / other)
                ready = temporary.with_name(temporary.name.replace(".writing-", ".placing-", 1))
                _unfinished.discard(temporary)  # from here on it is to be completed, not removed
                os.rename(temporary, ready)
                _place(ready, real)
                for name in gone:
                    (real / name).unlink()
    for name, other in kept.items():
        text = f"{target / name} was not written by hovercontrol, or was changed since: kept as {other}"
        warnings.warn(text, stacklevel=3)
    _tell(target)
    return [target / name for name in made]


@contextmanager
def folder_made(folder: Path) -> Iterator[None]:
    """Make a folder and its parents; where what is done in it fails, remove those that were made for it."""
    new = [p for p in (folder, *folder.parents) if not os.path.lexists(p)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for made in new:
            with contextlib.suppress(OSError):  # never made, or no longer empty
                made.rmdir()
        raise


def own_folder(folder: Path) -> None:
    """Make a working folder of this package, with its list; one that is there already is kept.

    Raises
    ------
    InputError
        If something else has that name, or the system refuses it.
    """
    if written.refuse_others(folder):
        return
    with _refusals(folder), folder_made(folder.parent):
        clear_dead(folder.parent)
        with _removed_at_last(Path(tempfile.mkdtemp(prefix=_prefix(), dir=folder.parent))) as temporary:
            written.write_list(temporary, {})
            os.rename(temporary, folder)


def clear_dead(folder: Path) -> None:
    """Remove what killed runs left unfinished in a folder; complete what they had only begun to move."""
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            found = _NAME.fullmatch(name)
            if not found or found[2] != _host() or _alive(int(found[3])) or not _own(folder / name):
                continue
            if found[1] == "placing":
                _place(folder / name, folder)
            _remove(folder / name)


def clear_own() -> None:
    """Remove what this process has not finished."""
    for path in list(_unfinished):
        _remove(path)


# ---- how ----------------------------------------------------------------------------------------------


class _TakenError(Exception):
    """Something has that name already."""


def _place_new(temporary: Path, target: Path) -> None:
    """Give a file a name that nothing has."""
    try:
        try:
            os.link(temporary, target, follow_symlinks=False)
        except FileExistsError:
            raise
        except OSError:  # a file system without links
            os.close(os.open(target, os.O_CREAT | os.O_EXCL))
            os.replace(temporary, target)
    except FileExistsError:
        raise _TakenError from None


@contextmanager
def _refusals(target: Path) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError, RuntimeError) as error:
        if not isinstance(error, OSError) and not _has_null(error) and "loop" not in str(error):
            raise
        if _is_part(target):  # who writes the whole says where that was to be
            raise
        raise InputError(f"{_short(target)}: cannot be written: {reason(error)}") from None


def _resolved(target: Path) -> Path:
    with _refusals(target):
        return target.resolve()


@contextmanager
def _removed_at_last(temporary: Path) -> Iterator[Path]:
    _unfinished.add(temporary)
    try:
        yield temporary
    finally:
        _remove(temporary)
        _unfinished.discard(temporary)


def _own(path: Path) -> bool:
    """Return whether something is this user's and no link: in a shared folder others may choose its name."""
    found = os.lstat(path)
    return not stat.S_ISLNK(found.st_mode) and (os.name == "nt" or found.st_uid == os.getuid())


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()


def _tell(target: Path) -> None:
    """Remember what was written, unless it is part of what is being written."""
    if not _is_part(target):
        placed[:] = [target]


def _is_part(target: Path) -> bool:
    return any(_NAME.fullmatch(part.name) for part in (target, *target.parents))


def _exchangeable(target: Path) -> bool:
    """Return whether a folder may be replaced by another of its name."""
    if not os.access(target.parent, os.W_OK | os.X_OK):
        return False
    if not target.exists():
        return True
    here = Path.cwd().resolve()
    used = here == target or target in here.parents or os.path.ismount(target)
    with os.scandir(target) as entries:
        return not used and not any(entry.is_dir(follow_symlinks=False) for entry in entries)


def _all_listed(folder: Path, gone: Sequence[str]) -> dict[str, str]:
    """Return what the list of a folder says of the files that are still there."""
    known = written.listed(folder) or {}
    return {k: v for k, v in known.items() if k not in gone and os.path.lexists(folder / k)}


def _refuse_folders(folder: Path, names: Mapping[str, str]) -> None:
    """Refuse to put a file where a folder stands, before the first file is moved."""
    for name in names:
        if (folder / name).is_dir() and not (folder / name).is_symlink():
            raise InputError(f"{_short(folder / name)}: cannot be written: a folder has that name")


def _keep_others(old: Path, new: Path, replaced: Sequence[str], kept: Mapping[str, str]) -> None:
    """Let a new folder have the files that others put into the old one, those in `kept` by another name."""
    for entry in os.scandir(old) if old.exists() else ():
        name = kept.get(entry.name, entry.name)
        if entry.name != written.LIST and (name != entry.name or name not in replaced):
            try:
                os.link(entry.path, new / name, follow_symlinks=False)
            except OSError:  # a file system without links
                shutil.copy2(entry.path, new / name, follow_symlinks=False)


def _exchange(new: Path, target: Path) -> None:
    """Put a folder in place in one step; what was there is left under the new one's name."""
    if not target.exists():
        with contextlib.suppress(FileExistsError):  # another run was first
            os.rename(new, target)
            return
    try:
        _swap(os.fsencode(new), os.fsencode(target))
    except OSError as error:
        if error.errno not in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP):
            raise
        away = Path(tempfile.mkdtemp(prefix=_prefix(), dir=target.parent))
        with _removed_at_last(away):
            os.rename(target, away / "old")
            os.rename(new, target)


def _swap(one: bytes, other: bytes) -> None:
    """Exchange two names in one step, where the system can."""
    library: Any = ctypes.CDLL(None, use_errno=True) if os.name == "posix" else None
    if hasattr(library, "renameat2"):
        here, exchange = -100, 2
        failed = library.renameat2(here, one, here, other, exchange)
    elif hasattr(library, "renamex_np"):
        failed = library.renamex_np(one, other, 2)
    else:
        raise OSError(errno.ENOSYS, "no exchange of names")
    if failed:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _place(ready: Path, target: Path) -> None:
    """Move what is complete, file by file."""
    for file in sorted(ready.iterdir()):
        os.replace(file, target / file.name)
    ready.rmdir()


def _prefix() -> str:
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


def _short(path: Path) -> str:
    """Return a path for an error line, however long it is and whatever is in it."""
    text = str(path).replace("\0", "\\0")
    return text if len(text) <= 200 else f"{text[:100]}...{text[-60:]}"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
