"""C17 Theorem 5: how far craft, controller and estimator may begin from the ellipse and from the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.analysis import Region
from hovercontrol.analysis.output import Progress, save, script
from hovercontrol.documents.c17.interconnection import clopper_pearson, region_of_attraction


def main(
    out: Path, progress: Progress | None = None, *, cells: int = 10, runs: int = 100, seed: int = 0
) -> list[Path]:
    """Draw the share of loops in time, with its confidence band, without limits of the commands and with."""
    every = cells * cells * runs
    tell = (lambda k: lambda n: progress((k + n / every) / 2)) if progress else (lambda k: None)
    free = region_of_attraction(cells=cells, runs=runs, limits=False, seed=seed, progress=tell(0))
    bound = region_of_attraction(cells=cells, runs=runs, limits=True, seed=seed, progress=tell(1))
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


if __name__ == "__main__":
    script(main, __doc__ or "")
