"""K06's turn law (2.39): from where the craft turns as wanted, and from where it drifts and does not turn."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from hovercontrol.analysis.basins import turn_basins
from hovercontrol.analysis.output import Progress, save, script

#: Three planes of initial velocities; the third velocity is that of the unwanted limit point.
PLANES = (
    ({"v": (-2.5, 2.5), "r": (-8.0, 8.0)}, {"u": 0.0}),
    ({"u": (-2.5, 2.5), "r": (-8.0, 8.0)}, {"v": -0.96}),
    ({"u": (-2.5, 2.5), "v": (-2.5, 2.5)}, {"r": 0.0}),
)


def main(out: Path, progress: Progress | None = None, *, points: int = 120) -> list[Path]:
    """Draw the basins of the two limit points on three planes, with W_bad and the entry ball of (2.48)."""
    figure = Figure(figsize=(16.0, 7.0), layout="constrained")
    figure.suptitle("K06 turn law (2.39), r_ref = 3 rad/s, k1 = 0.5 kg/s, k2 = 3.5 kg/s")
    findings, tables = [], {}
    for k, ((plane, at), axes) in enumerate(zip(PLANES, figure.subplots(1, 3), strict=True)):
        tell = (lambda n, k=k: progress((k + n / points**2) / len(PLANES))) if progress else None
        region = turn_basins(plane, points, at=at, progress=tell)
        region.plot("unwanted", axes=axes)
        (third, value), name = next(iter(at.items())), "".join(plane)
        axes.set_title(f"from {third} = {value:g} {'rad/s' if third == 'r' else 'm/s'}", fontsize=10)
        tables[f"k06_turn_basins_{name}"] = region.save
        doubt = int((~region["wanted"] & ~region["unwanted"]).sum())
        findings.append(
            f"plane {', '.join(plane)} at {third} = {value:g}: "
            f"{region['unwanted'].mean():.1%} of {points**2} starts end at the unwanted point, "
            f"{doubt} in doubt; W < W_bad covers {region.share('level', 'wanted'):.1%} of the wanted basin "
            f"with {len(region.outside('level', 'wanted'))} counter-examples; the entry ball has "
            f"{len(region.outside('entry', 'level'))} points outside it."
        )
    return save(out, "k06_turn_basins", figure, tables, findings)


if __name__ == "__main__":
    script(main, __doc__ or "")
