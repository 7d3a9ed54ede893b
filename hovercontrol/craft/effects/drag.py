"""Drag in surge, sway and yaw: dry (Coulomb, Stribeck), linear, quadratic, cubic [C17 eq 9, 10].

Each law is a class; the effects are made of the laws and of the axes at the end of the file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from hovercontrol.blocks.sgn import sgn
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape

FOSSEN = "Fossen, Handbook of Marine Craft, 2nd ed., 6.4"
ARMSTRONG = "Armstrong-Helouvry et al., Automatica 30 (1994)"
ABKOWITZ = "Abkowitz, HyA Report Hy-5 (1964)"


@dataclass(frozen=True)
class Axis:
    """A velocity that drag acts against: its names in effects, equations and sentences, and its unit.

    Dry friction is smoothed over ``width`` and fades at about ``slow``, both in the unit.
    """

    name: str
    state: str
    unit: str
    velocity: str
    width: float = 0.01
    slow: float = 0.2
    low: str = "low speed"
    drag: str = "Drag"
    force: str = " a force"


#: The velocities of a craft.
AXES = (
    Axis("surge", "u", "m/s", "the surge velocity"),
    Axis("sway", "v", "m/s", "the sway velocity"),
    Axis("yaw", "r", "rad/s", "the yaw rate", slow=0.5, drag="Drag torque", force=" a torque"),
)


def per_second(unit: str) -> str:
    """Return the unit of a signal's derivative."""
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"


class Drag(Effect):
    """Drag along one axis, against the velocity ``axis``; relative to the air if ``in_air``.

    A law names the ending of its effects' names, a sentence on them, and the sources of surge, sway, yaw, and
    of any machine's equation.
    """

    axis: ClassVar[str]
    in_air: ClassVar[bool] = False
    ending: ClassVar[str] = ""
    sentence: ClassVar[str] = ""
    sources: ClassVar[tuple[str, ...]] = ()
    rivals: ClassVar[tuple[str, ...]] = ()

    def velocity(self, s: Any) -> sp.Expr:
        """Return the velocity that the drag acts against."""
        return getattr(s, f"air_{self.axis}" if self.in_air and self.axis != "r" else self.axis)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.axis: -c.value * self.law(c, self.velocity(s))}

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        """Return the drag per coefficient at velocity `w`."""
        raise TypeError(f"{type(self).__name__} does not define its law")

    @classmethod
    def along(cls, axis: Axis) -> dict[str, Any]:
        """Return what an effect of this law declares for one axis: its axis, sentence and numbers."""
        sentence = cls.sentence.format_map(vars(axis))
        return {"axis": axis.state, "__doc__": sentence, **cls.declared(axis)}

    @staticmethod
    def declared(axis: Axis) -> dict[str, Coefficient]:
        """Return the numbers of the law along an axis; these are dry friction's."""
        width = Shape(axis.unit, lower=TINY, default=axis.width)
        return {"value": Coefficient(per_second(axis.unit), lower=0.0), "width": width}


class _Coulomb(Drag):
    ending, sentence = "coulomb", "Dry friction against {name},{force} of constant size."
    sources = "C17 (9), c1 = d_u0/m", "C17 (9), c3 = d_v0/m", "C17 (10), c5 = d_r0/J", "Coulomb"

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return sgn(w, c.width)


class _Linear(Drag):
    ending, sentence = "linear_drag", "{drag} in proportion to {velocity}."
    sources = "C17 (9), c2 = d_u/m", "C17 (9), c4 = d_v/m", "C17 (10), c6 = d_r/J", "viscous friction"
    in_air = True

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return w

    @staticmethod
    def declared(axis: Axis) -> dict[str, Coefficient]:
        return {"value": Coefficient("1/s", lower=0.0)}


class _Quadratic(Drag):
    ending, sentence = "quadratic_drag", "{drag} in proportion to the square of {velocity}."
    sources = FOSSEN, FOSSEN, FOSSEN, "drag of a blunt body at high Reynolds number"

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return sp.Abs(w) * w

    @staticmethod
    def declared(axis: Axis) -> dict[str, Coefficient]:
        bare = axis.unit.removesuffix("/s")
        per = f"1/{bare}" if axis.unit.endswith("/s") and bare.isalpha() else f"1/(({axis.unit})*s)"
        return {"value": Coefficient("1/s" if axis.unit == "1" else per, lower=0.0)}


class _Cubic(Drag):
    ending, sentence = "cubic_drag", "{drag} in proportion to the third power of {velocity}."
    sources = f"{ABKOWITZ}: X_uuu", f"{ABKOWITZ}: Y_vvv", f"{ABKOWITZ}: N_rrr"
    rivals = "quadratic_drag", "stribeck"

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return w**3

    @staticmethod
    def declared(axis: Axis) -> dict[str, Coefficient]:
        bare = axis.unit.removesuffix("/s")
        per = f"s/{bare}^2" if axis.unit.endswith("/s") and bare.isalpha() else f"1/(({axis.unit})^2*s)"
        return {"value": Coefficient("1/s" if axis.unit == "1" else per, lower=0.0)}


class _Stribeck(Drag):
    ending = "stribeck"
    sentence = "Dry friction against {name} that is larger at {low} and fades at about ``speed``."
    sources = (ARMSTRONG,) * 4
    contains = (_Coulomb,)

    def law(self, c: Any, w: sp.Expr) -> sp.Expr:
        return sgn(w, c.width) * sp.exp(-((w / c.speed) ** 2))

    @staticmethod
    def declared(axis: Axis) -> dict[str, Coefficient]:
        search = (0.05, 0.12, 0.3, 0.8)
        speed = Shape(axis.unit, lower=TINY, default=axis.slow, search=search, of="speed")
        dry = Drag.declared(axis)
        return {"value": dry["value"], "speed": speed, "width": dry["width"]}


class AirDrag(Effect):
    """Quadratic drag of the air against the velocity as a whole: -c V (u, v), V the speed through the air."""

    name, source = "air_drag", "Fossen, Handbook of Marine Craft, 2nd ed., 8.1: equal areas, one coefficient"
    mistaken_for = ("surge_quadratic_drag", "sway_quadratic_drag", "added_mass_coriolis")
    value = Coefficient("1/m", lower=0.0)
    width = Shape("m/s", lower=TINY, default=0.01, fixed=True)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        speed = sp.sqrt(s.air_u**2 + s.air_v**2 + c.width**2)  # smooth at rest
        return {"u": -c.value * speed * s.air_u, "v": -c.value * speed * s.air_v}


#: The laws by the ending of their effects' names, as in ``surge_coulomb``.
LAWS: dict[str, type[Drag]] = {law.ending: law for law in (_Coulomb, _Linear, _Quadratic, _Stribeck, _Cubic)}

for _law in LAWS.values():
    for _axis, _source in zip(AXES, _law.sources, strict=False):
        _name = f"{_axis.name}_{_law.ending}"
        _title = _name.title().replace("_", "")
        _rivals = tuple(f"{_axis.name}_{rival}" for rival in _law.rivals)
        _space = {"name": _name, "source": _source, "mistaken_for": _rivals, "__module__": __name__}
        globals()[_title] = type(_title, (_law,), _space | _law.along(_axis))  # a name for pickle
