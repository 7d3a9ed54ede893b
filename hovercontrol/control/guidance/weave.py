"""Steering under way for a craft without sway drag: the commands are modulated so that their means hold.

**No steady turn.** Let a craft without drag, with u' = v r + F_x/m, v' = -u r + F_y/m, r' = -d F_y/J
[K06 eq 2.10], move with bounded velocities. The sway velocity of its centre of oscillation,
``w = v + J/(m d) r``, has the derivative ``w' = -u r`` whatever the forces are. So the mean of ``u r`` over a
long time is zero: no bounded motion has a constant surge velocity U and a constant yaw rate R, unless one is
zero. A motion with these means has a covariance of u and r of ``-U R``: it turns while it is slow.

**Weaving.** ``u_d = U + A sin(a)`` and ``r_d = R - B sin(a)`` with ``A B/2 = U R`` has that covariance. It is
"a time-varying perturbation signal superimposed" as K06 chapter 7 suggests. A drift is damped by the size of
B: ``A B/2 = U R - k U w`` gives the averaged equation ``w' = -k U w``.
"""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.k06.laws import SURGE_REF, YAW_RATE_REF
from hovercontrol.control.guidance.commands import DESIRED
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body

_SEEN = tuple(s for s in MOTION if s.name in ("u", "v", "r"))


@checked
def weaving(
    *,
    lag: float = 1.0,
    ratio: float = 0.55,
    least_rate: float = 0.02,
    drift_gain: float = 0.5,
    turn_gain: float = 0.5,
    period: float = 0.0,
    body: Body = HOVERDEMON_BODY,
    name: str = "guidance",
) -> Block:
    """Return modulated commands whose means are the pilot's, for a craft without sway drag.

    Let U and R be the commands behind a first-order filter, ``a' = ratio sqrt(R^2 + r0^2)``,
    ``g = R/sqrt(R^2 + r0^2)``, ``w = v + J/(m d) r`` and s the sign of U, smooth at zero. Then

    ``u_d = U (1 + sqrt(2) g sin a)``,
    ``r_d = R - sqrt(2) g (R - s k e) sin a + s k (1 - g^2) e``,

    where ``e = w + U R g^2 sin(2 a)/(2 a')`` is the drift less that of the weave itself. Without turning,
    g = 0, nothing is modulated and ``r_d = s k w`` turns the bow into the drift. The desired accelerations
    are the exact derivatives, with ``w' = -u r`` of the craft without drag.

    Parameters
    ----------
    lag : float, optional
        Time constant of the commands' filter [s].
    ratio : float, optional
        Frequency of the modulation over the yaw rate [1]: 1 is one weave for each full turn. More asks for
        larger surge forces, less for larger excursions of the sway velocity, ``U/(2 ratio)``.
    least_rate : float, optional
        Yaw rate [rad/s] far below which the modulation fades.
    drift_gain : float, optional
        k [rad/m].
    turn_gain : float, optional
        Yaw rate added per sine of the integral of ``r_d - r`` [rad/s]: it makes the mean yaw rate right where
        small side forces are lost in a dead zone.
    period : float, optional
        Of a sampled Block [s]; 0: continuous.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``surge_ref`` [m/s], ``yaw_rate_ref`` [rad/s], ``u, v, r``; outputs the desired
        values of :func:`~hovercontrol.control.guidance.steering_law`.

    Raises
    ------
    InputError
        If a number is not positive, or the period negative.

    Examples
    --------
    >>> [s.name for s in weaving().outputs][:2]
    ['surge_desired', 'surge_acceleration_desired']
    """
    not_negative(f"{name}: period", period)
    p = {
        "lag": Signal("lag", "s", "time constant of the commands", start=lag, lower=1e-6),
        "ratio": Signal("ratio", "1", "modulation frequency over yaw rate", start=ratio),
        "least_rate": Signal(
            "least_rate", "rad/s", "yaw rate below which the modulation fades", start=least_rate
        ),
        "drift_gain": Signal("drift_gain", "rad/m", "gain from drift to yaw rate", start=drift_gain),
        "turn_gain": Signal("turn_gain", "rad/s", "gain from missing turn to yaw rate", start=turn_gain),
        "slow": Signal("slow", "m/s", "surge velocity below which the drift counts less", start=0.05),
        "percussion": Signal(
            "percussion",
            "m",
            "J/(m d): centre of oscillation ahead of the centre of mass",
            start=body.inertia / (body.mass * body.arm),
        ),
    }
    for key, signal in p.items():
        positive(f"{name}: {key}", signal.start)
    told, slopes = _commands({key: signal.symbol for key, signal in p.items()})
    values: list[sp.Expr] = []
    for expression in told:
        values += [expression, sum(sp.diff(expression, by) * slope for by, slope in slopes.items())]
    tick = Signal("period", "s", "of the ticks, fixed", start=period, lower=period, upper=period)
    following = {s.name: slopes[s.symbol] for s in _STATES}
    if period:
        following = _next_values(following, p["lag"].symbol, tick.symbol)
    return Block(
        name,
        states=_STATES,
        inputs=(SURGE_REF, YAW_RATE_REF, *_SEEN),
        outputs=DESIRED,
        parameters=(*p.values(), tick) if period else tuple(p.values()),
        definitions={"drift": _V + p["percussion"].symbol * _R},
        derivatives=following,
        output_expressions={d.name: e for d, e in zip(DESIRED, values, strict=True)},
        period=period,
    )


_U, _V, _R = (s.symbol for s in _SEEN)

_STATES = (
    Signal("surge_mean", "m/s", "filtered surge command"),
    Signal("yaw_rate_mean", "rad/s", "filtered yaw rate command"),
    Signal("phase", "rad", "of the modulation"),
    Signal("turn_missing", "rad", "integral of yaw rate reference minus yaw rate"),
)


def _commands(p: dict[str, sp.Symbol]) -> tuple[list[sp.Expr], dict[sp.Symbol, sp.Expr]]:
    """Return u_d and r_d, and the time derivative of each symbol in them."""
    U, R, a, missing = (s.symbol for s in _STATES)
    w = sp.Symbol("drift", real=True)
    whole = sp.sqrt(R**2 + p["least_rate"] ** 2)
    g, s, k = R / whole, sp.tanh(U / p["slow"]), p["drift_gain"]
    there = s**2  # on the spot nothing has to be modulated
    pace = p["ratio"] * whole
    # w of the weave alone, from w' = -u_d r_d with k = 0 and without its mean; e is what has to be damped.
    e = w + there * U * R * g**2 * sp.sin(2 * a) / (2 * pace)
    surge = U * (1 + sp.sqrt(2) * g * sp.sin(a))
    rate = R - sp.sqrt(2) * g * (there * R - s * k * e) * sp.sin(a) + s * k * (1 - g**2) * e
    slopes = {
        U: (SURGE_REF.symbol - U) / p["lag"],
        R: (YAW_RATE_REF.symbol - R) / p["lag"],
        a: pace,
        missing: rate - _R,
        w: -_U * _R,
    }
    # What is missing of the turn is made up for, so that the mean yaw rate is exact.
    return [surge, rate + p["turn_gain"] * sp.sin(missing)], slopes


def _next_values(slopes: dict[str, sp.Expr], lag: sp.Symbol, period: sp.Symbol) -> dict[str, sp.Expr]:
    """Return the next values of the states: the filters exactly, the two angles by Euler's method."""
    found = {s.name: s.symbol + period * slopes[s.name] for s in _STATES}
    for state, told in ((_STATES[0], SURGE_REF), (_STATES[1], YAW_RATE_REF)):
        found[state.name] = told.symbol + (state.symbol - told.symbol) * sp.exp(-period / lag)
    return found
