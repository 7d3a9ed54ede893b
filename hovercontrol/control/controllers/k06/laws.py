"""K06's continuous laws on the body velocities (section 2.2): stop, forward, reverse, turn, and joins.

Each returns a force in the body frame: ``force_x`` along the bow, ``force_y`` to the left; the force acts at
the rudder, an arm d behind the centre of mass. K06 writes momenta; here velocities are used: P_X = m u,
P_Y = m v, Pi = J r.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.actuators.signals import FORCE_X, FORCE_Y
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body

SURGE_REF = Signal("surge_ref", "m/s", "surge velocity reference")
YAW_RATE_REF = Signal("yaw_rate_ref", "rad/s", "yaw rate reference")

_MOVING = tuple(s for s in MOTION if s.name in ("u", "v", "r"))
_U, _V, _R = (s.symbol for s in _MOVING)


@checked
def stop(*, k1: float, k2: float, body: Body = HOVERDEMON_BODY, name: str = "controller") -> Block:
    """Return the law that brings the craft to rest [K06 eq 2.16] [K06 proposition 2.2.2].

    ``F_X = -k1 u``, ``F_Y = -k2 (v - d r)``. The origin is globally asymptotically stable; the kinetic energy
    never grows.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    body : Body, optional
        Its arm d enters.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r``; outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> print(stop(k1=1.0, k2=2.5).equations())
    force_x = -k1*u
    force_y = -k2*(-arm*r + v)
    """
    gains = _gains(body, k1=k1, k2=k2)
    return _law(name, (), gains, *_force(gains))


@checked
def forward(*, k1: float, k2: float, body: Body = HOVERDEMON_BODY, name: str = "controller") -> Block:
    """Return the law for a constant forward velocity [K06 eq 2.24].

    ``F_X = -k1 (u - u_ref)``, ``F_Y = -k2 (v - d r)``. Globally asymptotically stable if
    ``k2 > m u_ref/d``, which is sufficient, not necessary.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r, surge_ref``; outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> print(forward(k1=1.0, k2=20.0).equations())
    force_x = -k1*(-surge_ref + u)
    force_y = -k2*(-arm*r + v)
    """
    gains = _gains(body, k1=k1, k2=k2)
    return _law(name, (SURGE_REF.replace(lower=0.0),), gains, *_force(gains, SURGE_REF.symbol))


@checked
def forward_alternate(*, k1: float, body: Body = HOVERDEMON_BODY, name: str = "controller") -> Block:
    """Return the second law for a constant forward velocity [K06 eq 2.29].

    As :func:`forward` with the gain ``k2 = m u_ref/(2 d)``, which follows from the velocity.

    Parameters
    ----------
    k1 : float
        Gain [kg/s], positive.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r, surge_ref``; outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If the gain is not positive.

    Examples
    --------
    >>> print(forward_alternate(k1=1.0).equations())
    force_x = -k1*(-surge_ref + u)
    force_y = -mass*surge_ref*(-arm*r + v)/(2*arm)
    """
    K1, d = _gains(body, k1=k1)
    mass = Signal("mass", "kg", "mass of the craft", start=body.mass, lower=0.0)
    ref = SURGE_REF.replace(lower=0.0)
    K2 = mass.symbol * ref.symbol / (2 * d.symbol)
    force_x, force_y = -K1.symbol * (_U - ref.symbol), -K2 * (_V - d.symbol * _R)
    return _law(name, (ref,), (K1, d, mass), force_x, force_y)


@checked
def reverse(
    *, k1: float, k2: float, alpha: float, body: Body = HOVERDEMON_BODY, name: str = "controller"
) -> Block:
    """Return the law for a constant velocity astern [K06 eq 2.30].

    ``F_X = -k1 (u - u_ref)``, ``F_Y = k2 (v + alpha d r)`` with ``u_ref < 0``. Locally stable if
    ``alpha > J/(d^2 m)``; K06 has no proof for more.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    alpha : float
        Weight of the yaw rate, positive.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r, surge_ref`` (not positive); outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> print(reverse(k1=1.5, k2=1.0, alpha=0.8).equations())
    force_x = -k1*(-surge_ref + u)
    force_y = k2*(alpha*arm*r + v)
    """
    K1, K2, d = gains = _gains(body, k1=k1, k2=k2)
    positive("controller: alpha", alpha)
    weight = Signal("alpha", "1", "weight of the yaw rate", start=alpha, lower=0.0)
    ref = SURGE_REF.replace(upper=0.0)
    side = K2.symbol * (_V + weight.symbol * d.symbol * _R)
    return _law(name, (ref,), (*gains, weight), -K1.symbol * (_U - ref.symbol), side)


@checked
def turn(*, k1: float, k2: float, body: Body = HOVERDEMON_BODY, name: str = "controller") -> Block:
    """Return the law for a constant yaw rate on the spot [K06 eq 2.39].

    ``F_X = -k1 u``, ``F_Y = -k2 (v - d (r - r_ref))``. The craft converges to ``(0, 0, r_ref)`` or to the
    unwanted ``(0, -d r_ref, 0)``; to the former if it starts with less energy than (2.48) says. With
    ``r_ref = 0`` this is :func:`stop`.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r, yaw_rate_ref``; outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> print(turn(k1=0.5, k2=3.5).equations())
    force_x = -k1*u
    force_y = -k2*(-arm*(r - yaw_rate_ref) + v)
    """
    gains = _gains(body, k1=k1, k2=k2)
    return _law(name, (YAW_RATE_REF,), gains, *_force(gains, yaw_rate_ref=YAW_RATE_REF.symbol))


@checked
def drive(*, k1: float, k2: float, body: Body = HOVERDEMON_BODY, name: str = "controller") -> Block:
    """Return :func:`stop`, :func:`forward` and :func:`turn` in one, for guidance that changes between them.

    ``F_X = -k1 (u - u_ref)``, ``F_Y = -k2 (v - d (r - r_ref))``: (2.16) where both references are zero,
    (2.24) and (2.39) where one is. K06 proves nothing for both at once. Astern it is unstable in yaw, so
    that a negative `surge_ref` is out of its bounds: :func:`both_ways` takes it.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r, surge_ref`` (not negative), ``yaw_rate_ref``; outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> print(drive(k1=1.0, k2=2.0).equations())
    force_x = -k1*(-surge_ref + u)
    force_y = -k2*(-arm*(r - yaw_rate_ref) + v)
    """
    gains = _gains(body, k1=k1, k2=k2)
    ahead = SURGE_REF.replace(lower=0.0)
    return _law(name, (ahead, YAW_RATE_REF), gains, *_force(gains, SURGE_REF.symbol, YAW_RATE_REF.symbol))


@checked
def both_ways(
    *,
    k1: float,
    k2: float,
    reverse_k1: float,
    reverse_k2: float,
    alpha: float,
    body: Body = HOVERDEMON_BODY,
    name: str = "controller",
) -> Block:
    """Return :func:`drive`, and :func:`reverse` while the wanted surge is negative.

    (2.30) is stable near its motion only: halt before a change from ahead to astern. While it acts
    `yaw_rate_ref` is ignored.

    Parameters
    ----------
    k1, k2 : float
        Gains of :func:`drive` [kg/s], positive.
    reverse_k1, reverse_k2, alpha : float
        Those of :func:`reverse`.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r, surge_ref, yaw_rate_ref``; outputs ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive.

    Examples
    --------
    >>> law = both_ways(k1=1.0, k2=4.0, reverse_k1=1.5, reverse_k2=1.0, alpha=1.44).to_numpy()
    >>> law.outputs(0.0, (), [0.0, 0.1, 0.0, 1.1, 0.0]).tolist()  # ahead: against the drift
    [1.1, -0.4]
    >>> law.outputs(0.0, (), [0.0, 0.1, 0.0, -0.76, 0.0]).round(2).tolist()  # astern: with it
    [-1.14, 0.1]
    """
    ahead = drive(k1=k1, k2=k2, body=body)
    astern = reverse(k1=reverse_k1, k2=reverse_k2, alpha=alpha, body=body)
    own = {
        s.name: s.replace(name=f"reverse_{s.name}", description=f"{s.description}, astern")
        for s in astern.parameters
        if s.name in ("k1", "k2")
    }
    parameters = (*ahead.parameters, *own.values(), astern.signal("alpha"))
    renamed = {astern.signal(key).symbol: s.symbol for key, s in own.items()}
    force = (
        sp.Piecewise(
            (astern.expand(astern.output_expressions[f.name]).xreplace(renamed), SURGE_REF.symbol < 0),
            (ahead.expand(ahead.output_expressions[f.name]), True),
        )
        for f in (FORCE_X, FORCE_Y)
    )
    return _law(name, (SURGE_REF, YAW_RATE_REF), parameters, *force)


def _force(
    gains: tuple[Signal, ...], surge_ref: sp.Expr = sp.S.Zero, yaw_rate_ref: sp.Expr = sp.S.Zero
) -> tuple[sp.Expr, sp.Expr]:
    """Return the force that (2.16), (2.24) and (2.39) have in common."""
    k1, k2, d = (g.symbol for g in gains)
    return -k1 * (_U - surge_ref), -k2 * (_V - d * (_R - yaw_rate_ref))


def _gains(body: Body, **values: float) -> tuple[Signal, ...]:
    """Return the gains and the arm as parameters."""
    axes = {"k1": "force_x", "k2": "force_y"}
    for key, value in values.items():
        positive(f"controller: {key}", value)
    gains = [Signal(k, "kg/s", f"gain of {axes[k]}", start=v, lower=0.0) for k, v in values.items()]
    return (*gains, Signal("arm", "m", "rudder behind the centre of mass", start=body.arm, lower=0.0))


def _law(name: str, refs: tuple[Signal, ...], parameters: tuple[Signal, ...], *force: sp.Expr) -> Block:
    expressions: dict[str, Any] = dict(zip(("force_x", "force_y"), force, strict=True))
    return Block(
        name,
        inputs=(*_MOVING, *refs),
        outputs=(FORCE_X, FORCE_Y),
        parameters=parameters,
        output_expressions=expressions,
    )
