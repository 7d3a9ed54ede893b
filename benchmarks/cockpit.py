"""The cockpit: how many times faster than real time its two loops fly, as the page has them fly.

Times are processor time of one thread: rows of 10 ms, all signals told at each, under the turn law.
"""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.compiled import spent
from hovercontrol.app.cockpit.loops import LOOPS, loop_of
from hovercontrol.app.cockpit.pacer import ROW
from hovercontrol.craft.models.vehicles import vehicle

SECONDS = 20.0


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    for kind in LOOPS:
        loop = loop_of(kind, vehicle("hoverdemon"))
        loop.command(law="turn", references={"yaw_rate_ref": 3.0})

        def fly(loop=loop) -> None:
            end = loop.time + SECONDS
            while loop.time < end:
                loop.advance(round(loop.time + ROW, 9))
                loop.signals()

        times = SECONDS / spent(fly, 3)
        yield f"cockpit, {kind} loop", f"{times:.0f} times real time", ">= 10", times >= 10
