"""The steering law under way: it gives the craft a surge velocity and a yaw rate at the same time.

K06 chapter 7 asks for it: "we would still need to derive a control law ... to steer the hovercraft while
moving forward or in reverse". The law inverts the surge and yaw equations of the model; what remains, the
sway velocity, is the zero dynamics. They are stable exactly where the craft has sway drag: a craft without
drag has no steady turn under way (:func:`weaving` steers it in the mean).
"""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers.tracking import affine_dynamics, polar
from hovercontrol.control.guidance.commands import DESIRED
from hovercontrol.craft.hardware.actuators.signals import FORCE_X, FORCE_Y
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION, motion_symbols

_MOVING = tuple(s for s in MOTION if s.name in ("u", "v", "r"))


@checked
def steering_law(
    model: Model,
    *,
    surge_gain: float = 1.0,
    yaw_gain: float = 2.0,
    forces: bool = False,
    limits: bool = False,
    name: str = "controller",
) -> Block:
    """Return the law that follows a desired surge velocity and yaw rate.

    With ``u' = f_u + b_u T cos(theta)`` and ``r' = f_r + b_r T sin(theta)``, the model's surge and yaw
    equations, it asks for

    ``T cos(theta) = (u_d' - surge_gain (u - u_d) - f_u)/b_u``,
    ``T sin(theta) = (r_d' - yaw_gain (r - r_d) - f_r)/b_r``,

    so that both errors decay exponentially with the two gains. The sway velocity then follows
    ``v' = f_v + (b_v/b_r) (r_d' - f_r)`` by itself: with linear sway drag c4 and C17's effects
    ``v' = -c4 v - u r - (c7/c8)(c5 sgn r + c6 r)``, which settles where c4 > 0.

    Parameters
    ----------
    model : Model
        With a propeller and a rudder; its coefficients become the Block's parameters.
    surge_gain, yaw_gain : float, optional
        Decay rates of the two errors [1/s], positive.
    forces : bool, optional
        Tell the force vector ``force_x, force_y`` [N], as K06's laws do, in place of thrust and rudder; only
        for a model whose thrust is in newton.
    limits : bool, optional
        Keep thrust and rudder within the model's input bounds.
    name : str, optional

    Returns
    -------
    Block
        Inputs ``u, v, r`` and the four desired values (see :func:`command_filter`); outputs ``thrust``,
        ``rudder`` [rad] or ``force_x, force_y`` [N].

    Raises
    ------
    InputError
        If a gain is not positive, the model has no rudder, its thrust is not in newton though forces are
        wanted, or an effect is not a linear function of the thrust vector.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> print(steering_law(hoverdemon(), forces=True).equations().splitlines()[-2])
    force_x = thrust_x
    """
    gains = tuple(
        Signal(key, "1/s", f"decay rate of the {text}", start=positive(f"{name}: {key}", value), lower=0.0)
        for key, value, text in (
            ("surge_gain", surge_gain, "surge error"),
            ("yaw_gain", yaw_gain, "yaw rate error"),
        )
    )
    if forces and model.thrust.unit != "N":
        raise InputError(
            f"{name}: forces need a model whose thrust is in N, that of {model.name!r} is in "
            f"{model.thrust.unit}"
        )
    speed, speed_slope, rate, rate_slope = (d.symbol for d in DESIRED)
    ku, kr = (g.symbol for g in gains)
    s = motion_symbols(model.fans)
    slopes = (speed_slope - ku * (s.u - speed), rate_slope - kr * (s.r - rate))
    solution, _ = inverse_dynamics(model, name, *slopes)
    fx, fy = sp.symbols("thrust_x thrust_y", real=True)
    used = solution.free_symbols
    bounds: list[Signal] = []
    if forces:
        outputs: tuple[Signal, ...] = (FORCE_X, FORCE_Y)
        told = {"force_x": fx, "force_y": fy}
    else:
        thrust, rudder, bounds = polar(model, fx, fy, limits)
        outputs, told = (model.thrust, model.rudder), {"thrust": thrust, "rudder": rudder}
    return Block(
        name,
        inputs=(*_MOVING, *DESIRED),
        outputs=outputs,
        parameters=(*gains, *(p for p in model.parameters(name) if p.symbol in used), *bounds),
        definitions={"thrust_x": solution[0], "thrust_y": solution[1]},
        output_expressions=told,
    )


def inverse_dynamics(
    model: Model, name: str, surge_slope: sp.Expr, yaw_slope: sp.Expr
) -> tuple[sp.Matrix, sp.Expr]:
    """Return the thrust vector that makes given u' and r', and the v' that follows [C17 eq 11].

    Parameters
    ----------
    model : Model
        With a propeller and a rudder.
    name : str
        Of the Block whose parameters the coefficients are.
    surge_slope, yaw_slope : sympy.Expr
        Wanted u' [m/s^2] and r' [rad/s^2].

    Returns
    -------
    tuple of sympy.Matrix and sympy.Expr
        ``T [cos(theta), sin(theta)]`` in the unit of the thrust command, and v' [m/s^2].

    Raises
    ------
    InputError
        If the thrust cannot make both, or an effect is not a linear function of the thrust vector.
    """
    free, matrix, s = affine_dynamics(model, name)
    surge, sway, yaw = (matrix.gain.row(i) for i in range(3))
    both = sp.Matrix([surge, yaw])
    if both.subs({p.symbol: p.start for p in model.parameters(name)}).det() == 0:
        raise InputError(
            f"{name}: model {model.name!r} needs the effects 'thrust' and 'rudder_torque', not zero, to be "
            "driven and turned"
        )
    # u' = v r + f_u + b_u T, r' = f_r + b_r T, v' = -u r + f_v + b_v T
    vector = both.inv() * sp.Matrix([surge_slope - s.v * s.r - free["u"], yaw_slope - free["r"]])
    return vector, -s.u * s.r + free["v"] + (sway * vector)[0]
