"""C17 Theorem 3: gains that bring the craft to the ellipse in time, promised, exact and simulated."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from hovercontrol.analysis.output import Progress, save, script
from hovercontrol.documents.c17.gains import gain_region


def main(out: Path, progress: Progress | None = None, *, points: int = 200) -> list[Path]:
    """Draw the region over k1 and k2: each point is two closed loops of 20 s, without limits and with."""
    runs = points**2
    region = gain_region(points=points, progress=(lambda n: progress(n / runs)) if progress else None)
    against = len(region.outside("guaranteed", "simulated"))
    limited = len(region.outside("guaranteed", "with limits"))
    findings = [
        f"{runs} closed loops: the craft comes within 1 cm in {region['simulated'].mean():.1%} of them.",
        f"Theorem 3 guarantees {region.share('guaranteed', 'simulated'):.1%} of these; simulated "
        f"counter-examples inside its region: {against}.",
        f"With thrust within 0 to 6.1 and the rudder within +-26 deg, of which Theorem 3 knows nothing, "
        f"{limited / max(1, region['guaranteed'].sum()):.1%} of its region fails.",
    ]
    figure = Figure(figsize=(7.0, 5.8), layout="constrained")
    region.plot(axes=figure.subplots())
    return save(out, "c17_gain_region", figure, {"c17_gain_region": region.save}, findings)


if __name__ == "__main__":
    script(main, __doc__ or "")
