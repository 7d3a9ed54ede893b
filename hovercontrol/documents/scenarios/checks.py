"""Checks of a scenario before it runs: its length, its commands, its metrics' windows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import check_keys
from hovercontrol.blocks.signals import Signal
from hovercontrol.documents.scenarios.parts import loop_parts

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.definition import Metric, Sampling, Scenario

#: Most rows of a log; the signals of a loop with an estimator then take about 1 GB.
MAX_ROWS = 2_000_000

#: Times that differ by less are the same [s].
SAME_TIME = 1e-9


def check_scenario(scenario: Scenario) -> None:
    """Raise if a scenario is too long, exceeds the craft's commands, or has an empty metric window.

    Raises
    ------
    InputError
        The message names the key or the metric.
    """
    _check_rows(scenario)
    _check_commands(scenario)
    _check_law(scenario)
    for metric in scenario.metrics:
        _check_metric(scenario, metric)


def _check_rows(scenario: Scenario) -> None:
    steps = {"scenario.step": scenario.step}
    if scenario.sampling is not None:
        steps = {
            "sampling.measurement": scenario.sampling.measurement,
            "sampling.command": scenario.sampling.command,
        }
        _check_log(scenario.sampling)
    for key, step in steps.items():
        rows = scenario.end / step + 1
        if rows > MAX_ROWS:
            raise InputError(
                f"{key} = {step:g} s gives {rows:.3g} rows in {scenario.end:g} s, expected at most {MAX_ROWS}"
            )


def _check_log(sampling: Sampling) -> None:
    every = sampling.log / sampling.measurement
    if sampling.log and not math.isclose(every, max(1, round(every)), rel_tol=SAME_TIME):
        raise InputError(
            f"sampling.log = {sampling.log:g} s: expected a multiple of sampling.measurement = "
            f"{sampling.measurement:g} s"
        )


def _check_law(scenario: Scenario) -> None:
    """Raise if a law has no such set point, or a set point is out of bounds."""
    inputs: dict[str, Signal] = {}
    if scenario.controller is not None and not scenario.tracks:
        parts = loop_parts(scenario)
        inputs = {s.name: s for s in parts["reference"].outputs} if "reference" in parts else {}
    for phase in scenario.phases:
        for name, value in phase.setpoints.items():
            check_known(name, inputs, f"phase {phase.name!r}: set: unknown set point {name!r}")
            inputs[name].check(value, f"phase {phase.name!r}: set.{name}")


def _check_commands(scenario: Scenario) -> None:
    if scenario.commands is None:
        return
    inputs = {s.name: s for s in scenario.plant.plant().inputs}
    check_keys("command", scenario.commands, ["time", *inputs])
    for name, signal in inputs.items():
        times = scenario.commands["time"]
        for time, value in zip(times, scenario.commands.get(name, ()), strict=False):
            if not (signal.lower <= value <= signal.upper and math.isfinite(value)):
                hint = "; in degrees?" if signal.unit == "rad" and abs(value) > 2 * math.pi else ""
                raise InputError(
                    f"commands.{name}: expected values in [{signal.lower:.4g}, {signal.upper:.4g}] "
                    f"{signal.unit}, found {value:g} at {time:g} s{hint}"
                )


def _check_metric(scenario: Scenario, metric: Metric) -> None:
    where = f"metric {metric.name!r}"
    needs = {
        "tracking_error": ("a [controller]", scenario.tracks),
        "estimation_error": (
            "an [estimator] and controller.adapt",
            scenario.estimator is not None and bool((scenario.controller or {}).get("adapt")),
        ),
    }
    part, there = needs.get(metric.of, ("", True))
    if not there:
        raise InputError(f"{where}: {metric.of} needs {part}")
    known = [*needs, *_signals(scenario)]
    check_known(metric.of, known, f"{where}: unknown quantity {metric.of!r}")
    if metric.start < 0:
        raise InputError(f"{where}: from = {metric.start:g} must not be negative")
    if metric.start > metric.end:
        raise InputError(f"{where}: from = {metric.start:g} is later than to = {metric.end:g}")
    if metric.end > scenario.end + SAME_TIME:
        raise InputError(f"{where}: to = {metric.end:g} is beyond the scenario's end at {scenario.end:g} s")
    step = (
        scenario.step
        if scenario.sampling is None
        else (scenario.sampling.log or scenario.sampling.measurement)
    )
    samples = [step * math.ceil((metric.start - SAME_TIME) / step)]
    if scenario.sampling is None:
        samples += [phase.until for phase in scenario.phases]
    if not any(metric.start - SAME_TIME <= t <= metric.end + SAME_TIME for t in samples):
        raise InputError(
            f"{where}: no sample between from = {metric.start:g} and to = {metric.end:g}; "
            f"there is one every {step:g} s"
        )


def _signals(scenario: Scenario) -> list[str]:
    """Return the names of the signals that every run of a scenario has."""
    plant = scenario.plant.plant()
    if scenario.controller is None or scenario.tracks:
        return [s.name for s in (*plant.outputs, *plant.inputs)]
    return [s.name for block in loop_parts(scenario).values() for s in block.outputs]
