"""A variable-pitch propeller in place of K06's reversing fan (chapter 7): what it would gain."""

from __future__ import annotations

import dataclasses

from hovercontrol.errors import InputError
from hovercontrol.hardware.actuators import VariablePitch
from hovercontrol.scenarios import Scenario


def with_variable_pitch(scenario: Scenario, propeller: VariablePitch | None = None) -> Scenario:
    """Return a trial of the real loop run with a variable-pitch propeller.

    Parameters
    ----------
    scenario : Scenario
        With an autopilot and the stand-in tables of the fan, whose loss at a turned rudder stays.
    propeller : VariablePitch, optional

    Raises
    ------
    InputError
        If the scenario has no autopilot or tables of its own.

    Examples
    --------
    >>> from hovercontrol.scenarios import load_scenario
    >>> with_variable_pitch(load_scenario("k06-real-reverse")).autopilot.propeller.thrust
    1.944
    """
    own = scenario.autopilot
    if own is None or own.tables is not None:
        raise InputError(f"variable pitch: {scenario.name!r} is no trial of the real loop with K06's tables")
    changed = dataclasses.replace(own, propeller=propeller or VariablePitch())
    return dataclasses.replace(scenario, autopilot=changed)


def without_brake(scenario: Scenario) -> Scenario:
    """Return a trial whose speed controller reverses at once, to tell the brake from the thrust astern.

    Raises
    ------
    InputError
        If the scenario has no autopilot.

    Examples
    --------
    >>> from hovercontrol.scenarios import load_scenario
    >>> without_brake(load_scenario("k06-real-stop")).autopilot.imperfections.brake
    False
    """
    own = scenario.autopilot
    if own is None:
        raise InputError(f"variable pitch: {scenario.name!r} is no trial of the real loop")
    changed = dataclasses.replace(own, imperfections=own.imperfections.without("brake"))
    return dataclasses.replace(scenario, autopilot=changed)
