"""The input signals of inertial navigation: IMU and aids, under the names that all filters share."""

from __future__ import annotations

import sympy as sp

from hovercontrol.blocks.signals import Signal

#: Period of K06's IMU [s].
IMU_PERIOD = 6.5536e-3

ACCELERATION_X = Signal("acceleration_x", "m/s^2", "specific force along the bow, measured")
ACCELERATION_Y = Signal("acceleration_y", "m/s^2", "specific force to the side, measured")
YAW_RATE = Signal("yaw_rate", "rad/s", "yaw rate, measured")
IMU = (ACCELERATION_X, ACCELERATION_Y, YAW_RATE)

HEADING_AID = Signal("heading_aid", "rad", "heading measured by an aid; whole turns do not matter")
FIX_X = Signal("fix_x", "m", "x measured by an aid")
FIX_Y = Signal("fix_y", "m", "y measured by an aid")


def valid(aid: str) -> Signal:
    """Return the signal that is 1 at a tick at which an aid has a new measurement."""
    return Signal(f"{aid}_valid", "1", "1 at a tick with a new measurement, else 0", lower=0.0, upper=1.0)


def to_navigation(psi: sp.Expr, vector: sp.Matrix) -> sp.Matrix:
    """Return a vector in body axes resolved in navigation axes, K06's B(psi) [K06 eq 3.6]."""
    return sp.Matrix([[sp.cos(psi), -sp.sin(psi)], [sp.sin(psi), sp.cos(psi)]]) * vector
