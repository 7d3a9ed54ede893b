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

from hovercontrol.controllers.k06.laws import SURGE_REF, YAW_RATE_REF
from hovercontrol.core.block import Block
from hovercontrol.core.boundary import checked
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError
from hovercontrol.guidance.commands import DESIRED
from hovercontrol.io.tables import number, positive
from hovercontrol.models.model import MOTION
from hovercontrol.models.vehicles import HOVERDEMON_BODY, Body

_SEEN = tuple(s for s in MOTION if s.name in ("psi", "u", "v", "r"))


@checked
def weaving(
    *,
    lag: float = 1.0,
    ratio: float = 0.55,
    least_rate: float = 0.02,
    drift_gain: float = 0.5,
    heading_gain: float = 0.5,
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
    period : float, optional
        Of a sampled Block [s]; 0: continuous.
    body : Body, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``surge_ref`` [m/s], ``yaw_rate_ref`` [rad/s], ``u, v, r``; outputs the desired values of
        :func:`~hovercontrol.guidance.steering_law`.

    Raises
    ------
    InputError
        If a number is not positive, or the period negative.

    Examples
    --------
    >>> [s.name for s in weaving().outputs][:2]
    ['surge_desired', 'surge_acceleration_desired']
    """
    if not number(f"{name}: period", period) >= 0.0:
        raise InputError(f"{name}: period must not be negative, found {period!r}")
    given = {
        "lag": Signal("lag", "s", "time constant of the commands", start=lag, lower=1e-6),
        "ratio": Signal("ratio", "1", "modulation frequency over yaw rate", start=ratio),
        "least_rate": Signal("least_rate", "rad/s", "modulation fades below", start=least_rate),
        "drift_gain": Signal("drift_gain", "rad/m", "yaw rate per sway velocity", start=drift_gain),
        "slow": Signal("slow", "m/s", "surge below which the drift counts less", start=0.05),
        "heading_gain": Signal("heading_gain", "rad/s", "yaw rate per heading error", start=heading_gain),
    }
    for key, signal in given.items():
        positive(f"{name}: {key}", signal.start)
    ahead = Signal("percussion", "m", "J/(m d): centre of oscillation ahead of the centre of mass",
                   start=body.inertia / (body.mass * body.arm), lower=0.0)  # fmt: skip
    tau, times, r0, k, slow = (s.symbol for s in list(given.values())[:5])
    surge = Signal("surge_mean", "m/s", "filtered surge command")
    rate = Signal("yaw_rate_mean", "rad/s", "filtered yaw rate command")
    phase = Signal("phase", "rad", "of the modulation")
    U, R, a = surge.symbol, rate.symbol, phase.symbol
    u, r, w = (sp.Symbol(key, real=True) for key in ("u", "r", "drift"))
    whole = sp.sqrt(R**2 + r0**2)
    g, s = R / whole, sp.tanh(U / slow)
    # w of the weave alone: w' = -u_d r_d with k = 0 and without its mean; e is what has to be damped.
    e = w + U * R * g**2 * sp.sin(2 * a) / (2 * times * whole)
    told = (
        U * (1 + sp.sqrt(2) * g * sp.sin(a)),
        R - sp.sqrt(2) * g * (R - s * k * e) * sp.sin(a) + s * k * (1 - g**2) * e,
    )
    slopes = {
        U: (SURGE_REF.symbol - U) / tau,
        R: (YAW_RATE_REF.symbol - R) / tau,
        a: times * whole,
        w: -u * r,
    }
    # Heading loop: the integral of the yaw rate told, held with the gain kh, so that its mean is exact.
    turned, kh = sp.Symbol("heading_desired", real=True), given["heading_gain"].symbol
    psi = sp.Symbol("psi", real=True)
    slopes |= {turned: told[1], psi: r}
    told = (told[0], told[1] + kh * sp.sin(turned - psi))
    values = []
    for expression in told:
        values += [expression, sum(sp.diff(expression, by) * slope for by, slope in slopes.items())]
    parameters = (*given.values(), ahead)
    following = {x: slopes[x] for x in (U, R, a, turned)}
    if period:
        tick = Signal("period", "s", "of the ticks, fixed", start=period, lower=period, upper=period)
        parameters, h = (*parameters, tick), tick.symbol
        left = sp.exp(-h / tau)
        following = {
            U: SURGE_REF.symbol + (U - SURGE_REF.symbol) * left,
            R: YAW_RATE_REF.symbol + (R - YAW_RATE_REF.symbol) * left,
            a: a + h * slopes[a],
            turned: turned + h * slopes[turned],
        }
    return Block(
        name,
        states=(surge, rate, phase, Signal("heading_desired", "rad", "integral of the yaw rate told")),
        inputs=(SURGE_REF, YAW_RATE_REF, *_SEEN),
        outputs=DESIRED,
        parameters=parameters,
        definitions={"drift": sp.Symbol("v", real=True) + ahead.symbol * r},
        derivatives={str(x): e for x, e in following.items()},
        output_expressions={d.name: e for d, e in zip(DESIRED, values, strict=True)},
        period=period,
    )
