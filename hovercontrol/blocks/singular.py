"""Points at which a Block's equations have no derivative: a slip angle atan2(v, u) at rest, sqrt(0), 1/0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.functions import numpy_functions

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block, Columns, Rows
    from hovercontrol.blocks.signals import Signal


def finite_jacobian(
    block: Block,
    t: Any,
    x: Array,
    u: Array,
    params: Mapping[str, float] | None = None,
    rows: Rows = "derivatives",
    columns: Columns = "states",
) -> Array:
    """Return the exact Jacobian; arguments and shapes as for :meth:`.NumpyFunctions.jacobian`.

    At a kink, ``abs(v)`` or ``Max(v, 0)`` at v = 0, it has the mean of the slopes of both sides.

    Raises
    ------
    InputError
        If a value of the equations or of the Jacobian is infinite or not a number; the line has the equation
        and the point.

    Examples
    --------
    >>> from hovercontrol import Block, Signal
    >>> import sympy as sp
    >>> h, q, k = Signal("h", "m"), Signal("q", "m/s"), Signal("k", "m^(1/2)/s", start=1.0)
    >>> tank = Block("tank", [h], [q], [h], [k], {"h": q.symbol - k.symbol * sp.sqrt(h.symbol)})
    >>> finite_jacobian(tank, 0.0, np.array([4.0]), np.array([1.0]))
    array([[-0.25]])
    >>> finite_jacobian(tank, 0.0, np.array([0.0]), np.array([1.0]))
    Traceback (most recent call last):
        ...
    hovercontrol.base.errors.InputError: block 'tank': h' has no finite derivative by h at h = 0 m, q = 1 m/s
    """
    f = numpy_functions(block)
    with np.errstate(all="ignore"):
        J = f.jacobian(t, x, u, params, rows, columns)
        values = (f.derivatives if rows == "derivatives" else f.outputs)(t, x, u, params)
    fine = np.isfinite(J).all(axis=1) & np.isfinite(values)
    if fine.all():
        return J
    row, *first = (int(k[0]) for k in np.nonzero(~fine))
    at: Any = (slice(None), *first)
    wrong = np.flatnonzero(~np.isfinite(J[row][at]))
    x, u = (np.broadcast_to(z, (len(z), *fine.shape[1:]))[at] for z in (x, u))
    point = dict(zip((*block.states, *block.inputs), [*x, *u], strict=True))
    point |= dict(zip(block.parameters, block.parameter_values(params, bounded=False), strict=True))
    raise InputError(block.where(_line(block, rows, columns, row, wrong.tolist(), point)))


def _line(
    block: Block, rows: Rows, columns: Columns, row: int, wrong: list[int], point: Mapping[Signal, float]
) -> str:
    name = [s.name for s in (block.states if rows == "derivatives" else block.outputs)][row]
    expressions = block.derivatives if rows == "derivatives" else block.output_expressions
    used = block.expand(expressions[name]).free_symbols
    shown = {s: v for s, v in point.items() if s.symbol in used}
    moving = {s: v for s, v in shown.items() if s not in block.parameters}
    where = ", ".join(f"{s.name} = {v:.6g} {s.unit}".removesuffix(" 1") for s, v in (moving or shown).items())
    what = block.update_text(name) if rows == "derivatives" else f"output {name}"
    if not wrong:
        return f"{what} has no finite value at {where}"
    by = ", ".join(getattr(block, columns)[k].name for k in wrong)
    return f"{what} has no finite derivative by {by} at {where}"
