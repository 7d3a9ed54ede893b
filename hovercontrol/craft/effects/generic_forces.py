"""Generic effects in an equation: an offset, drag, dry friction, a spring."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.blocks.sgn import sgn
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape
from hovercontrol.craft.effects.drag import LAWS, Axis, Drag, per_second
from hovercontrol.craft.effects.friction import SOURCE, LuGre
from hovercontrol.craft.effects.generic_classes import make_class, remembered, word


@remembered
def offset(state: str, unit: str) -> type[Effect]:
    """Return the class of a constant in the equation of a state."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {state: c.value}

    return make_class(
        f"{word(state)}_offset",
        (),
        f"A constant in the equation of {state}.",
        "Newton",
        value=Coefficient(per_second(unit)),
        axis=state,
        terms=terms,
    )


@remembered
def drag(ending: str, state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a law of drag (``"coulomb"``) against a state of typical size `size`."""
    law = LAWS[ending]
    axis = Axis(state, state, unit, state, 0.01 * size, 0.2 * size, low=f"small {state}", force="")
    declared = law.along(axis)
    sentence, rivals = declared.pop("__doc__"), tuple(f"{word(state)}_{rival}" for rival in law.rivals)
    return make_class(
        f"{word(state)}_{ending}", (law,), sentence, law.sources[-1], **declared, in_air=False,
        mistaken_for=rivals,
    )  # fmt: skip


@remembered
def asymmetric_drag(state: str, unit: str) -> type[Effect]:
    """Return the class of a linear drag that differs with the sign of a state."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {state: -c.value * sp.Abs(getattr(s, state))}

    return make_class(
        f"{word(state)}_asymmetric_drag",
        (),
        f"Linear drag against {state} that differs with its sign: -c abs({state}).",
        "viscous friction of another size in each direction",
        value=Coefficient("1/s"),
        axis=state,
        terms=terms,
    )


@remembered
def load_friction(state: str, unit: str, size: float, drive: sp.Expr) -> type[Effect]:
    """Return the class of a dry friction in proportion to what the inputs add to the equation of a state."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        now = {symbol: getattr(s, symbol.name, symbol) for symbol in drive.free_symbols}
        return {state: -c.value * sp.Abs(drive.xreplace(now)) * sgn(getattr(s, state), c.width)}

    return make_class(
        f"{word(state)}_load_friction",
        (Drag,),
        f"Dry friction against {state} in proportion to what drives it: -c abs(drive) sgn({state}).",
        "Coulomb; the normal force grows with the drive",
        value=Coefficient("1", lower=0.0),
        width=Shape(unit, lower=TINY, default=0.01 * size),
        axis=state,
        terms=terms,
    )


@remembered
def lugre(state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a LuGre friction against a state of typical size `size`."""
    levels = (0.1 * size, 0.4 * size), (0.5 * size,)
    return make_class(
        f"{word(state)}_lugre",
        (LuGre,),
        f"LuGre friction against {state}: bristles that bend before it slides, stick-slip.",
        SOURCE,
        **LuGre.declared(unit, (100.0, 1000.0), *levels, 0.05 * size),
        axis=state,
        deflection=_integral(unit),
    )


@remembered
def spring(state: str, unit: str, place: str) -> type[Effect]:
    """Return the class of a spring: -k q in the equation of a state that is the derivative of q, `place`."""

    def terms(self: Effect, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {state: -c.value * getattr(s, place)}

    return make_class(
        f"{word(state)}_spring",
        (),
        f"A spring that pulls {place} back to zero: -k {place} in the equation of {state}.",
        "Hooke",
        value=Coefficient("1/s^2", lower=0.0),
        axis=state,
        terms=terms,
    )


def _integral(unit: str) -> str:
    """Return the unit of a signal's integral over time."""
    if unit == "1":
        return "s"
    bare = unit.removesuffix("/s")
    return bare if unit.endswith("/s") and (bare.isalpha() or bare == "1") else f"({unit})*s"
