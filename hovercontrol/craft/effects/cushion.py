"""The air under the craft: it turns with the hull, late, and may swirl by itself."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape

#: Rate of the cushion's air.
SWIRL = Signal("cushion_rate", "rad/s", "rate at which the air of the cushion turns")


class CushionSwirl(Effect):
    """Air of the cushion that turns with the hull, late: torque -c (r - w), with w' = (r - w)/tau, from rest.

    Angular momentum of the air: J_a w' = k (r - w), so tau = J_a/k; the hull feels the reaction, c = k/J. A
    cushion that turns with the hull at once (tau to 0) only adds inertia, one at rest (tau large) only damps.
    """

    name, source = "cushion_swirl", "Euler: two bodies that turn, coupled by viscous shear"
    value = Coefficient("1/s", lower=0.0)
    seconds = Shape("s", lower=TINY, search=(0.2, 0.6, 2.0))

    def states(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        return {SWIRL: (s.r - SWIRL.symbol) / c.seconds}

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": -c.value * (s.r - SWIRL.symbol)}

    def becomes(self, other: Effect) -> bool:
        return other.name == "yaw_linear_drag"


class BodyYawTorque(Effect):
    """A constant torque on the hull, to the left (the lift fan's air swirls in the cushion)."""

    name, source = "body_yaw_torque", "Euler; c = torque/J"
    mistaken_for = ("thrust_yaw_torque", "rudder_offset", "fan_misalignment")
    value = Coefficient("rad/s^2")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": c.value}
