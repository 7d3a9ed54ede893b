"""Which craft's rudder follows its yaw rate along C17's ellipse: control points, sides, yaw drag."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.analysis.loops import on_reference
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse
from hovercontrol.craft.models.vehicles import c17_experiment

#: Of the experiment's reference [s].
LAP = 2 * math.pi / 0.7

#: Control points that are tried [m]: those below the centre of percussion, 0.205 m, go stern-first.
CONTROL_POINTS = (-0.1, 0.0, 0.05, 0.1, 0.22, 0.25, 0.3, 0.4, 0.6, 1.0)

#: Factors on the yaw drag c6 that are tried with the last three of them.
FACTORS = (2.0, 4.0, 8.0)


@dataclass(frozen=True)
class Variant:
    """What one ideal loop does on its last two laps.

    Attributes
    ----------
    control_point : float
        [m]
    start : str
    factor : float
        On the yaw drag c6.
    sideslip : float
        Median [deg].
    least, largest : float
        Of the yaw rate [rad/s].
    with_rate, with_derivative : float
        Correlations of the rudder with minus the yaw rate and minus its derivative.
    """

    control_point: float
    start: str
    factor: float
    sideslip: float
    least: float
    largest: float
    with_rate: float
    with_derivative: float

    TITLES: ClassVar = (
        "control point [m]",
        "start",
        "factor on c6",
        "median sideslip [deg]",
        "least r [rad/s]",
        "largest r [rad/s]",
        "correlation of rudder with -r",
        "with -r'",
    )

    def cells(self) -> tuple[float | str, ...]:
        """Return the values in the order of the titles, rounded."""
        return tuple(v if isinstance(v, str) else round(v, 3) for v in astuple(self))


def pattern(time: Array, rate: Array, rudder: Array) -> tuple[float, float]:
    """Return the correlations of a rudder angle with minus the yaw rate and minus its derivative.

    Of the angle its sine counts: a craft that goes stern-first asks for angles about 180 deg.
    """
    others = (-rate, -np.gradient(rate, time))
    with_rate, with_derivative = (float(np.corrcoef(np.sin(rudder), other)[0, 1]) for other in others)
    return with_rate, with_derivative


@lru_cache(maxsize=1)
def variants() -> list[Variant]:
    """Return what yaw rate and rudder do on the last two of nine laps of ideal loops.

    Nose-first and stern-first starts of each control point with C17's drag, then more yaw drag. A loop that
    spins away is left out.
    """
    craft, reference = c17_experiment(), ellipse(1.15, 2.0, 0.7)
    controller = tracking_controller(craft, control_point=0.3, k1=1.75, k2=1.5)
    loop = interconnect([craft.plant(), reference, controller], "loop").compile(friction="smooth")
    own = craft.coefficients()["yaw_linear_drag"]
    tried = [(dx, side, 1.0) for dx in CONTROL_POINTS for side in ("nose-first", "stern-first")]
    tried += [(dx, "nose-first", factor) for dx in CONTROL_POINTS[-3:] for factor in FACTORS]
    time = np.arange(0.0, 9 * LAP, 0.02)
    rows = []
    for dx, side, factor in tried:
        start = on_reference(reference, dx, 0.0 if side == "nose-first" else math.pi)
        params = {f"{owner}.yaw_linear_drag": factor * own for owner in ("plant", "controller")}
        x0 = {name: value for name, value in start.items() if name.startswith("plant.")}
        try:
            run = loop.simulate(time, x0=x0, params=params | {"controller.control_point": dx})
        except InputError:
            continue
        o = dict(zip(run.output_labels, np.asarray(run.outputs), strict=True))
        late = time >= 7 * LAP
        slip = float(np.degrees(np.median(np.arctan2(o["v"], o["u"])[late])))
        rate = o["r"][late]
        seen = pattern(time[late], rate, o["rudder"][late])
        rows.append(Variant(dx, side, factor, slip, float(rate.min()), float(rate.max()), *seen))
    return rows
