"""The figure of a fan's table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from hovercontrol.craft.hardware.actuators.tables import FanTable


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
