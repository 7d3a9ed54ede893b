"""Write folders of results: in one step where a folder can be exchanged, and never over a user's file."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hovercontrol.base import file_list
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import (
    clear_dead,
    make_folder,
    place_files,
    refusals,
    removed_at_last,
    resolved,
    shortened,
    tell,
    temporary_prefix,
    umask,
    unfinished,
)  # fmt: skip


def write_folder(
    folder: str | Path, write: Callable[[Path], object], stale: Sequence[str] = ()
) -> list[Path]:
    """Let `write` fill a temporary folder beside `folder`, then rename it in one step.

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
    real = resolved(target)
    with refusals(target), make_folder(real.parent):
        for place in (real.parent, real):
            clear_dead(place)
        as_one = _exchangeable(real)
        if not as_one:
            real.mkdir(exist_ok=True)
        with removed_at_last(
            Path(tempfile.mkdtemp(prefix=temporary_prefix(), dir=real.parent if as_one else real))
        ) as temporary:
            write(temporary)
            files = sorted(file for file in temporary.iterdir() if file.name != file_list.LIST)
            made = {file.name: file_list.digest(file) for file in files}
            gone = [name for name in file_list.stale_files(real, tuple(stale)) if name not in made]
            kept = {name: file_list.free_name(real, name) for name in file_list.users_files(real, made)}
            file_list.write_list(temporary, _all_listed(real, gone) | made)
            os.chmod(temporary, real.stat().st_mode & 0o7777 if real.exists() else 0o777 & ~umask())
            if as_one:
                _keep_others(real, temporary, [*made, *gone], kept)
                _exchange(temporary, real)
            else:
                _refuse_folders(real, made)
                for name, other in kept.items():
                    os.rename(real / name, real / other)
                ready = temporary.with_name(temporary.name.replace(".writing-", ".placing-", 1))
                unfinished.discard(temporary)  # from here on it is to be completed, not removed
                os.rename(temporary, ready)
                place_files(ready, real)
                for name in gone:
                    (real / name).unlink()
    for name, other in kept.items():
        text = f"{target / name} was not written by hovercontrol, or has changed since: kept as {other}"
        warnings.warn(text, stacklevel=3)
    tell(target)
    return [target / name for name in made]


def own_folder(folder: Path) -> None:
    """Make a working folder of this package, with its list; an existing one is kept.

    Raises
    ------
    InputError
        If something else has that name, or the system refuses it.
    """
    if file_list.refuse_others(folder):
        return
    with refusals(folder), make_folder(folder.parent):
        clear_dead(folder.parent)
        made = Path(tempfile.mkdtemp(prefix=temporary_prefix(), dir=folder.parent))
        with removed_at_last(made) as temporary:
            file_list.write_list(temporary, {})
            os.rename(temporary, folder)


# ---- how ----------------------------------------------------------------------------------------------


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
    """Return the entries of a folder's list whose files still exist."""
    known = file_list.listed(folder) or {}
    return {k: v for k, v in known.items() if k not in gone and os.path.lexists(folder / k)}


def _refuse_folders(folder: Path, names: Mapping[str, str]) -> None:
    """Raise if a folder has the name of a new file, before the first file is moved."""
    for name in names:
        if (folder / name).is_dir() and not (folder / name).is_symlink():
            raise InputError(f"{shortened(folder / name)}: cannot be written: a folder has that name")


def _keep_others(old: Path, new: Path, replaced: Sequence[str], kept: Mapping[str, str]) -> None:
    """Move files that others put into the old folder to the new one, those in `kept` under another name."""
    for entry in os.scandir(old) if old.exists() else ():
        name = kept.get(entry.name, entry.name)
        if entry.name != file_list.LIST and (name != entry.name or name not in replaced):
            try:
                os.link(entry.path, new / name, follow_symlinks=False)
            except OSError:  # a file system without links
                shutil.copy2(entry.path, new / name, follow_symlinks=False)


def _exchange(new: Path, target: Path) -> None:
    """Exchange a folder in one step; the old content keeps the new folder's temporary name."""
    if not target.exists():
        with contextlib.suppress(FileExistsError):  # another run was first
            os.rename(new, target)
            return
    try:
        _swap(os.fsencode(new), os.fsencode(target))
    except OSError as error:
        if error.errno not in (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP):
            raise
        away = Path(tempfile.mkdtemp(prefix=temporary_prefix(), dir=target.parent))
        with removed_at_last(away):
            os.rename(target, away / "old")
            os.rename(new, target)


def _swap(one: bytes, other: bytes) -> None:
    """Exchange two names in one step if the system supports it."""
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
