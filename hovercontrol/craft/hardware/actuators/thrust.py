"""The fan's lookup tables: speed of a force, and force of a speed.

K06's LUT and RLUT (6.1.1) [K06 fig 6.5].
"""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.lookup import bilinear
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.k06 import (
    RUDDER_OFFSET,
    RUDDER_SLOPE,
    fan_tables,
    force_angle_of_rudder,
)
from hovercontrol.craft.hardware.actuators.rudder import clipped, counted, regression_signals
from hovercontrol.craft.hardware.actuators.signals import (
    DEGREE,
    FAN_SPEED,
    FAN_SPEED_COMMAND,
    RPM,
    RUDDER_ANGLE,
    RUDDER_ANGLE_COMMAND,
    THRUST_COMMAND,
    TICK,
)
from hovercontrol.craft.hardware.actuators.tables import FanTable
from hovercontrol.craft.models.motion import RUDDER, THRUST

_SPEED_UNIT = Signal("speed_unit", "rad/s", "one RPM of the table", start=RPM, nominal=RPM)
_FORCE_UNIT = Signal("force_unit", "N", "one newton of the table; larger for a stronger fan", start=1.0)


@checked
def thrust_lookup(
    *, table: FanTable | None = None, period: float = TICK, name: str = "thrust_lookup"
) -> Block:
    """Return the lookup of the fan's speed for a commanded force at a rudder angle.

    Between entries it interpolates bilinearly; outside the table it takes the border value, which is K06's
    saturation of the actuators ("clipped to their maximum values"), and counts these ticks.

    Parameters
    ----------
    table : FanTable, optional
        Over forces. Default: that of :func:`~hovercontrol.craft.hardware.actuators.k06.fan_tables`, a
        stand-in.
    period : float, optional
        [s]; 0 for a Block without states, to be joined with others.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``thrust_command`` [N], ``rudder_angle_command`` [rad]; outputs ``fan_speed_command`` [rad/s],
        and ``thrust_clipped``, the count of ticks (without period ``thrust_outside``, 1 where it is clipped).

    Raises
    ------
    InputError
        If the period is negative or the table not over forces.

    Examples
    --------
    >>> block = thrust_lookup(period=0.0)
    >>> speed, outside = block.to_numpy().outputs(0.0, (), [1.35, 0.0])
    >>> round(speed / RPM), float(outside)
    (10000, 0.0)
    """
    not_negative(f"{name}: period", period)
    known = _over("force", fan_tables()[0] if table is None else table, name)
    force, angle = THRUST_COMMAND.symbol, RUDDER_ANGLE_COMMAND.symbol
    row, column = _place(known, angle / DEGREE, force / _FORCE_UNIT.symbol)
    places = (Signal("table_row", "1", "counted from 0"), Signal("table_column", "1", "counted from 0"))
    i, j = (s.symbol for s in places)
    states: tuple[Signal, ...] = ()
    outputs: tuple[Signal, ...] = (FAN_SPEED_COMMAND,)
    definitions: dict[str, sp.Expr] = {"table_row": row, "table_column": column}
    margin = 1e-9  # a place at the border, rounded, is not outside
    sides = zip((i, j), known.shape, strict=True)
    outside = sp.Or(*(c for at, n in sides for c in (at < -margin, at > n - 1 + margin)))
    told = {FAN_SPEED_COMMAND.name: _SPEED_UNIT.symbol * bilinear("fan_speeds", known.values, i, j)}
    if period:
        last, count, defined = counted(outside, "thrust")
        states, outputs, definitions = (last,), (*outputs, count), definitions | defined
    else:
        flag, told["thrust_outside"] = clipped(outside, "thrust")
        outputs = (*outputs, flag)
    return Block(
        name,
        states=states,
        inputs=(THRUST_COMMAND, RUDDER_ANGLE_COMMAND),
        outputs=outputs,
        parameters=(_SPEED_UNIT, _FORCE_UNIT),
        definitions=definitions,
        definition_signals=(*places, *(outputs[1:] if period else ())),
        derivatives={s.name: outputs[1].symbol for s in states},
        output_expressions=told,
        period=period,
    )


@checked
def thrust_force(
    *,
    table: FanTable | None = None,
    slope: float = RUDDER_SLOPE,
    offset: float = RUDDER_OFFSET,
    name: str = "thrust_force",
) -> Block:
    """Return the force of fan and rudder, by the inverse table and the inverse of (4.3).

    Its outputs are the inputs of a rudder craft's plant. Outside the table it takes the border value.

    Parameters
    ----------
    table : FanTable, optional
        Over speeds. Default: the inverse one of
        :func:`~hovercontrol.craft.hardware.actuators.k06.fan_tables`, a stand-in.
    slope, offset : float, optional
        Of (4.3), as for :func:`~hovercontrol.craft.hardware.actuators.rudder_lookup`.
    name : str, optional

    Returns
    -------
    Block
        Without states. Inputs ``fan_speed`` [rad/s], ``rudder_angle`` [rad]; outputs ``thrust`` [N], negative
        astern, and ``rudder`` [rad], the angle of the force from the bow.

    Raises
    ------
    InputError
        If the table is not over speeds or the slope zero.

    Examples
    --------
    >>> block = thrust_force()
    >>> block.to_numpy().outputs(0.0, (), [10000 * RPM, 0.0]).round(4).tolist()  # rudder 0: 0.4 degrees
    [1.35, -0.0071]
    """
    known = _over("speed", fan_tables()[1] if table is None else table, name)
    parameters = (*regression_signals(slope, offset, name), _SPEED_UNIT, _FORCE_UNIT)
    K, b = (p.symbol for p in parameters[:2])
    speed, angle = FAN_SPEED.symbol, RUDDER_ANGLE.symbol
    row, column = _place(known, angle / DEGREE, speed / _SPEED_UNIT.symbol)
    places = (Signal("table_row", "1", "counted from 0"), Signal("table_column", "1", "counted from 0"))
    i, j = (s.symbol for s in places)
    return Block(
        name,
        inputs=(FAN_SPEED, RUDDER_ANGLE),
        outputs=(
            THRUST.replace(unit="N", description="force of the propeller"),
            RUDDER.replace(description="angle of the force from the bow"),
        ),
        parameters=parameters,
        definitions={"table_row": row, "table_column": column},
        definition_signals=places,
        output_expressions={
            "thrust": _FORCE_UNIT.symbol * bilinear("fan_forces", known.values, i, j),
            "rudder": force_angle_of_rudder(angle, K, b),
        },
    )


def _over(over: str, table: FanTable, name: str) -> FanTable:
    if table.over != over:
        raise InputError(f"{name}: expected a table over {over}s, found {table.name!r} over {table.over}s")
    return table


def _place(table: FanTable, rudder: sp.Expr, column: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the place in a table, in rows and columns from 0, of plain numbers in its units."""
    return tuple(
        (at - float(axis[0])) / step
        for at, axis, step in zip((rudder, column), (table.rudder, table.columns), table.step, strict=True)
    )
