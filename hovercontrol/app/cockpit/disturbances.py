"""Disturbances that the pilot can switch on: effects of the package, by their coefficients."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import Effect, effect, effect_class
from hovercontrol.craft.models.model import Model


@dataclass(frozen=True)
class Knob:
    """A number of a disturbance.

    Parameters
    ----------
    signal : Signal
        Name, unit, bounds of the slider, and the value when it is switched on.
    parameters : tuple of str
        The plant's parameters to which it is added.
    """

    signal: Signal
    parameters: tuple[str, ...]


@dataclass(frozen=True)
class Disturbance:
    """A disturbance: its title, the effects it needs, its numbers."""

    title: str
    effects: tuple[str, ...]
    knobs: tuple[Knob, ...]


def _knob(name: str, unit: str, start: float, lower: float, upper: float, *parameters: str) -> Knob:
    return Knob(Signal(name, unit, name, start=start, lower=lower, upper=upper), parameters)


def _effect(name: str, knob: str, unit: str, start: float, lower: float, upper: float) -> Disturbance:
    """Return the disturbance of one number of an effect, under the effect's name, as the monitor says it."""
    title = name.replace("_", " ").capitalize()
    return Disturbance(title, (name,), (_knob(knob, unit, start, lower, upper, name),))


#: Every disturbance by its key.
DISTURBANCES: dict[str, Disturbance] = {
    "wind": Disturbance(
        "Wind",
        ("wind",),
        (_knob("x", "m/s", 1.0, -4.0, 4.0, "wind_x"), _knob("y", "m/s", 0.0, -4.0, 4.0, "wind_y")),
    ),
    "gusts": Disturbance("Gusts", ("wind",), (_knob("speed", "m/s", 1.0, 0.0, 3.0),)),
    "air_drag": Disturbance(
        "Air drag",
        ("surge_linear_drag", "sway_linear_drag"),
        (_knob("coefficient", "1/s", 0.3, 0.0, 2.0, "surge_linear_drag", "sway_linear_drag"),),
    ),
    "slope": Disturbance(
        "Slope of the floor",
        ("slope",),
        (_knob("x", "m/s^2", 0.0, -0.5, 0.5, "slope_x"), _knob("y", "m/s^2", -0.1, -0.5, 0.5, "slope_y")),
    ),
    # K06's craft had a linear drag in yaw, see scenario k06-field-turn
    "yaw_linear_drag": _effect("yaw_linear_drag", "coefficient", "1/s", 2.459, 0.0, 5.0),
    "yaw_coulomb": _effect("yaw_coulomb", "coefficient", "rad/s^2", 0.8, 0.0, 4.0),
    "surge_coulomb": _effect("surge_coulomb", "coefficient", "m/s^2", 0.1, 0.0, 1.0),
    "body_side_force": _effect("body_side_force", "push", "m/s^2", 0.1, -0.5, 0.5),
    "rudder_offset": _effect(
        "rudder_offset", "angle", "rad", math.radians(5), -math.radians(20), math.radians(20)
    ),
    "reverse_thrust_loss": _effect("reverse_thrust_loss", "part", "1", 0.5, 0.0, 1.0),
}

#: What is there in the real loop only; parameters with the keys that they have in the whole.
REAL_DISTURBANCES: dict[str, Disturbance] = {
    "packet_loss": Disturbance(
        "Packets corrupted", (), (_knob("part", "1", 0.3, 0.0, 1.0, "uplink.loss", "downlink.loss"),)
    ),
    "platform_tilt": Disturbance(
        "Tilted IMU platform",
        (),
        (
            _knob("roll", "rad", math.radians(1), -math.radians(5), math.radians(5), "platform.roll"),
            _knob("pitch", "rad", math.radians(2), -math.radians(5), math.radians(5), "platform.pitch"),
        ),
    ),
}


def possible(model: Model) -> dict[str, Disturbance]:
    """Return the disturbances that can act on a craft."""
    reverses = any(s.name == "thrust" and s.lower < 0 for s in model.plant().inputs)

    def acts(name: str) -> bool:
        return model.accepts(effect_class(name)) and (reverses or name != "reverse_thrust_loss")

    return {key: d for key, d in DISTURBANCES.items() if all(map(acts, d.effects))}


def with_disturbances(model: Model) -> Model:
    """Return the craft with all effects of its disturbances; added effects are zero.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> with_disturbances(vehicle("hoverdemon")).coefficients()["yaw_coulomb"]
    0.0
    """
    wanted = {name for d in possible(model).values() for name in d.effects} - {e.name for e in model.effects}
    return model.with_effects(_absent(name) for name in sorted(wanted))


def note(switched_on: Iterable[str], drags: Iterable[float]) -> str:
    """Return a note to the pilot on the active disturbances, or ``""``."""
    if {"wind", "gusts"} & set(switched_on) and not any(drags):
        return "Wind and gusts act through air drag, which this craft lacks: switch air drag on as well."
    return ""


def _absent(name: str) -> Effect:
    numbers = effect_class(name).numbers
    return effect(name, **{key: n.default if n.default is not None else 0.0 for key, n in numbers.items()})
