"""Energies that K06's hybrid controllers compare before they change their law (sections 2.2.6, 2.3.3)."""

from __future__ import annotations

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.vehicles import Body


def body_signals(body: Body) -> tuple[Signal, Signal, Signal]:
    """Return mass, inertia and arm as parameters of a Block."""
    return (
        Signal("mass", "kg", "mass of the craft", start=body.mass, lower=0.0),
        Signal("inertia", "kg*m^2", "moment of inertia", start=body.inertia, lower=0.0),
        Signal("arm", "m", "rudder behind the centre of mass", start=body.arm, lower=0.0),
    )


def kinetic_energy(m: sp.Expr, J: sp.Expr, u: sp.Expr, v: sp.Expr, r: sp.Expr) -> sp.Expr:
    """Return V [K06 eq 2.14, 2.40], or W [K06 eq 2.36] where `r` is the error of the yaw rate.

    Examples
    --------
    >>> kinetic_energy(2, 1, 3, 0, 4)
    17
    """
    return sp.Rational(1, 2) * (m * (u**2 + v**2) + J * r**2)


def unwanted_level(m: sp.Expr, J: sp.Expr, d: sp.Expr, yaw_rate: sp.Expr) -> sp.Expr:
    """Return W_bad: W at the turn law's unwanted limit point ``(0, -d r_ref, 0)`` (section 2.2.6).

    W never grows, so that a craft that starts below this level reaches the wanted limit point.
    """
    return kinetic_energy(m, J, sp.S.Zero, d * yaw_rate, yaw_rate)


def entry_energy(m: sp.Expr, J: sp.Expr, d: sp.Expr, yaw_rate: sp.Expr) -> sp.Expr:
    """Return eps [K06 eq 2.48]: below this kinetic energy the turn law may take over.

    K06 writes it for the momentum ``Pi = J r``: ``(d^2 m)^2 Pi^2/(8 J^2 (J + d^2 m))``.
    """
    dm = d**2 * m
    return dm**2 * yaw_rate**2 / (8 * (J + dm))


def least_yaw_rate(m: sp.Expr, J: sp.Expr, d: sp.Expr, level: sp.Expr, yaw_rate: sp.Expr) -> sp.Expr:
    """Return v_max/J [K06 eq 2.66, 2.67, 2.68]: the least yaw rate reference while the turn law runs.

    Above it the craft is below the new reference's unwanted level, wherever it is within ``W <= level`` of
    the present reference `yaw_rate`.

    Parameters
    ----------
    level : sympy.Expr
        W at the present reference [J].
    yaw_rate : sympy.Expr
        The present reference [rad/s].
    """
    ratio = d**2 * m / J
    return (sp.sqrt(2 * level / J) + sp.Abs(yaw_rate)) * (sp.sqrt(1 + ratio) - 1) / ratio
