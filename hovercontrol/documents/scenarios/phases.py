"""Compiled simulation of a loop through the phases of a scenario; parameters change between phases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.friction import Friction
from hovercontrol.documents.scenarios.definition import Phase, Scenario

#: Times that differ by less are the same [s].
SAME = 1e-9

#: A phase of a loop that ticks ends this much early [s]: the ticks of that time belong to the next one.
EARLY = 1e-6


@checked
def phase_grid(begin: float, end: float, step: float) -> Array:
    """Return times from begin to end, both included, on multiples of the step.

    Parameters
    ----------
    begin, end, step : float
        [s]

    Returns
    -------
    ndarray, shape (n,)
        [s]

    Examples
    --------
    >>> phase_grid(0.0, 0.5, 0.2).round(9).tolist()
    [0.0, 0.2, 0.4, 0.5]
    """
    first, last = int(np.floor(begin / step + SAME)) + 1, int(np.ceil(end / step - SAME))
    return np.concatenate([[begin], step * np.arange(first, last), [end]])


def through_phases(
    scenario: Scenario,
    loop: Block,
    parameters: Callable[[Scenario, Phase], Mapping[str, float]],
    *,
    step: float | None = None,
    friction: Friction = "smooth",
    progress: Callable[[float], None] | None = None,
) -> dict[str, Array]:
    """Return time and outputs of a loop through a scenario's phases.

    Parameters
    ----------
    scenario : Scenario
        Its commands, if any, are the loop's inputs.
    parameters : callable
        Parameters of a phase, by key.
    step : float, optional
        Time between rows [s]; default: that of the scenario. The end of a phase is a row, too.
    friction : {"events", "smooth"}, optional
    progress : callable, optional
        Called with the simulated time.
    """
    compiled = loop.compile(friction=friction)
    state = np.array([s.start for s in loop.states])
    pieces: list[dict[str, Array]] = []
    step = scenario.step if step is None else step
    begin = 0.0
    for phase in scenario.phases:
        last = phase is scenario.phases[-1]
        end = phase.until if last else phase.until - EARLY
        rows = phase_grid(begin, end, step)
        played = () if scenario.commands is None else scenario.commands["time"]
        time = np.array(sorted({*rows.tolist(), *(t for t in played if begin < t < end)}))
        response = compiled.simulate(
            time, held_commands(scenario, time), x0=state, params=parameters(scenario, phase)
        )
        state = np.atleast_2d(np.asarray(response.states))[:, -1]
        shown = np.isin(time, rows)
        shown[-1] &= last  # the next phase shows it
        if len(rows) > 1 and rows[1] - begin < 2 * EARLY:
            shown[0] = False  # a row of its own follows at once
        outputs, given = (np.atleast_2d(np.asarray(part)) for part in (response.outputs, response.inputs))
        piece = dict(zip(response.output_labels, outputs[:, shown], strict=True))
        if loop.inputs:
            piece |= dict(zip(response.input_labels, given[:, shown], strict=True))
        pieces.append({"time": time[shown], **piece})
        begin = end
        if progress is not None:
            progress(end)
    return {key: np.concatenate([p[key] for p in pieces]) for key in pieces[0]}


def held_commands(scenario: Scenario, time: Array) -> dict[str, Array] | None:
    """Return the commands of a scenario at given times; None if it has none."""
    if scenario.commands is None:
        return None
    return held(scenario.commands, time)


def held(commands: Mapping[str, Sequence[float]], time: Array) -> dict[str, Array]:
    """Return commands at given times [s], held from row to row."""
    times = np.array(commands["time"])
    row = np.searchsorted(times, time + SAME, side="right") - 1
    return {k: np.array(v)[row] for k, v in commands.items() if k != "time"}
