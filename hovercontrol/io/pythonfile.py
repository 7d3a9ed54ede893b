"""What a Python file of the user's own defines: ``machine.py:MODEL``."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.files import readable

#: Kinds of machines, and how many of other kinds an error line lists.
MACHINES, MOST = ("Block", "BlockModel", "Model"), 8


def names_python(text: str) -> bool:
    """Return whether a text names something in a Python file.

    Examples
    --------
    >>> names_python("machine.py:MODEL"), names_python("machine.py"), names_python("craft.toml")
    (True, True, False)
    """
    return text.partition(".py:")[1] != "" or text.endswith(".py")


def from_python(text: str, *kinds: type) -> Any:
    """Return what a Python file defines under a name; the file is run, as by ``import``.

    Parameters
    ----------
    text : str
        ``FILE.py:NAME``; ``FILE.py`` alone where it defines one thing of these kinds. The Block of a model
        that is one of them counts as the model.
    *kinds : type
        What is wanted.

    Raises
    ------
    InputError
        If there is no such file or name (the nearest is named), the file does not run (its line is named),
        or what it defines is of another kind.
    """
    file, _, name = (text if ".py:" in text else f"{text}:").rpartition(":")
    path = readable(file, "a Python file")
    module = _run(path)
    known = {key: value for key, value in vars(module).items() if isinstance(value, kinds)}
    wanted = " or ".join(kind.__name__ for kind in kinds)
    nearest = did_you_mean(name, known) if known else _others(module)
    parts = {id(getattr(value, "block", None)) for value in known.values()}
    alone = {id(value): value for value in known.values() if id(value) not in parts}
    if not name and len(alone) == 1:
        return next(iter(alone.values()))
    if name in known:
        return known[name]
    if hasattr(module, name):
        found = type(getattr(module, name)).__name__
        raise InputError(f"{text}: expected a {wanted}, found a {found}{nearest}")
    if not name:
        raise InputError(f"{text}: expected FILE.py:NAME of a {wanted}{nearest}")
    raise InputError(f"{path}: defines no {name!r}{nearest}")


def _others(module: ModuleType) -> str:
    """Return the end of an error line: what machines of other kinds a file defines."""
    there = [
        f"{key} (a {type(v).__name__})" for key, v in vars(module).items() if type(v).__name__ in MACHINES
    ]
    return f"; the file defines none, but {', '.join(there[:MOST])}" if there else "; the file defines none"


def _run(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    beside, before = str(path.resolve().parent), sys.modules.get(path.stem)
    sys.modules[path.stem] = module  # what it defines looks itself up there
    sys.path.insert(0, beside)
    try:
        spec.loader.exec_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # sys.exit as well: it is the file that ends there, not this command
        raise InputError(
            f"{path}{_line(error, spec.origin)}: {type(error).__name__}: {_why(error)}"
        ) from error
    finally:
        sys.path.remove(beside)
        if before is not None:
            sys.modules[path.stem] = before
    return module


def _line(error: BaseException, file: str | None) -> str:
    own = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    at = error.lineno if isinstance(error, SyntaxError) else own[-1] if own else None
    return f", line {at}" if at else ""


def _why(error: BaseException) -> str:
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    return next(iter(text.strip().splitlines()), "no more is said")
