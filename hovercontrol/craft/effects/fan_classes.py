"""Effects of one fan, made for each fan of a craft: another gain, another bend of its static curve."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape
from hovercontrol.craft.effects.command import bent
from hovercontrol.craft.effects.generic_classes import make_class, remembered, word

#: Endings of the names of these effects, behind the fan's.
ENDINGS = "_gain", "_curve"


@lru_cache(maxsize=64)
def fan_effects(fan: str) -> Mapping[str, type[Effect]]:
    """Return the effects that one fan may have for itself, by name.

    Parameters
    ----------
    fan : str
        Its name.

    Examples
    --------
    >>> list(fan_effects("left"))
    ['left_gain', 'left_curve']
    """
    return MappingProxyType({cls.name: cls for cls in (gain(fan), curve(fan))})


@remembered
def gain(fan: str) -> type[Effect]:
    """Return the class of a factor of one fan's force."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[fan] = c.value * s.thrusts[fan]
        return {}

    return make_class(
        f"{word(fan)}_gain",
        (),
        f"Force of the fan {fan} times a factor of its own.",
        "spread of motors and propellers of one kind",
        signal=fan,
        craft="fan",
        order=8,
        value=Coefficient("1", lower=0.0, neutral=1.0),
        commands=commands,
    )


@remembered
def curve(fan: str) -> type[Effect]:
    """Return the class of another bend of one fan's static curve."""

    def commands(self: Effect, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        s.thrusts[fan] = bent(s.thrusts[fan], c)
        return {}

    return make_class(
        f"{word(fan)}_curve",
        (),
        f"Another bend of the static curve of the fan {fan}: F (1 + b (1 - abs(F)/S)) up to the scale S.",
        "second order of a static curve, its ends held",
        signal=fan,
        craft="fan",
        order=2,
        value=Coefficient("1", lower=-1.0, upper=1.0),
        scale=Shape("{thrust}", lower=TINY, default=1.0, search=(1.0,), of="input", fixed=True),
        commands=commands,
    )
