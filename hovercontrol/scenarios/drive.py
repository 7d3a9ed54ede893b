"""A first run of a model file: steps of its commands, so that everything the craft can do shows once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hovercontrol.core.signals import Signal
from hovercontrol.models.model import RUDDER, Model
from hovercontrol.scenarios.definition import Phase, Scenario

#: Sections that only model files have.
MODEL_SECTIONS = ("inputs", "effects", "fans")

#: Length of the run, from row to row, how long a command is held [s].
END, STEP, HELD = 20.0, 0.02, 1.0

#: Share of the commands' range that is used, in its middle.
SHARE = 0.6


def is_model(content: Mapping[str, Any]) -> bool:
    """Return whether the content of a TOML file is a model, not a scenario.

    Examples
    --------
    >>> is_model({"plant": {"name": "duck"}, "effects": {}}), is_model({"scenario": {}, "plant": {}})
    (True, False)
    """
    return "scenario" not in content and any(key in content for key in MODEL_SECTIONS)


def driven(model: Model, name: str) -> Scenario:
    """Return a scenario that drives a craft by steps of its commands, the same each time.

    Parameters
    ----------
    model : Model
    name : str
        Of the scenario.

    Returns
    -------
    Scenario
        20 s; each command is held for 1 s at a value within the middle 60 % of its bounds.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import vehicle
    >>> scenario = driven(vehicle("c17_experiment"), "first")
    >>> scenario.end, sorted(scenario.commands)
    (20.0, ['rudder', 'thrust', 'time'])
    """
    random = np.random.default_rng(1)
    times = np.arange(0.0, END, HELD)
    commands = {"time": tuple(times.tolist())}
    for signal in model.plant().inputs:
        low, high = _span(signal)
        middle, half = (low + high) / 2, SHARE * (high - low) / 2
        values = middle + half * random.uniform(-1.0, 1.0, times.size)
        commands[signal.name] = tuple(float(f"{value:.3g}") for value in values)
    return Scenario(
        name=name,
        title=f"{model.name}: steps of its commands",
        source=f"drawn for the model {model.name}",
        step=STEP,
        plant=model,
        belief=model,
        start={},
        phases=(Phase("steps", END),),
        commands=commands,
    )


def _span(signal: Signal) -> tuple[float, float]:
    """Return the range of a command; where it has no bounds its usual size, forward only but for a rudder."""
    usual = -signal.nominal if signal.name == RUDDER.name else 0.0
    low = signal.lower if math.isfinite(signal.lower) else usual
    return low, signal.upper if math.isfinite(signal.upper) else max(signal.nominal, low + signal.nominal)
