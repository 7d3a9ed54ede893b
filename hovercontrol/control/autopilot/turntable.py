"""K06's rotating bench (section 6.2.1.1): a motor-driven platform with the craft's sensors on a beam.

The sensors' x axis is tangential and their y axis points to the spin axis (section 6.2.1.4), so that a
positive rate moves them forward.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative, number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.models.motion import MOTION

#: Distance from the spin axis to the inertial sensors [m]: 12 in.
ARM = 12 * 0.0254
#: Motions that can be commanded.
MOTIONS = ("constant", "square", "sine")

_COMMAND = Signal("rate_command", "rad/s", "commanded rate of the platform")
_GRAVITY = 9.80665


def bench_command(
    motion: str = "constant",
    *,
    rate: float = math.radians(-166.0),
    half_period: float = 3.0,
    rest: float = 0.0,
    frequency: float = 5.0,
    name: str = "command",
) -> Block:
    """Return the command of the platform: a constant rate, a square wave of the rate or a sine.

    Parameters
    ----------
    motion : {"constant", "square", "sine"}, optional
        A parameter of the Block, like all of the following.
    rate : float, optional
        The rate, or its amplitude [rad/s]; K06's constant rates are -57, -115, -166 and -230 deg/s.
    half_period : float, optional
        Time for which the square wave spins in one direction [s]; K06's is 3 s (section 6.2.1.3).
    rest : float, optional
        Time for which the square wave rests before the direction changes [s].
    frequency : float, optional
        Frequency of the sine [1/s].

    Returns
    -------
    Block
        Without inputs and states; output ``rate_command`` [rad/s].

    Raises
    ------
    InputError
        If the motion is unknown, `half_period` or `frequency` is not positive, `rest` is negative, or a value
        is not a number.

    Examples
    --------
    >>> told = bench_command("square", rate=5.0).to_numpy()
    >>> [told.outputs(t, (), ()).tolist() for t in (1.0, 4.0, 7.0)]
    [[5.0], [-5.0], [5.0]]
    """
    if motion not in MOTIONS:
        raise InputError(f"{name}: motion must be one of {', '.join(MOTIONS)}, found {motion!r}")
    not_negative(f"{name}: rest", rest)
    mode = Signal("motion", "1", "of the platform", start=MOTIONS.index(motion), modes=MOTIONS)
    size = Signal("rate", "rad/s", "rate or its amplitude", start=number(f"{name}: rate", rate))
    spin = Signal(
        "half_period",
        "s",
        "half period of the square wave",
        start=positive(f"{name}: half_period", half_period),
        lower=1e-3,
    )
    stand = Signal("rest", "s", "standstill between half periods of the square wave", start=rest, lower=0.0)
    f = Signal("frequency", "1/s", "of the sine", start=positive(f"{name}: frequency", frequency), lower=0.0)
    part = sp.Mod(time, 2 * (spin.symbol + stand.symbol))
    turn = spin.symbol + stand.symbol
    square = sp.Piecewise(
        (1, part < spin.symbol), (0, part < turn), (-1, part < turn + spin.symbol), (0, True)
    )
    shape = sp.Piecewise(
        (1, mode.symbol < 0.5), (square, mode.symbol < 1.5), (sp.sin(2 * sp.pi * f.symbol * time), True)
    )
    return Block(
        name,
        outputs=(_COMMAND,),
        parameters=(mode, size, spin, stand, f),
        output_expressions={_COMMAND.name: size.symbol * shape},
    )


def turntable(
    *,
    arm: float = ARM,
    lag: float = 0.1,
    tilt: float = 0.0,
    centre: Sequence[float] = (0.0, 0.0),
    rate: float = 0.0,
    name: str = "turntable",
) -> Block:
    """Return the rotating platform with the craft's sensors on a beam.

    Parameters
    ----------
    arm : float, optional
        Distance from the spin axis to the sensors [m]; 0 is on the axis. A parameter, like all except `rate`.
    lag : float, optional
        Time constant of the motor's response to its command [s].
    tilt : float, optional
        Tilt of the spin axis from the vertical, about the earth's y [rad]: the accelerometers then measure
        ``g sin(tilt)`` along the earth's x.
    centre : (float, float), optional
        Position of the spin axis, earth frame [m].
    rate : float, optional
        Initial rate [rad/s].

    Returns
    -------
    Block
        Continuous. Input ``rate_command`` [rad/s]; states ``psi`` [rad] and ``r`` [rad/s]; outputs at the
        sensors' position: ``x, y`` [m], ``psi``, ``u, v`` [m/s], ``r``, and ``specific_force_x``,
        ``specific_force_y`` [m/s^2], forward and left.

    Raises
    ------
    InputError
        If the lag is not positive, the arm is negative, or a value is not a number.

    Examples
    --------
    >>> told = turntable(tilt=0.0).to_numpy().outputs(0.0, [0.0, 2.0], [2.0])
    >>> told.round(4).tolist()  # x, y, psi, u, v, r, and the centripetal 0.3048 * 2**2
    [0.0, -0.3048, 0.0, 0.6096, 0.0, 2.0, 0.0, 1.2192]
    """
    not_negative(f"{name}: arm", arm)
    if not hasattr(centre, "__len__") or len(centre) != 2:
        raise InputError(f"{name}: centre must be two numbers, found {centre!r}")
    radius = Signal("arm", "m", "from the spin axis to the sensors", start=arm, lower=0.0)
    slow = Signal("lag", "s", "of the motor", start=positive(f"{name}: lag", lag), lower=1e-4)
    lean = Signal("tilt", "rad", "of the spin axis", start=number(f"{name}: tilt", tilt))
    gravity = Signal("gravity", "m/s^2", "", start=_GRAVITY)
    at = [
        Signal(f"centre_{axis}", "m", "of the spin axis", start=number(f"{name}: centre", value))
        for axis, value in zip("xy", centre, strict=True)
    ]
    # r' = (r_command - r) / lag;  x = x_c + R sin psi, y = y_c - R cos psi, u = R r, v = 0;
    # f_x = R r' + g sin(tilt) cos psi,  f_y = R r^2 - g sin(tilt) sin psi.
    psi, r = MOTION[2], MOTION[5]
    R, cos, sin = radius.symbol, sp.cos(psi.symbol), sp.sin(psi.symbol)
    turning = (_COMMAND.symbol - r.symbol) / slow.symbol
    felt = gravity.symbol * sp.sin(lean.symbol)
    return Block(
        name,
        states=(psi.replace(start=0.0), r.replace(start=number(f"{name}: rate", rate))),
        inputs=(_COMMAND,),
        outputs=(
            *MOTION,
            Signal("specific_force_x", "m/s^2", "specific force along the tangent"),
            Signal("specific_force_y", "m/s^2", "specific force towards the spin axis"),
        ),
        parameters=(radius, slow, lean, gravity, *at),
        derivatives={"psi": r.symbol, "r": turning},
        output_expressions={
            "x": at[0].symbol + R * sin,
            "y": at[1].symbol - R * cos,
            "u": R * r.symbol,
            "v": sp.S.Zero,
            "specific_force_x": R * turning + felt * cos,
            "specific_force_y": R * r.symbol**2 - felt * sin,
        },
    )
