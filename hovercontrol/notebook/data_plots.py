"""Pictures of tables and of smoothed logs; each a ``plot`` of its class."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.notebook.plots import BLUE, ORANGE

if TYPE_CHECKING:
    from hovercontrol.hardware.actuators.tables import FanTable
    from hovercontrol.logs.smooth import Smoothed

Array = NDArray[np.float64]


def curve_figure(name: str, x: Array, y: Array, xlabel: str, ylabel: str) -> Figure:
    """Return the points of a table as a curve."""
    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(x, y, "o-", color=BLUE, ms=4, lw=1.1)
    axes.set(title=name, xlabel=xlabel, ylabel=ylabel)
    axes.grid(alpha=0.3)
    return figure


def fan_table_figure(table: FanTable) -> Figure:
    """Return a table of a fan as curves, one for each rudder angle, coloured by it."""
    labels = {"force": "force [N]", "speed": "speed [RPM]"}
    other = "speed" if table.over == "force" else "force"
    figure = Figure(figsize=(6.6, 4.4), layout="constrained")
    axes = figure.subplots()
    span = mpl.colors.Normalize(float(table.rudder[0]), float(table.rudder[-1]))
    colours = mpl.cm.ScalarMappable(span, "cividis")
    for colour, row in zip(colours.to_rgba(table.rudder), table.values, strict=True):
        axes.plot(table.columns, row, color=colour, lw=1.1)
    axes.set(title=table.name, xlabel=labels[table.over], ylabel=labels[other])
    axes.grid(alpha=0.3)
    figure.colorbar(colours, ax=axes, label="rudder angle [deg]")
    return figure


def smoothed_figure(found: Smoothed) -> Figure:
    """Return pose and body velocities; samples that were not used, and hatched spans that are guessed."""
    log, units = found.log, {"x": "m", "y": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}
    figure = Figure(figsize=(8.0, 7.5), layout="constrained")
    axes = figure.subplots(6, 1, sharex=True)
    guessed = np.flatnonzero(np.diff(np.concatenate([[False], ~found.valid, [False]]).astype(int)))
    for axis, (name, unit) in zip(axes, units.items(), strict=True):
        axis.plot(log.time, log[name], color=BLUE, lw=0.9)
        for begin, end in guessed.reshape(-1, 2):
            axis.axvspan(log.time[begin], log.time[end - 1], color="0.9", hatch="//", ec="0.6", lw=0)
        for span in found.rejected:
            axis.axvspan(span.start, span.stop, color=ORANGE, alpha=0.3, lw=0)
        axis.set_ylabel(f"{name} [{unit}]")
        axis.margins(x=0)
        axis.grid(alpha=0.3)
    axes[0].set_title(f"{log.name}: smoothed; orange: samples not used, hatched: guessed", fontsize="medium")
    axes[-1].set_xlabel("time [s]")
    return figure
