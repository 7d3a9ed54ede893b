"""Pictures of results that have no module of their own for it; each a ``plot`` of its class."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from hovercontrol.analysis.budget import Budget
    from hovercontrol.analysis.iss import IssGain
    from hovercontrol.analysis.margins import FrozenMargins
    from hovercontrol.discrepancy.diagnosis import Diagnosis
    from hovercontrol.identify.result import Identified
    from hovercontrol.logs import Log

#: Colours for the colour-blind (Okabe and Ito).
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "0.55"


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


def identified_figure(found: Identified) -> Figure:
    """Return coefficients with two standard errors to either side beside what they were, each in its size.

    Below each stand its other readings, beside a missing effect and over longer times.
    """
    many = len(found.coefficients)
    figure = Figure(figsize=(7.5, 1.3 + 0.34 * many), layout="constrained")
    axis = figure.subplots()
    labels = []
    for k, c in enumerate(found.coefficients):
        size = max(abs(v) for v in (c.value, c.start, *(r.value for r in c.readings))) or 1.0
        known = c.excited and math.isfinite(c.std)
        if known:
            std = c.noise_std or c.std
            axis.errorbar(
                c.value / size, k, xerr=2 * std / size, fmt="o", color=BLUE, ms=5, capsize=3,
                label=None if "now" in labels else "identified, two standard errors",
            )  # fmt: skip
        elif "open" not in labels:
            axis.plot([], [], "s", mfc="none", color=ORANGE, label="not excited by the logs")
        if not known:
            axis.plot(c.value / size, k, "s", mfc="none", color=ORANGE)
        axis.plot(c.start / size, k, "|", color="0.2", ms=14, label=None if k else "before")
        for r in c.readings:
            axis.errorbar(
                r.value / size, k + 0.22, xerr=2 * r.std / size, fmt="D", color=GREEN, ms=4, capsize=2,
                label=None if "other" in labels else "other readings",
            )  # fmt: skip
            labels.append("other")
        labels.append("now" if known else "open")
    axis.set_yticks(range(many), [f"{c.name} [{c.unit}]" for c in found.coefficients])
    axis.set_ylim(many - 0.5, -0.5)
    axis.set_xlabel("value over the largest of its row [1]")
    axis.grid(alpha=0.3, axis="x")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def diagnosis_figure(found: Diagnosis) -> Figure:
    """Return errors without and with what was added: held out by horizon, else of the training logs."""
    if not found.ahead:
        return _bars(found)
    channels = list(dict.fromkeys(a.channel for a in found.ahead))
    columns = min(3, len(channels))
    rows = -(-len(channels) // columns)
    figure = Figure(figsize=(3.4 * columns + 0.6, 2.5 * rows + 0.9), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, channel in zip(axes, channels, strict=False):
        own = [a for a in found.ahead if a.channel == channel]
        at = [a.horizon for a in own]
        axis.loglog(at, [a.before for a in own], "o--", color=ORANGE, label="model as given")
        axis.loglog(at, [a.after for a in own], "s-", color=BLUE, label="with what was added")
        axis.set_xticks(at, [f"{h:g}" for h in at])
        axis.minorticks_off()
        axis.set_ylabel(f"{channel} [{own[0].unit}]")
        axis.set_xlabel("time ahead [s]")
        axis.grid(alpha=0.3)
    for axis in axes[len(channels) :]:
        axis.remove()
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{_title(found)}: errors on held-out logs")
    return figure


def _bars(found: Diagnosis) -> Figure:
    before, after = found.train_before.nrmse, found.train_after.nrmse
    figure = Figure(figsize=(1.8 + 1.1 * len(before), 3.6), layout="constrained")
    axis = figure.subplots()
    at = np.arange(len(before))
    axis.bar(at - 0.2, list(before.values()), 0.38, color=ORANGE, hatch="//", label="model as given")
    axis.bar(at + 0.2, [after[c] for c in before], 0.38, color=BLUE, label="with what was added")
    axis.set_xticks(at, list(before))
    axis.set_ylabel("error 1 s ahead over the scatter [1]")
    axis.grid(alpha=0.3, axis="y")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{_title(found)}: training logs")
    return figure


def _title(found: Diagnosis) -> str:
    names = ", ".join(dict.fromkeys(e.effect for e in found.effects))
    return f"{found.verdict}: {names}" if names else str(found.verdict)


def budget_figure(found: Budget) -> Figure:
    """Return what each imperfection costs alone, with two standard errors, beside all and none."""
    names = sorted(found.alone, key=lambda n: -found.alone[n].mean)
    costs = [("all", found.whole), *((n, found.alone[n]) for n in names), ("none", found.none)]
    figure = Figure(figsize=(7.5, 1.2 + 0.32 * len(costs)), layout="constrained")
    axis = figure.subplots()
    for k, (name, cost) in enumerate(costs):
        whole = name in ("all", "none")
        axis.barh(
            k, cost.mean, xerr=2 * cost.error, color=GREY if whole else BLUE, hatch="//" if whole else ""
        )
    axis.set_yticks(range(len(costs)), [name for name, _ in costs])
    axis.invert_yaxis()
    axis.set_xlabel("rms gap to the ideal loop, alone, two standard errors [m/s]")
    axis.set_title(found.trial)
    axis.grid(alpha=0.3, axis="x")
    return figure


def margins_figure(found: FrozenMargins) -> Figure:
    """Return phase, gain and delay margins along a motion."""
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    axes[0].plot(found.times, found["phase"], color=BLUE)
    axes[0].set_ylabel("phase margin [deg]")
    for name, style, colour in (("gain_up", "-", BLUE), ("gain_down", "--", ORANGE)):
        limit = np.where((found[name] > 0) & np.isfinite(found[name]), found[name], np.nan)
        none = "" if np.isfinite(limit).any() else ": any gain is borne"
        axes[1].plot(found.times, limit, style, color=colour, label=f"{name.removeprefix('gain_')}{none}")
    if np.isfinite([found["gain_up"], found["gain_down"]]).any():
        axes[1].set_yscale("log")
    axes[1].set_ylabel("gain at the edge [1]")
    axes[1].legend(frameon=False)
    axes[2].plot(found.times, found["delay"], color=BLUE, label="constant")
    axes[2].plot(found.times, found["jitter"], "--", color=ORANGE, label="varying")
    axes[2].set_ylabel("delay borne [s]")
    axes[2].legend(frameon=False)
    axes[2].set_xlabel("time [s]")
    for axis in axes:
        axis.margins(x=0)
        axis.grid(alpha=0.3)
    return figure


def iss_figure(found: IssGain) -> Figure:
    """Return how far the craft strays per unit of each wrong coefficient: exact, and by Lyapunov's bound."""
    names = found.coefficients
    figure = Figure(figsize=(7.0, 1.4 + 0.4 * len(names)), layout="constrained")
    axis = figure.subplots()
    at = np.arange(len(names))
    sizes = np.array([found.regressor[n] for n in names])
    axis.barh(at - 0.2, found.exact * sizes, 0.38, color=BLUE, label="exact")
    axis.barh(at + 0.2, found.guaranteed * sizes, 0.38, color=ORANGE, hatch="//", label="guaranteed")
    axis.set_yticks(at, [f"{n} [{u}]" for n, u in zip(names, found.units, strict=True)])
    axis.invert_yaxis()
    axis.set_xscale("log")
    axis.set_xlabel("bound of the tracking error per unit of the coefficient [m]")
    axis.grid(alpha=0.3, axis="x")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure
