"""What changes during a run."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.effects.base import TINY, Effect, Shape
from hovercontrol.effects.drag import Drag


class ParameterJump(Effect):
    """All drag coefficients jump to a multiple at one time (another floor, less air in the skirt)."""

    name, source = "parameter_jump", "C17 section VIII-B: drag 25 % above the prior run with less air"
    factor = Shape("1", lower=TINY, neutral=1.0, search=(1.1,))
    seconds = Shape("s", search=tuple(k / 16 for k in range(1, 16)), of="time")

    def factors(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        jump = sp.Piecewise((sp.S.One, s.time < c.seconds), (c.factor, True))
        return {name: jump for name, cls in Effect.known.items() if issubclass(cls, Drag)}
