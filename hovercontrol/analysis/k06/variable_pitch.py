"""A variable-pitch propeller in place of K06's reversing fan (chapter 7): what it would gain.

It turns at one speed; a servo sets the pitch of its blades, so that it pushes both ways alike and needs no
speed controller, whose brake of 150 ms K06 calls problematic.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from hovercontrol.effects import effect
from hovercontrol.errors import InputError
from hovercontrol.hardware.actuators import fan_tables
from hovercontrol.hardware.actuators.k06 import forward_thrust
from hovercontrol.scenarios import Scenario

Array = NDArray[np.float64]

#: Time constant of the pitch's servo [s], an assumption: K06's rudder servo takes a command every 20 ms.
PITCH_LAG = 0.05


def with_variable_pitch(scenario: Scenario, *, lag: float = PITCH_LAG) -> Scenario:
    """Return a trial of the real loop flown with a variable-pitch propeller.

    Both its tables push backward as they push forward, the brake is off, and the thrust follows with the
    servo's lag; the loss at a turned rudder stays.

    Parameters
    ----------
    scenario : Scenario
        With an autopilot and the stand-in tables.
    lag : float, optional
        Time constant of the pitch's servo [s].

    Raises
    ------
    InputError
        If the scenario has no autopilot or tables of its own, or the lag is not positive.

    Examples
    --------
    >>> from hovercontrol.scenarios import load_scenario
    >>> changed = with_variable_pitch(load_scenario("k06-real-reverse"))
    >>> changed.autopilot.imperfections.brake, float(changed.autopilot.tables[1].values[7, 0])
    (False, -2.088)
    """
    own = scenario.autopilot
    if own is None or own.tables is not None:
        raise InputError(f"variable pitch: {scenario.name!r} is no trial of the real loop with K06's tables")
    loss = own.rudder_loss

    def force(speed: Array, rudder: float) -> Array:
        turned = 1 - loss * (rudder / 35.0) ** 2
        pushed: Array = np.sign(speed) * forward_thrust(np.abs(speed), rudder) * turned
        return pushed

    plant = scenario.plant.with_effects([effect("thrust_lag", seconds=lag)])
    changed = dataclasses.replace(
        own, tables=fan_tables(force), rudder_loss=0.0, imperfections=own.imperfections.without("brake")
    )
    return dataclasses.replace(scenario, plant=plant, autopilot=changed)
