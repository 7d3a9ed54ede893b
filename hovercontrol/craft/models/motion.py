"""A craft's motion and commands: their signals, units and symbols, and the forces of its fans.

Body frame: surge u forward, sway v to the left, yaw rate r counter-clockwise; earth frame x, y, heading psi.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import sympy as sp

from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.models.fans import Fan

#: The six states of every plant [C17 eq 8] [K06 eq 2.2, 2.5].
MOTION = (
    Signal("x", "m", "position, earth frame"),
    Signal("y", "m", "position, earth frame"),
    Signal("psi", "rad", "heading"),
    Signal("u", "m/s", "surge velocity"),
    Signal("v", "m/s", "sway velocity"),
    Signal("r", "rad/s", "yaw rate"),
)

#: The commands of a craft with one propeller and a rudder (T and theta in C17).
THRUST = Signal("thrust", "1", "thrust command")
RUDDER = Signal("rudder", "rad", "rudder angle", nominal=0.5)


def craft_units(thrust: str, rudder: str, fans: bool) -> dict[str, str]:
    """Return the unit of each signal of a craft that a law may use.

    Examples
    --------
    >>> craft_units("N", "rad", fans=False)["r"], craft_units("N", "rad", fans=True)["fan_torque"]
    ('rad/s', 'N*m')
    """
    commands = (
        {"fan_x": "N", "fan_y": "N", "fan_torque": "N*m"} if fans else {"thrust": thrust, "rudder": rudder}
    )
    return {s.name: s.unit for s in MOTION} | commands | {"time": "s"}


def motion_symbols(fans: Iterable[Fan] = (), owner: str = "plant") -> SimpleNamespace:
    """Return the symbols of the effects' equations: motion, commands, and the fans' wrench."""
    symbols: dict[str, Any] = {signal.name: signal.symbol for signal in (*MOTION, THRUST, RUDDER)}
    s = SimpleNamespace(**symbols, time=time)
    s.air_u, s.air_v = s.u, s.v
    s.inputs = {c.name: c.symbol for c in (THRUST, RUDDER, *(f.command() for f in fans))}
    add_forces(s, fans, owner, {f.name: f.force(owner) for f in fans})
    return s


def add_forces(s: SimpleNamespace, fans: Iterable[Fan], owner: str, forces: Mapping[str, sp.Expr]) -> None:
    """Set the force vector of the rudder craft's commands, and the wrench of the fans' forces."""
    s.thrusts = dict(forces) or {THRUST.name: s.thrust}
    s.thrust_x = s.thrust * sp.cos(s.rudder)
    s.thrust_y = s.thrust * sp.sin(s.rudder)
    s.fan_x = s.fan_y = s.fan_torque = s.fan_cross_torque = sp.S.Zero
    for fan in fans:
        force = forces[fan.name]
        s.fan_x += _exact(math.cos(fan.direction)) * force
        s.fan_y += _exact(math.sin(fan.direction)) * force
        s.fan_torque += fan.lever_arm(owner).symbol * force
        s.fan_cross_torque += fan.cross_arm(owner).symbol * force


def _exact(value: float) -> sp.Number:
    """Return 0 or +-1 for a fan along an axis: with six digits, the cosine is 1 to twelve."""
    near = round(value)
    return sp.Integer(near) if abs(value - near) < (1e-12 if near else 1e-6) else sp.Float(value)
