"""A loop through the phases of a scenario, in machine code: parameters change exactly where a phase ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.scenarios.definition import Phase, Scenario
from hovercontrol.targets.compiled import Friction

Array = NDArray[np.float64]

#: Times that differ by less are the same [s].
SAME = 1e-9


def phase_grid(begin: float, end: float, step: float) -> Array:
    """Return times from begin to end, both included, on multiples of the step."""
    first, last = int(np.floor(begin / step + SAME)) + 1, int(np.ceil(end / step - SAME))
    return np.array([begin, *(step * k for k in range(first, last)), end])


def through_phases(
    scenario: Scenario,
    loop: Block,
    parameters: Callable[[Scenario, Phase], Mapping[str, float]],
    *,
    step: float | None = None,
    friction: Friction = "events",
    progress: Callable[[float], None] | None = None,
) -> dict[str, Array]:
    """Return time and outputs of a loop through a scenario's phases.

    Parameters
    ----------
    scenario : Scenario
        Its commands, if it plays any, are the loop's inputs.
    loop : Block
    parameters : callable
        Those that hold in a phase, by key.
    step : float, optional
        Of the rows [s]; default that of the scenario. There is a row at each end of a phase, too, if the loop
        has no commands to play.
    friction : {"events", "smooth"}, optional
    progress : callable, optional
        Called with the time reached.
    """
    compiled = loop.compile(friction=friction)
    state = np.array([s.start for s in loop.states])
    pieces: list[dict[str, Array]] = []
    begin = 0.0
    for phase in scenario.phases:
        rows = phase_grid(begin, phase.until, scenario.step if step is None else step)
        changes = _changes(scenario, begin, phase.until)
        time = np.array(sorted({*rows.tolist(), *changes}))
        inputs = held_commands(scenario, time)
        params = parameters(scenario, phase)
        response = compiled.simulate(time, inputs, x0=state, params=params)
        # The ticks at the end belong to the next phase, which has other parameters.
        if phase is not scenario.phases[-1]:
            for start, stop in pairwise([begin, *changes, phase.until]):
                u = _at(loop, held_commands(scenario, np.array([start])))
                state = compiled.advance(start, stop, state, u, params=params)
        shown = np.isin(time, rows)
        shown[-1] &= phase is scenario.phases[-1]
        outputs, given = (np.atleast_2d(np.asarray(rows)) for rows in (response.outputs, response.inputs))
        piece = dict(zip(response.output_labels, outputs[:, shown], strict=True))
        if loop.inputs:
            piece |= dict(zip(response.input_labels, given[:, shown], strict=True))
        pieces.append({"time": time[shown], **piece})
        begin = phase.until
        if progress is not None:
            progress(begin)
    return {key: np.concatenate([p[key] for p in pieces]) for key in pieces[0]}


def held_commands(scenario: Scenario, time: Array) -> dict[str, Array] | None:
    """Return the commands that a scenario plays, as they are held at some times; None if it plays none."""
    if scenario.commands is None:
        return None
    times = np.array(scenario.commands["time"])
    row = np.searchsorted(times, time + SAME, side="right") - 1
    return {k: np.array(v)[row] for k, v in scenario.commands.items() if k != "time"}


def _changes(scenario: Scenario, begin: float, end: float) -> list[float]:
    """Return when commands change between two times, both excluded."""
    times = () if scenario.commands is None else scenario.commands["time"]
    return [t for t in times if begin + SAME < t < end - SAME]


def _at(loop: Block, inputs: Mapping[str, Array] | None) -> list[float]:
    given = inputs or {}
    return [float(given[s.name][0]) if s.name in given else s.start for s in loop.inputs]
