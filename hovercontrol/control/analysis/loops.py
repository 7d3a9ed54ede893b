"""The tracking loops that the analyses simulate: craft, controller, reference, and a watch on them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.analysis.byrnes_isidori import ERRORS
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION

#: What the watch shows of a loop.
WATCHED = ("tracking_error", "facing", "r")


def c17_ellipse() -> Block:
    """Return the reference of C17's simulation, ``[1.5 sin t, 2.5 cos t]``."""
    return ellipse(1.5, 2.5, rate=-1.0, phase=math.pi / 2)


def watch(memory: float = 3.0) -> Block:
    """Return the Block that looks at a tracking loop.

    Outputs: ``tracking_error`` [m], the distance of the control point from the reference, and ``facing``,
    a running mean (over `memory` seconds) of the cosine of the angle between the heading and where the craft
    goes: 1 is nose-first, -1 stern-first.
    """
    u, v = (s.symbol for s in MOTION[3:5])
    error = [Signal(f"error_{axis}", "m", "tracking error of the control point") for axis in "xy"]
    facing = Signal("facing", "1", "mean cosine of the sideslip angle")
    slow = Signal("slow", "m/s", "speed below which a craft goes nowhere", start=1e-3, lower=0.0)
    window = Signal("memory", "s", "time constant of the mean", start=memory, lower=0.0)
    along = u / sp.sqrt(u**2 + v**2 + slow.symbol**2)
    distance = sp.sqrt(error[0].symbol ** 2 + error[1].symbol ** 2)
    return Block(
        "watch",
        states=(facing,),
        inputs=(*error, *MOTION[3:5]),
        outputs=(Signal("tracking_error", "m", "distance from the reference"), facing),
        parameters=(slow, window),
        derivatives={"facing": (along - facing.symbol) / window.symbol},
        output_expressions={"tracking_error": distance},
    )


def tracking_loop(
    model: Model,
    reference: Block | None = None,
    *,
    estimator: Mapping[str, Any] | None = None,
    adapt: Sequence[str] = (),
    more: Sequence[Block] = (),
    outputs: Sequence[str] = WATCHED,
    **controller: Any,
) -> Block:
    """Return a craft under the tracking controller, with what the analyses look at.

    Parameters
    ----------
    model : Model
        Craft and belief of the controller; their numbers are parameters apart (``plant.NAME``,
        ``controller.NAME``).
    reference : Block, optional
        Default C17's ellipse.
    estimator : mapping, optional
        Arguments of :func:`~hovercontrol.control.observers.kalman_bucy`; default none in the loop.
    adapt : sequence of str, optional
        The coefficients that are estimated.
    more : sequence of Block, optional
        Others to wire in.
    outputs : sequence of str, optional
        Default ``tracking_error``, ``facing`` and ``r``.
    **controller
        Arguments of :func:`~hovercontrol.control.controllers.tracking_controller`.

    Returns
    -------
    Block

    Raises
    ------
    InputError
        As those do.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> [s.name for s in tracking_loop(c17_simulation()).outputs]
    ['tracking_error', 'facing', 'r']
    """
    blocks = [model.plant(), tracking_controller(model, adapt=adapt, **controller)]
    blocks += [reference or c17_ellipse(), watch(), *more]
    if estimator is not None:
        blocks.append(kalman_bucy(model.plant(), list(adapt), **estimator))
    return interconnect(blocks, "loop", outputs=list(outputs))


def on_reference(reference: Block, control_point: float, heading: float = 0.0) -> dict[str, float]:
    """Return the initial state of a plant whose control point moves with the reference, by ``plant.NAME``.

    Parameters
    ----------
    reference : Block
    control_point : float
        [m]
    heading : float, optional
        Angle from the course to the heading [rad]; default nose-first.

    Raises
    ------
    InputError
        If the reference stands still at t = 0.
    """
    x, y, vx, vy, ax, ay = (float(value) for value in reference.to_numpy().outputs(0.0, ()))
    speed = math.hypot(vx, vy)
    if speed == 0:
        raise InputError(f"reference {reference.name!r} stands still at t = 0: it has no course")
    psi = math.atan2(vy, vx) + heading
    r = (vx * ay - vy * ax) / speed**2
    forward, side = np.array([[math.cos(psi), math.sin(psi)], [-math.sin(psi), math.cos(psi)]]) @ (vx, vy)
    return {
        "plant.x": x - control_point * math.cos(psi),
        "plant.y": y - control_point * math.sin(psi),
        "plant.psi": psi,
        "plant.u": float(forward),
        "plant.v": float(side - control_point * r),
        "plant.r": r,
        "watch.facing": math.cos(heading),
    }


def initial_errors(loop: Block, start: Mapping[str, float]) -> np.ndarray:
    """Return z1 [m] and z2 [m/s] of a tracking loop at t = 0, shape (2, 2): rows z1, z2, columns x, y.

    Parameters
    ----------
    loop : Block
        As :func:`tracking_loop` makes it.
    start : mapping
        Initial state by name, over the loop's own.
    """
    values = {s.symbol: start.get(s.name, s.start) for s in loop.states}
    values |= {s.symbol: s.start for s in loop.parameters} | {time: 0.0}
    errors = [loop.expand(sp.Symbol(f"controller.{name}", real=True)).xreplace(values) for name in ERRORS]
    return np.array([float(e) for e in errors]).reshape(2, 2)
