"""Friction proportional to the thrust, and LuGre friction with elastic bristles."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import sympy as sp

from hovercontrol.core.signals import Signal
from hovercontrol.effects.base import TINY, Coefficient, Effect, Shape
from hovercontrol.effects.drag import _Coulomb, _Stribeck


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


class LugreSurge(LuGre):
    """LuGre friction in surge: bristles that bend before the craft slides, stick-slip."""

    name, axis, deflection, source = "lugre_surge", "u", "m", SOURCE
    stiffness = Shape("1/s^2", lower=0.0, search=(300.0,))
    damping = Shape("1/s", lower=0.0, default=10.0)
    coulomb = Shape("m/s^2", lower=TINY, search=(0.1, 0.4))
    static = Shape("m/s^2", lower=TINY, search=(0.15, 0.5))
    speed = Shape("m/s", lower=TINY, default=0.05)


class LugreSway(LuGre):
    """LuGre friction in sway: bristles that bend before the craft slides, stick-slip."""

    name, axis, deflection, source = "lugre_sway", "v", "m", SOURCE
    stiffness = Shape("1/s^2", lower=0.0, search=(300.0,))
    damping = Shape("1/s", lower=0.0, default=10.0)
    coulomb = Shape("m/s^2", lower=TINY, search=(0.1, 0.4))
    static = Shape("m/s^2", lower=TINY, search=(0.15, 0.5))
    speed = Shape("m/s", lower=TINY, default=0.05)


class LugreYaw(LuGre):
    """LuGre friction in yaw: bristles that bend before the craft turns, stick-slip."""

    name, axis, deflection, source = "lugre_yaw", "r", "rad", SOURCE
    stiffness = Shape("1/s^2", lower=0.0, search=(300.0,))
    damping = Shape("1/s", lower=0.0, default=10.0)
    coulomb = Shape("rad/s^2", lower=TINY, search=(0.2, 1.0))
    static = Shape("rad/s^2", lower=TINY, search=(0.3, 1.2))
    speed = Shape("rad/s", lower=TINY, default=0.1)
