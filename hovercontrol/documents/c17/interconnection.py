"""C17 Theorem 5: how far craft, controller and estimator may begin from the ellipse and from the truth.

The loop of craft, controller and estimator is judged by Monte Carlo [C17 theorem 5].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arguments import at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.control.analysis.intervals import clopper_pearson
from hovercontrol.control.analysis.iss import DRAG
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference, tracking_loop
from hovercontrol.control.analysis.output import Progress, part, quiet, save
from hovercontrol.control.analysis.regions import Axis, Region, axis, refuse_large
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation

#: C17's estimator. States are measured, so that they start at their steady variance (Q R)^(1/2).
ESTIMATOR = {"R": 1e-5, "Q": [1e-4] * 3 + [1e-2] * 6, "P0": [3e-5] * 3 + [1e-2] * 6}

#: Runge-Kutta's step [s].
STEP = 0.01

#: Seconds that a run takes, of loops with C17's estimator on one core: for the estimate before a sweep.
SECONDS_PER_RUN = 2e-3


@checked
def region_of_attraction(
    coefficient_error: tuple[float, float] = (0.0, 10.0),
    tracking_error: tuple[float, float] = (0.0, 10.0),
    cells: int = 10,
    runs: int = 100,
    *,
    model: Model | None = None,
    limits: bool = True,
    deadline: float = 6.0,
    duration: float = 20.0,
    tolerance: float = 0.05,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return how often the loop with its estimator gets to C17's ellipse, by initial errors.

    Parameters
    ----------
    coefficient_error : tuple of float, optional
        Range of max |c_i - c_hat_i(0)|, i = 1..6, each in its own unit; the direction is random.
    tracking_error : tuple of float, optional
        Range of |z1(0)| [m], in a random direction; the velocity is the reference's.
    cells, runs : int, optional
        There are cells x cells cells with so many runs each, drawn within the cell.
    model : Model, optional
        Default C17's simulation.
    limits : bool, optional
        Keep thrust and rudder within those of C17's experiment.
    deadline, duration : float, optional
        For the maps ``in time`` and ``in the end`` [s].
    tolerance : float, optional
        The error [m] below which the craft is on the reference.
    seed : int, optional
    progress
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

    Returns
    -------
    Region
        Maps ``in time``, ``in the end``: shares of the runs; with ``... low`` and ``... high`` their 95 %
        Clopper-Pearson intervals. Axes are the cells' centres.

    Raises
    ------
    InputError
        If a range is none or negative, a count or time is not positive, or the sweep is too large.

    Examples
    --------
    >>> region = region_of_attraction((0.0, 1.0), (0.0, 1.0), cells=2, runs=2)
    >>> region.maps["in the end"].tolist()
    [[1.0, 1.0], [1.0, 1.0]]
    """
    x = _cells("coefficient_error", "SI units", coefficient_error, cells, "initial max |c_i - c_hat_i|")
    y = _cells("tracking_error", "m", tracking_error, cells, "initial |z1|")
    for name, value in (("deadline", deadline), ("duration", duration), ("tolerance", tolerance)):
        positive(name, value)
    if runs < 1:
        raise InputError(f"runs: expected 1 or more in a cell, found {runs!r}")
    at_least("seed", seed)
    model = c17_simulation() if model is None else model
    if limits:
        model = replace(model, thrust=c17_experiment().thrust, rudder=c17_experiment().rudder)
    loop = tracking_loop(
        model, estimator=ESTIMATOR, adapt=DRAG, limits=limits, outputs=["tracking_error"]
    ).compile(friction="smooth")
    refuse_large(loop, cells * cells * runs, SECONDS_PER_RUN)
    start = _draw(model, x, y, runs, np.random.default_rng(seed))
    times = np.linspace(0.0, duration, 1 + max(2, round(10 * duration)))
    found = loop.sweep(
        times, x0=start, band=tolerance / 2, method="rk4", step=STEP,
        progress=progress,
    )  # fmt: skip
    error = found["tracking_error"]
    there = (found.status == 0) & (error.final < tolerance / 2)
    maps: dict[str, Array] = {}
    for name, reached in (("in time", there & (error.settling <= deadline)), ("in the end", there)):
        count = reached.reshape(cells, cells, runs).sum(axis=2)
        low, high = clopper_pearson(count, runs)
        maps |= {name: count / runs, f"{name} low": low, f"{name} high": high}
    bound = "thrust 0 to 6.1, rudder +-26 deg" if limits else "no limits"
    return Region(
        f"C17 Theorem 5, estimator in the loop: {bound}",
        x,
        y,
        maps,
        labels={
            "in time": f"share within {100 * tolerance:g} cm by {deadline:g} s",
            "in the end": f"share within {100 * tolerance:g} cm at {duration:g} s",
        },
    )


def _cells(name: str, unit: str, span: tuple[float, float], cells: int, label: str) -> Axis:
    edges = axis(name, unit, span, cells + 1, label) if isinstance(cells, int) else None
    if edges is None or cells < 2:
        raise InputError(f"{name}: expected 2 or more cells, found {cells!r}")
    if edges.values[0] < 0:
        raise InputError(f"{name}: errors are sizes, not negative, found {edges.values[0]:g}")
    return replace(edges, values=(edges.values[1:] + edges.values[:-1]) / 2)


def _draw(model: Model, x: Axis, y: Axis, runs: int, rng: np.random.Generator) -> dict[str, Array]:
    """Return the loops' initial states, cell by cell, y outermost."""
    shape = (len(y.values), len(x.values), runs)
    within = [rng.uniform(-0.5, 0.5, shape) * (a.values[1] - a.values[0]) for a in (x, y)]
    wrong = (x.values[None, :, None] + within[0]).ravel()
    away = (y.values[:, None, None] + within[1]).ravel()
    side = rng.uniform(0.0, 2 * np.pi, away.size)
    direction = rng.uniform(-1.0, 1.0, (len(DRAG), wrong.size))
    direction /= np.abs(direction).max(axis=0)
    begin = on_reference(c17_ellipse(), 0.2)
    start = {name: np.full(wrong.size, value) for name, value in begin.items()}
    start["plant.x"] += away * np.cos(side)
    start["plant.y"] += away * np.sin(side)
    start |= {f"estimator.xhat[{i}]": start[f"plant.{name}"] for i, name in enumerate("uvr")}
    known = model.coefficients()
    for i, name in enumerate(DRAG):
        start[f"estimator.xhat[{i + 3}]"] = known[name] + wrong * direction[i]
    return start


def main(
    out: Path, progress: Progress = quiet, *, cells: int = 10, runs: int = 100, seed: int = 0
) -> list[Path]:
    """Draw the share of loops in time, with its confidence band, without limits of the commands and with."""
    every = cells * cells * runs
    free = region_of_attraction(
        cells=cells, runs=runs, limits=False, seed=seed, progress=part(progress, 0, 2, every)
    )
    bound = region_of_attraction(
        cells=cells, runs=runs, limits=True, seed=seed, progress=part(progress, 1, 2, every)
    )
    figure = Figure(figsize=(12.0, 9.0), layout="constrained")
    axes = figure.subplots(2, 2)
    findings = []
    for row, (region, what) in enumerate(((free, "without limits"), (bound, "with limits"))):
        region.plot("in time", axes=axes[row, 0])
        _band(region, axes[row, 1])
        reached = round(float(region["in the end"].mean()) * every)
        low, high = clopper_pearson(reached, every)
        findings.append(
            f"{what}: {reached} of {every} loops are on the ellipse in the end "
            f"(95 % interval of the probability {low:.2%} to {high:.2%})."
        )
    tables = {"c17_interconnection_free": free.save, "c17_interconnection_limited": bound.save}
    return save(out, "c17_interconnection", figure, tables, findings)


def _band(region: Region, axes: Axes) -> None:
    """Draw the shares over the coefficients' error for the smallest, a middle and the largest error z1."""
    rows = (0, len(region.y.values) // 2, len(region.y.values) - 1)
    for row, line, colour in zip(rows, ("-", "--", ":"), ("C0", "C1", "C2"), strict=True):
        low, high = region["in time low"][row], region["in time high"][row]
        axes.fill_between(region.x.values, low, high, color=colour, alpha=0.25, lw=0)
        label = f"initial |z1| about {region.y.values[row]:.2g} m"
        axes.plot(region.x.values, region["in time"][row], color=colour, ls=line, label=label)
    axes.set(xlabel=str(region.x), ylabel=region.label("in time"), ylim=(-0.02, 1.02))
    axes.set_yticks(np.linspace(0.0, 1.0, 6))
    axes.set_title("with 95 % Clopper-Pearson intervals", fontsize=10)
    axes.legend(frameon=False, fontsize="small")
