"""Which rudder arms and control points let C17's craft go nose-first, stern-first or spin away: both maps.

Theory is that of :mod:`.zero_dynamics`; simulation judges it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.analysis.loops import c17_ellipse, on_reference, tracking_loop
from hovercontrol.analysis.regions import Axis, Region, axis, mesh, refuse_large, subfolder, sweep_map
from hovercontrol.analysis.zero_dynamics import predict
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError
from hovercontrol.io.tables import number, positive
from hovercontrol.models.model import Model
from hovercontrol.models.vehicles import c17_simulation
from hovercontrol.targets.sweep import SweepResult

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotionCriteria:
    """How a simulated craft is judged.

    No published source: set by hand, exercised by tests/documents/c17/test_zero_dynamics.py.

    Attributes
    ----------
    runaway : float
        Yaw rate beyond which a craft spins away [rad/s]; a solver that fails counts as well.
    facing : float
        Mean cosine of the sideslip beyond which a craft moves bow first, or stern first below the
        negative.
    settled : float
        Largest change of the mean cosine in the last third of a run.
    """

    runaway: float = 30.0
    facing: float = 0.3
    settled: float = 0.3


#: The values in use.
MOTION = MotionCriteria()


#: Runge-Kutta's step [s]; a twentieth where theory and simulation disagree.
STEP = 0.005

#: Seconds that a run of 30 s takes on one core: for the estimate before a sweep.
SECONDS_PER_RUN = 2e-3


@checked
def arm_region(
    arm: tuple[float, float] = (-0.3, 0.3),
    control_point: tuple[float, float] = (-0.3, 0.3),
    points: int = 60,
    *,
    model: Model | None = None,
    mass: float = 0.585,
    inertia: float = 0.01,
    heading: float = 0.0,
    duration: float = 30.0,
    executor: Executor | None = None,
    checkpoint: str | Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> tuple[Region, Region]:
    """Return which arms and control points let the craft go nose-first, stern-first or spin away.

    Parameters
    ----------
    arm, control_point : tuple of float, optional
        Ranges [m].
    points : int, optional
        Along each axis.
    model, mass, inertia
        As for :func:`predict`.
    heading : float, optional
        Angle from the course to the heading at the start [rad]; default nose-first.
    duration : float, optional
        Of each simulation along C17's ellipse [s].
    executor : concurrent.futures.Executor, optional
        Where the simulations are done; default threads of this machine.
    checkpoint : path, optional
        Folder from which the same map resumes.
    progress : callable, optional
        Called now and then with the number of runs done.

    Returns
    -------
    Region
        Theory: maps ``nose``, ``stern``, ``bounded`` (24), ``printed``.
    Region
        Simulation, the judge: maps ``nose``, ``stern``, ``unsettled`` (on neither side, or still turning in
        the last third), ``bounded`` (does not spin away), with theory's ``theorem``.

    Raises
    ------
    InputError
        As for :func:`predict`, if a range is none, or the map is too large.

    Examples
    --------
    >>> theory, simulated = arm_region((0.1, 0.2), (0.1, 0.2), points=2, duration=5.0)
    >>> list(theory.maps), list(simulated.maps)
    (['nose', 'stern', 'bounded', 'printed'], ['nose', 'stern', 'unsettled', 'bounded', 'theorem'])
    """
    model = c17_simulation() if model is None else model
    x = axis("arm", "m", arm, points, "rudder arm a (negative: ahead of the centre of mass)")
    y = axis("control_point", "m", control_point, points, "control point delta_x")
    mass, inertia, duration = (
        positive("mass", mass),
        positive("inertia", inertia),
        positive("duration", duration),
    )
    if not math.isfinite(number("heading", heading)):
        raise InputError(f"heading must be finite, found {heading!r}")
    reference, gain = c17_ellipse(), model.coefficients()["thrust"] * mass / inertia
    loop = tracking_loop(model, reference).compile(friction="smooth")
    refuse_large(loop, points**2, SECONDS_PER_RUN)
    grid = mesh(x, y)
    theory = predict(*grid, model=model, mass=mass, inertia=inertia)

    def params(a: Array, dx: Array) -> dict[str, Array]:
        return {
            "plant.rudder_torque": gain * a,
            "controller.rudder_torque": gain * a,
            "controller.control_point": dx,
        }

    starts = [on_reference(reference, d, heading) for d in y.values]
    start = {name: np.repeat([s[name] for s in starts], points) for name in starts[0]}
    late = 2 / 3 * duration  # a start off the stable side may turn fast at first
    options: dict[str, Any] = {"x0": start, "start": late, "method": "rk4", "step": STEP}
    times = np.linspace(0.0, duration, 1 + max(2, round(10 * duration)))
    kept = subfolder(checkpoint, "all")
    runs = sweep_map(
        loop, x, y, params, times, executor=executor, checkpoint=kept, progress=progress, **options
    )
    bounded = _bounded(runs)
    doubtful = np.flatnonzero(theory.bounded & ~bounded)  # near a dx = J/m the loop is too fast for the step
    if doubtful.size:
        options |= {"x0": {name: v[doubtful] for name, v in start.items()}, "step": STEP / 20}
        fine, kept = params(*(g[doubtful] for g in grid)), subfolder(checkpoint, "doubtful")
        again = loop.sweep(times, params=fine, executor=executor, checkpoint=kept, **options)
        bounded[doubtful] = _bounded(again)
        for figure in ("final", "maximum", "minimum"):
            getattr(runs["facing"], figure)[doubtful] = getattr(again["facing"], figure)
    facing, moved = runs["facing"].final, runs["facing"].maximum - runs["facing"].minimum
    settled = bounded & (np.abs(facing) > MOTION.facing) & (moved <= MOTION.settled)
    shape = (points, points)
    lines = {"a dx = J/m: B of (21) has no inverse": _singular_line(x, y, inertia / mass)}
    predicted = {n: getattr(theory, n) for n in ("nose", "stern", "bounded", "printed")}
    judged = {
        "nose": settled & (facing > 0),
        "stern": settled & (facing < 0),
        "unsettled": bounded & ~settled,
        "bounded": bounded,
        "theorem": theory.bounded,
    }
    marks = {"C17 simulation": (0.14, 0.2)}
    labels = {
        "nose": "nose-first straight motion is stable",
        "stern": "stern-first straight motion is stable",
        "bounded": "Theorem 4, (24) corrected: yaw rate bounded",
        "printed": "Theorem 4, (24) as printed",
    }
    said = {
        "nose": "simulated: goes nose-first",
        "stern": "simulated: goes stern-first",
        "unsettled": "simulated: not settled on a side",
        "bounded": "simulated: does not spin away",
        "theorem": labels["bounded"],
    }
    return (
        Region(
            "C17 Theorem 4 and the linearisation",
            x,
            y,
            {n: v.reshape(shape) for n, v in predicted.items()},
            labels=labels,
            lines=lines,
            marks=marks,
        ),
        Region(
            f"C17: simulated {duration:g} s along the ellipse",
            x,
            y,
            {n: v.reshape(shape) for n, v in judged.items()},
            labels=said,
            lines=lines,
            marks=marks,
        ),
    )


def _bounded(runs: SweepResult) -> NDArray[np.bool_]:
    rate = np.maximum(runs["r"].maximum, -runs["r"].minimum)
    return (runs.status == 0) & (rate < MOTION.runaway)


def _singular_line(x: Axis, y: Axis, ratio: float) -> tuple[Array, Array]:
    """Return where a dx = J/m, both branches, within the axes."""
    a = np.linspace(x.values[0], x.values[-1], 801)
    with np.errstate(divide="ignore"):
        dx = ratio / a
    inside = (dx >= y.values[0]) & (dx <= y.values[-1])
    return np.where(inside, a, math.nan), np.where(inside, dx, math.nan)
