"""Physical effects, one class each, found by name."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import Coefficient, Shape

__all__ = ["Coefficient", "Effect", "Shape", "effect", "effect_class", "effect_names"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")


@checked
def effect_names() -> list[str]:
    """Return the names of all known effects, sorted.

    Examples
    --------
    >>> len(effect_names()) > 50, "yaw_coulomb" in effect_names()
    (True, True)
    """
    return sorted(Effect.known)


@checked
def effect_class(name: str) -> type[Effect]:
    """Return the class of an effect.

    Raises
    ------
    InputError
        If no effect has that name; the message names the nearest one.

    Examples
    --------
    >>> effect_class("yaw_coulomb").source
    'C17 (10), c5 = d_r0/J'
    """
    check_known(name, Effect.known, f"unknown effect {name!r}")
    return Effect.known[name]


@checked
def effect(name: str, value: float | None = None, **values: Any) -> Effect:
    """Return an effect with its numbers.

    Parameters
    ----------
    name : str
        As in the model file, ``"yaw_coulomb"``.
    value : float, optional
        The effect's coefficient, in its unit.
    **values : float
        Its other numbers (``width=0.02``).

    Raises
    ------
    InputError
        If the name or a number's name is unknown, a number is missing or out of bounds.

    Examples
    --------
    >>> effect("surge_linear_drag", 0.4).values
    {'value': 0.4}
    """
    return effect_class(name)(value, **values)
