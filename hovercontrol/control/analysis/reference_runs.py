"""Runs of a craft along references, with an estimator beside the loop: its covariance at the end."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.loops import tracking_loop
from hovercontrol.control.analysis.regions import refuse_large
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.control.observers.regression import regression
from hovercontrol.craft.models.model import Model


@dataclass(frozen=True)
class RunCriteria:
    """When a craft counts as on its reference.

    No published source: set by hand, exercised by tests/documents/c17/test_experiment_design.py.

    Attributes
    ----------
    doubt : float
        Standard error of every coefficient before a run, in its SI unit: C17's coefficients are of about
        this size.
    settle : float
        Time to reach the reference before the run counts [s].
    off : float
        Largest distance from the reference [m].
    """

    doubt: float = 1.0
    settle: float = 15.0
    off: float = 0.01


#: The values in use.
RUNS = RunCriteria()


#: Runge-Kutta's steps of loop and loop with estimator, whose covariance falls fast at first [s].
STEP, FINE_STEP = 0.01, 0.002


#: Of runs with six coefficients on one core, per simulated second: for the estimate before a sweep.
SECONDS_PER_SIMULATED = 2e-3

COMMANDS = ("thrust", "rudder")


class ReferenceRuns:
    """A craft that knows its coefficients, and beside it an estimator that does not.

    Parameters
    ----------
    model : Model
    coefficients : sequence of str
        Those that are sought.
    duration : float
        From when the craft is on its reference [s].
    noise, disturbance : float
        Intensities of the noise of the measured velocities and of the disturbance of their rates.

    Raises
    ------
    InputError
        If a coefficient cannot be estimated or a number is out of range.
    """

    def __init__(
        self, model: Model, coefficients: Sequence[str], duration: float, noise: float, disturbance: float
    ) -> None:
        self.model, self.duration = model, positive("duration", duration)
        if not 0 <= number("disturbance", disturbance) < math.inf:
            raise InputError(f"disturbance must be 0 or more, found {disturbance!r}")
        sought = regression(model.plant(), coefficients)
        self.units = {name: c.unit for name, c in zip(sought.names, sought.coefficients, strict=True)}
        n, m = len(sought.states), len(sought.names)
        self._estimator = kalman_bucy(
            model.plant(),
            coefficients,
            R=positive("noise", noise),
            Q=[disturbance] * n + [0.0] * m,
            P0=[noise] * n + [RUNS.doubt**2] * m,
        )
        self._variances = [f"{self._estimator.name}.P[{k},{k}]" for k in range(n, n + m)]

    def loop(self, reference: Block, *, estimator: bool = True) -> Block:
        """Return the tracking loop, with the estimator beside it or without."""
        more = [self._estimator] if estimator else []
        return tracking_loop(self.model, reference, more=more, outputs=("tracking_error", *COMMANDS))

    @property
    def control_point(self) -> float:
        """Where the point that follows the reference is [m]."""
        return tracking_controller(self.model).default_parameters["controller.control_point"]

    def refuse_large(self, reference: Block, runs: int) -> None:
        """Refuse so many runs if they need too much time or memory; the line has the estimates."""
        refuse_large(self.loop(reference).compile(), runs, SECONDS_PER_SIMULATED * self.duration)

    def run(
        self,
        reference: Block,
        start: Mapping[str, ArrayLike],
        params: Mapping[str, ArrayLike],
        *,
        progress: Callable[[int], None] | None = None,
    ) -> tuple[Array, Array]:
        """Return standard errors (n, m) and least and largest thrust and rudder (n, 4) of many runs."""
        settled = self.loop(reference, estimator=False).compile(friction="smooth").sweep(
            [0.0, RUNS.settle], x0=start, params=params, method="rk4", step=STEP,
        )  # fmt: skip
        off = settled.status != 0
        there = np.where(off[:, None], 0.0, settled.states_final)
        run = self.loop(reference).compile(friction="smooth").sweep(
            RUNS.settle + np.linspace(0.0, self.duration, 1 + max(10, round(50 * self.duration))),
            x0=dict(zip(settled.states, there.T, strict=True)), params=params, method="rk4", step=FINE_STEP,
            progress=progress,
        )  # fmt: skip
        last = dict(zip(run.states, run.states_final.T, strict=True))
        variance = np.transpose([last[name] for name in self._variances])
        good = ~off & (run.status == 0) & (run["tracking_error"].maximum < RUNS.off)
        good &= (variance > 0).all(axis=1)
        ends = [getattr(run[name], end) for name in COMMANDS for end in ("minimum", "maximum")]
        keep = good[:, None]
        error = np.sqrt(np.where(keep, variance, np.nan))
        return error, np.where(keep, np.transpose(ends), np.nan)
