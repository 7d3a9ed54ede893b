"""Models from a user's Python file: ``machine.py:MODEL``."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.files import readable
from hovercontrol.base.users_code import run_users_code

#: Begins the name of the module that a user's file becomes where its own name is taken.
_PREFIX = "users_file_"
_run_before: set[str] = set()

#: Kinds of machines, and how many of other kinds an error line lists.
MACHINES, MOST = ("Block", "BlockModel", "Model"), 8


def names_python(text: str) -> bool:
    """Return whether a text refers to a Python file.

    Examples
    --------
    >>> names_python("machine.py:MODEL"), names_python("machine.py"), names_python("craft.toml")
    (True, True, False)
    """
    return text.partition(".py:")[1] != "" or text.endswith(".py")


def from_python(text: str, *kinds: type, lists: bool = False) -> Any:
    """Return an object that a Python file defines; the file is executed, as by ``import``.

    Parameters
    ----------
    text : str
        ``FILE.py:NAME``; ``FILE.py`` alone where it defines one thing of these kinds. The Block of a model
        that is one of them counts as the model.
    *kinds : type
        Accepted types.
    lists : bool, optional
        Whether NAME may be a list or tuple of these types.

    Raises
    ------
    InputError
        If there is no such file or name (the nearest is named), the file does not run (its line is named),
        or what it defines is of another kind.
    """
    file, _, name = (text if ".py:" in text else f"{text}:").rpartition(":")
    path = readable(file, "a Python file")
    known, other, others = run_users_code(path, lambda: _defined(path, name, kinds, lists))
    parts = {id(getattr(value, "block", None)) for value in known.values()}
    alone = {id(value): value for value in known.values() if id(value) not in parts}
    if not name and len(alone) == 1:
        return next(iter(alone.values()))
    if name in known:
        return known[name]
    wanted = " or ".join(kind.__name__ for kind in kinds) + (", or a list of them" if lists else "")
    nearest = did_you_mean(name, known) if known else others
    if other:
        raise InputError(f"{text}: expected a {wanted}, found a {other}{nearest}")
    if not name:
        raise InputError(f"{text}: expected FILE.py:NAME of a {wanted}{nearest}")
    raise InputError(f"{path}: defines no {name!r}{nearest}")


def _defined(path: Path, name: str, kinds: tuple[type, ...], lists: bool) -> tuple[dict[str, Any], str, str]:
    """Return what a file defines of some kinds, and for errors what it defines instead.

    That is the type of what has the name, if it is of another kind, and the end of an error line: which
    machines of other kinds there are.
    """
    module = _run(path)
    known = {key: value for key, value in vars(module).items() if isinstance(value, kinds)}
    several = getattr(module, name, None) if lists and name else None
    if isinstance(several, list | tuple) and several and all(isinstance(one, kinds) for one in several):
        known[name] = list(several)
    other = name and name not in known and hasattr(module, name)
    found = {key: type(value).__name__ for key, value in vars(module).items()}
    there = [f"{key} (a {kind})" for key, kind in found.items() if kind in MACHINES]
    others = f"; the file defines none, but {', '.join(there[:MOST])}" if there else "; the file defines none"
    return known, type(getattr(module, name)).__name__ if other else "", others


def _is_installed(path: Path) -> bool:
    """Return whether a file has the name of a module that is installed or imported."""
    if path.stem in _run_before:
        return False
    try:
        found = importlib.util.find_spec(path.stem)
    except (ImportError, ValueError):  # a name with dots; __main__
        return True
    if found is None or os.path.realpath(found.origin or "") == os.path.realpath(path):
        _run_before.add(path.stem)
        return False
    return True


def _run(path: Path) -> ModuleType:
    """Execute a file; while it runs, modules in its folder can be imported.

    A file with the name of an installed module (``control.py``) does not hide it from this package.
    """
    hides = _is_installed(path)
    own = f"{_PREFIX}{path.stem}" if hides else path.stem
    spec = importlib.util.spec_from_file_location(own, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[own] = module  # what it defines looks itself up there
    beside = str(path.resolve().parent)
    sys.path.insert(len(sys.path) if hides else 0, beside)
    try:
        spec.loader.exec_module(module)
    finally:
        with contextlib.suppress(ValueError, AttributeError):
            sys.path.remove(beside)
    return module
