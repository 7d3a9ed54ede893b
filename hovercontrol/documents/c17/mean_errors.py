"""Mean tracking errors of a sampled scenario, computed while it is simulated, over many runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.documents.scenarios import Scenario
from hovercontrol.documents.scenarios.definition import Metric
from hovercontrol.documents.scenarios.grid import swept_phases
from hovercontrol.documents.scenarios.parts import loop_parts
from hovercontrol.documents.scenarios.sampling import sampled_loop


def mean_errors(scenario: Scenario, given: Mapping[str, ArrayLike]) -> Array:
    """Return the mean tracking errors of a sampled scenario's windows, over many runs.

    Parameters
    ----------
    scenario : Scenario
        Sampled, with a tracking controller; its windows are those of the metrics that are means of
        ``tracking_error``.
    given : mapping of str to array_like
        Parameters by key (``sensor.seed``) and states to start from
        (``computer.estimator.last_P[3,3]``): values that broadcast to one shape.

    Returns
    -------
    ndarray, shape (..., n_windows)
        [m]; NaN where a run failed.

    Raises
    ------
    InputError
        If there are no such metrics, or a name is unknown.
    """
    windows = [m for m in scenario.metrics if m.of == "tracking_error" and m.statistic == "mean"]
    if scenario.sampling is None or not windows:
        raise InputError(f"{scenario.name}: expected a sampled scenario with means of tracking_error")
    loop = sampled_loop(scenario, loop_parts(scenario))
    whole = interconnect(
        [loop, _means(windows)], "watched", outputs=[f"mean_{k}" for k in range(len(windows))]
    )
    shape = np.broadcast_shapes(*(np.shape(v) for v in given.values()))
    full = {_own(whole, k): np.broadcast_to(v, shape).ravel().astype(float) for k, v in given.items()}
    found = swept_phases(scenario, whole, full)
    return found.final.reshape(*shape, len(windows))


def _own(loop: Block, name: str) -> str:
    """Return a name of the loop as the whole around it has it: states bear the loop's name in front."""
    return name if name in loop.default_parameters else f"loop.{name}"


def _means(windows: Sequence[Metric]) -> Block:
    """Return what integrates the tracking error over windows of time."""
    error = Signal("tracking_error", "m")
    means = [
        Signal(f"mean_{k}", "m", f"mean error from {w.start:g} to {w.end:g} s") for k, w in enumerate(windows)
    ]
    edges = [
        (
            Signal(f"from_{k}", "s", "start of the window", start=w.start),
            Signal(f"to_{k}", "s", "end of the window", start=w.end),
        )
        for k, w in enumerate(windows)
    ]
    return Block(
        "means",
        states=tuple(means),
        inputs=(error,),
        outputs=tuple(means),
        parameters=tuple(s for pair in edges for s in pair),
        derivatives={
            mean.name: sp.Piecewise(
                (error.symbol / (b.symbol - a.symbol), sp.And(time >= a.symbol, time < b.symbol)), (0, True)
            )
            for mean, (a, b) in zip(means, edges, strict=True)
        },
    )
