"""Running a scenario: the loop is wired, then simulated phase by phase."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.documents.scenarios.checks import check_scenario
from hovercontrol.documents.scenarios.definition import Scenario
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.phases import held_commands, phase_grid
from hovercontrol.documents.scenarios.result import Run

__all__ = ["loop_parts", "phase_grid", "phase_parameters", "run_scenario"]

Progress = Callable[[float], None]


@checked
def run_scenario(scenario: Scenario, progress: Progress | None = None) -> Run:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario
    progress : callable, optional
        Called from time to time with the simulated time [s].

    Returns
    -------
    Run
        Log with all signals, metrics and figures.

    Raises
    ------
    InputError
        If the parts cannot be connected, or the simulation fails; the message names the scenario.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> run = run_scenario(load_scenario("k06-stop"))
    >>> all(figure.met for figure in run.metrics())
    True
    """
    try:
        check_scenario(scenario)
        if scenario.sampling is not None:
            from hovercontrol.documents.scenarios.sampling import run_sampled

            return run_sampled(scenario, loop_parts(scenario), progress)
        if scenario.autopilot is not None:
            from hovercontrol.documents.scenarios.real import run_real

            return run_real(scenario, loop_parts(scenario), progress)
        return _run_continuous(scenario, progress)
    except InputError as error:
        raise type(error)(f"{scenario.file or scenario.name}: {error}") from None


def _run_continuous(scenario: Scenario, progress: Progress | None) -> Run:
    loop = interconnect([*loop_parts(scenario).values()], "loop")
    x = np.array([s.start for s in loop.states])
    pieces = []
    begin = 0.0
    for phase in scenario.phases:
        time = phase_grid(begin, phase.until, scenario.step)
        response = simulate(
            loop,
            time,
            held_commands(scenario, time),
            x,
            phase_parameters(scenario, phase),
            progress=progress,
        )
        columns = dict(zip(response.output_labels, np.atleast_2d(response.outputs), strict=True))
        if loop.inputs:
            columns |= dict(zip(response.input_labels, np.atleast_2d(response.inputs), strict=True))
        x = response.states[:, -1]
        last = len(time) if phase is scenario.phases[-1] else -1  # the next phase begins where this ends
        pieces.append({"time": time[:last]} | {k: v[:last] for k, v in columns.items()})
        begin = phase.until
    joined = {key: np.concatenate([p[key] for p in pieces]) for key in pieces[0]}
    return Run(scenario, joined.pop("time"), joined)
