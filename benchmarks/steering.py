"""Steering under way: mean surge velocity and yaw rate over the stick (0.3..1.1 m/s, -0.5..0.5 rad/s)."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

import hovercontrol as hc
from hovercontrol.analysis import steering_map, turning_modes
from hovercontrol.autopilot import autopilot
from hovercontrol.core.block import Block
from hovercontrol.guidance import command_filter, steering_law, steering_reference, weaving

POINTS = 5


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for what, loop in loops().items():
        begin = time.perf_counter()
        found = steering_map(loop, points=POINTS)
        worst = [np.abs(found[name]).max() for name in ("surge_error", "yaw_rate_error")]
        share = found["within"].mean()
        text = f"{worst[0]:.1%}, {worst[1]:.1%}; {share:.0%} of {POINTS**2}"
        yield f"{what}: worst errors, within both", text, "5 %, 10 %; 100 %", bool(share == 1.0)
        yield f"  {POINTS**2} runs", f"{time.perf_counter() - begin:.0f} s", "", None
    craft = hc.vehicle("c17_simulation")
    for point in (0.03, 0.09, 0.13, 0.2, 0.4):
        slowest = max(
            turning_modes(craft, surge, rate, control_point=point).real.max()
            for surge in (0.3, 0.7, 1.1)
            for rate in (-0.5, -0.25, 0.25, 0.5)
        )
        yield f"C17's law, control point {point:g} m: slowest mode of a turn", f"{slowest:+.2f} 1/s", "", None


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
