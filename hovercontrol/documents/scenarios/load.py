"""Scenarios as TOML: found by name, read, and checked key by key."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from hovercontrol.base.boundary import as_user, checked
from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.base.pythonfile import from_python, names_python
from hovercontrol.base.tables import check_keys, number, positive, read_toml, table, text
from hovercontrol.control.controllers.references import REFERENCES
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.modelfile import load_model, model_from_table
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body, vehicle
from hovercontrol.documents.scenarios.autopilots import KEYS as AUTOPILOT_KEYS
from hovercontrol.documents.scenarios.autopilots import autopilot_section
from hovercontrol.documents.scenarios.base import with_base
from hovercontrol.documents.scenarios.checks import check_scenario
from hovercontrol.documents.scenarios.definition import Metric, Phase, Sampling, Scenario
from hovercontrol.documents.scenarios.drive import driven, is_model
from hovercontrol.documents.scenarios.measures import NEEDS, STATISTICS
from hovercontrol.documents.scenarios.parts import GUIDANCE, LAWS
from hovercontrol.documents.scenarios.sections import (
    ACTUATION,
    BODY,
    CONTROLLER,
    ESTIMATOR,
    HEAD,
    METRIC,
    METRIC_NEEDS,
    PHASE,
    PLANT,
    POOR_VIEW,
    SAMPLING,
    SECTIONS,
    STATES,
    arguments,
)
from hovercontrol.logs.log import Log


@checked
def scenario_names() -> list[str]:
    """Return the names of the package's scenarios.

    Examples
    --------
    >>> "table1" in scenario_names()
    True
    """
    folder = resources.files("hovercontrol.documents.scenarios")
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


@checked
def load_scenario(name: str | Path, *, seconds: float | None = None, commands: Log | None = None) -> Scenario:
    """Return a scenario by name, or from a TOML file.

    Parameters
    ----------
    name : str or path
        ``"table1"``, or a ``.toml`` file. A model file, or ``FILE.py:NAME`` of a Model, is driven from rest
        by steps of its commands.
    seconds : float, optional
        Length of a model's run [s].
    commands : Log, optional
        Commands that drive a model instead.

    Raises
    ------
    InputError
        If there is no such scenario, the file has an error (the message names the key), or length or commands
        are given for a scenario.

    Examples
    --------
    >>> scenario = load_scenario("table1")
    >>> scenario.step, [phase.until for phase in scenario.phases]
    (0.01, [15.0, 30.0, 50.0])
    """
    if names_python(str(name)):
        model: Model = from_python(str(name), Model)
        return replace(driven(model, model.name, seconds, commands), file=str(name))
    own = str(name).endswith(".toml")
    path = Path(name) if own else _shipped(str(name))
    content = read_toml(path) if own else {}
    if own and is_model(content):
        return replace(driven(load_model(path), path.stem, seconds, commands), file=str(path))
    if seconds is not None or commands is not None:
        raise InputError(f"{name}: a scenario has its own duration and commands; expected a model file")
    if not own:
        return _of_the_package(path)
    if not content:
        raise InputError(f"{path}: expected a scenario or a model, found an empty file")
    return replace(_checked_scenario(path, content), file=str(path))


@cache
def _of_the_package(path: Path) -> Scenario:
    """Return a scenario of the package; it is read once in a process."""
    return _checked_scenario(path, read_toml(path))


def _checked_scenario(path: Path, content: dict[str, Any]) -> Scenario:
    try:
        scenario = _scenario(path, with_base(content, path, _base))
        check_scenario(scenario)
        return scenario
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None


def _shipped(name: str) -> Path:
    if name not in scenario_names():
        few = get_close_matches(name, scenario_names(), n=5, cutoff=0.0)
        hint = did_you_mean(name, few)
        more = " and more (hovercontrol simulate --list)" if "known" in hint else ""
        raise InputError(f"unknown scenario {name!r}{hint}{more}")
    return Path(str(resources.files("hovercontrol.documents.scenarios") / f"{name}.toml"))


def _base(name: str, path: Path) -> Path:
    return path.parent / name if name.endswith(".toml") else _shipped(name)


def _scenario(path: Path, content: dict[str, Any]) -> Scenario:
    check_keys("section", content, SECTIONS)
    head = _section(content, "scenario", HEAD, required=("step",))
    positive("scenario.step", head["step"])
    plant = _section(content, "plant", PLANT)
    belief = _model(path, plant)
    belief = replace(belief, limited=plant.get("limited", belief.limited))
    craft = belief.with_coefficients(_numbers("plant.coefficients", plant.get("coefficients", {})))
    craft = craft.with_effects(model_from_table({"effects": plant.get("effects", {})}).effects)
    start = _numbers("plant.start", plant.get("start", {}))
    check_keys("state in plant.start", start, STATES)
    closed = "controller" in content
    _check_sections(content, closed=closed)
    scenario = Scenario(
        name=path.stem,
        title=head.get("title", path.stem),
        source=head.get("source", ""),
        step=float(head["step"]),
        plant=craft,
        belief=belief,
        start=start,
        phases=_phases(content, craft),
        reference=_reference(content),
        guidance=_kind(content, "guidance", GUIDANCE) if "guidance" in content else None,
        controller=_controller(content) if closed else None,
        actuation=_section(content, "actuation", ACTUATION) if "actuation" in content else {},
        body=_body(content),
        estimator=_estimator(content, belief),
        commands=_commands(content) if not closed else None,
        sampling=_sampling(content),
        autopilot=autopilot_section(path.parent, _section(content, "autopilot", AUTOPILOT_KEYS))
        if "autopilot" in content
        else None,
        metrics=_metrics(content),
    )
    _check_adaptation(scenario)
    return scenario


def _check_sections(content: dict[str, Any], *, closed: bool) -> None:
    """Raise if sections are missing, or exclude each other."""
    if closed == ("commands" in content):
        raise InputError("expected either [controller] with [reference], or [commands]")
    law = closed and "kind" in table("controller", content["controller"])
    if closed and not law and "reference" not in content:
        raise InputError("[controller] needs a [reference]")
    for section in ("body", "guidance", "actuation", "autopilot"):
        if section in content and not law:
            raise InputError(f"[{section}] needs a [controller] with a kind: one of {', '.join(LAWS)}")
    for section in ("reference", "estimator"):
        if section in content and law:
            raise InputError(
                f"[{section}] is not used by controller.kind = {content['controller']['kind']!r}"
            )
    for section in ("sampling", "actuation"):
        if section in content and "autopilot" in content:
            raise InputError(f"[{section}] and [autopilot] exclude each other: the autopilot has its own")


def _check_adaptation(scenario: Scenario) -> None:
    """Raise if the controller adapts what no estimator estimates."""
    adapt = (scenario.controller or {}).get("adapt", [])
    if adapt and scenario.estimator is None:
        raise InputError("controller.adapt needs an [estimator]")
    for name in adapt:
        if name not in (scenario.estimator or {}).get("estimate", [name]):
            raise InputError(f"controller.adapt: {name!r} is not in estimator.estimate")


def _controller(content: Mapping[str, Any]) -> dict[str, Any]:
    if "kind" in table("controller", content["controller"]):
        return _kind(content, "controller", LAWS)
    return _section(content, "controller", CONTROLLER)


def _kind(
    content: Mapping[str, Any], section: str, makers: Mapping[str, Callable[..., Any]]
) -> dict[str, Any]:
    """Return a section whose ``kind`` names a function and whose other keys are its arguments, numbers."""
    given = table(section, content[section])
    kind = text(f"{section}.kind", given.get("kind"))
    check_known(kind, makers, f"{section}.kind: unknown {kind!r}")
    kinds, required = arguments(makers[kind], ("body", "name", "period"))
    return _check(section, given, {"kind": str, **dict.fromkeys(kinds, float)}, required)


def _body(content: Mapping[str, Any]) -> Body:
    if "body" not in content:
        return HOVERDEMON_BODY
    return as_user(Body, **_section(content, "body", BODY, tuple(BODY)))


def _estimator(content: Mapping[str, Any], belief: Model) -> dict[str, Any] | None:
    if "estimator" not in content:
        return None
    given = _section(content, "estimator", ESTIMATOR)
    if "start" in given and "sampling" not in content:
        raise InputError("estimator.start needs a [sampling]: a continuous estimator runs from 0 on")
    for key in ("R", "Q", "P0"):
        value = given.get(key, 0.0)
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, bool) or not isinstance(one, int | float):
                raise InputError(f"estimator.{key} must be a number or a list of numbers, found {value!r}")
    if "first" in given:
        given["first"] = _numbers("estimator.first", given["first"])
        check_keys("coefficient in estimator.first", given["first"], belief.coefficients())
    return given


def _model(path: Path, plant: Mapping[str, Any]) -> Model:
    if ("vehicle" in plant) == ("model" in plant):
        raise InputError("[plant] needs either vehicle = NAME or model = FILE")
    return vehicle(plant["vehicle"]) if "vehicle" in plant else load_model(path.parent / plant["model"])


def _phases(content: Mapping[str, Any], craft: Model) -> tuple[Phase, ...]:
    phases: list[Phase] = []
    for k, entry in enumerate(_entries(content, "phase", required=True)):
        where = f"phase {k + 1}"
        given = _check(where, entry, PHASE, ("until",))
        scale = _numbers(f"{where}.scale", given.get("scale", {}))
        for name in scale:
            check_known(name, craft.coefficients(), f"{where}.scale: unknown coefficient {name!r}")
        before = phases[-1].until if phases else 0.0
        if not before < given["until"] < math.inf:
            raise InputError(f"{where}: until = {given['until']:g} must be later than {before:g}")
        share = float(given.get("adaptation", 0.0))
        if not 0 <= share <= 1:
            raise InputError(f"{where}: adaptation = {share:g} is out of [0, 1]")
        told = _numbers(f"{where}.set", given.get("set", {}))
        phases.append(Phase(given.get("name", where), float(given["until"]), scale, share, told))
    return tuple(phases)


def _metrics(content: Mapping[str, Any]) -> tuple[Metric, ...]:
    metrics = []
    for k, entry in enumerate(_entries(content, "metric")):
        g = _check(f"metric {k + 1}", entry, METRIC, METRIC_NEEDS)
        statistic = g.get("statistic", "mean")
        check_known(statistic, STATISTICS, f"metric {k + 1}: unknown statistic {statistic!r}")
        for key in NEEDS.get(statistic, ()):
            if key not in g:
                raise InputError(f"metric {k + 1}: {key!r} is missing for statistic = {statistic!r}")
        keys = ("low", "high", "unit", "paper", "statistic", "target", "within")
        rest = {key: g[key] for key in keys if key in g}
        metrics.append(Metric(g["name"], g["of"], float(g["from"]), float(g["to"]), **rest))
    return tuple(metrics)


def _reference(content: Mapping[str, Any]) -> dict[str, Any] | None:
    if "reference" not in content:
        return None
    given = dict(table("reference", content["reference"]))
    kind = text("reference.kind", given.get("kind"))
    check_known(kind, REFERENCES, f"reference.kind: unknown {kind!r}")
    accepted, required = arguments(REFERENCES[kind], ("name",))
    check_keys("key in [reference]", given, ("kind", *accepted))
    for key in required:
        if key not in given:
            raise InputError(f"reference: {key!r} is missing for kind = {kind!r}")
    own = {key: value for key, value in given.items() if key != "kind"}
    as_user(REFERENCES[kind], **own)  # refuses wrong values
    return given


def _sampling(content: Mapping[str, Any]) -> Sampling | None:
    if "sampling" not in content:
        return None
    given = _section(content, "sampling", SAMPLING, required=("measurement",))
    if "poor_view" in given:
        given["poor_view"] = _check("sampling.poor_view", given["poor_view"], POOR_VIEW, ())
    given.setdefault("command", given["measurement"])
    for key in ("measurement", "command", "log"):
        positive(f"sampling.{key}", given.get(key, given["measurement"]))
    for key in ("position_noise", "heading_noise", "velocity_noise", "rate_noise"):
        if not 0 <= given.get(key, 0.0) < math.inf:
            raise InputError(f"sampling.{key} must not be negative, found {given[key]!r}")
    if given.get("seed", 0) < 0:
        raise InputError(f"sampling.seed must not be negative, found {given['seed']}")
    return Sampling(**given)


def _commands(content: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    given = table("commands", content["commands"])
    if "time" not in given:
        raise InputError("commands: 'time' is missing")
    columns = {}
    for name, values in given.items():
        numbers = values if isinstance(values, list) else [values]
        columns[name] = tuple(number(f"commands.{name}", v) for v in numbers)
    time = columns["time"]
    for name, column in columns.items():
        if len(column) != len(time):
            raise InputError(
                f"commands.{name}: expected {len(time)} values as in commands.time, found {len(column)}"
            )
    if time[:1] != (0.0,) or any(b <= a for a, b in itertools.pairwise(time)):
        raise InputError("commands.time must begin with 0 and increase")
    return columns


def _entries(content: Mapping[str, Any], name: str, required: bool = False) -> list[Mapping[str, Any]]:
    entries = content.get(name, [])
    if not isinstance(entries, list) or (required and not entries):
        raise InputError(f"expected one or more [[{name}]] sections")
    return [table(f"{name} {k + 1}", entry) for k, entry in enumerate(entries)]


def _section(
    content: Mapping[str, Any], name: str, kinds: Mapping[str, type], required: tuple[str, ...] = ()
) -> dict[str, Any]:
    if name not in content:
        raise InputError(f"the section [{name}] is missing")
    return _check(name, table(name, content[name]), kinds, required)


def _numbers(where: str, entries: Any) -> dict[str, float]:
    return {key: number(f"{where}.{key}", value) for key, value in table(where, entries).items()}


def _check(
    where: str, given: Mapping[str, Any], kinds: Mapping[str, type], required: tuple[str, ...]
) -> dict[str, Any]:
    check_keys(f"key in {where}", given, kinds)
    for key in required:
        if key not in given:
            raise InputError(f"{where}: {key!r} is missing")
    for key, value in given.items():
        kind = kinds[key]
        if kind is float:
            number(f"{where}.{key}", value)
        elif kind is list:
            if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
                raise InputError(f"{where}.{key} must be a list of text, found {value!r}")
        elif not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
            raise InputError(f"{where}.{key} must be a {kind.__name__}, found {value!r}")
    return dict(given)
