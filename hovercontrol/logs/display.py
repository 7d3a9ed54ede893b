"""Figures and HTML of logs, bench tables and smoothed logs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.figure_style import BLUE, VERMILION
from hovercontrol.base.html import card, table
from hovercontrol.base.svg import sparkline

if TYPE_CHECKING:
    from hovercontrol.logs.log import Floats, Log
    from hovercontrol.logs.smooth import Smoothed


def log_html(log: Log) -> str:
    """Return a log's HTML: each column's range and its course as a sparkline."""
    span = f"{log.time[0]:.4g} to {log.time[-1]:.4g} s" if len(log) else "empty"
    step = f", usually {1e3 * float(np.median(np.diff(log.time))):.4g} ms apart" if len(log) > 1 else ""
    gaps = f", {len(log.gaps)} gaps" if log.gaps else ""
    return card("Log", log.name, f"{len(log)} rows, {span}{step}{gaps}", courses(log))


def courses(log: Log) -> str:
    """Return a table of the columns: range, and course over time as a sparkline."""
    rows = []
    for name, row in log.columns.items():
        known = row[np.isfinite(row)]
        held = known.size > 2 and np.mean(np.diff(known) == 0.0) > 0.5
        low, high = (float(f(known)) if known.size else math.nan for f in (np.min, np.max))
        rows.append((name, low, high, sparkline(log.time, row, stairs=bool(held))))
    return table(("column", "from", "to", "over time"), rows)


def log_figure(log: Log, units: Mapping[str, str]) -> Figure:
    """Return the columns of a log over time, one pair of axes each; commands as stairs."""
    names = list(log.columns)
    figure = Figure(figsize=(8.0, 0.9 + 1.25 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False).ravel()
    for axis, name in zip(axes, names, strict=True):
        row = log[name]
        known = np.isfinite(row)
        held = known.sum() > 2 and np.mean(np.diff(row[known]) == 0.0) > 0.5
        axis.plot(
            log.time[known], row[known], color=BLUE, lw=0.8, drawstyle="steps-post" if held else "default"
        )
        unit = f" [{units[name]}]" if name in units else ""
        axis.set_ylabel(f"{name}{unit}", rotation=0, ha="right", va="center")
        for a, b in log.gaps:
            axis.axvspan(a, b, color="0.9", hatch="//", ec="0.6", lw=0)
        axis.margins(x=0)
        axis.grid(alpha=0.3)
    axes[-1].set_xlabel("time [s]")
    figure.suptitle(log.name)
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
            axis.axvspan(span.start, span.stop, color=VERMILION, alpha=0.3, lw=0)
        axis.set_ylabel(f"{name} [{unit}]")
        axis.margins(x=0)
        axis.grid(alpha=0.3)
    axes[0].set_title(f"{log.name}: smoothed; orange: samples not used, hatched: guessed", fontsize="medium")
    axes[-1].set_xlabel("time [s]")
    return figure


def curve_figure(name: str, x: Floats, y: Floats, xlabel: str, ylabel: str) -> Figure:
    """Return the points of a table as a curve."""
    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(x, y, "o-", color=BLUE, ms=4, lw=1.1)
    axes.set(title=name, xlabel=xlabel, ylabel=ylabel)
    axes.grid(alpha=0.3)
    return figure
