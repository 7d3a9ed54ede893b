"""External effects: a sloping floor, wind, a constant force."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import Coefficient


def _to_body(s: Any, x: sp.Expr, y: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return a vector of the earth frame in the body frame."""
    return sp.cos(s.psi) * x + sp.sin(s.psi) * y, -sp.sin(s.psi) * x + sp.cos(s.psi) * y


class BodySurgeForce(Effect):
    """A constant force along the hull, forward (air that leaks at the stern)."""

    name, source = "body_surge_force", "Newton; c = force/m"
    value = Coefficient("m/s^2")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"u": c.value}


class BodySideForce(Effect):
    """A constant force across the hull, to the left (a skirt that leaks on the right)."""

    name, source = "body_side_force", "Newton; c = force/m"
    value = Coefficient("m/s^2")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"v": c.value}


class Slope(Effect):
    """A floor that slopes: a constant acceleration in the earth frame."""

    name, source = "slope", "Newton; g times the slope"
    x = Coefficient("m/s^2", default=0.0)
    y = Coefficient("m/s^2", default=0.0)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        surge, sway = _to_body(s, c.x, c.y)
        return {"u": surge, "v": sway}


class Wind(Effect):
    """Wind: the linear drags act against the velocity relative to the air."""

    name, source = "wind", "Fossen, Handbook of Marine Craft, 2nd ed., 8.1"
    x = Coefficient("m/s", default=0.0)
    y = Coefficient("m/s", default=0.0)

    def motion(self, c: Any, s: Any) -> None:
        surge, sway = _to_body(s, c.x, c.y)
        s.air_u, s.air_v = s.air_u - surge, s.air_v - sway
