"""An animation as one self-contained HTML page: a canvas, a slider, and the motion as numbers."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.app.animation.craft import MARGIN, Craft
from hovercontrol.app.animation.frames import extent
from hovercontrol.app.animation.motion import Motion

TEMPLATE = Path(__file__).with_name("player.html")

#: Digits behind the point of metres, radians and the like in the page.
DIGITS = 4

#: Height of the page in a notebook [px].
HEIGHT = 560


def page(motion: Motion, craft: Craft, step: float, speed: float, *, trail: bool) -> str:
    """Return the page.

    Parameters
    ----------
    motion : Motion
        At equal steps.
    craft : Craft
        With forces at those times.
    step : float
        Time step [s].
    speed : float
        Initial speed of the player.
    trail : bool
        Whether the past path is drawn.
    """
    x, y = extent(motion)
    edge = MARGIN * craft.length
    units = {"u": "m/s", "v": "m/s", "r": "rad/s"}
    target = [_row(motion.reference[k]) for k in "xy"] if motion.reference else None
    data: dict[str, Any] = {
        "start": float(motion.time[0]),
        "step": step,
        "speed": speed,
        "x": _row(motion.x),
        "y": _row(motion.y),
        "psi": _row(motion.psi),
        "speeds": [[name, units[name], _row(row)] for name, row in motion.velocities.items()],
        "hull": craft.outline.tolist(),
        "length": craft.length,
        "arrows": [
            {"place": a.place.tolist(), "along": _row(a.force[0]), "across": _row(a.force[1])}
            for a in craft.arrows
        ],
        "box": _row([x.min() - edge, x.max() + edge, y.min() - edge, y.max() + edge]),
        "target": target,
        "line": None if motion.goal else target,
        "goal": motion.goal,
        "trail": trail,
        "point": [_row(motion.tracked[k]) for k in "xy"] if motion.tracked else None,
        "obstacles": motion.scenery.obstacles.tolist(),
        "waypoints": motion.scenery.waypoints.tolist(),
        "plans": [_row(plan.T) for plan in motion.scenery.plans],
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    numbers = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for key, value in (
        ("title", escape(motion.name)),
        ("note", escape(note(motion, craft))),
        ("data", numbers),
    ):
        text = text.replace("{{ " + key + " }}", value)
    return text


def note(motion: Motion, craft: Craft) -> str:
    """Return the note below the picture."""
    parts = [motion.name]
    if craft.arrows:
        parts.append("arrows: forces on the hull, each ends where it acts")
    if craft.enlarged > 1:
        parts.append(f"the craft is drawn {craft.enlarged:.2g} times its size")
    return "; ".join(parts)


def framed(text: str) -> str:
    """Return a page for embedding, for example in a notebook, with sandboxed scripts."""
    style = f"width:100%;height:{HEIGHT}px;border:0"
    return f'<iframe srcdoc="{escape(text)}" sandbox="allow-scripts" style="{style}"></iframe>'


def _row(values: ArrayLike) -> list[Any]:
    found: NDArray[np.float64] = np.round(np.asarray(values, dtype=float), DIGITS)
    return (found + 0.0).tolist()
