"""The linear system of a Block about a point, which can be given in several forms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.backends.friction_slopes import Point, Slope, linear_matrices, warn_of_smoothing
from hovercontrol.blocks.backends.hybrid_linear import common_period, hybrid_matrices, without_ticks
from hovercontrol.blocks.backends.linear import point_values, state_space
from hovercontrol.blocks.backends.trim import Trim
from hovercontrol.blocks.block import Block

if TYPE_CHECKING:
    import control


def linearize(
    block: Block,
    at: Any = None,
    u: ArrayLike | Mapping[str, float] | None = None,
    params: Mapping[str, float] | None = None,
    t: float | None = None,
    *,
    friction: Slope = "smooth",
    amplitude: Mapping[str, float] | None = None,
) -> control.StateSpace:
    """Return a Block's linear system; arguments and errors as for :meth:`hovercontrol.Block.linearize`.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation").plant()
    >>> ahead = linearize(craft, craft.trim({"u": 1.0}), friction="none")
    >>> round(float(ahead.A[5, 5]), 3)
    -0.48
    """
    point = operating_point(block, {} if at is None else at, u, params, t)
    if friction == "smooth" and amplitude is None and not block.ticks:
        return block.to_control().linearize(point.x, point.u, t=point.t, params=point.params)
    if block.delays:
        block.to_control()  # raises an error that says how to treat delayed inputs
    labels = {kind: [s.name for s in getattr(block, kind)] for kind in ("inputs", "outputs", "states")}
    matrices, period = matrices_at(block, point, friction, amplitude)
    return state_space(matrices, period, name=f"{block.name}$linearized", **labels)


def matrices_at(
    block: Block,
    point: Point,
    friction: Slope = "smooth",
    amplitude: Mapping[str, float] | None = None,
    *,
    warn: bool = True,
) -> tuple[list[Array], float]:
    """Return A, B, C, D and the period [s] of a Block's linear system; 0 if it is continuous.

    Parameters
    ----------
    friction, amplitude
        As for :meth:`hovercontrol.Block.linearize`.
    warn : bool, optional
        Whether to warn about a pole that is due to smoothed dry friction.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> craft = vehicle("c17_simulation").plant()
    >>> (A, *_), period = matrices_at(craft, operating_point(craft, {"u": 1.0}), "none")
    >>> A.shape, period
    ((6, 6), 0.0)
    """
    if warn and friction == "smooth":
        plain = without_ticks(block)
        warn_of_smoothing(plain, linear_matrices(plain, point)[0], point)
    if block.ticks:
        return hybrid_matrices(block, point, friction, amplitude), common_period(block)
    return linear_matrices(block, point, friction, amplitude), block.period


def operating_point(
    block: Block,
    at: Any,
    u: ArrayLike | Mapping[str, float] | None = None,
    params: Mapping[str, float] | None = None,
    t: float | None = None,
) -> Point:
    """Return the point that a user gives; arguments as for :meth:`hovercontrol.Block.linearize`.

    Raises
    ------
    InputError
        If a name or the number of values is wrong, a value is not finite, or a Trim has other signals.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> operating_point(vehicle("c17_simulation").plant(), {"u": 1.0, "thrust": 1.8}).u
    array([1.8, 0. ])
    """
    import control

    values, inputs = dict(params or {}), u
    if isinstance(at, Trim):
        for kind in ("states", "inputs"):
            if {s.name for s in getattr(block, kind)} != set(getattr(at, kind)):
                raise InputError(block.where(f"the trim is of {at.block.name!r}, which has other {kind}"))
        t, values = at.time if t is None else t, {**at.params, **values}
        inputs = _by_name(block, "input", at.inputs) if u is None else u
        at = _by_name(block, "state", at.states)
    elif isinstance(at, control.OperatingPoint):
        at, inputs = at.states, at.inputs if u is None else u
    elif isinstance(at, Mapping):
        names = {s.name for s in block.inputs}
        known = [*(s.name for s in block.states), *names]
        for name in at:
            check_known(block.full_state(name), known, block.where(f"no state or input {name!r}"))
        given = {name: value for name, value in at.items() if name in names}
        at = _by_name(block, "state", {name: value for name, value in at.items() if name not in names})
        inputs = _by_name(block, "input", given) if u is None else u
    if isinstance(inputs, Mapping):
        inputs = _by_name(block, "input", inputs)
    return Point(
        0.0 if t is None else t,
        point_values(at, len(block.states), "state", block.name),
        point_values(inputs, len(block.inputs), "input", block.name),
        values,
    )


def _by_name(block: Block, kind: str, values: Mapping[str, float]) -> list[float]:
    signals = getattr(block, f"{kind}s")
    names = [s.name for s in signals]
    if kind == "state":
        values = {block.full_state(name): value for name, value in values.items()}
    for name in values:
        check_known(name, names, block.where(f"no {kind} {name!r}"))
    return np.array([values.get(s.name, s.start) for s in signals], dtype=float).tolist()
