"""C17 section VIII-A: which reference shows which coefficient, when c3 and c4 are slow, the best ellipse."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure

from hovercontrol.base.arrays import Array
from hovercontrol.base.figure_style import COLOUR_MAP
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.analysis import (
    ExpectedErrors,
    Gramian,
    Region,
    ellipse_errors,
    excitation,
    expected_errors,
    observability_gramian,
    signals_of,
)
from hovercontrol.control.analysis.iss import DRAG
from hovercontrol.control.analysis.output import Progress, part, quiet, save
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse, figure_eight
from hovercontrol.control.observers import regression, regressors_along
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.documents.c17.runs import draw, run
from hovercontrol.documents.c17.simulation import ACTUATORS, errors_at
from hovercontrol.documents.printed import rebuilds

#: Angular rates of the ellipses that are tried [rad/s].
RATES = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def main(out: Path, progress: Progress = quiet, *, points: int = 24) -> list[Path]:
    """Draw the standard errors that references leave, ellipses of all sizes, and the Gramian along C17's."""
    regions = {}
    for k, rate in enumerate(RATES):
        told = part(progress, k, len(RATES), points**2)
        regions[rate] = ellipse_errors(points=points, rate=rate, progress=told)
    best = {rate: _best(region) for rate, region in regions.items()}
    rate = min(best, key=lambda r: best[r][0])
    worst, semi_x, semi_y = best[rate]
    references = {
        "circle 2 m, 1 rad/s": _clockwise(2.0, 2.0, 1.0),
        "C17 simulation: ellipse 1.5 x 2.5 m, 1 rad/s": _clockwise(1.5, 2.5, 1.0),
        "C17 experiment: ellipse 1.15 x 2 m, 0.7 rad/s": ellipse(1.15, 2.0, 0.7),
        "ellipse 1 x 3 m, 1 rad/s": _clockwise(1.0, 3.0, 1.0),
        f"best: ellipse {semi_x:.3g} x {semi_y:.3g} m, {rate:g} rad/s": _clockwise(semi_x, semi_y, rate),
        "eight 6 x 2.5 m, 0.5 rad/s": figure_eight(6.0, 2.5, 0.5),
        "eight 4 x 2 m, 0.8 rad/s": figure_eight(4.0, 2.0, 0.8),
    }
    found = expected_errors(references, coefficients=DRAG)
    eight = expected_errors(references, coefficients=(*DRAG, *ACTUATORS))
    slow = {len(names): errors_at(names) for names in (DRAG, (*DRAG, *ACTUATORS))}
    time, motion = _motion(1.5, 2.5, 1.0)
    _, other = _motion(semi_x, semi_y, rate)
    plant = c17_simulation().plant()
    gramian = observability_gramian(plant, time, motion, DRAG)
    figure = Figure(figsize=(15.0, 17.0), layout="constrained")
    grid = figure.add_gridspec(3, 1)
    above, middle, below = (figure.add_subfigure(grid[k, 0]) for k in range(3))
    found.plot(above.subplots())
    _named(above, "c7 and c8 known")
    heat, bars = middle.subplots(1, 2, width_ratios=(3, 1))
    eight.plot(heat)
    _named(middle, "all eight coefficients sought at once")
    _bars(slow, bars)
    left, right = below.subplots(1, 2)
    _draw(regions[rate], left, (semi_x, semi_y))
    _spectrum(gramian, right)
    findings = [
        *_why(found, time, motion),
        *_condition(eight, slow),
        f"The best of {len(RATES) * points**2} ellipses, by the largest of the six errors, with thrust 0 to "
        f"6.1 and rudder +-26 deg: {semi_x:.3g} x {semi_y:.3g} m at {rate:g} rad/s. It leaves {worst:.2g}, "
        f"{found.error[1].max() / worst:.1f} times less than C17's; v goes from {other['v'].min():.2f} to "
        f"{other['v'].max():.2f} m/s.",
        *(
            f"  at {r:g} rad/s: {a:.3g} x {b:.3g} m, {w:.2g}; the actuators can follow "
            f"{regions[r]['within limits'].mean():.0%} of the ellipses"
            for r, (w, a, b) in best.items()
        ),
        f"Gramian along C17's ellipse: {gramian.sentence()}.",
    ]
    tables = {"c17_excitation_references": found.save}
    tables |= {f"c17_excitation_ellipses_{round(100 * r):03d}": region.save for r, region in regions.items()}
    return save(out, "c17_excitation", figure, tables, findings)


def _why(found: ExpectedErrors, time: Array, motion: dict[str, Array]) -> list[str]:
    """Return in words why c3 and c4 are slow on C17's ellipse, whose motion is given."""
    circle, c17, eight = (found.error[k] for k in (0, 1, 5))
    first, second = np.argsort(-c17)[:2]
    sway = np.abs(motion["v"])
    sets = excitation(c17_simulation().plant(), time, motion, DRAG).sets
    alike = ", ".join(f"{s.gram[0, 1]:.2f} in {s.equation}'" for s in sets)
    return [
        f"With c7 and c8 known, a flight of {found.duration:.3g} s along C17's ellipse leaves most "
        f"doubt of {DRAG[first]} ({c17[first]:.2g}, 1 before) and {DRAG[second]} ({c17[second]:.2g}).",
        "Why c3 and c4: all along the ellipse the craft slides to the same side, with |v| from "
        f"{sway.min():.2f} to {sway.max():.2f} m/s, so that sgn v is constant and v nearly so. Friction and "
        f"drag look alike (cosine of the two functions: {alike}), and only a weighted sum is seen well.",
        "An eight slides both ways: that of 6 x 2.5 m at 0.5 rad/s leaves "
        f"{eight[2]:.2g} of {DRAG[2]}, {eight[3]:.2g} of {DRAG[3]}.",
        "A circle at constant speed shows one combination of each pair only: no error falls below "
        f"{circle.min():.2g}.",
    ]


def _condition(eight: ExpectedErrors, slow: Mapping[int, Mapping[str, float]]) -> list[str]:
    """Return in words that c3 and c4 are the slowest only where c7 and c8 are known."""
    first, second = (list(eight.coefficients)[k] for k in np.argsort(-eight.error[1])[:2])
    values = np.sort(eight.error[1])[::-1]
    rows = [
        f"  {words}: " + ", ".join(f"c{k} {v:.2g}" for k, v in enumerate(slow[n].values(), 1))
        for n, words in ((6, "c7 and c8 known"), (8, "all eight estimated, as C17's Q has it"))
    ]
    worst = max(slow[8], key=lambda name: slow[8][name])
    return [
        "That c3 and c4 are the slowest holds where c7 and c8 are known. Where all eight are sought, most "
        f"doubt is left of {first} ({values[0]:.2g}) and {second} ({values[1]:.2g}).",
        "Errors of Table I's estimates at 25 s, 10 s after the drag was halved (C17: c3 and c4 are slower):",
        *rows,
        f"With all eight estimated {worst} is the slowest: u keeps its side, too, and friction, drag and "
        "thrust in u' look alike.",
    ]


def _named(part: SubFigure, text: str) -> None:
    """Put what is known before the title of a part's first axes."""
    axes = part.axes[0]
    axes.set_title(f"{text}: {axes.get_title()}", fontsize=10)


def _bars(slow: Mapping[int, Mapping[str, float]], axes: Axes) -> None:
    """Draw the errors of Table I's estimates at 25 s."""
    for k, (n, label) in enumerate(((6, "c7, c8 known"), (8, "all eight"))):
        place = np.arange(len(DRAG)) + 0.4 * (k - 0.5)
        axes.barh(place, list(slow[n].values()), 0.38, color=f"C{k}", label=label)
    axes.set_yticks(range(len(DRAG)), [f"c{k}" for k in range(1, len(DRAG) + 1)])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set(xlabel="error of the estimate [SI]", title="Table I at 25 s")
    axes.title.set_fontsize(10)
    axes.legend(fontsize=8)


def _best(region: Region) -> tuple[float, float, float]:
    """Return the smallest worst error of the ellipses within limits, and that ellipse's semi-axes."""
    worst = np.where(region["within limits"], region["worst"], np.inf)
    row, column = np.unravel_index(worst.argmin(), worst.shape)
    return float(worst[row, column]), float(region.x.values[column]), float(region.y.values[row])


def _motion(semi_x: float, semi_y: float, rate: float) -> tuple[Array, dict[str, Array]]:
    """Return times and signals of C17's craft once it is on an ellipse, for two of C17's laps."""
    craft = c17_simulation()
    plant = craft.plant().with_values({"y": semi_y - 1.0, "u": 1.0})
    loop = interconnect([plant, tracking_controller(craft), _clockwise(semi_x, semi_y, rate)], "loop")
    time = np.arange(0.0, 15.0 + 4 * math.pi, 0.01)
    on = time >= 15.0
    return time[on], {name: values[on] for name, values in signals_of(simulate(loop, time)).items()}


def _clockwise(semi_x: float, semi_y: float, rate: float) -> Block:
    return ellipse(semi_x, semi_y, -rate, math.pi / 2)


def _draw(region: Region, axes: Axes, best: tuple[float, float]) -> None:
    """Draw the worst error of each ellipse; what the actuators cannot follow is hatched."""
    worst: Array = region["worst"]
    grid = (region.x.values, region.y.values)
    scale = LogNorm(float(np.nanmin(worst)), 1.0)
    shades = axes.pcolormesh(*grid, worst, cmap=COLOUR_MAP, norm=scale, shading="nearest", rasterized=True)
    if min(worst.shape) > 8:
        lines = axes.contour(*grid, worst, [0.01, 0.02, 0.05, 0.2], colors="black", linewidths=0.7)
        axes.clabel(lines, fontsize=8)
    outside = (~region["within limits"]).astype(float)
    if outside.any():
        axes.contourf(*grid, outside, [0.5, 1.5], colors="none", hatches=["xx"])
        axes.contour(*grid, outside, [0.5], colors="black")
    axes.plot(1.5, 2.5, "o", color="black", mfc="white", ms=9, label="C17 simulation, run at 1 rad/s")
    axes.plot(*best, "*", color="black", mfc="white", ms=15, label="best")
    axes.set(xlabel=str(region.x), ylabel=str(region.y))
    axes.set_title(f"{region.title}: the largest of six errors; hatched: beyond the actuators", fontsize=10)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, frameon=False)
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.colorbar(shades, ax=axes, label=region.label("worst"))


def _spectrum(gramian: Gramian, axes: Axes) -> None:
    """Draw the eigenvalues of the Gramian of windows of a third of a lap that slide along C17's ellipse."""
    sliding = gramian.sliding(2 * math.pi / 3)
    for k, values in enumerate(sliding.eigenvalues):
        line = ("-", "--", ":")[k % 3]
        axes.semilogy(sliding.time - gramian.window[0], np.where(values > 0, values, np.nan), line)
    axes.set(xlabel="end of the window [s]", ylabel="eigenvalues of the Gramian (6) [s]")
    axes.set_title(f"u, v, r and c1 to c6 along C17's ellipse, windows of {sliding.width:.2g} s", fontsize=10)


@rebuilds(
    "c17",
    "eq 6",
    why="(6) prints t_f as the upper limit of the inner integral, and so does the Peano-Baker series "
    "before it; the proof of Lemma 2 has t. With t_f the rank is that of [I Gamma], 3",
)
def eq_6(folder: Path) -> Mapping[str, float]:
    """Rank of the Gramian along Table I, integrated to t, and to t_f as printed."""
    found = run("table1")
    lap = (found.time >= 8.0) & (found.time < 8.0 + 2 * math.pi)
    signals = {name: found.columns[name][lap] for name in ("u", "v", "r", "thrust", "rudder")}
    plant, time = c17_simulation().plant(), found.time[lap]
    gramian = observability_gramian(plant, time, signals)
    G = regressors_along(regression(plant), time, signals)
    gamma = np.trapezoid(G, time, axis=-1)  # to t_f, the same at all times t
    printed = np.hstack([np.eye(len(gramian.states)), gamma])
    ranks = {"rank integrated to t": gramian.matrix, "rank as printed": printed.T @ printed}
    return {
        key: float(np.linalg.matrix_rank(W, tol=1e-12 * np.linalg.norm(W, 2))) for key, W in ranks.items()
    }


@rebuilds("c17", "eq 14c")
def eq_14c(folder: Path) -> Mapping[str, float]:
    """Estimates on a circle, where the sets (14a-c) are dependent."""
    draw("c17-dependent", folder, "estimates")
    found = run("c17-dependent")
    late = found.time >= 50.0
    error = found.estimation_error()
    assert error is not None
    return {
        "change of the estimates in the last 10 s": max(
            float(np.ptp(v[late])) for v in found.estimates().values()
        ),
        "worst error of c1..c6 at the end": float(error[-1]),
    }
