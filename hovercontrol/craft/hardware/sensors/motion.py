"""Specific force at accelerometers, derived from a plant's equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import offset, pair


@checked
def with_specific_force(plant: Block, *, lever_arm: Sequence[float] | None = None) -> Block:
    """Return a plant with outputs for its specific force [K06 eq 3.9] and angular acceleration.

    The specific force in the body's axes is ``(u' - v r, v' + u r)`` with the plant's own derivatives; the
    craft is level, so gravity does not appear (K06 section 3.2). Away from the centre of mass, terms in
    ``r'`` and ``r^2`` (centripetal) are added.

    Parameters
    ----------
    plant : Block
        Continuous, with states ``u, v`` [m/s] and ``r`` [rad/s].
    lever_arm : (float, float), optional
        Place of the inertial sensors in the body's axes [m]; it becomes the parameters ``imu_x``, ``imu_y``.

    Returns
    -------
    Block
        The plant with the outputs ``specific_force_x``, ``specific_force_y`` [m/s^2] (forward and left) and
        ``angular_acceleration`` [rad/s^2].

    Raises
    ------
    InputError
        If the plant is sampled or lacks one of these states, or the lever arm is not a pair of numbers.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> plant = with_specific_force(hoverdemon().plant())
    >>> state, pushed = [0.0, 0.0, 0.0, 1.0, 0.0, 2.0], [2.6, 0.0]
    >>> plant.to_numpy().outputs(0.0, state, pushed)[6:8].round(9).tolist()  # circling alone is not felt
    [1.0, 0.0]
    """
    plant.need_continuous("specific force")
    states = {s.name: s for s in plant.states}
    for name in "uvr":
        if name not in states:
            raise InputError(
                f"block {plant.name!r}: specific force needs the states u, v and r; it has no {name!r}"
            )
    u, v, r = (states[name].symbol for name in "uvr")
    turning = plant.derivatives["r"]
    x = plant.derivatives["u"] - v * r
    y = plant.derivatives["v"] + u * r
    places: tuple[Signal, ...] = ()
    if lever_arm is not None:
        arm = pair(f"block {plant.name!r}: lever_arm", lever_arm)
        places = tuple(
            offset(f"imu_{axis}", "m", "position of the inertial sensors", plant.name, value)
            for axis, value in zip("xy", arm, strict=True)
        )
        lx, ly = (s.symbol for s in places)
        x, y = x - turning * ly - r**2 * lx, y + turning * lx - r**2 * ly
    told = {"specific_force_x": x, "specific_force_y": y, "angular_acceleration": turning}
    return replace(
        plant,
        outputs=(
            *plant.outputs,
            Signal("specific_force_x", "m/s^2", "specific force along the bow, at the inertial sensors"),
            Signal("specific_force_y", "m/s^2", "specific force to the left, at the inertial sensors"),
            Signal("angular_acceleration", "rad/s^2", "angular acceleration"),
        ),
        parameters=(*plant.parameters, *places),
        output_expressions={**plant.output_expressions, **told},
    )
