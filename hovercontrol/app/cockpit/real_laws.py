"""All laws of the pilot as one Block with a switch, which ticks on the ground station."""

from __future__ import annotations

import sympy as sp

from hovercontrol.app.cockpit.laws import CHOICES, FULL_RUDDER, FULL_THRUST, STICK, force_parts
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, prefix, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot import nearest_heading
from hovercontrol.control.controllers.k06.heading import TICK
from hovercontrol.control.observers.ins.calibration import restartable
from hovercontrol.craft.hardware.actuators.signals import FORCE_X, FORCE_Y
from hovercontrol.craft.models.motion import MOTION

#: Which law flies, K06's "Desired Law" (K06 figure 5.2); ``manual`` are K06's user commands.
LAW = Signal("law", "1", "active law", modes=tuple(CHOICES))

_CHANGED = Signal("law_changed", "1", "1 at the tick of a change of law")
_FORCES = (FORCE_X, FORCE_Y)


def switched_laws(name: str = "laws") -> Block:
    """Return all laws of the pilot, computed in parallel, and the switch between them.

    Guidance restarts when its law is chosen.

    Returns
    -------
    Block
        Sampled. Inputs ``law``, the stick and the motion; outputs ``force_x, force_y`` [N] of the law chosen,
        and the further outputs of each law with its key as prefix (``forward_surge_ref``). The references are
        parameters (``forward.reference.surge_ref``).

    Examples
    --------
    >>> laws = switched_laws()
    >>> laws.period, [s.name for s in laws.inputs][:3]
    (0.001, ['law', 'stick_ahead', 'stick_right'])
    """
    parts = [_change(), *map(_one, CHOICES), _switch()]
    hidden = {f"{key}_{s.name}" for key in CHOICES for s in _FORCES} | {_CHANGED.name}
    outputs = [s.name for part in parts for s in part.outputs if s.name not in hidden]
    return interconnect(parts, name, outputs=outputs)


def reference_key(law: str, reference: str) -> str:
    """Return the key of a law's reference among the parameters of :func:`switched_laws`.

    Examples
    --------
    >>> reference_key("turn", "yaw_rate_ref") in switched_laws().default_parameters
    True
    """
    return f"{law}.reference.{reference}"


def _one(key: str) -> Block:
    """Return a law with its key as prefix of its names; the measured motion keeps its names."""
    parts = [_stick_force()] if key == "manual" else [nearest_heading(block) for block in force_parts(key)]
    block = interconnect(parts, key)
    starts = CHOICES[key].references
    block = block.with_values({f"reference.{s.name}": s.start for s in starts})
    if block.states:
        block = restartable(block, _CHANGED)
    kept = (*STICK, *MOTION, _CHANGED)
    there = {s.name for s in block.inputs}
    return rename(prefix(block, key), {f"{key}_{s.name}": s.name for s in kept if s.name in there})


def _stick_force() -> Block:
    """Return the stick as a force: magnitude, and angle at the rudder."""
    ahead, right = (s.symbol for s in STICK)
    full = (
        Signal("thrust", "N", "at full stick", start=FULL_THRUST),
        Signal("rudder", "rad", "at full stick", start=FULL_RUDDER),
    )
    size, angle = full[0].symbol * ahead, full[1].symbol * right
    return Block(
        "stick",
        inputs=STICK,
        outputs=_FORCES,
        parameters=full,
        output_expressions={FORCE_X.name: size * sp.cos(angle), FORCE_Y.name: size * sp.sin(angle)},
    )


def _change() -> Block:
    last = Signal("last_law", "1", "law of the last tick; 0 before the first", start=-1.0)
    return Block(
        "change",
        states=(last,),
        inputs=(LAW,),
        outputs=(_CHANGED,),
        derivatives={last.name: LAW.symbol},
        output_expressions={_CHANGED.name: sp.Piecewise((0, sp.Eq(LAW.symbol, last.symbol)), (1, True))},
        period=TICK,
    )


def _switch() -> Block:
    asked = {key: [f.replace(name=f"{key}_{f.name}") for f in _FORCES] for key in CHOICES}
    told = {
        f.name: sp.Piecewise(
            *((asked[key][k].symbol, sp.Eq(LAW.symbol, LAW.mode(key))) for key in CHOICES), (0, True)
        )
        for k, f in enumerate(_FORCES)
    }
    return Block(
        "switch",
        inputs=(LAW, *(s for pair in asked.values() for s in pair)),
        outputs=_FORCES,
        output_expressions=told,
    )
