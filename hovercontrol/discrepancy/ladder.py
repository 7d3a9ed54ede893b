"""Lengths of windows: short ones find the way, long ones weigh the evidence."""

from __future__ import annotations

from hovercontrol.discrepancy.windowed import Data, Subject, structure

#: Windows [s], one after the other: short ones find the way, long ones weigh the evidence.
LADDER = (0.25, 1.0, 3.0)

#: A window may be longer than from one correction of a navigation to the next by this factor.
ROOM = 1.1


def ladder(data: Data) -> tuple[float, ...]:
    """Return the lengths of windows [s] that the logs hold."""
    longest = max(m.time[b - 1] - m.time[a] for m in data.logs for a, b in m.segments)
    most = ROOM * longest if data.navigated else longest / 2  # from one correction to the next
    return tuple(length for length in LADDER if length <= most) or LADDER[:1]


def rungs(model: Subject, data: Data) -> tuple[float, ...]:
    """Return the lengths of windows to search in: where no velocity is measured short ones say nothing."""
    every = ladder(data)
    if data.navigated:  # the longer, the less is its error a ramp
        return every[:1]
    block = structure(model)
    slopes = {str(block.expand(e)) for e in block.derivatives.values()}
    moving = [s.name for s in block.states if s.name in slopes or s.name in ("u", "v", "r")]
    return every if not moving or set(moving) & set(data.channels) else every[1:] or every
