"""Backends of a Block by name; a Block imports none of them.

The package registers its backends when it is imported; each is imported when it is first asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_PLACES: dict[str, tuple[str, str]] = {}


def register(name: str, module: str, function: str) -> None:
    """Register the module of a backend.

    Parameters
    ----------
    name : str
        By which :class:`~hovercontrol.core.block.Block` asks for it; one registered before is replaced.
    module, function : str
        Of a function that takes a Block first.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import vehicle
    >>> register("states", "operator", "attrgetter")
    >>> backend("states")("n_continuous")(vehicle("hoverdemon").plant())
    6
    """
    _PLACES[name] = (module, function)


def backend(name: str) -> Callable[..., Any]:
    """Return the function of a backend; raises KeyError where none of that name is registered."""
    module, function = _PLACES[name]
    found: Callable[..., Any] = getattr(importlib.import_module(module), function)
    return found
