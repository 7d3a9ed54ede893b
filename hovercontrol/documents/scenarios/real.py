"""K06's real loop beside the ideal one, from the same start (figure 6.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.autopilot import autopilot, beside_ideal, nearest_heading
from hovercontrol.control.autopilot.limits import lossy_tables
from hovercontrol.control.autopilot.loop import autopilot_parts
from hovercontrol.craft.hardware.actuators import actuators, pitch_lookup, pitch_servo, pitch_thrust
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.documents.scenarios.definition import Phase, Scenario
from hovercontrol.documents.scenarios.parts import phase_parameters
from hovercontrol.documents.scenarios.phases import through_phases
from hovercontrol.documents.scenarios.result import Run


def real_loop(scenario: Scenario, parts: Mapping[str, Block]) -> Block:
    """Return a scenario's real loop beside the ideal one, its imperfections as parameters.

    Parameters
    ----------
    scenario : Scenario
        A scenario with an autopilot.
    parts : mapping of str to Block
        By :func:`~hovercontrol.documents.scenarios.parts.loop_parts`.
    """
    parts = _same_guidance(parts)
    real = autopilot(parts["controller"], **_arguments(scenario, parts))
    return beside_ideal(real, interconnect([*parts.values()], "loop"), body=scenario.body)


def real_parts(scenario: Scenario, parts: Mapping[str, Block]) -> dict[str, Block]:
    """Return the Blocks of the real loop by name, and the parts of composed ones.

    Arguments as for :func:`real_loop`.
    """
    given = scenario.autopilot
    assert given is not None
    parts = _same_guidance(parts)
    joined = autopilot_parts(parts["controller"], **_arguments(scenario, parts))
    single = actuators(tables=given.tables or lossy_tables(given.rudder_loss), servo=given.servo)
    blocks = [*single.sampled, single.body]
    if given.propeller is not None:
        made = replace(given.propeller, rudder_loss=given.rudder_loss)
        fan = ("thrust_lookup", "speed_controller", "actuators")
        blocks = [block for block in blocks if block.name not in fan]
        blocks += [pitch_lookup(made), pitch_servo(lag=made.lag), pitch_thrust(made)]
    return {block.name: block for block in (*blocks, *joined)}


def _same_guidance(parts: Mapping[str, Block]) -> dict[str, Block]:
    """Return the parts with the same guidance for both loops, as in K06."""
    if "guidance" not in parts:
        return dict(parts)
    return {**parts, "guidance": nearest_heading(parts["guidance"])}


def _arguments(scenario: Scenario, parts: Mapping[str, Block]) -> dict[str, Any]:
    given = scenario.autopilot
    assert given is not None
    return {
        "guidance": parts.get("guidance"),
        "plant": scenario.plant.plant(),
        "start": scenario.start,
        "navigation": given.navigation,
        "beacons": given.beacons,
        "tables": given.tables,
        "servo": given.servo,
        "propeller": given.propeller,
        "rudder_loss": given.rudder_loss,
        "imperfections": given.imperfections,
        "seed": given.seed,
    }


def real_parameters(scenario: Scenario, phase: Phase) -> dict[str, float]:
    """Return the parameters of both loops in a phase, by key."""
    own = phase_parameters(scenario, phase)
    return own | {f"ideal.{key}": value for key, value in own.items()}


def run_real(
    scenario: Scenario, parts: Mapping[str, Block], progress: Callable[[float], None] | None = None
) -> Run:
    """Run the real and the ideal loop; see :func:`hovercontrol.documents.scenarios.runner.run_scenario`.

    The log is that of the navigation: ``x ... r`` are its estimates, ``true_x ... true_r`` the truth,
    ``u_seen`` ... the values received by the law, ``thrust`` and ``rudder`` the acting commands by the
    calibration tables;
    ``ideal_x ... ideal_r`` are those of the ideal loop.
    """
    loop = real_loop(scenario, parts)
    columns = through_phases(scenario, loop, real_parameters, progress=progress)
    names = [s.name for s in MOTION]
    log = {"time": columns.pop("time")}
    log |= {name: columns.pop(f"{name}_hat") for name in names}
    log |= {f"true_{name}": columns.pop(name) for name in names}
    if "heading_ref" in columns:
        off = log["true_psi"] - columns["heading_ref"]
        log["true_heading_error"] = np.arctan2(np.sin(off), np.cos(off))
    log |= columns
    return Run(scenario, log.pop("time"), log)
