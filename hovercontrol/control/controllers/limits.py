"""Commands kept within the bounds of the plant's inputs."""

from __future__ import annotations

import math

import sympy as sp

from hovercontrol.blocks.signals import Signal, suffixed


def limited(command: Signal, demand: sp.Expr, limits: bool = True) -> tuple[sp.Expr, list[Signal]]:
    """Return a demand within the command's finite bounds, and these bounds as parameters.

    Parameters
    ----------
    command : Signal
        A plant's input.
    demand : sympy.Expr
        In the command's unit.
    limits : bool, optional
        False returns the demand itself.

    Examples
    --------
    >>> rudder = Signal("rudder", "rad", lower=-0.45, upper=0.45)
    >>> expression, bounds = limited(rudder, sp.Symbol("demand", real=True))
    >>> expression, [b.name for b in bounds]
    (Max(rudder_lower, Min(demand, rudder_upper)), ['rudder_lower', 'rudder_upper'])
    """
    bounds: list[Signal] = []
    for key, clip in (("upper", sp.Min), ("lower", sp.Max)):
        value = getattr(command, key)
        if limits and math.isfinite(value):
            bound = Signal(
                suffixed(command.name, key), command.unit, f"{key} limit of {command.name}", start=value
            )
            bounds.insert(0, bound)
            demand = clip(demand, bound.symbol)
    return demand, bounds


def applied_signal(command: Signal) -> Signal:
    """Return the input with which a controller reads the applied command.

    Examples
    --------
    >>> applied_signal(Signal("thrust", "N")).name
    'thrust_applied'
    """
    text = f"{command.name} that the actuator applies"
    return command.replace(
        name=suffixed(command.name, "applied"), description=text, lower=-math.inf, upper=math.inf
    )
