"""Coupling between axes: added mass of air, and pressure on the hull."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.effects.base import Effect
from hovercontrol.effects.coefficient import Coefficient


class SwayYawCoupling(Effect):
    """Yaw torque in proportion to the sway velocity (centre of pressure off the centre of mass)."""

    name, source = "sway_yaw_coupling", "Fossen, Handbook of Marine Craft, 2nd ed., 6.4: N_v"
    value = Coefficient("1/(m*s)")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": c.value * s.v}


class MunkMoment(Effect):
    """Munk's destabilising moment of a body in oblique flow: c u v in yaw."""

    name, source = "munk_moment", "Munk, NACA Report 184 (1924); Fossen, 6.3: (Y_v' - X_u')/J"
    value = Coefficient("1/m^2")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"r": c.value * s.u * s.v}


class AddedMassCoriolis(Effect):
    """Air carried along sideways: v r in surge becomes (1 + c) v r."""

    name, source = "added_mass_coriolis", "Fossen, Handbook of Marine Craft, 2nd ed., 6.3"
    value = Coefficient("1")

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"u": c.value * s.v * s.r}
