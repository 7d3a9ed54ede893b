"""A trial of the real loop repeated with many seeds: outputs and metrics."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.control.autopilot import seeds
from hovercontrol.documents.scenarios import Scenario
from hovercontrol.documents.scenarios.definition import Autopilot
from hovercontrol.documents.scenarios.measures import measure
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.real import real_loop


def run_trial(
    scenario: Scenario, *, runs: int = 20, progress: Callable[[float], None] | None = None
) -> tuple[Array, dict[str, Array]]:
    """Run a trial's real loop, beside the ideal one, with the seeds from 1 on, compiled.

    Parameters
    ----------
    scenario : Scenario
        With an autopilot and one phase.
    runs : int, optional
        Number of seeds.
    progress : callable, optional
        Called with the share that is done.

    Returns
    -------
    time : ndarray, shape (n,)
        [s]
    outputs : dict of str to ndarray, shape (runs, n)
        True motion ``x ... r``, that of the ideal loop ``ideal_x`` ..., and the loop's other outputs;
        ``heading_error`` is that of the true heading, less whole turns.

    Raises
    ------
    InputError
        If the scenario has no autopilot or several phases, or there is no run.
    """
    need_trial("trials", scenario, runs, at_least=1)
    loop = real_loop(scenario, loop_parts(scenario))
    told = phase_parameters(scenario, scenario.phases[0])
    params = told | {f"ideal.{key}": value for key, value in told.items()}
    return run_seeds(scenario, loop, params, runs=runs, progress=progress)


def run_seeds(
    scenario: Scenario,
    loop: Block,
    params: Mapping[str, float],
    *,
    runs: int,
    progress: Callable[[float], None] | None = None,
) -> tuple[Array, dict[str, Array]]:
    """Run one real loop with the seeds from 1 on; result as of :func:`run_trial`.

    Parameters
    ----------
    scenario : Scenario
        Its length and step count.
    loop : Block
        By :func:`~hovercontrol.documents.scenarios.real.real_loop`; it is compiled once, however often it is
        run.
    params : mapping of str to float
    runs, progress
        As there.
    """
    compiled = loop.compile()
    time = scenario.step * np.arange(round(scenario.end / scenario.step) + 1, dtype=np.float64)
    rows = []
    for seed in range(1, runs + 1):
        own = {key: values[0] for key, values in seeds(loop, [seed]).items()}
        response = compiled.simulate(time, params=dict(params) | own, method="rk4", step=scenario.step)
        rows.append(np.asarray(response.outputs))
        if progress is not None:
            progress(seed / runs)
    outputs = dict(zip(response.output_labels, np.stack(rows, axis=1), strict=True))
    if "heading_ref" in outputs:
        off = outputs["psi"] - outputs["heading_ref"]
        outputs["heading_error"] = np.arctan2(np.sin(off), np.cos(off))
    return time, outputs


def need_trial(analysis: str, scenario: Scenario, runs: int, *, at_least: int) -> Autopilot:
    """Return a trial's autopilot; raise :class:`InputError` without one, or with too few runs."""
    if scenario.autopilot is None or len(scenario.phases) != 1:
        raise InputError(
            f"{analysis}: {scenario.name!r} is no trial of the real loop: k06-real-stop and so on are"
        )
    if runs < at_least:
        raise InputError(f"{analysis}: runs must be at least {at_least}, found {runs}")
    return scenario.autopilot


def trial_metrics(
    scenario: Scenario, *, runs: int = 20, progress: Callable[[float], None] | None = None
) -> dict[str, Array]:
    """Return the values of a trial's metrics by name, shape (runs,): one value for each seed.

    Parameters and errors are those of :func:`run_trial`.
    """
    time, outputs = run_trial(scenario, runs=runs, progress=progress)
    return {
        metric.name: np.array([measure(metric, time, values) for values in outputs[metric.of]])
        for metric in scenario.metrics
    }
