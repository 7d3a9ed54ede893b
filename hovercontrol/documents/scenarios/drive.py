"""A run of a model file, driven by steps of its commands or by the commands of a log."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import RUDDER
from hovercontrol.documents.scenarios.checks import MAX_ROWS
from hovercontrol.documents.scenarios.definition import Phase, Scenario
from hovercontrol.logs.log import Log

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


def driven(model: Model, name: str, seconds: float | None = None, log: Log | None = None) -> Scenario:
    """Return a scenario that drives a craft from rest, by the commands of a log or by steps.

    Parameters
    ----------
    name : str
        Of the scenario.
    seconds : float, optional
        Length [s]; default: 20, or the length of the log.
    log : Log, optional
        Log with the model's inputs, held from row to row. Default: reproducible random steps of 1 s within
        the middle 60 % of the command's bounds.

    Raises
    ------
    InputError
        If the length is too small, or the log lacks an input or is shorter.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> scenario = driven(vehicle("c17_experiment"), "first")
    >>> scenario.end, sorted(scenario.commands)
    (20.0, ['rudder', 'thrust', 'time'])
    """
    seconds = run_length(seconds, log)
    return Scenario(
        name=name,
        title=f"{model.name}: {'steps of its commands' if log is None else f'commands of {log.name}'}",
        source=f"drawn for the model {model.name}" if log is None else log.name,
        step=STEP,
        plant=model,
        belief=model,
        start={},
        phases=(Phase("steps" if log is None else "log", seconds),),
        commands=played(model.plant().inputs, seconds, log),
    )


def run_length(seconds: float | None, log: Log | None) -> float:
    """Return the length of a run [s]: as given, else that of the log, else 20.

    Raises
    ------
    InputError
        If the length is too small, needs too many rows, or the log is shorter.
    """
    if log is not None and not len(log):
        raise InputError(f"{log.name}: expected samples, found no rows")
    longest = END if log is None else float(np.ptp(log.time))
    found = longest if seconds is None else seconds
    if not STEP <= found < math.inf:
        raise InputError(f"expected a run of at least {STEP:g} s, found {found:g} s")
    if found / STEP > MAX_ROWS:
        raise InputError(f"expected a run of at most {STEP * MAX_ROWS:g} s, found {found:g} s")
    if log is not None and found > longest:
        raise InputError(f"{log.name}: expected commands for {found:g} s, found {longest:g} s")
    return found


def played(inputs: Sequence[Signal], seconds: float, log: Log | None) -> dict[str, tuple[float, ...]]:
    """Return time [s] and commands of a run: those of a log, or else steps within the inputs' bounds."""
    return _steps(inputs, seconds) if log is None else _of_log(inputs, log)


def _steps(inputs: Sequence[Signal], seconds: float) -> dict[str, tuple[float, ...]]:
    random = np.random.default_rng(1)
    times = np.arange(0.0, seconds, HELD)
    commands = {"time": tuple(times.tolist())}
    for signal in inputs:
        low, high = _span(signal)
        middle, half = (low + high) / 2, SHARE * (high - low) / 2
        values = middle + half * random.uniform(-1.0, 1.0, times.size)
        commands[signal.name] = tuple(float(f"{value:.3g}") for value in values)
    return commands


def _of_log(inputs: Sequence[Signal], log: Log) -> dict[str, tuple[float, ...]]:
    rows = {"time": log.time - log.time[0], **{s.name: log[s.name] for s in inputs}}
    for name, values in rows.items():
        if not np.isfinite(values).all():
            when = log.time[np.argmin(np.isfinite(values))]
            raise InputError(f"{log.name}: column {name!r}: expected a command, found none at {when:g} s")
    return {name: tuple(values.tolist()) for name, values in rows.items()}


def _span(signal: Signal) -> tuple[float, float]:
    """Return the range of a command; without bounds, its nominal size (positive, except for a rudder)."""
    usual = -signal.nominal if signal.name == RUDDER.name else 0.0
    low = signal.lower if math.isfinite(signal.lower) else usual
    return low, signal.upper if math.isfinite(signal.upper) else max(signal.nominal, low + signal.nominal)
