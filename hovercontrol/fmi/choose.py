"""What the command line can export, by name: whole loops of scenarios, their parts, plants of craft."""

from __future__ import annotations

import re
from dataclasses import dataclass

from hovercontrol.block import Block
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.interconnect import interconnect
from hovercontrol.modelfile import load_model
from hovercontrol.scenarios import Scenario, load_scenario, scenario_names
from hovercontrol.scenarios.runner import loop_parts, phase_parameters
from hovercontrol.tables import read_toml
from hovercontrol.vehicles import VEHICLES, vehicle


@dataclass(frozen=True)
class Choice:
    """A Block to export, what it is in a sentence, and its default experiment [s] where one is known."""

    block: Block
    text: str
    stop: float | None = None
    step: float | None = None


def choose(name: str) -> Choice:
    """Return the Block of a name.

    Parameters
    ----------
    name : str
        A scenario (``table1``, or its TOML file) is its whole closed loop; ``table1:controller`` one part of
        it; a vehicle (``four_fan``) or a model file (TOML) its plant.

    Raises
    ------
    InputError
        If there is no such thing (the nearest is named), or a scenario's loop is sampled.

    Examples
    --------
    >>> choose("table1:reference").block.name
    'reference'
    """
    whole, colon, part = name.partition(":")
    if colon and not whole.endswith(".toml") and whole not in scenario_names():
        raise InputError(f"unknown scenario {whole!r} in {name!r}{did_you_mean(whole, scenario_names())}")
    if whole.endswith(".toml") and not colon and "scenario" not in read_toml(whole):
        model = load_model(whole)
        return Choice(model.plant(), f"The plant of {model.name}, from a model file.")
    if whole.endswith(".toml") or whole in scenario_names():
        scenario = load_scenario(whole)
        return _part(scenario, part) if colon else _loop(scenario)
    if name not in VEHICLES:
        raise InputError(f"unknown block {name!r}{did_you_mean(name, [*scenario_names(), *VEHICLES])}")
    return Choice(vehicle(name).plant(), f"The plant of {name}.")


def choices() -> list[tuple[str, str]]:
    """Return what comes with the package, names and texts."""
    found = []
    for name in scenario_names():
        scenario = load_scenario(name)
        parts = ", ".join(f"{name}:{part}" for part in loop_parts(scenario))
        if scenario.sampling is None:
            found.append((name, f"closed loop: {scenario.title}"))
        found.append((parts, "its parts" if scenario.sampling is None else f"parts of: {scenario.title}"))
    return found + [(name, "plant") for name in VEHICLES]


def _part(scenario: Scenario, part: str) -> Choice:
    parts = loop_parts(scenario)
    if part not in parts:
        raise InputError(f"{scenario.name} has no part {part!r}{did_you_mean(part, parts)}")
    return Choice(parts[part], f"The {part} of: {scenario.title}.", scenario.end, scenario.step)


def _loop(scenario: Scenario) -> Choice:
    parts = loop_parts(scenario)
    where = scenario.file or scenario.name
    if scenario.sampling is not None:
        names = ", ".join(f"{where}:{part}" for part in parts)
        raise InputError(
            f"{where} is a sampled loop, which cannot be exported whole; its continuous parts can: {names}"
        )
    name = re.sub(r"\W", "_", scenario.name, flags=re.ASCII)
    loop = interconnect([*parts.values()], name if re.match(r"[A-Za-z_]", name) else f"loop_{name}")
    first = phase_parameters(scenario, scenario.phases[0])
    text = f"Closed loop: {scenario.title}."
    if len(scenario.phases) > 1:
        text += f" Parameters as in the first phase, {scenario.phases[0].name!r}."
    return Choice(loop.with_values(first), text, scenario.end, scenario.step)
