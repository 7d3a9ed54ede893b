"""The source documents' craft, as lists of effects with their coefficients.

C17 is Cabecinhas, Batista, Oliveira, Silvestre, "Hovercraft Control With Dynamic Parameters Identification",
IEEE TCST; K06 is Kulis, "Feedback Control of a Hovercraft over a Wireless Link", Univ. of Maryland, 2006.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.base.tables import positive
from hovercontrol.craft.effects import Effect, effect
from hovercontrol.craft.models.fans import Fan
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import RUDDER, THRUST


@dataclass(frozen=True)
class Body:
    """Mass, inertia and rudder arm of a craft, as control laws on momenta need them.

    Parameters
    ----------
    mass : float
        m [kg]
    inertia : float
        J [kg m^2]
    arm : float
        d [m], distance of the rudder behind the centre of mass.

    Raises
    ------
    InputError
        If a value is not positive.
    """

    mass: float
    inertia: float
    arm: float

    def __post_init__(self) -> None:
        for key in ("mass", "inertia", "arm"):
            object.__setattr__(self, key, positive(f"body: {key}", getattr(self, key)))


#: K06's craft [K06 fig 2.1]: table 4.1 prints 1.6 kg, but 5.7 lb are 2.6 kg, and tables 6.2-6.3 agree with
#: that.
HOVERDEMON_BODY = Body(mass=2.6, inertia=0.096, arm=0.32)


def _c17_effects(rudder_torque: float) -> tuple[Effect, ...]:
    """Return zeta [C17 eq 12] of the experiment (section VIII-C); zeta_8 differs with arm and inertia."""
    return (
        effect("surge_coulomb", 1.35),
        effect("surge_linear_drag", 0.0),
        effect("sway_coulomb", 0.0),
        effect("sway_linear_drag", 1.20),
        effect("yaw_coulomb", 0.83),
        effect("yaw_linear_drag", 0.48),
        effect("thrust", 0.75),
        effect("rudder_torque", rudder_torque),
    )


def c17_simulation() -> Model:
    """Return the craft of C17's simulation: m = 0.585 kg, J = 0.01 kg m^2, arm 0.14 m.

    C17 prints no coefficients for it; those of the experiment with ``zeta_8 = a zeta_7 m / J`` reproduce
    its error of "around 60 cm".
    """
    mass, inertia, arm = 0.585, 0.01, 0.14
    return Model("c17_simulation", _c17_effects(arm * 0.75 * mass / inertia))


def c17_experiment() -> Model:
    """Return the craft of C17's experiment: Ikarus, 0.585 kg; thrust command in ampere of motor current."""
    return Model(
        "c17_experiment",
        _c17_effects(3.66),
        thrust=THRUST.replace(unit="A", upper=6.1, lower=0.0, description="thrust command, motor current"),
        rudder=RUDDER.replace(lower=-math.radians(26), upper=math.radians(26)),
    )


def hoverdemon() -> Model:
    """Return K06's craft, :data:`HOVERDEMON_BODY`; no drag.

    The thrust command is the propeller's force in newton.
    """
    body = HOVERDEMON_BODY
    return Model(
        "hoverdemon",
        (effect("thrust", 1 / body.mass), effect("rudder_torque", body.arm / body.inertia)),
        thrust=THRUST.replace(unit="N", description="force of the propeller"),
    )


def four_fan() -> Model:
    """Return a small craft with four fixed fans, two pushing forward, two backward; m = 0.1763 kg.

    The two fans whose names end in ``left`` turn it counter-clockwise (to positive yaw) when they push
    forward, so in this frame (y to the left) they stand at y = -0.0425 m. Mass and lever arm are measured;
    drag and inertia are rounded results of ``hovercontrol identify`` on logs of such a craft, to start from.
    """
    mass, arm, inertia = 0.1763, 0.0425, 8.7e-4
    forward, backward = 0.0, math.pi
    return Model(
        "four_fan",
        (
            effect("surge_linear_drag", 0.2),
            effect("sway_linear_drag", 0.3),
            effect("yaw_linear_drag", 0.13),
            effect("fan_force", 1 / mass),
            effect("fan_torque", 1 / inertia),
        ),
        fans=(
            Fan("rear_left", -0.05, -arm, forward),
            Fan("rear_right", -0.05, arm, forward),
            Fan("front_left", 0.05, -arm, backward),
            Fan("front_right", 0.05, arm, backward),
        ),
    )


#: Every craft by name.
VEHICLES: dict[str, Callable[[], Model]] = {
    f.__name__: f for f in (c17_simulation, c17_experiment, hoverdemon, four_fan)
}


@checked
def vehicle(name: str) -> Model:
    """Return a craft by name.

    Raises
    ------
    InputError
        If there is no such craft; the message names the nearest one.

    Examples
    --------
    >>> vehicle("hoverdemon").coefficients()["thrust"]
    0.3846153846153846
    """
    check_known(name, VEHICLES, f"unknown vehicle {name!r}")
    return VEHICLES[name]()
