"""The monitor in the cockpit: the first names of disturbances that are switched on, three pilots each."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping

from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.watch import Watch, watch_block
from hovercontrol.craft.models.vehicles import vehicle

#: Time of the switch [s], and values other than those of the page.
Switches = Mapping[str, tuple[float, dict[str, float] | None]]

CASES: dict[str, Switches] = {
    "dry yaw friction": {"yaw_coulomb": (20.0, None)},
    "air drag, wind 15 s later": {"air_drag": (20.0, None), "wind": (35.0, None)},
    "air drag and wind": {"air_drag": (20.0, None), "wind": (20.0, None)},
    "yaw friction, 0.8 1/s": {"yaw_linear_drag": (20.0, {"coefficient": 0.8})},
    "yaw friction": {"yaw_linear_drag": (20.0, None)},
}
PILOTS, SECONDS, STEP = (3, 5, 8), 60.0, 0.01


def flown(loop: Loop, watch: Watch, switches: Switches, pilot: int) -> str:
    """Return the first two alarms of a flight under random sticks."""
    loop.command(law="manual", disturbances=dict.fromkeys(loop.disturbances))
    loop.reset()
    watch.restart()
    sticks = random.Random(pilot)
    for k in range(round(SECONDS / STEP)):
        if k % 100 == 0:
            slow = sticks.uniform(-0.3, 1.0) - 0.6 * loop.signals()["u"]
            loop.command(stick=(max(-1.0, min(1.0, slow)), sticks.uniform(-0.6, 0.6)))
        for key, (at, values) in switches.items():
            if k == round(at / STEP):
                known = {s.signal.name: s.signal.start for s in loop.disturbances[key].knobs}
                loop.command(disturbances={key: values or known})
        watch.row(loop.signals())
        loop.advance(loop.time + STEP)
    told = [f"{a['name']} {a['change']:.2f} at {a['time']:.1f} s" for a in watch.state()["alarms"]]
    more = f", {len(told) - 2} more" if len(told) > 2 else ""
    return ", ".join(told[:2]) + more


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    loop = Loop(vehicle("hoverdemon"))
    watch = Watch(watch_block(loop.model))
    for label, switches in CASES.items():
        for pilot in PILOTS:
            yield f"{label}, pilot {pilot}", flown(loop, watch, switches, pilot), "", None
