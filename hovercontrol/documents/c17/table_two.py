"""C17's Table II over what the paper does not print: initial covariance, noise, the craft's drag."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.core.block import Block
from hovercontrol.core.interconnect import interconnect
from hovercontrol.core.signals import Signal, time
from hovercontrol.errors import InputError
from hovercontrol.io.short_repr import short_repr
from hovercontrol.scenarios import Scenario, load_scenario
from hovercontrol.scenarios.definition import Metric
from hovercontrol.scenarios.parts import loop_parts
from hovercontrol.scenarios.sampling import sampled_loop
from hovercontrol.scenarios.varied import swept_phases

Array = NDArray[np.float64]

#: The error that the paper states with the estimator on [m].
PRINTED = 0.05


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


@dataclass(frozen=True, eq=False)
class TableTwo:
    """Mean tracking errors [m] of the three phases over what is not printed; see :func:`table_two`.

    Attributes
    ----------
    seeds : int
        Runs of each point, with different noise.
    P0 : ndarray, shape (p,)
        Initial variances of the coefficients.
    R : ndarray, shape (s,)
        Factors on the printed R.
    search : ndarray, shape (p, s, seeds)
        Error with the estimator on.
    position_noise, heading_noise : ndarray, shapes (n,), (h,)
        [m, rad]
    noise : ndarray, shape (n, h, seeds, 3)
    factor : ndarray, shape (f,)
        On the drag coefficients of the craft, c1 to c6.
    fitted : ndarray, shape (f, seeds, 2)
        Errors before the estimator, with the drag of both phases at that factor.
    estimated : ndarray, shape (2, p, seeds)
        Error with the estimator on, where it estimates all eight coefficients, and only c1 to c6.
    """

    seeds: int
    P0: Array
    R: Array
    search: Array
    position_noise: Array
    heading_noise: Array
    noise: Array
    factor: Array
    fitted: Array
    estimated: Array

    __repr__ = short_repr

    @property
    def least(self) -> float:
        """The least P0 tried that leaves the printed error with each seed, R as printed; NaN if none does."""
        met = (self.search[:, np.argmin(np.abs(self.R - 1.0))] < PRINTED).all(axis=-1)
        return float(self.P0[met][0]) if met.any() else float("nan")


def table_two(
    scenario: Scenario | None = None,
    *,
    P0: ArrayLike = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0),
    R: ArrayLike = (0.1, 1.0, 10.0),
    position_noise: ArrayLike = (0.0, 3e-4, 1e-3, 3e-3),
    heading_noise: ArrayLike = (0.0, 1e-3, 2e-3, 5e-3),
    factor: ArrayLike = (1.0, 1.05, 1.1, 1.13, 1.2, 1.25, 1.3),
    seeds: int = 4,
    progress: Callable[[float], None] | None = None,
) -> TableTwo:
    """Return how the three errors of C17's Table II depend on what the paper does not print.

    Parameters
    ----------
    scenario : Scenario, optional
        Default ``table2``.
    P0, R, position_noise, heading_noise, factor : array_like, optional
        What is tried; of P0 and R every pair, of the noises, too.
    seeds : int, optional
        Runs of each point, with different noise.
    progress : callable, optional
        Called with the share that is done.
    """
    scenario = load_scenario("table2") if scenario is None else scenario
    seed = np.arange(1.0, seeds + 1.0)
    p, r, pn, hn, f = (np.asarray(v, dtype=float) for v in (P0, R, position_noise, heading_noise, factor))
    report = progress or (lambda done: None)
    printed = (scenario.estimator or {})["R"]
    given: dict[str, Array] = {"sensor.seed": seed}
    given |= {f"estimator.R[{i},{i}]": r[:, None] * v for i, v in enumerate(printed)}
    search = mean_errors(scenario, given | _variances(p[:, None, None], 3, 11))[..., 2]
    report(0.4)
    noise = mean_errors(
        scenario,
        {
            "sensor.seed": seed,
            "sensor.position_noise": pn[:, None, None],
            "sensor.heading_noise": hn[:, None],
        },
    )
    report(0.7)
    fitted = np.array([mean_errors(_with_drag(scenario, v), {"sensor.seed": seed})[..., :2] for v in f])
    report(0.8)
    drag = list((scenario.controller or {})["adapt"])
    six = replace(scenario, estimator={**(scenario.estimator or {}), "estimate": drag})
    few = mean_errors(six, {"sensor.seed": seed} | _variances(p[:, None], 3, 9))[..., 2]
    return TableTwo(
        seeds, p, r, search, pn, hn, noise, f, fitted,
        np.array([search[:, np.argmin(np.abs(r - 1.0))], few]),
    )  # fmt: skip


def _variances(values: Array, first: int, last: int) -> dict[str, Array]:
    """Return the initial variances of the coefficients, by the estimator's states."""
    return {f"computer.estimator.last_P[{i},{i}]": values for i in range(first, last)}


def _with_drag(scenario: Scenario, factor: float) -> Scenario:
    phases = [replace(p, scale=dict.fromkeys(p.scale, factor)) for p in scenario.phases]
    return replace(scenario, phases=tuple(phases))
