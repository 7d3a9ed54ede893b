"""Classes of effects made for the signals of a Block: once for the same signals, pickled by recipe."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Mapping
from functools import cache
from types import new_class
from typing import Any, ClassVar

from hovercontrol.craft.effects.base import Effect


class _Generic(Effect):
    """An effect whose class is made by a remembered function; it can be pickled by its recipe."""

    recipe: ClassVar[tuple[Any, ...]]

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.recipe, self.values)


def _again(recipe: tuple[Any, ...], values: Mapping[str, float]) -> Effect:
    module, make, *arguments = recipe
    made: Effect = getattr(importlib.import_module(module), make)(*arguments)(**values)
    return made


def remembered(make: Callable[..., type[Effect]]) -> Callable[..., type[Effect]]:
    """Make a class once for the same arguments, and note how."""

    def once(*arguments: Any) -> type[Effect]:
        cls = make(*arguments)
        cls.recipe = (make.__module__, make.__name__, *arguments)  # type: ignore[attr-defined]
        return cls

    once.__doc__, once.__name__, once.__module__ = make.__doc__, make.__name__, make.__module__
    return cache(once)


def make_class(
    name: str, bases: tuple[type[Effect], ...], sentence: str, source: str, **attributes: Any
) -> type[Effect]:
    """Return a class of effects that is not registered.

    Parameters
    ----------
    name : str
        Of the effect.
    bases : tuple of type of Effect
    sentence : str
        Its docstring.
    source : str
    **attributes
        Its numbers, methods and what else a class of effects declares.
    """
    title = "".join(part.capitalize() for part in name.split("_"))
    space = {"name": name, "__doc__": sentence, "__module__": __name__, "source": source, **attributes}
    made: type[Effect] = new_class(
        title, (*bases, _Generic), {"register": False}, lambda namespace: namespace.update(space)
    )
    return made


def word(signal: str) -> str:
    """Return a signal's name as part of an effect's: ``P[0,1]`` becomes ``P_0_1``."""
    return re.sub(r"\W+", "_", signal).strip("_")
