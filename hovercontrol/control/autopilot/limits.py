"""Limits of the force of fan and rudder: saturation of the commands, and tables with rudder losses."""

from __future__ import annotations

import numpy as np
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators import (
    FanTable,
    ServoTable,
    fan_force,
    fan_tables,
    force_angle_of_rudder,
    servo_table,
)
from hovercontrol.craft.hardware.actuators.signals import DEGREE, FORCE_ANGLE_COMMAND, THRUST_COMMAND

#: The force and its angle requested by a law, before saturation.
WANTED = tuple(
    s.replace(name=s.name.replace("_command", "_wanted")) for s in (THRUST_COMMAND, FORCE_ANGLE_COMMAND)
)
#: 1 if the request is outside the table of fan or servo.
OUTSIDE = tuple(Signal(f"{key}_outside", "1", "1 outside the table") for key in ("thrust", "rudder"))


def fan_ends(tables: tuple[FanTable, FanTable]) -> tuple[float, float]:
    """Return the smallest and the largest force [N] of a fan with the rudder straight, from its tables.

    Examples
    --------
    >>> [round(end, 2) for end in fan_ends(fan_tables())]
    [-0.9, 1.94]
    """
    lookup, reverse = tables
    least, most = (float(np.interp(0.0, reverse.rudder, reverse.values[:, k])) for k in (0, -1))
    return max(float(lookup.columns[0]), least), min(float(lookup.columns[-1]), most)


def actuator_limits(
    ends: tuple[float, float] | None = None,
    *,
    servo: ServoTable | None = None,
    name: str = "saturation",
) -> Block:
    """Return a Block that clips thrust and force angle to the calibrated range, with the rudder straight.

    K06: "Commands that exceed the predefined actuator limits are clipped to their maximum values" (6.1.1).
    The limits are the ends of the tables. The tables also clip by themselves; this Block is for loops
    without tables.

    Parameters
    ----------
    ends : tuple of 2 float, optional
        Smallest and largest force [N]. Default: those of K06's fan, by :func:`fan_ends`.
    servo : ServoTable, optional
        Default: K06's stand-in.

    Returns
    -------
    Block
        Inputs ``thrust_wanted`` [N] and ``force_angle_wanted`` [rad]; outputs ``thrust_command`` and
        ``force_angle_command``. With the parameter ``on`` at 0 it passes its inputs unchanged.

    Examples
    --------
    >>> actuator_limits().to_numpy().outputs(0.0, (), [9.0, 1.5]).round(2).tolist()
    [1.94, 0.47]
    """
    least, most = ends or fan_ends(fan_tables())
    angles = (servo_table() if servo is None else servo).angle * DEGREE
    sides = sorted(float(force_angle_of_rudder(a)) for a in (angles[0], angles[-1]))
    on = Signal("on", "1", "ends of fan and rudder", start=1.0, modes=("off", "on"))
    ahead = Signal("ahead", "N", "largest force ahead", start=most)
    astern = Signal("astern", "N", "largest force astern", start=-least)
    right = Signal("angle_lowest", "rad", "smallest angle of the force", start=sides[0])
    left = Signal("angle_highest", "rad", "largest angle of the force", start=sides[1])
    F, a = (s.symbol for s in WANTED)
    kept = {
        THRUST_COMMAND.name: (sp.Max(-astern.symbol, sp.Min(ahead.symbol, F)), F),
        FORCE_ANGLE_COMMAND.name: (sp.Max(right.symbol, sp.Min(left.symbol, a)), a),
    }
    return Block(
        name,
        inputs=WANTED,
        outputs=(THRUST_COMMAND, FORCE_ANGLE_COMMAND),
        parameters=(on, ahead, astern, right, left),
        output_expressions={
            key: sp.Piecewise((limited, on.symbol > 0), (whole, True))
            for key, (limited, whole) in kept.items()
        },
    )


def clip_counters(period: float, *, name: str = "clipping") -> Block:
    """Return a Block that counts the ticks at which a law requests more than fan or rudder can do.

    Parameters
    ----------
    period : float
        Time from tick to tick [s].

    Returns
    -------
    Block
        Inputs: the requests, the outputs of :func:`actuator_limits`, and ``thrust_outside`` and
        ``rudder_outside``, which are 1 outside a table. Outputs: ``thrust_clipped`` and ``rudder_clipped``,
        the number of ticks so far at which the limits clipped a request or a table was left (the fan's table
        has ends in force and in rudder angle).
    """
    commands = (THRUST_COMMAND, FORCE_ANGLE_COMMAND)
    counts, last, definitions = [], [], {}
    for key, want, command, outside in zip(("thrust", "rudder"), WANTED, commands, OUTSIDE, strict=True):
        text = "number of ticks with a clipped command"
        counts.append(Signal(f"{key}_clipped", "1", text, lower=0.0))
        last.append(counts[-1].replace(name=f"last_{key}_clipped"))
        cut = sp.Or(want.symbol < command.symbol, want.symbol > command.symbol, outside.symbol > 0)
        definitions[counts[-1].name] = last[-1].symbol + sp.Piecewise((1, cut), (0, True))
    return Block(
        name,
        states=tuple(last),
        inputs=(*WANTED, *commands, *OUTSIDE),
        outputs=tuple(counts),
        definitions=definitions,
        definition_signals=tuple(counts),
        derivatives={old.name: new.symbol for old, new in zip(last, counts, strict=True)},
        period=period,
    )


def lossy_tables(loss: float) -> tuple[FanTable, FanTable]:
    """Return K06's stand-in tables with a thrust loss that grows with the rudder angle.

    The thrust is multiplied by ``1 - loss (rudder / 35 deg)^2``.

    Parameters
    ----------
    loss : float
        Share of the thrust lost at 35 degrees.

    Raises
    ------
    InputError
        If the loss is not at least 0 and less than 1.

    Examples
    --------
    >>> lossy_tables(0.0)[0].shape
    (14, 161)
    """
    if not 0 <= loss < 1:
        raise InputError(f"autopilot: rudder_loss must be at least 0 and less than 1, found {loss!r}")

    def force(speed: np.ndarray, rudder: float) -> np.ndarray:
        return fan_force(speed, rudder) * (1 - loss * (rudder / 35.0) ** 2)

    return fan_tables(force if loss else fan_force)
