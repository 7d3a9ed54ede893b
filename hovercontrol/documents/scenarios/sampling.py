"""A scenario's sampled loop as Blocks: a sensor, a computer, commands sent and held.

C17's experiment [C17 fig 10]: motion capture at 100 Hz measures the pose with noise, velocities are its
backward
differences; at each sample one computer takes it in, reads the reference at that time and computes the
commands; another sends the last of them to the craft every 22.5 ms, where they are held.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.craft.hardware.links import constant_delay
from hovercontrol.craft.hardware.sensors import mocap, noisy_motion, poor_view
from hovercontrol.craft.models.motion import MOTION
from hovercontrol.documents.scenarios.definition import Sampling, Scenario
from hovercontrol.documents.scenarios.parts import phase_parameters
from hovercontrol.documents.scenarios.phases import through_phases
from hovercontrol.documents.scenarios.result import Run

#: Where the control point is, as the controller tells what watches the true error.
AHEAD = Signal("point_ahead", "m", "control point ahead of the centre of mass")

_MOVES = {s.name for s in MOTION}


def sampled_loop(scenario: Scenario, parts: Mapping[str, Block], name: str = "loop") -> Block:
    """Return a sampled scenario's loop as one hybrid Block.

    Parameters
    ----------
    scenario : Scenario
        A scenario with a sampling.
    parts : mapping of str to Block
        By :func:`~hovercontrol.documents.scenarios.parts.loop_parts`.

    Returns
    -------
    Block
        Outputs: the true motion ``x ... r``, the measurements ``x_measured ... r_measured``, the acting
        commands; of a tracking loop also the reference, the true tracking error ``error_x, error_y`` and its
        distance ``tracking_error`` [m], the computed commands (``thrust_wanted``; ``thrust_asked`` without
        limits) and the estimates; of a law the signals between its parts. Without a controller the commands
        are inputs.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> from hovercontrol.documents.scenarios.parts import loop_parts
    >>> scenario = load_scenario("table2")
    >>> loop = sampled_loop(scenario, loop_parts(scenario))
    >>> sorted({tick.period for tick in loop.ticks})
    [0.01, 0.0225]
    """
    assert scenario.sampling is not None
    blocks = [*sampled_blocks(scenario, parts).values()]
    told = [s.name for block in blocks for s in block.outputs]
    shown = [n for n in told if n not in (AHEAD.name, "radio_age") and not n.endswith("_viewed")]
    return interconnect(blocks, name, outputs=shown, hybrid=True)


def run_sampled(
    scenario: Scenario, parts: Mapping[str, Block], progress: Callable[[float], None] | None = None
) -> Run:
    """Run a sampled scenario; see :func:`hovercontrol.documents.scenarios.runner.run_scenario`.

    In the log, ``x ... r`` are measured values and ``true_x ... true_r`` true ones.
    """
    assert scenario.sampling is not None
    loop = sampled_loop(scenario, parts)
    step = scenario.sampling.log or scenario.sampling.measurement
    found = through_phases(scenario, loop, phase_parameters, step=step, friction="smooth", progress=progress)
    time = found.pop("time")
    on_grid = np.abs(time / step - np.round(time / step)) < 1e-6  # phases may end between samples
    names = [s.name for s in MOTION]
    columns = {name: found.pop(f"{name}_measured") for name in names}
    columns |= {f"true_{name}": found.pop(name) for name in names}
    return Run(scenario, time[on_grid], {key: values[on_grid] for key, values in (columns | found).items()})


def sampled_blocks(scenario: Scenario, parts: Mapping[str, Block]) -> dict[str, Block]:
    """Return the Blocks of :func:`sampled_loop` by name; arguments as there."""
    assert scenario.sampling is not None
    blocks = [parts["plant"], *_sensors(scenario.sampling, parts["plant"])]
    if scenario.tracks:
        blocks += _tracking(scenario, parts)
    elif scenario.controller is not None:
        own = [block for role, block in parts.items() if role != "plant"]
        blocks.append(_ticking(interconnect(own, "law"), scenario.sampling.command))
    return {block.name: block for block in blocks}


def _sensors(sampling: Sampling, plant: Block) -> list[Block]:
    sensor = _sensor(sampling, plant)
    if sampling.poor_view is None:
        return [sensor]
    view = poor_view(**sampling.poor_view, period=sampling.measurement, seed=sampling.seed)
    return [view, rename(sensor, {s.name: f"{s.name}_viewed" for s in view.inputs})]


def _sensor(sampling: Sampling, plant: Block) -> Block:
    noise: dict[str, Any] = {
        "period": sampling.measurement,
        "position_noise": sampling.position_noise,
        "heading_noise": sampling.heading_noise,
        "seed": sampling.seed,
        "name": "sensor",
    }
    if sampling.velocity_noise is not None or sampling.rate_noise is not None:
        noise |= {"velocity_noise": sampling.velocity_noise or 0.0, "rate_noise": sampling.rate_noise or 0.0}
        return noisy_motion(**noise)
    start = {s.name: s.start for s in plant.states}
    return mocap(**noise, first_velocity=[start[s.name] for s in MOTION[3:]])


def _ticking(block: Block, period: float) -> Block:
    """Return a sampled version of a Block that uses the measured motion."""
    seen = {s.name: f"{s.name}_measured" for s in block.inputs if s.name in _MOVES}
    return rename(replace(block, period=period), seen)


def _tracking(scenario: Scenario, parts: Mapping[str, Block]) -> list[Block]:
    """Return reference, computer, radio and the Block of the true error."""
    assert scenario.sampling is not None and scenario.controller is not None
    sampling, controller = scenario.sampling, parts["controller"]
    commands = [s for s in controller.outputs if s.name in {i.name for i in parts["plant"].inputs}]
    wanted = {s.name: f"{s.name}_wanted" for s in commands}
    free = tracking_controller(scenario.belief, **{**scenario.controller, "limits": False})
    asked = {f"{s.name}_asked": free.output_expressions[s.name] for s in commands}
    told = [s.replace(name=f"{s.name}_asked", lower=-float("inf"), upper=float("inf")) for s in commands]
    ahead = next(p for p in controller.parameters if p.name == "control_point")
    computing = [
        rename(
            replace(
                controller,
                outputs=(*controller.outputs, *told, AHEAD),
                output_expressions={**controller.output_expressions, **asked, AHEAD.name: ahead.symbol},
            ),
            {**wanted, "error_x": "error_x_measured", "error_y": "error_y_measured"},
        )
    ]
    if "estimator" in parts:
        estimator = parts["estimator"]
        known = {s.name for s in estimator.inputs}
        computing.append(rename(estimator, {k: v for k, v in wanted.items() if k in known}))
    computer = _ticking(interconnect(computing, "computer"), sampling.measurement)
    link = constant_delay(commands, 0.0, sampling.command, suffix="_sent", name="radio")
    link = rename(link, {**wanted, **{f"{s.name}_sent": s.name for s in commands}})
    return [parts["reference"], computer, link, _watch(controller, ahead)]


def _watch(controller: Block, ahead: Signal) -> Block:
    """Return a Block with the true tracking error, by the controller's own equations."""
    errors = {
        key: controller.definitions[key].xreplace({ahead.symbol: AHEAD.symbol})
        for key in ("error_x", "error_y")
    }
    used = set().union(*(e.free_symbols for e in errors.values()))
    outputs = [s for s in controller.outputs if s.name in errors]
    x, y = (s.symbol for s in outputs)
    return Block(
        "watch",
        inputs=tuple(s for s in (*controller.inputs, AHEAD) if s.symbol in used),
        outputs=(*outputs, Signal("tracking_error", "m", "distance of the control point from the reference")),
        definitions=errors,
        output_expressions={"tracking_error": sp.sqrt(x**2 + y**2)},
    )
