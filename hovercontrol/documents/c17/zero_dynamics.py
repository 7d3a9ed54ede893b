"""C17 Theorem 4: with which rudder arm and control point the craft goes nose-first, stern-first or spins."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import finite, positive
from hovercontrol.blocks.backends.sweep import SweepResult
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference, tracking_loop
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.analysis.regions import Axis, Region, axis, mesh, refuse_large, sweep_map
from hovercontrol.control.analysis.zero_dynamics import predict, theorem_4_margin
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation
from hovercontrol.documents.printed import rebuilds


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


#: Labels of the predicted and of the simulated regions.
PREDICTED = {
    "nose": "nose-first straight motion is stable",
    "stern": "stern-first straight motion is stable",
    "bounded": "Theorem 4, (24) corrected: yaw rate bounded",
    "printed": "Theorem 4, (24) as printed",
}
SIMULATED = {
    "nose": "simulated: goes nose-first",
    "stern": "simulated: goes stern-first",
    "unsettled": "simulated: not settled on a side",
    "bounded": "simulated: does not spin away",
    "theorem": PREDICTED["bounded"],
}

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
    progress
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

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
    mass, inertia = positive("mass", mass), positive("inertia", inertia)
    duration = positive("duration", duration)
    finite("heading", heading)
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
    options: dict[str, Any] = {"start": late, "method": "rk4"}
    times = np.linspace(0.0, duration, 1 + max(2, round(10 * duration)))
    runs = sweep_map(loop, x, y, params, times, progress=progress, x0=start, step=STEP, **options)
    bounded = _bounded(runs)
    doubtful = np.flatnonzero(theory.bounded & ~bounded)  # near a dx = J/m the loop is too fast for the step
    if doubtful.size:
        fine = params(*(g[doubtful] for g in grid))
        x0 = {name: v[doubtful] for name, v in start.items()}
        again = loop.sweep(times, params=fine, x0=x0, step=STEP / 20, **options)
        bounded[doubtful] = _bounded(again)
        for figure in ("final", "maximum", "minimum"):
            getattr(runs["facing"], figure)[doubtful] = getattr(again["facing"], figure)
    facing, moved = runs["facing"].final, runs["facing"].maximum - runs["facing"].minimum
    settled = bounded & (np.abs(facing) > MOTION.facing) & (moved <= MOTION.settled)
    predicted = {n: getattr(theory, n) for n in ("nose", "stern", "bounded", "printed")}
    judged = {
        "nose": settled & (facing > 0),
        "stern": settled & (facing < 0),
        "unsettled": bounded & ~settled,
        "bounded": bounded,
        "theorem": theory.bounded,
    }
    drawn: dict[str, Any] = {
        "lines": {"a dx = J/m: B of (21) has no inverse": _singular_line(x, y, inertia / mass)},
        "marks": {"C17 simulation": (0.14, 0.2)},
    }
    predicted, judged = (
        {n: v.reshape(points, points) for n, v in found.items()} for found in (predicted, judged)
    )
    return (
        Region("C17 Theorem 4 and the linearisation", x, y, predicted, labels=PREDICTED, **drawn),
        Region(f"C17: simulated {duration:g} s along the ellipse", x, y, judged, labels=SIMULATED, **drawn),
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


#: Of C17's simulation [kg, kg m^2].
MASS, INERTIA = 0.585, 0.01

#: A rudder this near to the centre of mass hardly turns the craft [m].
NEAR = 0.02


def main(out: Path, progress: Progress = quiet, *, points: int = 120) -> list[Path]:
    """Draw theory beside simulation, over the rudder arm and the control point."""
    runs = points**2
    theory, judge = arm_region(
        points=points,
        mass=MASS,
        inertia=INERTIA,
        progress=lambda n: progress(n / runs),
    )
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    for region, axes in zip((theory, judge), figure.subplots(1, 2), strict=True):
        region.plot(axes=axes)
    arm, control_point = np.meshgrid(judge.x.values, judge.y.values)
    ahead = judge["nose"] & (arm > 0)
    beyond = (arm * control_point > INERTIA / MASS)[ahead].mean()
    printed = (theory["printed"] & ~judge["bounded"]).sum()
    findings = [
        f"{runs} closed loops of 30 s along the ellipse, started nose-first: {judge['nose'].mean():.1%} "
        f"settle nose-first, {judge['stern'].mean():.1%} stern-first, {judge['unsettled'].mean():.1%} on "
        f"neither side in that time ({_nearest(judge)}), {1 - judge['bounded'].mean():.1%} spin away.",
        f"(24) corrected: {len(judge.outside('theorem', 'bounded'))} simulated counter-examples; it covers "
        f"{judge.share('theorem', 'bounded'):.1%} of the bounded loops.",
        f"(24) as printed: {printed} simulated counter-examples.",
        f"The linearisation tells the side that the craft settles on in {_agreement(theory, judge):.1%} of "
        "the points that it calls stable.",
        f"With the rudder behind the centre of mass, {beyond:.1%} of the loops that go nose-first have "
        "a dx > J/m.",
    ]
    tables = {"c17_zero_dynamics_theory": theory.save, "c17_zero_dynamics_simulated": judge.save}
    return save(out, "c17_zero_dynamics", figure, tables, findings)


def _nearest(judge: Region) -> str:
    """Return where most of the loops are that have not settled."""
    arm = np.broadcast_to(np.abs(judge.x.values), judge["unsettled"].shape)
    near = (arm < NEAR)[judge["unsettled"]]
    return f"{near.mean():.0%} of these at |a| < {NEAR:g} m, where the rudder hardly turns the craft"


def _agreement(theory: Region, judge: Region) -> float:
    same = (theory["nose"] & judge["nose"]) | (theory["stern"] & judge["stern"])
    return float(same.sum() / (theory["nose"] | theory["stern"]).sum())


@rebuilds(
    "c17",
    "eq 24",
    why="(24) as printed lacks a factor J^-1 on its right side, as its units show; (23) has it",
)
def eq_24(folder: Path) -> Mapping[str, float]:
    """(24) as printed and corrected at a control point where the loop spins away."""
    there = predict(0.14, 0.09)
    return {
        "(24) as printed holds at a = 0.14 m, dx = 0.09 m": float(there.printed),
        "(24) corrected holds there": float(there.bounded),
    }


@rebuilds(
    "c17",
    "theorem 4",
    lacks="a value of Delta. C17's own control point of 0.2 m lies beyond it, where (24) holds again",
)
def theorem_4(folder: Path) -> Mapping[str, float]:
    """Return the margin Delta of both craft."""
    return {
        "Delta of the simulation's craft": theorem_4_margin(c17_simulation()),
        "Delta of the experiment's craft [m]": theorem_4_margin(c17_experiment()),
    }
