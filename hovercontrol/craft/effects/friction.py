"""Friction proportional to the thrust, and LuGre friction with elastic bristles."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape
from hovercontrol.craft.effects.drag import AXES, _Coulomb, _Stribeck, per_second

Search = tuple[float, ...]


class LoadFriction(Effect):
    """Dry friction of the hull in proportion to the thrust that presses: -c abs(T) along the velocity.

    Adds -c abs(T) (u, v)/sqrt(u^2 + v^2 + width^2) to (u', v'): of size c abs(T) and against the planar
    velocity once that is larger than the width, so -c abs(T) sgn(u) where the craft moves straight ahead.
    """

    name, source, craft = "load_friction", "Coulomb; the normal force grows with the thrust", "rudder"
    value = Coefficient("m/s^2/{thrust}", lower=0.0)
    width = Shape("m/s", lower=TINY, default=0.01)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        pressed = c.value * sp.Abs(s.thrust) / sp.sqrt(s.u**2 + s.v**2 + c.width**2)
        return {"u": -pressed * s.u, "v": -pressed * s.v}


class LuGre(Effect):
    """LuGre friction along one axis, against the velocity ``axis``.

    Bristles of deflection z: z' = v - sigma0 abs(v) z/g(v), force sigma0 z + sigma1 z', level
    g(v) = Fc + (Fs - Fc) exp(-(v/vs)^2). Numbers: ``stiffness`` sigma0, ``damping`` sigma1, ``coulomb`` Fc,
    ``static`` Fs, ``speed`` vs.
    """

    axis: ClassVar[str]
    deflection: ClassVar[str]  # unit of z
    contains = (_Coulomb, _Stribeck)
    flexible = True

    @staticmethod
    def declared(
        unit: str, stiffness: Search, coulomb: Search, static: Search, speed: float
    ) -> dict[str, Shape]:
        """Return the numbers of the friction against a velocity of a unit, with values to search from."""
        force = per_second(unit)
        return {
            "stiffness": Shape("1/s^2", lower=0.0, search=stiffness),
            "damping": Shape("1/s", lower=0.0, default=10.0),
            "coulomb": Shape(force, lower=TINY, search=coulomb),
            "static": Shape(force, lower=TINY, search=static),
            "speed": Shape(unit, lower=TINY, default=speed),
        }

    def bristles(self) -> Signal:
        """Return the state z."""
        word = re.sub(r"\W+", "_", self.axis).strip("_")
        return Signal(f"lugre_{word}", self.deflection, f"bristles of friction against {self.axis}")

    def deflection_rate(self, c: Any, s: Any) -> sp.Expr:
        """Return z', with its rate limited to `s.fastest` if that is given.

        Sliding bristles settle within microseconds, and longer steps are unstable.
        """
        v, z = getattr(s, self.axis), self.bristles().symbol
        level = c.coulomb + (c.static - c.coulomb) * sp.exp(-((v / c.speed) ** 2))
        rate = c.stiffness * sp.Abs(v) / level
        fastest = getattr(s, "fastest", None)
        return (v - rate * z) / (sp.sqrt(sp.sqrt(1 + (rate / fastest) ** 4)) if fastest else 1)

    def states(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        return {self.bristles(): self.deflection_rate(c, s)}

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        z = self.bristles().symbol
        return {self.axis: -c.stiffness * z - c.damping * self.deflection_rate(c, s)}


SOURCE = "Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Automatic Control 40 (1995)"

#: Axis, what it does, where a search begins: Coulomb and static level [velocity/s]; the speed of fading.
_CRAFT = (
    (AXES[0], "slides", (0.1, 0.4), (0.15, 0.5), 0.05),
    (AXES[1], "slides", (0.1, 0.4), (0.15, 0.5), 0.05),
    (AXES[2], "turns", (0.2, 1.0), (0.3, 1.2), 0.1),
)

for _axis, _verb, _coulomb, _static, _speed in _CRAFT:
    _title = f"Lugre{_axis.name.title()}"
    _space = {
        "__doc__": f"LuGre friction in {_axis.name}: bristles that bend before the craft {_verb}, "
        "stick-slip.",
        "__module__": __name__,
        "name": f"lugre_{_axis.name}",
        "axis": _axis.state,
        "deflection": _axis.unit.removesuffix("/s"),
        "source": SOURCE,
        **LuGre.declared(_axis.unit, (300.0,), _coulomb, _static, _speed),
    }
    globals()[_title] = type(_title, (LuGre,), _space)  # a name for pickle
