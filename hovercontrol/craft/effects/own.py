"""User-defined effects: errors in them become one line with the name of their file."""

from __future__ import annotations

import functools
import traceback
from collections.abc import Callable
from inspect import isfunction
from typing import Any

from hovercontrol.base.errors import InputError, did_you_mean

#: What an effect may define to say what it does.
HOOKS = ("terms", "motion", "commands", "states", "measured", "factors", "inertia")


def explain(cls: type, base: type) -> None:
    """Check the class of an effect at its definition, and report its errors in one line.

    Parameters
    ----------
    cls : type
        A subclass of `base` outside the package, with a name.
    base : type
        ``Effect``.

    Raises
    ------
    InputError
        If its name is not a valid parameter name, or it defines none of :data:`HOOKS`.
    """
    name: str = getattr(cls, "name", "")
    if not name.isidentifier():
        raise InputError(f"effect {name!r}: expected letters, digits and underscores, as in spin_force")
    if all(getattr(cls, hook) is getattr(base, hook) for hook in HOOKS):
        others = [k for k, v in vars(cls).items() if callable(v)]
        near = next((f"; {k}() is none of them" for k in others), "")
        raise InputError(f"effect {name}: {cls.__name__} defines none of {', '.join(HOOKS)}{near}")
    for hook in HOOKS:
        if isfunction(vars(cls).get(hook)):
            setattr(cls, hook, _explained(name, vars(cls)[hook]))


def _explained(name: str, hook: Callable[..., Any]) -> Callable[..., Any]:
    """Return the method with errors reported with effect, file and line."""

    @functools.wraps(hook)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return hook(*args, **kwargs)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"effect {name}: {_where(error, hook)}{_why(error)}") from error

    return call


def _where(error: Exception, hook: Callable[..., Any]) -> str:
    file = hook.__code__.co_filename
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    return f"{file}, line {lines[-1]}: " if lines else ""


def _why(error: Exception) -> str:
    if isinstance(error, AttributeError) and isinstance(getattr(error.obj, "__dict__", None), dict):
        return f"{error.name!r} does not exist here{did_you_mean(error.name, vars(error.obj))}"
    return f"{type(error).__name__}: {error}"
