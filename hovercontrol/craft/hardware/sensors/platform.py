"""A tilted platform of the inertial sensors: accelerometers measure a component of gravity."""

from __future__ import annotations

import sympy as sp

from hovercontrol.base.tables import finite
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal

#: Standard gravity, as a parameter of Blocks.
GRAVITY = Signal("gravity", "m/s^2", "standard gravity", start=9.80665, nominal=10.0)

_FELT = (
    Signal("specific_force_x", "m/s^2", "along the bow"),
    Signal("specific_force_y", "m/s^2", "to the left"),
)


def tilted_platform(*, roll: float = 0.0, pitch: float = 0.0, name: str = "platform") -> Block:
    """Return the tilt of the inertial sensors against the level craft, K06's platform misalignment.

    Small tilts "contribute a small time-varying bias to each sensor" (section 3.2.2). Pitch is positive with
    the bow up, roll with the right side down.

    Parameters
    ----------
    roll, pitch : float, optional
        [rad]; parameters.

    Returns
    -------
    Block
        Without states. Inputs ``specific_force_x, specific_force_y`` [m/s^2]; outputs ``tilted_force_x,
        tilted_force_y``, the specific force at the accelerometers.

    Raises
    ------
    InputError
        If an angle is not finite.

    Examples
    --------
    >>> tilted_platform(pitch=0.01).to_numpy().outputs(0.0, (), [0.0, 0.0]).round(4).tolist()
    [0.0981, 0.0]
    """
    right, up = (
        Signal(key, "rad", "angle of the sensors' platform", start=finite(f"{name}: {key}", value),
               lower=-0.3, upper=0.3)
        for key, value in (("roll", roll), ("pitch", pitch))
    )  # fmt: skip
    phi, theta, g = right.symbol, up.symbol, GRAVITY.symbol
    x, y = (s.symbol for s in _FELT)
    told = {
        "tilted_force_x": x * sp.cos(theta) + g * sp.sin(theta),
        "tilted_force_y": y * sp.cos(phi) + g * sp.sin(phi) * sp.cos(theta),
    }
    return Block(
        name,
        inputs=_FELT,
        outputs=tuple(s.replace(name=key) for s, key in zip(_FELT, told, strict=True)),
        parameters=(right, up, GRAVITY),
        output_expressions=told,
    )
