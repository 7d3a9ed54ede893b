"""The Blocks of a scenario's loop, by their role."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hovercontrol.base.boundary import as_user, checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.k06 import (
    bang_bang_heading,
    both_ways,
    drive,
    force_to_command,
    forward,
    forward_alternate,
    origin,
    proportional_heading,
    reverse,
    setpoints,
    stop,
    turn,
)
from hovercontrol.control.controllers.k06.heading import TICK
from hovercontrol.control.controllers.references import REFERENCES
from hovercontrol.control.observers import kalman_bucy, sampled_estimator
from hovercontrol.documents.scenarios.definition import Phase, Scenario

#: What ``controller.kind`` may be; without a kind it is the tracking controller.
LAWS: dict[str, Callable[..., Block]] = {
    "stop": stop,
    "forward": forward,
    "forward_alternate": forward_alternate,
    "reverse": reverse,
    "turn": turn,
    "drive": drive,
    "both_ways": both_ways,
}

#: Values of ``guidance.kind``: sampled Blocks that send set points to a law.
GUIDANCE: dict[str, Callable[..., Block]] = {
    "heading_bang_bang": bang_bang_heading,
    "heading_proportional": proportional_heading,
    "origin": origin,
}


@checked
def loop_parts(scenario: Scenario) -> dict[str, Block]:
    """Return the Blocks of a scenario's loop by role.

    Roles are plant; for the tracking controller reference, controller, estimator; for one of K06's laws
    reference (its set points), guidance, controller, actuation.

    Parameters
    ----------
    scenario : Scenario

    Raises
    ------
    InputError
        If the parts cannot be connected.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> list(loop_parts(load_scenario("table1")))
    ['plant', 'reference', 'controller', 'estimator']
    """
    parts = {"plant": scenario.plant.plant().with_values(scenario.start)}
    if scenario.controller is None:
        return parts
    if scenario.tracks:
        return parts | _tracking_parts(scenario)
    given = dict(scenario.controller)
    law = {"controller": as_user(LAWS[given.pop("kind")], body=scenario.body, **given)}
    if scenario.guidance is not None:
        given = dict(scenario.guidance)
        if scenario.sampling is None and scenario.autopilot is None:
            raise InputError(
                "[guidance] is sampled: expected a [sampling] section, whose commands set its period"
            )
        period = TICK if scenario.sampling is None else scenario.sampling.command
        tick = {"body": scenario.body, "period": period}
        law = {"guidance": as_user(GUIDANCE[given.pop("kind")], **tick, **given), **law}
        _check_told(law["guidance"], law["controller"], scenario.controller["kind"])
    reference = setpoints(law.values())
    if reference.outputs:
        parts["reference"] = reference
    return parts | law | {"actuation": as_user(force_to_command, **scenario.actuation)}


def _check_told(guidance: Block, law: Block, kind: str) -> None:
    """Raise if an output of the guidance may exceed the bounds of a law."""
    takes = {s.name: s for s in law.inputs}
    for s in guidance.outputs:
        if s.name in takes and s.lower < takes[s.name].lower:
            raise InputError(
                f"[guidance] may send {s.name} down to {s.lower:g} {s.unit}, controller.kind = {kind!r} "
                f"takes {takes[s.name].lower:g} at least: both_ways takes both signs"
            )


def _tracking_parts(scenario: Scenario) -> dict[str, Block]:
    assert scenario.controller is not None and scenario.reference is not None
    reference: dict[str, Any] = dict(scenario.reference)
    parts = {"reference": as_user(REFERENCES[reference.pop("kind")], **reference)}
    parts["controller"] = as_user(tracking_controller, scenario.belief, **scenario.controller)
    if scenario.estimator is not None:
        given = dict(scenario.estimator)
        first = {f"plant.{name}": value for name, value in given.pop("first", {}).items()}
        belief = scenario.belief.plant().with_values({**scenario.start, **first})
        parts["estimator"] = (
            as_user(kalman_bucy, belief, **given)
            if scenario.sampling is None
            else as_user(sampled_estimator, belief, period=scenario.sampling.measurement, **given)
        )
    return parts


@checked
def phase_parameters(scenario: Scenario, phase: Phase) -> dict[str, float]:
    """Return the parameters of a phase, by key.

    Parameters
    ----------
    scenario : Scenario
    phase : Phase
        One of its phases.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> scenario = load_scenario("table1")
    >>> len(phase_parameters(scenario, scenario.phases[1]))
    7
    """
    own = scenario.plant.coefficients()
    params = {f"plant.{name}": factor * own[name] for name, factor in phase.scale.items()}
    if scenario.controller is not None and scenario.controller.get("adapt"):
        params["controller.adaptation"] = phase.adaptation
    return params | {f"reference.{name}": value for name, value in phase.setpoints.items()}
