"""Blocks that can be exported by name: loops of scenarios, parts, plants of craft, a user's Blocks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

from hovercontrol.app.commands.options import parts_in_file
from hovercontrol.base.boundary import as_user
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.tables import read_toml
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.craft.models.interface import AnyModel
from hovercontrol.craft.models.modelfile import load_model
from hovercontrol.craft.models.vehicles import VEHICLES, vehicle
from hovercontrol.documents.scenarios import Scenario, load_scenario, scenario_names
from hovercontrol.documents.scenarios.real import real_loop, real_parameters, real_parts
from hovercontrol.documents.scenarios.runner import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.sampling import sampled_blocks, sampled_loop

#: How many names an error line has room for.
NEAREST = 5


@dataclass(frozen=True)
class Choice:
    """A Block to export, its description, and the stop time of its default experiment [s], if known.

    ``title`` is what tools show as the model's name: the craft of a plant, the scenario of a loop.
    """

    block: Block
    text: str
    title: str
    stop: float | None = None
    step: float | None = None
    parts: tuple[Block, ...] = ()  # of a continuous loop


def choose(name: str, params: Path | None = None) -> Choice:
    """Return the Block of a name.

    Parameters
    ----------
    name : str
        A scenario (``table1``, or its TOML file) is its whole closed loop, with an autopilot the real loop
        beside the ideal one; ``table1:controller`` one part of it; a name of
        :data:`~hovercontrol.app.commands.exportable_parts.PARTS` (``imu``) that part with its defaults; a
        vehicle (``four_fan``) or a model file (TOML) its plant; ``FILE.py:NAME`` a Block, or the plant of a
        model, of one's own, or a list of them: the loop that they make.
    params : path, optional
        A parameter file for what a Python file defines.

    Raises
    ------
    InputError
        If there is no such thing (the nearest is named), or parameters are given for another thing.

    Examples
    --------
    >>> choose("table1:reference").block.name
    'reference'
    >>> choose("rudder_servo").block.period
    0.02
    """
    own = parts_in_file(name, params)
    if own is not None:
        return _own(name, own)
    if params is not None:
        raise InputError(f"export: --params belongs to a model FILE.py:NAME, found {name}")
    whole, colon, part = name.partition(":")
    if colon and not whole.endswith(".toml") and whole not in scenario_names():
        raise InputError(f"unknown scenario {whole!r} in {name!r}{_nearest(whole, scenario_names())}")
    if whole.endswith(".toml") and not colon and "scenario" not in read_toml(whole):
        model = load_model(whole)
        return Choice(model.plant(), f"The plant of {model.name}, from a model file.", model.name)
    if whole.endswith(".toml") or whole in scenario_names():
        scenario = load_scenario(whole)
        return _part(scenario, part) if colon else _loop(scenario)
    if name in VEHICLES:
        return Choice(vehicle(name).plant(), f"The plant of {name}.", name)
    from hovercontrol.app.commands.exportable_parts import PARTS  # not needed by all else

    if name not in PARTS:
        raise InputError(f"unknown block {name!r}{_nearest(name, [*scenario_names(), *VEHICLES, *PARTS])}")
    text = PARTS[name].says
    return _ticking(PARTS[name].block(name), f"{text[0].upper()}{text[1:]}.", name)


@dataclass(frozen=True)
class Listed:
    """What can be exported by a name: its title, and the names of its parts."""

    name: str
    title: str
    parts: tuple[str, ...] = ()
    more: str = ""  # about further parts


def choices() -> list[Listed]:
    """Return the package's Blocks: names, titles and parts."""
    from hovercontrol.app.commands.exportable_parts import PARTS

    found = []
    for name in scenario_names():
        scenario = load_scenario(name)
        parts = tuple(f"{name}:{part}" for part in loop_parts(scenario))
        more = ""
        if scenario.autopilot is not None:
            more = f", and the autopilot's, as {name}:imu, {name}:pilot, {name}:rudder_servo"
        kind = "closed loop" if scenario.sampling is None else "sampled loop"
        kind = kind if scenario.autopilot is None else "real loop beside the ideal one"
        found.append(Listed(name, f"{kind}: {scenario.title}", parts, more))
    found += [Listed(name, "plant") for name in VEHICLES]
    return found + [Listed(name, f"part: {part.says}") for name, part in PARTS.items()]


def _own(name: str, found: list[AnyModel]) -> Choice:
    parts = [one if isinstance(one, Block) else one.plant() for one in found]
    file, _, own = name.rpartition(":") if ":" in name else (name, "", parts[0].name)
    block = parts[0] if len(parts) == 1 else as_user(interconnect, parts, own)
    choice = _ticking(block, f"{own} of {Path(file).name}.", own)
    return choice if len(parts) == 1 else replace(choice, parts=tuple(parts))


def _ticking(block: Block, text: str, title: str) -> Choice:
    return Choice(block, text, title, step=block.period or None)


def _part(scenario: Scenario, part: str) -> Choice:
    parts = loop_parts(scenario)
    if scenario.autopilot is not None and part not in parts:
        parts |= real_parts(scenario, parts)
    if scenario.sampling is not None and part not in parts:
        parts |= sampled_blocks(scenario, parts)
    if part not in parts:
        raise InputError(f"{scenario.name} has no part {part!r}{_nearest(part, parts)}")
    block = parts[part]
    title = scenario.plant.name if part == "plant" else f"{part} of {scenario.name}"
    step = block.period or scenario.step
    return Choice(block, f"The {part} of: {scenario.title}.", title, scenario.end, step)


def _loop(scenario: Scenario) -> Choice:
    parts = loop_parts(scenario)
    alone: tuple[Block, ...] = ()
    first = scenario.phases[0]
    if scenario.autopilot is not None:
        loop, values = real_loop(scenario, parts), real_parameters(scenario, first)
        text = f"The autopilot's real loop beside the ideal one: {scenario.title}."
    elif scenario.sampling is not None:
        loop, values = sampled_loop(scenario, parts), phase_parameters(scenario, first)
        text = f"Sampled loop: {scenario.title}."
    else:
        loop, values = interconnect([*parts.values()]), phase_parameters(scenario, first)
        text = f"Closed loop: {scenario.title}."
        alone = tuple(_with_own(part, values) for part in parts.values())
    if len(scenario.phases) > 1:
        text += f" Parameters as in the first phase, {first.name!r}."
    name = re.sub(r"\W", "_", scenario.name, flags=re.ASCII)
    loop = loop.named(name if re.match(r"[A-Za-z_]", name) else f"loop_{name}")
    return Choice(loop.with_values(values), text, scenario.name, scenario.end, scenario.step, alone)


def _with_own(part: Block, values: Mapping[str, float]) -> Block:
    """Return a part with its own among the loop's parameter values."""
    keys = {part.parameter_key(s.name) for s in part.parameters}
    return part.with_values({key: value for key, value in values.items() if key in keys})


def _nearest(name: str, known: Iterable[str]) -> str:
    """Return the end of an error line: the nearest name, or a few of many."""
    names = list(known)
    if len(names) <= NEAREST or get_close_matches(name, names, n=1, cutoff=0.6):
        return did_you_mean(name, names)
    holding = [n for n in names if name and (name in n or n in name)]
    few = list(dict.fromkeys([*holding, *get_close_matches(name, names, n=NEAREST, cutoff=0.0)]))[:NEAREST]
    return f"; nearest of {len(names)}: {', '.join(few)} (hovercontrol export --list shows all)"
