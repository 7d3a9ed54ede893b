"""Coupling between axes: added mass, and flow across the hull."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import Coefficient, Shape


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


class SwayMass(Effect):
    """Another mass in sway than in surge, m22/m11 = 1 + c: (1 + c) v r in surge, forces over 1 + c in sway.

    Kirchhoff's equations without the yaw moment (:class:`MunkMoment`), all forces X, Y per surge mass m11:

        u' = (m22/m11) v r + X,    v' = (m11/m22) (-u r + Y).

    A search considers it only where it is named: a load that swings on a craft is another mass, too.
    """

    by_name = True

    name, source = (
        "sway_mass",
        "Fossen, Handbook of Marine Craft, 2nd ed., 6.3: m22 = m - Y_v', m11 = m - X_u'",
    )
    value = Shape("1", lower=-0.9, upper=10.0, neutral=0.0, search=(0.05,))

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"u": c.value * s.v * s.r, "v": s.u * s.r * c.value / (1 + c.value)}

    def inertia(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"v": 1 / (1 + c.value)}


class CrossFlowDrag(Effect):
    """Drag of a hull or skirt across its motion: -k abs(v) v in sway and -c abs(v) r in yaw.

    First order in r of the drag of strips at x along the hull, -abs(v + x r) (v + x r). A search considers it
    only where it is named: its parts are sway_quadratic_drag and the law abs(v) r in r'.
    """

    by_name = True
    name, source = (
        "cross_flow_drag",
        "Fossen, Handbook of Marine Craft, 2nd ed., 6.4: cross-flow drag, strips",
    )
    sway = Coefficient("1/m", lower=0.0)
    yaw = Coefficient("1/m", lower=0.0)

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {"v": -c.sway * sp.Abs(s.v) * s.v, "r": -c.yaw * sp.Abs(s.v) * s.r}

    def becomes(self, other: Effect) -> bool:
        return other.name == "sway_quadratic_drag"
