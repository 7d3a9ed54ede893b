"""Steering under way: the real loop's mean motion over the stick, and where C17's law holds a turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure

import hovercontrol as hc
from hovercontrol.control.analysis import Region, axis, steering_map, turning_modes
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.autopilot import autopilot
from hovercontrol.control.guidance import steering_law, weaving

#: Surge velocity of the turns in the picture of their modes [m/s].
SURGE = 0.7


def main(out: Path, progress: Progress = quiet, *, points: int = 7) -> list[Path]:
    """Draw both errors of the real loop and the slowest mode of C17's zero dynamics."""
    craft = hc.vehicle("hoverdemon")
    loop = autopilot(
        steering_law(craft, forces=True, yaw_gain=1.5),
        guidance=weaving(period=0.001),
        references={"surge_ref": 0.5, "yaw_rate_ref": 0.3},
    )
    driven = steering_map(loop, points=points, progress=progress)
    modes = c17_modes(points)
    figure = Figure(figsize=(16.0, 4.8), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    _draw(left, driven, "surge_error", 100.0, "mean surge velocity, error [%]", 5.0)
    _draw(middle, driven, "yaw_rate_error", 100.0, "mean yaw rate, error [%]", 10.0)
    _draw(right, modes, "slowest", 1.0, f"C17's law at {SURGE:g} m/s: slowest mode [1/s]", 8.0)
    worst = [np.abs(driven[name]).max() for name in ("surge_error", "yaw_rate_error")]
    stable = modes.y.values[(modes["slowest"] < 0).all(axis=1)]
    findings = [
        f"K06's real loop (error model), weaving, {points**2} commands: mean surge velocity within "
        f"{worst[0]:.1%}, mean yaw rate within {worst[1]:.1%}; "
        f"{driven['within'].mean():.0%} keep 5 % and 10 %. "
        "The weave's ratio was chosen on such maps; python -m benchmarks steering has others.",
        "Without sway drag the mean of u r is zero: no steady turn under way; the means hold over "
        "whole weaves.",
        f"C17's craft under C17's law: turns at {SURGE:g} m/s are stable for the control points "
        f"tried from {stable.min():.3f} m on, and for none nearer than the centre of percussion, "
        f"{_percussion():.3f} m.",
    ]
    tables = {"k06_steering_stick": driven.save, "k06_steering_modes": modes.save}
    return save(out, "k06_steering", figure, tables, findings)


def c17_modes(points: int) -> Region:
    """Return the largest real part of the modes of a turn over yaw rate and control point."""
    craft = hc.vehicle("c17_simulation")
    x = axis("yaw_rate", "rad/s", (0.05, 0.5), points, "yaw rate")
    y = axis("control_point", "m", (0.13, 0.4), points, "control point")
    low = axis("control_point", "m", (0.01, 0.11), points, "control point")
    both = np.concatenate([low.values, y.values])
    values = np.array(
        [
            [turning_modes(craft, SURGE, float(r), control_point=float(d)).real.max() for r in x.values]
            for d in both
        ]
    )
    whole = type(y)(y.name, y.unit, both, y.label)
    return Region("slowest mode of a turn", x, whole, {"slowest": values}, {"slowest": "1/s"})


def _percussion() -> float:
    numbers = hc.vehicle("c17_simulation").coefficients()
    return numbers["thrust"] / numbers["rudder_torque"]


def _draw(axes: Axes, region: Region, name: str, scale: float, title: str, most: float) -> None:
    norm = TwoSlopeNorm(0.0, -most, most)
    values = scale * region[name]
    drawn = axes.pcolormesh(
        region.x.values, region.y.values, values, cmap="RdBu_r", norm=norm, shading="nearest"
    )
    axes.set(xlabel=str(region.x), ylabel=str(region.y))
    axes.set_title(title, fontsize=10)
    axes.figure.colorbar(drawn, ax=axes)
