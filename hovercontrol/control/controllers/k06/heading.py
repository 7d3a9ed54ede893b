"""K06's two hybrid controllers for a heading (section 2.3.3): they set the yaw rate of the turn law.

No smooth static feedback holds a heading (K06 proposition 2.3.4). Both controllers switch between two modes:
``stop`` (the wanted yaw rate is zero: with it the turn law is the stop law) and ``turn``, which is entered
when the heading error is large and the kinetic energy so low that the turn law reaches its wanted limit
point, (2.48).
"""

from __future__ import annotations

import math

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.energy import (
    body_signals,
    entry_energy,
    kinetic_energy,
    least_yaw_rate,
)
from hovercontrol.control.controllers.k06.laws import YAW_RATE_REF
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body

HEADING_REF = Signal("heading_ref", "rad", "heading reference, not wrapped")

#: K06's base tick [s].
TICK = 0.001

_SEEN = tuple(s for s in MOTION if s.name in ("psi", "u", "v", "r"))
_PSI, _U, _V, _R = (s.symbol for s in _SEEN)
_MODE = Signal("heading_mode", description="mode of the heading controller", modes=("stop", "turn"))
_LAST_MODE = _MODE.replace(name="last_heading_mode", description="mode at the last tick")
_LAST_RATE = YAW_RATE_REF.replace(name="last_yaw_rate", description="yaw rate reference of the last tick")
_ERROR = Signal("heading_error", "rad", "heading minus heading reference")
_TURNING = sp.Eq(_LAST_MODE.symbol, _LAST_MODE.mode("turn"))


@checked
def bang_bang_heading(
    *,
    yaw_rate: float = 1.5,
    tolerance: float = math.radians(1.0),
    period: float = TICK,
    body: Body = HOVERDEMON_BODY,
    name: str = "guidance",
) -> Block:
    """Return the controller that turns to a heading at one fixed yaw rate (K06 section 2.3.3, six steps).

    Parameters
    ----------
    yaw_rate : float, optional
        Its size [rad/s]; the sign is chosen when the turn begins and held.
    tolerance : float, optional
        phi [rad], the error from which on it turns.
    period : float, optional
        [s]
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``psi, u, v, r, heading_ref``; outputs ``yaw_rate_ref``, ``heading_mode`` (stop, turn)
        and ``heading_error``.

    Raises
    ------
    InputError
        If a number is not positive.

    Examples
    --------
    >>> block = bang_bang_heading()
    >>> block.period, block.signal("heading_mode").modes
    (0.001, ('stop', 'turn'))
    """
    positive("guidance: yaw_rate", yaw_rate)
    speed = Signal("yaw_rate", "rad/s", "magnitude of the yaw rate reference", start=yaw_rate)
    mass, inertia, arm = body_signals(body)
    limit = entry_energy(mass.symbol, inertia.symbol, arm.symbol, speed.symbol)
    wanted = -sp.sign(_ERROR.symbol) * speed.symbol
    held = sp.Piecewise((_LAST_RATE.symbol, _TURNING), (wanted, True))
    return _heading(name, period, tolerance, (speed, mass, inertia, arm), limit, held)


@checked
def proportional_heading(
    *,
    k: float = 1.0,
    margin: float = 1.02,
    tolerance: float = math.radians(1.0),
    period: float = TICK,
    body: Body = HOVERDEMON_BODY,
    name: str = "guidance",
) -> Block:
    """Return the controller that turns to a heading at a yaw rate in proportion to the error (K06 2.3.3).

    The turn is entered by (2.48) for the yaw rate wanted then; while it lasts, the yaw rate falls no further
    than (2.67) allows. For small errors the energy of a drifting craft is too high to enter the turn, so a
    steady error remains.

    Parameters
    ----------
    k : float, optional
        Yaw rate per error [1/s]. K06 writes ``Pi = -k error``; its figures agree with a gain on the rate.
    margin : float, optional
        How many times the bound of (2.67) the yaw rate stays above it, more than 1: at the bound itself the
        craft comes to rest at the turn law's unwanted limit point.
    tolerance, period, body, name
        As for :func:`bang_bang_heading`.

    Returns
    -------
    Block
        As for :func:`bang_bang_heading`.

    Raises
    ------
    InputError
        If a number is not positive, or the margin not more than 1.

    Examples
    --------
    >>> [s.name for s in proportional_heading(k=0.5).outputs]
    ['yaw_rate_ref', 'heading_mode', 'heading_error']
    """
    gain = Signal("k", "1/s", "yaw rate per heading error", start=positive("guidance: k", k))
    if not 1 < margin < math.inf:
        raise InputError(f"guidance: margin must be more than 1, found {margin!r}")
    over = Signal("margin", "1", "times the bound of (2.67)", start=margin, lower=1.0)
    mass, inertia, arm = body_signals(body)
    m, J, d = mass.symbol, inertia.symbol, arm.symbol
    wanted = -gain.symbol * _ERROR.symbol
    level = kinetic_energy(m, J, _U, _V, _R - _LAST_RATE.symbol)
    least = over.symbol * least_yaw_rate(m, J, d, level, _LAST_RATE.symbol)
    # [K06 eq 2.69]
    limited = -sp.sign(_ERROR.symbol) * sp.Max(least, sp.Abs(wanted))
    held = sp.Piecewise((limited, _TURNING), (wanted, True))
    parameters = (gain, over, mass, inertia, arm)
    return _heading(name, period, tolerance, parameters, entry_energy(m, J, d, wanted), held)


def _heading(
    name: str,
    period: float,
    tolerance: float,
    parameters: tuple[Signal, ...],
    limit: sp.Expr,
    wanted: sp.Expr,
) -> Block:
    """Return the state machine [K06 eq 2.54, 2.55].

    `limit` is the energy below which a turn may begin, `wanted` its yaw rate.
    """
    phi = Signal(
        "tolerance", "rad", "tolerance of the heading error", start=positive("guidance: tolerance", tolerance)
    )
    m, J = (p.symbol for p in parameters if p.name in ("mass", "inertia"))
    energy = Signal("energy", "J", "kinetic energy")
    calm = Signal("entry_energy", "J", "kinetic energy below which a turn may begin")
    rate = YAW_RATE_REF.replace(name="wanted_yaw_rate")
    may_turn = sp.Or(_TURNING, energy.symbol < calm.symbol)
    off = sp.Abs(_ERROR.symbol) > phi.symbol
    turns = sp.Eq(_MODE.symbol, _MODE.mode("turn"))
    return Block(
        name,
        states=(_LAST_MODE, _LAST_RATE),
        inputs=(*_SEEN, HEADING_REF),
        outputs=(YAW_RATE_REF, _MODE, _ERROR),
        parameters=(*parameters, phi),
        definitions={
            "heading_error": _PSI - HEADING_REF.symbol,
            "energy": kinetic_energy(m, J, _U, _V, _R),
            "entry_energy": limit,
            "heading_mode": sp.Piecewise(
                (_MODE.mode("turn"), sp.And(off, may_turn)), (_MODE.mode("stop"), True)
            ),
            "wanted_yaw_rate": sp.Piecewise((wanted, turns), (sp.S.Zero, True)),
        },
        definition_signals=(_ERROR, energy, calm, _MODE, rate),
        derivatives={"last_heading_mode": _MODE.symbol, "last_yaw_rate": rate.symbol},
        output_expressions={"yaw_rate_ref": rate.symbol},
        period=period,
    )
