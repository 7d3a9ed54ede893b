"""Thrust and rudder of a demanded force vector, within the limits of both.

A propeller with a rudder at the stern pushes along T [cos theta, sin theta], with T in [lower, upper],
lower >= 0, and theta in [right, left]. To clip T = |f| and theta = atan2(f_y, f_x) each by itself has two
faults where the demand f points astern: the craft is pushed ahead with all of |f|, and where f_y passes
through zero the rudder jumps from one limit to the other. With velocity feedback f_y falls while the rudder
is positive, so that the jump is a relay that drives f_y back to zero: a sliding mode, in which a solver makes
no progress.

Here the side force, which turns the craft, is kept, and the force ahead is at least what the rudder needs:

    g_x = max(f_x, max(f_y, 0) / tan(left) + max(-f_y, 0) / tan(-right))
    theta = atan2(f_y, max(g_x, eps)),   T = min(upper, max(lower, sqrt(g_x^2 + f_y^2)))

Within the limits these are the demanded vector's own T and theta. Both are continuous in f: astern, the
thrust falls to zero with f_y. The upper limit of T keeps the direction. eps, 1 % of the largest thrust and at
least `lower`, is the thrust below which the rudder returns to the middle. A demand exactly astern, f_y = 0,
gets no thrust: the craft coasts.
"""

from __future__ import annotations

import math

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.actuator import clipped

#: eps, as a share of the largest thrust (of its nominal size where it has no bound).
SMALLEST = 0.01


def within_limits(
    fx: sp.Expr, fy: sp.Expr, thrust: Signal, rudder: Signal
) -> tuple[sp.Expr, sp.Expr, list[Signal]]:
    """Return thrust and rudder of a force vector within their bounds, and the bounds as parameters.

    Where the rudder does not have two bounds within 90 degrees, one on each side, thrust and rudder are
    clipped each by itself.

    Parameters
    ----------
    fx, fy : sympy.Expr
        Demanded force ahead and to the left, in the unit of the thrust.
    thrust, rudder : Signal
        With bounds.

    Returns
    -------
    bounds : list of Signal
        Parameters ``thrust_lower``, ``thrust_upper``, ``rudder_lower``, ``rudder_upper``, as far as finite.

    Examples
    --------
    >>> fx, fy = sp.symbols("fx fy", real=True)
    >>> T, theta = Signal("thrust", "N", lower=0.0, upper=4.0), Signal("rudder", "rad")
    >>> within_limits(fx, fy, T, theta)[0]
    Max(thrust_lower, Min(thrust_upper, sqrt(fx**2 + fy**2)))
    """
    of_thrust, of_rudder = _bounds(thrust), _bounds(rudder)
    t_low, t_high = (_symbol(b) for b in of_thrust)
    right, left = (_symbol(b) for b in of_rudder)
    parameters = [b for b in (*of_thrust, *of_rudder) if b is not None]
    if not -math.pi / 2 < rudder.lower < 0 < rudder.upper < math.pi / 2:
        free = sp.sqrt(fx**2 + fy**2), sp.atan2(fy, fx)
        return clipped(free[0], t_low, t_high), clipped(free[1], right, left), parameters
    assert left is not None and right is not None
    least = sp.Max(fy, 0) / sp.tan(left) + sp.Max(-fy, 0) / sp.tan(-right)
    ahead = sp.Max(fx, least)
    eps = SMALLEST * (sp.Float(thrust.nominal) if t_high is None else t_high)
    small = eps if t_low is None else sp.Max(eps, t_low)
    size = clipped(sp.sqrt(ahead**2 + fy**2), t_low, t_high)
    return size, clipped(sp.atan2(fy, sp.Max(ahead, small)), right, left), parameters


def _bounds(signal: Signal) -> tuple[Signal | None, Signal | None]:
    lower, upper = (
        None
        if math.isinf(value)
        else Signal(f"{signal.name}_{key}", signal.unit, f"{key} limit of {signal.name}", start=value)
        for key, value in (("lower", signal.lower), ("upper", signal.upper))
    )
    return lower, upper


def _symbol(bound: Signal | None) -> sp.Symbol | None:
    return None if bound is None else bound.symbol
