"""Backends of a Block by name, so that a Block need not import them.

The package registers its backends when it is imported. A backend's module is imported on its first use.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

_PLACES: dict[str, tuple[str, str]] = {}


def register(name: str, module: str, function: str) -> None:
    """Register the function of a backend.

    Parameters
    ----------
    name : str
        Name that :class:`~hovercontrol.core.block.Block` uses; an earlier backend of this name is replaced.
    module, function : str
        Module and name of a function whose first argument is a Block.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import vehicle
    >>> register("states", "operator", "attrgetter")
    >>> backend("states")("n_continuous")(vehicle("hoverdemon").plant())
    6
    """
    _PLACES[name] = (module, function)


def backend(name: str) -> Callable[..., Any]:
    """Return the function of a backend; raises KeyError if the name is not registered."""
    module, function = _PLACES[name]
    found: Callable[..., Any] = getattr(importlib.import_module(module), function)
    return found
