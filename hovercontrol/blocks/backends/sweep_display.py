"""Figure and HTML of a sweep: a curve over one varied number, a map over two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.figure_style import BLUE, COLOUR_MAP
from hovercontrol.base.html import card, lines, table
from hovercontrol.base.svg import sparkline

if TYPE_CHECKING:
    from hovercontrol.blocks.backends.sweep import SweepResult


#: One number that was varied: what the axis says, and its values, increasing.
Varied = tuple[str, Array]

#: More points than these make a line a smear.
LINE = 400


def sweep_figure(found: SweepResult, of: str | None = None, figure: str = "final") -> Figure:
    """Return one figure of one output over one number or two that make a grid, else over the runs."""
    name = of or found.outputs[0]
    values: Array = getattr(found[name], figure)
    unit = "s" if figure == "settling" else found.units.get(name)
    label = _with_unit(f"{figure} of {name}", unit)
    drawn = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes, order = _grid({_with_unit(k, found.units.get(k)): v for k, v in found.given.items()}, len(found))
    draw_grid(drawn.subplots(), axes, values[order], label)
    return drawn


def draw_grid(axes: Axes, varied: Sequence[Varied], values: Array, label: str) -> None:
    """Draw values of runs as a curve over what was varied, or as a map over two; failed runs are grey.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    varied : sequence of one or two (str, ndarray)
        Label and values of each axis; of two, the first varies slowest and stands upright.
    values : ndarray
        One for each run.
    label : str
    """
    x_label, x = varied[-1]
    axes.set_xlabel(x_label)
    if len(varied) == 1:
        axes.plot(x, values.ravel(), ".-" if len(x) <= LINE else ".", color=BLUE, ms=4, lw=0.8)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        return
    y_label, y = varied[0]
    seen = np.ma.masked_invalid(values.reshape(len(y), len(x)))
    axes.set_facecolor("0.8")
    drawn = axes.pcolormesh(x, y, seen, cmap=COLOUR_MAP, shading="nearest", rasterized=True)
    axes.set_ylabel(y_label)
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    figure.colorbar(drawn, ax=axes, label=label)


def _grid(given: Mapping[str, Array], runs: int) -> tuple[list[Varied], NDArray[np.intp]]:
    """Return the axes of what was varied, and the runs in their order."""
    several = {label: values for label, values in given.items() if np.ptp(values) > 0}
    if len(several) == 1:
        ((label, values),) = several.items()
        order = np.argsort(values, kind="stable")
        return [(label, values[order])], order
    if len(several) == 2:
        (one, a), (other, b) = several.items()
        y, x = np.unique(a), np.unique(b)
        order = np.lexsort((b, a))
        grid = np.array([np.repeat(y, len(x)), np.tile(x, len(y))])
        if len(y) * len(x) == runs and np.array_equal(grid, [a[order], b[order]]):
            return [(one, y), (other, x)], order
    every = np.arange(runs)
    return [("number of the run [1]", every.astype(float))], every


def _with_unit(name: str, unit: str | None) -> str:
    return name if unit is None else f"{name} [{unit}]"


def sweep_html(found: SweepResult) -> str:
    """Return a sweep as HTML: the spread of each output's figures over the runs, and what failed."""
    given = found.given
    runs = np.arange(len(found), dtype=float)
    varied = [
        (name, float(v.min()), float(v.max()), sparkline(runs, v))
        for name, v in given.items()
        if np.ptp(v) > 0
    ]
    rows = []
    for name in found.outputs:
        for figure in ("final", "rms", "settling"):
            values = getattr(found[name], figure)
            known = values[np.isfinite(values)]
            if known.size:
                rows.append(
                    (name, figure, float(known.min()), float(np.median(known)), float(known.max()),
                     sparkline(runs, values))
                )  # fmt: skip
    failed = [f"{len(found.failures)} runs failed; {found.failures[0]}"] if found.failures else []
    return card(
        "Sweep",
        f"{len(found)} runs",
        "",
        table(("given", "from", "to", "over the runs"), varied),
        table(("output", "figure", "least", "median", "most", "over the runs"), rows),
        lines(*failed),
    )
