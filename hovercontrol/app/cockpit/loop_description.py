"""Constant data of the page: the craft, the laws and the disturbances, with units and bounds."""

from __future__ import annotations

import math
from typing import Any

from hovercontrol.app.cockpit.laws import full_stick
from hovercontrol.app.cockpit.orders import Flown
from hovercontrol.app.cockpit.real_loop import flies_real
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY


def loop_description(loop: Flown) -> dict[str, Any]:
    """Return the constant data of a loop: craft, laws, disturbances, with units and bounds."""
    return {
        "craft": loop.model.name,
        "loop": loop.kind,
        "real": flies_real(loop.model),
        "arm": _drawn_arm(loop),
        "fans": [{"name": f.name, "x": f.x, "y": f.y, "direction": f.direction} for f in loop.model.fans],
        "inputs": [{**_shown_signal(s), "full": full_stick(s)} for s in loop.inputs],
        "laws": {
            key: {
                "title": c.title,
                "stick": c.stick,
                "references": [_shown_signal(s) for s in c.references],
            }
            for key, c in loop.choices.items()
        },
        "disturbances": {
            key: {"title": d.title, "knobs": [_shown_signal(k.signal) for k in d.knobs]}
            for key, d in loop.disturbances.items()
        },
        "energy": len(loop.choices) > 1,
    }


def _drawn_arm(loop: Flown) -> float:
    """Return the drawn distance from the centre of mass to the stern [m]."""
    if loop.model.fans:
        return 1.6 * max(abs(f.x) for f in loop.model.fans)
    return HOVERDEMON_BODY.arm if len(loop.choices) > 1 else 0.14  # C17's craft


def _shown_signal(s: Signal) -> dict[str, Any]:
    finite = {key: v for key, v in (("lower", s.lower), ("upper", s.upper)) if math.isfinite(v)}
    return {"name": s.name, "unit": s.unit, "text": s.description, "start": s.start, **finite}
