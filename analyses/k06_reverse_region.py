"""K06's reverse law (2.30): theorem, linearisation and simulations, with and without the link's delay."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from hovercontrol.analysis import reverse_region
from hovercontrol.analysis.output import Progress, save, script


def main(out: Path, progress: Progress | None = None, *, points: int = 40) -> list[Path]:
    """Draw the regions; each point is six simulations of 600 s."""
    region = reverse_region(points=points)
    if progress:
        progress(1.0)
    stable, against = region.share("theorem", "simulated"), region.outside("theorem", "simulated")
    late = len(region.outside("theorem", "delayed")) / region["theorem"].sum()
    linear = (region["linear"] == region["simulated"]).mean()
    delayed = (region["linear delayed"] == region["delayed"]).mean()
    findings = [
        f"Without delay: {len(against)} points inside the theorem's region do not reach u_ref (the theorem "
        "is local, the starts are up to 0.5 m/s and 2 rad/s off); it covers "
        f"{stable:.1%} of the simulated one.",
        f"With the mean round trip of the link, of which the theorem knows nothing, {late:.1%} of its region "
        "fails.",
        f"Linearisation and simulation agree at {linear:.1%} of the points, {delayed:.1%} with delay.",
    ]
    name = "k06_reverse_region"
    figure = Figure(figsize=(7.0, 5.8), layout="constrained")
    region.plot(axes=figure.subplots())
    return save(out, name, figure, {name: region.save}, findings)


if __name__ == "__main__":
    script(main, __doc__ or "")
