"""Generic measurement effects: a bias, a wrong scale."""

from __future__ import annotations

from typing import Any

from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import Coefficient
from hovercontrol.craft.effects.generic_classes import make_class, remembered, word


@remembered
def bias(signal: str, unit: str) -> type[Effect]:
    """Return the class of a constant error of an output's sensor."""

    def measured(self: Effect, c: Any, s: Any) -> None:
        setattr(s, signal, getattr(s, signal) + c.value)

    return make_class(
        f"{word(signal)}_bias",
        (),
        f"A sensor of {signal} that is off by a constant.",
        "calibration",
        order=3,
        value=Coefficient(unit),
        measured=measured,
    )


@remembered
def scale(signal: str) -> type[Effect]:
    """Return the class of a wrong scale of an output's sensor."""

    def measured(self: Effect, c: Any, s: Any) -> None:
        setattr(s, signal, getattr(s, signal) + c.value * getattr(s.true, signal))

    return make_class(
        f"{word(signal)}_scale",
        (),
        f"A sensor of {signal} with a wrong scale: (1 + c) {signal}.",
        "calibration",
        order=3,
        value=Coefficient("1"),
        measured=measured,
    )
