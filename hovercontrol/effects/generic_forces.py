"""Generic effects in an equation: an offset, drag, dry friction, a spring."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.core.sgn import sgn
from hovercontrol.effects.base import TINY, Coefficient, Effect, Shape
from hovercontrol.effects.drag import Drag, _Coulomb, _Linear, _Quadratic, _Stribeck
from hovercontrol.effects.friction import SOURCE, LuGre
from hovercontrol.effects.generic_classes import make_class, remembered, word


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
        value=Coefficient(_per_second(unit)),
        axis=state,
        terms=terms,
    )


@remembered
def linear_drag(state: str, unit: str) -> type[Effect]:
    """Return the class of a drag in proportion to a state."""
    return make_class(
        f"{word(state)}_linear_drag",
        (_Linear,),
        f"Drag in proportion to {state}.",
        "viscous friction",
        value=Coefficient("1/s", lower=0.0),
        axis=state,
        in_air=False,
    )


@remembered
def quadratic_drag(state: str, unit: str) -> type[Effect]:
    """Return the class of a drag in proportion to the square of a state."""
    return make_class(
        f"{word(state)}_quadratic_drag",
        (_Quadratic,),
        f"Drag in proportion to the square of {state}.",
        "drag of a blunt body at high Reynolds number",
        value=Coefficient(_inverse(unit), lower=0.0),
        axis=state,
    )


@remembered
def coulomb(state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a dry friction of constant size against a state of typical size `size`."""
    return make_class(
        f"{word(state)}_coulomb",
        (_Coulomb,),
        f"Dry friction against {state}, of constant size.",
        "Coulomb",
        value=Coefficient(_per_second(unit), lower=0.0),
        width=Shape(unit, lower=TINY, default=0.01 * size),
        axis=state,
    )


@remembered
def stribeck(state: str, unit: str, size: float) -> type[Effect]:
    """Return the class of a dry friction that fades as a state of typical size `size` grows."""
    return make_class(
        f"{word(state)}_stribeck",
        (_Stribeck,),
        f"Dry friction against {state} that is larger at small {state} and fades at about ``speed``.",
        "Armstrong-Helouvry et al., Automatica 30 (1994)",
        value=Coefficient(_per_second(unit), lower=0.0),
        speed=Shape(unit, lower=TINY, default=0.2 * size, search=(0.05, 0.12, 0.3, 0.8), of="speed"),
        width=Shape(unit, lower=TINY, default=0.01 * size),
        axis=state,
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
    force = _per_second(unit)
    return make_class(
        f"{word(state)}_lugre",
        (LuGre,),
        f"LuGre friction against {state}: bristles that bend before it slides, stick-slip.",
        SOURCE,
        stiffness=Shape("1/s^2", lower=0.0, search=(100.0, 1000.0)),
        damping=Shape("1/s", lower=0.0, default=10.0),
        coulomb=Shape(force, lower=TINY, search=(0.1 * size, 0.4 * size)),
        static=Shape(force, lower=TINY, search=(0.5 * size,)),
        speed=Shape(unit, lower=TINY, default=0.05 * size),
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


def _per_second(unit: str) -> str:
    """Return the unit of a signal's derivative."""
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"


def _inverse(unit: str) -> str:
    """Return the unit of a quadratic drag's coefficient: per second and per signal."""
    bare = unit.removesuffix("/s")
    if unit == "1":
        return "1/s"
    return f"1/{bare}" if unit.endswith("/s") and bare.isalpha() else f"1/(({unit})*s)"


def _integral(unit: str) -> str:
    """Return the unit of a signal's integral over time."""
    if unit == "1":
        return "s"
    bare = unit.removesuffix("/s")
    return bare if unit.endswith("/s") and (bare.isalpha() or bare == "1") else f"({unit})*s"
