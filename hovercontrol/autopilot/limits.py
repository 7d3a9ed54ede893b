"""How large a force fan and rudder can make: a limit of what is commanded, and tables that lose more."""

from __future__ import annotations

import numpy as np
import sympy as sp

from hovercontrol.block import Block
from hovercontrol.errors import InputError
from hovercontrol.hardware.actuators import FanTable, fan_force, fan_tables, force_angle_of_rudder
from hovercontrol.hardware.actuators.k06 import HIGHEST_SPEED, servo_table
from hovercontrol.hardware.actuators.signals import DEGREE, FORCE_ANGLE_COMMAND, THRUST_COMMAND
from hovercontrol.signals import Signal


def actuator_limits(*, name: str = "saturation") -> Block:
    """Return what clips thrust and angle of a force to what K06's calibration has, with the rudder straight.

    K06: "Commands that exceed the predefined actuator limits are clipped to their maximum values" (6.1.1).
    The sizes are those at the ends of the stand-in tables, which clip by themselves: this is for loops
    without them.

    Returns
    -------
    Block
        Inputs ``thrust_wanted`` [N] and ``force_angle_wanted`` [rad]; outputs ``thrust_command`` and
        ``force_angle_command``; the parameter ``on`` switches it off.

    Examples
    --------
    >>> actuator_limits().to_numpy().outputs(0.0, (), [9.0, 1.5]).round(2).tolist()
    [2.0, 0.47]
    """
    angles = servo_table().angle * DEGREE
    sides = sorted(float(force_angle_of_rudder(a)) for a in (angles[0], angles[-1]))
    on = Signal("on", "1", "ends of fan and rudder", start=1.0, modes=("off", "on"))
    ahead = Signal("ahead", "N", "largest force ahead", start=min(2.0, float(fan_force(HIGHEST_SPEED))))
    astern = Signal("astern", "N", "largest force astern", start=-float(fan_force(-HIGHEST_SPEED)))
    right = Signal("angle_lowest", "rad", "least angle of the force", start=sides[0])
    left = Signal("angle_highest", "rad", "greatest angle of the force", start=sides[1])
    thrust, angle = (
        s.but(name=s.name.replace("_command", "_wanted")) for s in (THRUST_COMMAND, FORCE_ANGLE_COMMAND)
    )
    F, a = thrust.symbol, angle.symbol
    kept = {
        THRUST_COMMAND.name: (sp.Max(-astern.symbol, sp.Min(ahead.symbol, F)), F),
        FORCE_ANGLE_COMMAND.name: (sp.Max(right.symbol, sp.Min(left.symbol, a)), a),
    }
    return Block(
        name,
        inputs=(thrust, angle),
        outputs=(THRUST_COMMAND, FORCE_ANGLE_COMMAND),
        parameters=(on, ahead, astern, right, left),
        output_expressions={
            key: sp.Piecewise((limited, on.symbol > 0), (whole, True))
            for key, (limited, whole) in kept.items()
        },
    )


def lossy_tables(loss: float) -> tuple[FanTable, FanTable]:
    """Return K06's stand-in tables with less thrust the more the rudder is turned.

    Parameters
    ----------
    loss : float
        Share lost at 35 degrees, growing with the square of the angle.

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
