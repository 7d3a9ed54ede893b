"""Picture of the turn law's basins on three planes of initial velocities."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from hovercontrol.base.figure_style import BLUE, SKY, VERMILION
from hovercontrol.control.analysis.output import Progress, part, quiet, save
from hovercontrol.control.analysis.regions import Region
from hovercontrol.documents.k06.turn_basins import RTOL, TOLD, turn_basins

#: Three planes of initial velocities; the third velocity is that of the unwanted limit point.
PLANES: tuple[tuple[dict[str, tuple[float, float]], dict[str, float]], ...] = (
    ({"v": (-2.5, 2.5), "r": (-8.0, 8.0)}, {"u": 0.0}),
    ({"u": (-2.5, 2.5), "r": (-8.0, 8.0)}, {"v": -0.96}),
    ({"u": (-2.5, 2.5), "v": (-2.5, 2.5)}, {"r": 0.0}),
)

#: A craft that does not turn within this time is stuck [s].
DURATION = 150.0


def main(out: Path, progress: Progress = quiet, *, points: int = 120) -> list[Path]:
    """Draw the three classes on three planes, the time to the turn, W_bad and the entry ball (2.48)."""
    figure = Figure(figsize=(16.0, 6.6), layout="constrained")
    figure.suptitle("K06 turn law (2.39), r_ref = 3 rad/s, k1 = 0.5 kg/s, k2 = 3.5 kg/s")
    findings = [
        f"Turns: W at 0.26 % of W_bad within {DURATION:g} s. Unwanted: near (0, -d r_ref, 0), r against "
        f"r_ref by at least {TOLD:g} rad/s, which rtol = {RTOL:g} resolves. Stuck: neither."
    ]
    tables = {}
    places = figure.subplots(1, 3)
    for k, ((plane, at), axes) in enumerate(zip(PLANES, places, strict=True)):
        told = part(progress, k, len(PLANES), points**2)
        region = turn_basins(plane, points, at=at, duration=DURATION, progress=told)
        drawn = _draw(axes, region, at)
        tables[f"k06_turn_basins_{''.join(plane)}"] = region.save
        findings.append(_finding(region, plane, at))
    figure.colorbar(drawn, ax=places, label=f"time until it turns [s], at most {DURATION:g} s", shrink=0.8)
    return save(out, "k06_turn_basins", figure, tables, findings)


def _draw(axes: Axes, region: Region, at: Mapping[str, float]) -> QuadMesh:
    (third, value) = next(iter(at.items()))
    grid = region.x.values, region.y.values
    norm = LogNorm(1.0, DURATION)
    drawn = axes.pcolormesh(*grid, region["time"], norm=norm, cmap="cividis_r", shading="nearest")
    handles: list[Artist] = []
    for name, colour, hatch in (("unwanted", SKY, None), ("stuck", "white", "///")):
        edge = VERMILION if hatch else BLUE
        if region[name].any():
            look = {"colors": [colour], "hatches": [hatch]}
            filled = axes.contourf(*grid, region[name].astype(float), [0.5, 1.5], **look)
            filled.set_edgecolor(edge)
            filled.set_linewidth(0.0)
        handles.append(Patch(facecolor=colour, hatch=hatch, edgecolor=edge, label=name))
    for (name, (x, y)), style in zip(region.lines.items(), ("-", "--"), strict=False):
        handles += axes.plot(x, y, color="black", lw=1.6, ls=style, label=name)
    for name, point in region.marks.items():
        marker = "o" if name.startswith("wanted") else "s"
        handles += axes.plot(*point, marker, color="black", mfc="white", ms=8, ls="none", label=name)
    unit = "rad/s" if third == "r" else "m/s"
    axes.set_title(f"from {third} = {value:g} {unit}", fontsize=10)
    axes.set(xlabel=str(region.x), ylabel=str(region.y))
    axes.set_xlim(*region.x.values[[0, -1]])
    axes.set_ylim(*region.y.values[[0, -1]])
    below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.12)}
    axes.legend(handles=handles, frameon=False, fontsize="small", ncols=2, **below)
    return drawn


def _finding(region: Region, plane: Mapping[str, object], at: Mapping[str, float]) -> str:
    third, value = next(iter(at.items()))
    reached = region["turns"] | region["stuck"]
    leaves = region["leaves"][np.isfinite(region["leaves"])]
    untold = int(region["stuck"].sum()) - leaves.size
    late = f" (they leave after {np.median(leaves):.1g} s, median; {untold} not resolved)"
    bad = int((region["level"] & region["unwanted"]).sum())
    covered = (region["level"] & reached).sum() / reached.sum()
    return (
        f"plane {', '.join(plane)} at {third} = {value:g}: {region['turns'].mean():.1%} of {reached.size} "
        f"starts turn (median {np.nanmedian(region['time']):.0f} s), {region['stuck'].mean():.1%} are "
        f"stuck{late if leaves.size else ''}, {region['unwanted'].mean():.1%} end at the unwanted point; "
        f"W < W_bad covers {covered:.1%} of the others with {bad} counter-examples; "
        f"the entry ball has {len(region.outside('entry', 'level'))} points outside it."
    )
