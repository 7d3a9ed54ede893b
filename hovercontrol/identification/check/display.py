"""Figure and HTML of a log check: columns over time with their faults, time steps, coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from hovercontrol.base.envelope import envelope
from hovercontrol.base.figure_style import BLUE, GREEN, VERMILION
from hovercontrol.base.html import card, lines, table
from hovercontrol.base.percent import percent
from hovercontrol.base.svg import sparkline
from hovercontrol.identification.check.facts import Column, LogFacts
from hovercontrol.identification.identify.result import Fitted
from hovercontrol.logs import Log

if TYPE_CHECKING:
    from hovercontrol.identification.check.check import Checked

#: Colours; shapes and hatching carry the same information.
MEASURED, COMMAND, WRONG, GAP = BLUE, GREEN, VERMILION, "0.85"

COLOURS = {"measured": MEASURED, "command": COMMAND, "other": "0.4"}

#: Maximum number of columns drawn for one log.
MOST_COLUMNS = 12

#: Height of the paths [inch], maximum number of their points, and number of headings drawn.
PATH, MOST_POINTS, HEADINGS = 3.6, 5000, 40


def draw(checked: Checked) -> Figure:
    """Return the figure of a check, with one column of axes per log and the coefficients below."""
    shown = [_drawn(f.columns) for f in checked.logs]
    rows = 1 + max(len(columns) for columns in shown)
    wide, many = len(checked.logs), len(checked.coefficients)
    below = 0.9 + 0.28 * many if many else 0.0
    posed = [f for f in checked.logs if f.log.has("x", "y")]
    heights = [1.25 * rows + 0.8, *([PATH] if posed else []), *([below] if many else [])]
    figure = Figure(figsize=(max(7.5, 5.6 * wide), sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    top: SubFigure = parts[0]
    if posed:
        for axis, facts in zip(parts[1].subplots(1, len(posed), squeeze=False)[0], posed, strict=True):
            _path(axis, facts.log)
    axes = top.subplots(rows, wide, squeeze=False, sharex="col")
    for k, (facts, columns) in enumerate(zip(checked.logs, shown, strict=True)):
        for axis, column in zip(axes[:, k], columns, strict=False):
            _column(axis, facts, column)
        _stamps(axes[len(columns), k], facts)
        for axis in axes[len(columns) + 1 :, k]:
            axis.remove()
        axes[len(columns), k].set_xlabel("time [s]")
        axes[len(columns), k].tick_params(labelbottom=True)
        t = facts.timing[0]
        gaps = f", {len(t.gaps)} gap{'s' * (len(t.gaps) > 1)}" if t.gaps else ""
        axes[0, k].set_title(
            f"{facts.log.name}: {t.rows} rows, {t.rate:.3g} a second{gaps}", fontsize="medium", loc="left"
        )
    handles: dict[str, Artist] = {}
    for axis in axes.ravel():
        if axis.figure is not None:
            handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    place: dict[str, Any] = {"loc": "outside lower center", "ncols": 3 * wide, "frameon": False}
    top.legend(list(handles.values()), list(handles), **place)
    if many:
        _coefficients(parts[-1].subplots(), checked.coefficients)
    return figure


def _path(axis: Axes, log: Log) -> None:
    """Draw the path of a craft with its headings: in a wrong frame they do not fit the path."""
    known = np.flatnonzero(np.isfinite(log.stack("x", "y")).all(axis=1))
    drawn = known[:: max(1, known.size // MOST_POINTS)]
    axis.plot(log["x"][drawn], log["y"][drawn], color=MEASURED, lw=0.8)
    if log.has("psi") and known.size:
        at = known[:: max(1, known.size // HEADINGS)]
        psi = log["psi"][at]
        axis.quiver(
            log["x"][at], log["y"][at], np.cos(psi), np.sin(psi), color=COMMAND, width=0.004, scale=25
        )
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("x [m]")
    axis.set_ylabel("y [m]")
    axis.set_title(f"{log.name}: path, and headings as arrows", fontsize="medium", loc="left")
    axis.grid(alpha=0.3)


def _drawn(columns: Sequence[Column]) -> list[Column]:
    """Return the columns to draw: measured and commanded columns, or the others if there are none."""
    known = [c for c in columns if c.kind != "other"]
    return (known or list(columns))[:MOST_COLUMNS]


def _column(axis: Axes, facts: LogFacts, column: Column) -> None:
    log, row = facts.log, facts.log[column.name]
    drawn = envelope(row)
    command = column.kind == "command"
    axis.plot(
        log.time[drawn], row[drawn], color=COLOURS[column.kind], lw=0.8,
        drawstyle="steps-post" if command else "default",
        label="command" if command else "measured" if column.kind == "measured" else "other",
    )  # fmt: skip
    _spans(axis, facts.timing[0].gaps, color=GAP, hatch="//", ec="0.6", lw=0, label="gap")
    if not command:
        wrong = [(s.start, s.stop) for s in facts.rejected]
        _spans(axis, wrong, color=WRONG, alpha=0.3, lw=0.6, label="rejected: implausible motion")
    if column.outliers:
        at = np.searchsorted(log.time, column.outliers)
        at = at[envelope(row[at])]
        axis.plot(log.time[at], row[at], "x", color=WRONG, ms=5, label="stands alone")
    unit = f" [{column.unit}]" if column.unit else ""
    axis.set_ylabel(f"{column.name}{unit}", rotation=0, ha="right", va="center")
    if column.noise is not None:
        axis.set_title(f"noise {column.noise:.2g} {column.unit}", fontsize="x-small", loc="right", pad=1)
    axis.margins(x=0)
    axis.grid(alpha=0.3)
    axis.tick_params(labelsize="small")


def _spans(axis: Axes, spans: Sequence[tuple[float, float]], **style: Any) -> None:
    """Shade spans of time [s] over the full height, as a single artist because there may be thousands."""
    if spans:
        wide = [(a, b - a) for a, b in spans]
        axis.broken_barh(wide, (0.0, 1.0), transform=axis.get_xaxis_transform(), **style)


def _stamps(axis: Axes, facts: LogFacts) -> None:
    """Draw the time steps between rows, which show jitter, lost samples and gaps."""
    time = facts.log.time
    steps = 1e3 * np.diff(time)
    drawn = envelope(steps)
    axis.semilogy(time[1:][drawn], steps[drawn], ".", color="0.35", ms=2, label="from row to row")
    if steps.size:
        usual = float(np.median(steps))
        axis.set_ylim(min(0.3 * usual, 0.8 * steps.min()), max(3.0 * usual, 1.25 * steps.max()))
    axis.yaxis.set_major_formatter("{x:g}")
    axis.yaxis.set_minor_formatter("")
    axis.set_ylabel("step [ms]", rotation=0, ha="right", va="center")
    axis.margins(x=0)
    axis.grid(alpha=0.3)
    axis.tick_params(labelsize="small")


def _coefficients(axis: Axes, coefficients: tuple[Fitted, ...]) -> None:
    """Draw the standard error of each coefficient in per cent of the estimate."""
    parts = [100 * c.std / abs(c.value) if c.value and np.isfinite(c.std) else np.inf for c in coefficients]
    finite = [p for p in parts if np.isfinite(p) and p > 0]
    largest, least = max([200.0, *(2 * p for p in finite)]), 0.3 * min([10.0, *finite])
    for k, (c, part) in enumerate(zip(coefficients, parts, strict=True)):
        good = c.excited
        axis.barh(
            k, min(part, largest) - least, left=least, height=0.6, hatch="" if good else "////",
            color=MEASURED if good else "white", ec=MEASURED if good else WRONG,
        )  # fmt: skip
        label = percent(part / 100, 3)
        axis.annotate(
            label if good else f"{label}: not shown", (min(part, largest), k), xytext=(4, 0),
            textcoords="offset points", va="center", fontsize="small",
        )  # fmt: skip
    axis.set_xscale("log")
    axis.set_xlim(least, 30 * largest)
    axis.xaxis.set_major_formatter("{x:g}")
    axis.axvline(100.0, color="0.4", lw=0.8, ls=":")
    axis.set_yticks(range(len(coefficients)), [c.name for c in coefficients], fontsize="small")
    axis.invert_yaxis()
    axis.set_xlabel("standard error of a trial fit [% of the estimate]")
    axis.grid(alpha=0.3, axis="x")


def checked_html(found: Checked) -> str:
    """Return a log check as HTML."""
    logs = [
        (f.log.name, t.of, t.rows, t.rate, 1e3 * t.jitter, len(t.gaps), t.lost)
        for f in found.logs
        for t in f.timing
    ]
    columns = [
        (f.log.name, c.name, c.unit or "?", c.low, c.high, c.noise, len(c.outliers) if c.noise else "",
         sparkline(f.log.time, f.log[c.name], stairs=c.kind == "command"))
        for f in found.logs
        for c in f.columns
    ]  # fmt: skip
    shown = [
        (c.name, c.value, f"± {c.std:.2g}", c.unit, "yes" if c.excited else f"no: {c.reason}")
        for c in found.coefficients
    ]
    shown += [(g.name, g.value, f"± {g.std:.2g}", g.unit, "yes") for g in found.groups]
    shown += [(c.name, c.value, "kept", c.unit, c.kept) for c in found.kept]
    return card(
        "Log check",
        found.model,
        "",
        lines(*(f"must be corrected: {e}" for e in found.errors), *(f"look at: {w}" for w in found.warnings)),
        table(("log", "file", "rows", "per second", "jitter [ms]", "gaps", "lost"), logs),
        table(("log", "column", "unit", "from", "to", "noise", "outliers", "over time"), columns),
        table(("coefficient", "estimate", "std. error", "unit", "shown"), shown),
    )
