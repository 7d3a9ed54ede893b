"""Changes during a run."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape
from hovercontrol.craft.effects.coupling import AddedMassCoriolis
from hovercontrol.craft.effects.drag import Drag
from hovercontrol.craft.effects.environment import Slope


class ParameterJump(Effect):
    """All drag coefficients jump to a multiple at one time (another floor, less air in the skirt)."""

    name, source = "parameter_jump", "C17 section VIII-B: drag 25 % above the prior run with less air"
    factor = Shape("1", lower=TINY, neutral=1.0, search=(1.1,))
    seconds = Shape("s", search=tuple(k / 16 for k in range(1, 16)), of="time")

    def factors(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        jump = sp.Piecewise((sp.S.One, s.time < c.seconds), (c.factor, True))
        return {name: jump for name, cls in Effect.known.items() if issubclass(cls, Drag)}


class MassDrift(Effect):
    """Mass and moment of inertia that grow alike with time: m (1 + c t), t from the start of each log."""

    name, source = "mass_drift", "Newton and Euler; c = rate of mass/m (a load that is taken in, fuel burnt)"
    mistaken_for = ("battery_sag", "parameter_jump")
    value = Coefficient("1/s")

    def factors(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        free = (Slope, AddedMassCoriolis)  # of how much mass there is
        forces = (cls for cls in Effect.known.values() if cls.kind() == "force")
        return {cls.name: 1 / (1 + c.value * s.time) for cls in forces if not issubclass(cls, free)}
