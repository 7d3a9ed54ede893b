"""Steering under way: mean surge velocity and yaw rate over the stick (0.3..1.1 m/s, -0.5..0.5 rad/s).

The ratio of K06's weaving was chosen on such a grid: its errors there are fitted. The commands midway between
the grid's points had no part in that choice.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import hovercontrol as hc
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis import steering_map, turning_modes
from hovercontrol.control.autopilot import autopilot
from hovercontrol.control.guidance import command_filter, steering_law, steering_reference, weaving

POINTS = 5


#: Ends of the commands midway between the points of the grid [m/s, rad/s].
MIDWAY = {"surge": (0.4, 1.0), "yaw_rate": (-0.375, 0.375), "points": POINTS - 1}


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for what, loop in loops().items():
        weaves = "weaving" in what
        yield from errors(f"{what}{', fitted' if weaves else ''}", loop, points=POINTS)
        if weaves:
            yield from errors(f"{what}, commands midway between", loop, **MIDWAY)
    craft = hc.vehicle("c17_simulation")
    for point in (0.03, 0.09, 0.13, 0.2, 0.4):
        slowest = max(
            turning_modes(craft, surge, rate, control_point=point).real.max()
            for surge in (0.3, 0.7, 1.1)
            for rate in (-0.5, -0.25, 0.25, 0.5)
        )
        yield f"C17's law, control point {point:g} m: slowest mode of a turn", f"{slowest:+.2f} 1/s", "", None


def errors(what: str, loop: Block, **grid: Any) -> Iterator[tuple[str, str, str, bool | None]]:
    begin = time.perf_counter()
    found = steering_map(loop, **grid)
    worst = [np.abs(found[name]).max() for name in ("surge_error", "yaw_rate_error")]
    share, n = found["within"].mean(), found["within"].size
    text = f"{worst[0]:.1%}, {worst[1]:.1%}; {share:.0%} of {n}"
    yield f"{what}: worst errors, within both", text, "5 %, 10 %; 100 %", bool(share == 1.0)
    yield f"  {n} runs", f"{time.perf_counter() - begin:.0f} s", "", None


def loops() -> dict[str, Block]:
    """Return the loops that are flown, by what they are called."""
    c17, k06 = hc.vehicle("c17_simulation"), hc.vehicle("hoverdemon")
    found = {
        "C17's craft, steering law": hc.interconnect([c17.plant(), command_filter(), steering_law(c17)]),
        "C17's craft, C17's law behind a virtual craft": hc.interconnect(
            [c17.plant(), command_filter(), steering_reference(c17), hc.tracking_controller(c17)]
        ),
        "K06's ideal craft, weaving": hc.interconnect([k06.plant(), weaving(), steering_law(k06)]),
    }
    for navigation in ("error_model", "magnetometer"):
        found[f"K06's real loop, {navigation}, weaving"] = autopilot(
            steering_law(k06, forces=True, yaw_gain=1.5),
            guidance=weaving(period=0.001),
            references={"surge_ref": 0.5, "yaw_rate_ref": 0.3},
            navigation=navigation,
        )
    return found
