"""C17 Theorem 4: with which rudder arm and control point the craft goes nose-first, stern-first or spins."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.analysis import Region
from hovercontrol.analysis.output import Progress, save, script
from hovercontrol.documents.c17.arm_region import arm_region

#: Of C17's simulation [kg, kg m^2].
MASS, INERTIA = 0.585, 0.01

#: A rudder this near to the centre of mass hardly turns the craft [m].
NEAR = 0.02


def main(out: Path, progress: Progress | None = None, *, points: int = 120) -> list[Path]:
    """Draw theory beside simulation, over the rudder arm and the control point."""
    runs = points**2
    theory, judge = arm_region(
        points=points,
        mass=MASS,
        inertia=INERTIA,
        progress=(lambda n: progress(n / runs)) if progress else None,
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


if __name__ == "__main__":
    script(main, __doc__ or "")
