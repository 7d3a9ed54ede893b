"""Backends of a Block from other packages: entry points of the group ``hovercontrol.backends``.

A package adds one by two lines of its ``pyproject.toml``::

    [project.entry-points."hovercontrol.backends"]
    name = "module:function"

The function takes the Block and the options of ``block.to("name", **options)``. Its module is imported at
the first call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from hovercontrol.base.errors import InputError, did_you_mean

GROUP = "hovercontrol.backends"


def installed() -> dict[str, EntryPoint]:
    """Return the entry points of installed backends by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def installed_backend(name: str, own: Iterable[str]) -> Callable[..., Any]:
    """Return the function of a backend that another package provides.

    Parameters
    ----------
    name : str
    own : iterable of str
        Names of the backends of this package, for the error message.

    Raises
    ------
    InputError
        If no package provides it, or its module cannot be imported.
    """
    known = installed()
    if name not in known:
        names = sorted({*own, *known})
        nearest = did_you_mean(name, names)
        every = "" if nearest.startswith("; known") else f" known: {', '.join(names)}"
        raise InputError(f"Block.to: unknown backend {name!r}{nearest}{every}")
    point, label = known[name], f"Block.to: the backend {name!r} ({known[name].value})"
    try:
        found: Callable[..., Any] = point.load()
    except (ImportError, AttributeError) as error:
        raise InputError(f"{label} cannot be loaded: {error}") from error
    if not callable(found):
        raise InputError(f"{label} is not a function")
    return found
