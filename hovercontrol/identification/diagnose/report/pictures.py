"""The figures of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.svg import Plot, bounds
from hovercontrol.identification.diagnose.evidence.blocks import Blocks
from hovercontrol.identification.diagnose.evidence.holdout import Ahead
from hovercontrol.identification.diagnose.evidence.missing import Missing
from hovercontrol.identification.diagnose.laws.regions import Range
from hovercontrol.identification.diagnose.laws.scan import Yardstick
from hovercontrol.identification.diagnose.report.formatting import prime, small, times, unit
from hovercontrol.identification.diagnose.report.free_run import FreeRun
from hovercontrol.identification.diagnose.report.templates import render
from hovercontrol.identification.diagnose.unknown.function import FittedFunction

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.report.where_section import Binned

#: Length of the part of a log shown with runs of the model [s], and number of logs with their own colour.
SPAN, COLOURS = 20.0, 4

#: Number of cells across a map of the floor, minimum number of rows in a cell that is drawn, and fraction of
#: the cells within the range of colours.
CELLS, FEWEST, WITHIN = 16, 4, 0.97


def error_bars(errors: Sequence[Ahead], changed: bool, noise: Mapping[str, float]) -> str:
    """Return bars of each channel's error, before and after; without a change, in multiples of the noise."""
    rows = []
    multiples = {a.channel: a.before / max(noise[a.channel], 1e-300) for a in errors}
    most = max(multiples.values())
    for a in errors:
        longest = max(a.before, a.after, 1e-300)
        many = multiples[a.channel]
        bars = [("before", many / most, times(many))]
        if changed:
            pair = (("before", a.before), ("after", a.after))
            bars = [(kind, value / longest, _size(value, a)) for kind, value in pair]
        rows.append((a.channel, bars))
    return render("bars.html", rows=rows)


def _size(value: float, a: Ahead) -> str:
    return f"{small(value)} {unit(a.unit)}".strip()


def horizons(far: Sequence[Ahead], changed: bool, noise: Mapping[str, float]) -> list[str]:
    """Return a plot for each channel of its error over the prediction horizon, with the noise as a line."""
    found = []
    for channel in dict.fromkeys(a.channel for a in far):
        own = sorted((a for a in far if a.channel == channel), key=lambda a: a.horizon)
        at = np.array([a.horizon for a in own])
        sides = {"before": np.array([a.before for a in own])}
        sides |= {"after": np.array([a.after for a in own])} if changed else {}
        top = max(noise[channel], *(float(y[np.isfinite(y)].max(initial=0.0)) for y in sides.values()))
        plot = Plot((0.0, 1.2 * float(at.max())), (0.0, 1.08 * top), f"error of {channel}", (360.0, 160.0))
        plot.line(np.array(plot.x), np.full(2, noise[channel]), "whole")
        for kind, y in sides.items():
            plot.line(at, y, kind)
            plot.dots(at, y, np.zeros(y.size), kind)
        found.append(plot.svg(_bracketed(own[0].unit), "[s]"))
    return found


class Scale(NamedTuple):
    """Conversion of sizes relative to that on all logs into a coefficient: ``zero + part * size``."""

    zero: float
    size: float
    unit: str


def blocks_of(title: str, blocks: Blocks, scale: Scale) -> str:
    """Return a plot of an effect's size on each block, with standard errors and a colour for each log.

    Blocks without information are left out. The line is the size on all logs.
    """
    shown = np.flatnonzero(telling(blocks))
    at = np.arange(1.0, len(blocks.estimate) + 1.0)
    y = scale.zero + scale.size * blocks.estimate
    half = np.abs(scale.size) * np.nan_to_num(blocks.std, nan=0.0, posinf=0.0)
    ends = [y[shown] - half[shown], y[shown] + half[shown]]
    limits = bounds([*ends, np.array([scale.zero, scale.zero + scale.size])])
    plot = Plot((0.0, at.size + 1.0), limits, title, (360.0, 190.0))
    edges = np.array([0.0, at.size + 1.0])
    plot.line(edges, np.full(2, scale.zero), "zero")
    plot.line(edges, np.full(2, scale.zero + scale.size), "whole")
    for log in np.unique(blocks.log[shown]).tolist():
        own = shown[blocks.log[shown] == log]
        plot.dots(at[own], y[own], half[own], f"log{log % COLOURS}")
    return plot.svg(_bracketed(scale.unit), "segment")


def telling(blocks: Blocks) -> NDArray[np.bool_]:
    """Return the blocks with more than 5 % of the mean information on an effect's size, as a mask."""
    std = blocks.std
    if not np.isfinite(std).any():
        return np.isfinite(blocks.estimate)
    with np.errstate(all="ignore"):
        information = np.where(np.isfinite(std), std**-2.0, 0.0)
    return np.asarray(information > 0.05 * information.sum() / information.size)


def overlays(before: FreeRun, after: FreeRun, changed: bool) -> list[str]:
    """Return a plot for each channel of measurement and free runs, where the given model errs most."""
    begin, end = stretch(before)
    sides = {"before": before} | ({"after": after} if changed else {})
    found = []
    for c, channel in enumerate(before.channels):
        rows = (before.time >= begin) & (before.time <= end)
        measured = before.measured[c][rows]
        if not np.isfinite(measured).any():
            continue
        drawn = {kind: _part(run, begin, end) for kind, run in sides.items()}
        limits = bounds([measured, *(y[c] for _, y, _ in drawn.values())], part=0.999)
        plot = Plot((begin, end), limits, channel)
        plot.line(*_known(before.time[rows], measured), "measured")
        for kind, (at, y, starts) in drawn.items():
            plot.line(at, y[c], kind, starts)
        found.append(plot.svg(_bracketed(before.units[channel]), "[s]"))
    return found


def _part(run: FreeRun, begin: float, end: float) -> tuple[Array, Array, list[int]]:
    """Return times, channels and starts of the runs within an interval."""
    rows = np.flatnonzero((run.at >= begin) & (run.at <= end))
    starts = np.flatnonzero(np.isin(rows, run.starts)).tolist()
    return run.at[rows], run.simulated[:, rows], starts


def stretch(run: FreeRun) -> tuple[float, float]:
    """Return the interval in which runs err most, or the whole of a short log [s]."""
    first, last = float(run.time[0]), float(run.time[-1])
    if last - first <= 1.5 * SPAN:
        return first, last
    error = np.minimum(np.nan_to_num(run.error**2, nan=0.0, posinf=100.0), 100.0).sum(axis=0)
    total = np.concatenate([[0.0], np.cumsum(error)])
    starts = [s for s in run.at[list(run.starts)].tolist() if s + SPAN <= last] or [first]
    rows = [np.searchsorted(run.time, [s, s + SPAN]) for s in starts]
    best = int(np.argmax([total[b] - total[a] for a, b in rows]))
    return starts[best], starts[best] + SPAN


def forces(
    before: Sequence[Missing], after: Sequence[Missing], least: Mapping[str, float], changed: bool
) -> list[str]:
    """Return a plot for each equation of a log of the missing force over time, with band and segments.

    `least` is the minimum half-range of the force axis, by equation.
    """
    found = []
    for was, now in zip(before, after, strict=True):
        sides = ((was, "before"), (now, "after"))[: 2 if changed else 1]
        limits = bounds([m.force for m, _ in sides], around_zero=True, part=0.99, least=least[was.equation])
        plot = Plot((float(was.time[0]), float(was.time[-1])), limits, prime(was.equation))
        for m, kind in sides:
            plot.band(m.time, m.force - 2 * m.band, m.force + 2 * m.band, kind)
            plot.line(m.time, m.force, kind)
        plot.spans(sides[-1][0].segments, sides[-1][1])
        found.append(plot.svg(_bracketed(was.unit), "[s]"))
    return found


def over_signal(yardstick: Yardstick, force_unit: str, signal_unit: str) -> str:
    """Return a plot of what is missing in an equation as a function of a signal, with two standard errors."""
    at, force, std = yardstick.at, yardstick.force, yardstick.std
    limits = bounds([force - 2 * std, force + 2 * std], around_zero=True)
    plot = Plot((float(at[0]), float(at[-1])), limits, prime(yardstick.equation), (360.0, 190.0))
    plot.line(at, np.zeros_like(at), "zero")
    plot.band(at, force - 2 * std, force + 2 * std, "after")
    plot.line(at, force, "after")
    return plot.svg(_bracketed(force_unit), f"{yardstick.signals[0]} {_bracketed(signal_unit)}".strip())


def in_bins(
    title: str,
    was: Binned,
    now: Binned | None,
    regions: Sequence[Range],
    force_unit: str,
    signal: tuple[str, str],
) -> str:
    """Return a plot of a missing force in bins of a signal, with two standard errors and regions marked.

    `now` is that of the amended model; `signal` is a name and a unit.
    """
    sides = {"before": was} | ({"after": now} if now else {})
    ends = [b.mean + k * b.std for b in sides.values() for k in (-2.0, 2.0)]
    plot = Plot((float(was.at[0]), float(was.at[-1])), bounds(ends, around_zero=True), title, (360.0, 190.0))
    plot.line(was.at, np.zeros_like(was.at), "zero")
    for kind, b in sides.items():
        plot.band(b.at, b.mean - 2 * b.std, b.mean + 2 * b.std, kind)
        plot.line(b.at, b.mean, kind)
    limits = [(r["low"], r["high"]) for r in regions]
    spans = [
        (plot.x[0] if low is None else float(low), plot.x[1] if high is None else float(high))
        for low, high in limits
    ]
    plot.spans([s for s in spans if s[0] < plot.x[1] and s[1] > plot.x[0]], "after")
    return plot.svg(_bracketed(force_unit), f"{signal[0]} {_bracketed(signal[1])}".strip())


def function(f: FittedFunction) -> str:
    """Return a plot of an unknown function: its table with two standard errors, and its likeliest form."""
    limits = bounds([f.values - 2 * f.std, f.values + 2 * f.std])
    plot = Plot((float(f.grid[0]), float(f.grid[-1])), limits, f"{f.name}({f.argument})", (360.0, 190.0))
    plot.band(f.grid, f.values - 2 * f.std, f.values + 2 * f.std, "before")
    plot.dots(f.grid, f.values, np.zeros(f.grid.size), "before")
    plot.line(f.forms[0].at, f.forms[0].values, "after")
    return plot.svg(_bracketed(f.unit), f"{f.argument} {_bracketed(f.argument_unit)}".strip())


def floor_map(title: str, x: Array, y: Array, force: Array, label: str, kind: str, length: str = "m") -> str:
    """Return a map of a force's root mean square over cells of the floor; empty with too few rows.

    `x`, `y` and `force` hold all rows of all logs; `label` is the unit of the force, `kind` its colour,
    `length` the unit of x and y.
    """
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(force)
    x, y, force = x[known], y[known], force[known]
    if x.size < 10 * FEWEST:
        return ""
    (x0, x1), (y0, y1) = bounds([x]), bounds([y])
    cell = max(x1 - x0, y1 - y0) / CELLS
    across, up = ((v - v0) // cell for v, v0 in ((x, x0), (y, y0)))
    places, of = np.unique(np.stack([across, up]), axis=1, return_inverse=True)
    of = of.ravel()
    count = np.bincount(of)
    rms = np.sqrt(np.bincount(of, weights=force**2) / count)
    drawn = np.flatnonzero(count >= FEWEST)
    if not drawn.size:
        return ""
    top = float(np.quantile(rms[drawn], WITHIN))
    height = 300.0
    half = 0.5 * max(x1 - x0, (y1 - y0) * 306.0 / (height - 44.0))
    middle = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    tall = half * (height - 44.0) / 306.0
    plot = Plot(
        (middle[0] - half, middle[0] + half), (middle[1] - tall, middle[1] + tall), title, (360.0, height)
    )
    corners = np.array([[x0], [y0]]) + cell * places[:, drawn]
    plot.cells(corners[0], corners[1], cell, rms[drawn] / max(top, 1e-300), kind)
    picture = plot.svg(f"y {_bracketed(length)}".strip(), f"x {_bracketed(length)}".strip())
    return render("floor_map.html", picture=picture, kind=kind, top=small(top), unit=label)


def _bracketed(text: str) -> str:
    return f"[{unit(text)}]" if unit(text) else ""


def _known(time: Array, row: Array) -> tuple[Array, Array]:
    """Return the finite samples, with a break (NaN) in each long gap; a single missing sample is no break."""
    known = np.flatnonzero(np.isfinite(row))
    steps = np.diff(known)
    holes = np.flatnonzero(steps > max(10.0, 3.0 * float(np.median(steps)) if steps.size else 0.0)) + 1
    return np.insert(time[known], holes, np.nan), np.insert(row[known], holes, np.nan)
