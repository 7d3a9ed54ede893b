"""The pictures of a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.holdout import Gap
from hovercontrol.discrepancy.localize import Missing
from hovercontrol.discrepancy.report.svg import Plot, bounds
from hovercontrol.discrepancy.report.words import prime, times, unit
from hovercontrol.discrepancy.traces import Trace

Array = NDArray[np.float64]

#: How much of a log is shown beside the simulations [s].
SPAN = 20.0


def gap_bars(before: Gap, after: Gap, changed: bool) -> str:
    """Return bars of each channel's error, in multiples of its noise, before and after."""
    rows = []
    multiples = {
        c: [g.nrmse[c] / max(before.floor[c], 1e-12) for g in ((before, after) if changed else (before,))]
        for c in before.nrmse
    }
    longest = max([1.5, *(value for pair in multiples.values() for value in pair)])
    for channel, pair in multiples.items():
        bars = "".join(
            f'<span class="bar"><i class="{kind}" style="--long:{value / longest:.3f}"></i>'
            f"<b>{times(value)}</b></span>"
            for value, kind in zip(pair, ("before", "after"), strict=False)
        )
        rows.append(
            f'<div class="row"><span class="channel">{escape(channel)}</span>'
            f'<span class="bars" style="--floor:{1.0 / longest:.3f}">{bars}</span></div>'
        )
    return f'<div class="gap">{"".join(rows)}</div>'


def overlays(before: Trace, after: Trace, changed: bool) -> list[str]:
    """Return for each channel measurement and simulations in the stretch where the given model errs most."""
    begin, end = worst(before)
    rows = (before.time >= begin) & (before.time < end)
    time, found, fresh = before.time[rows], [], _fresh(before, rows)
    for i, channel in enumerate(before.channels):
        measured, was, now = (r[i][rows] for r in (before.measured, before.simulated, after.simulated))
        shown = [measured, was, now] if changed else [measured, was]
        plot = Plot((begin, end), bounds(shown, part=0.999), channel)
        plot.line(time, _joined(measured), "measured")
        plot.line(time, _joined(was, fresh), "before", fresh)
        if changed:
            plot.line(time, _joined(now, fresh), "after", fresh)
        found.append(plot.svg(unit(before.units[channel])))
    return found


def errors(before: Trace, after: Trace, noise: dict[str, float], changed: bool) -> list[str]:
    """Return for each channel simulated minus measured over the whole log, with twice the noise as a band."""
    found, fresh = [], _fresh(before, np.ones(before.time.size, dtype=bool))
    span = (float(before.time[0]), float(before.time[-1]))
    for i, channel in enumerate(before.channels):
        was, now = (t.simulated[i] - t.measured[i] for t in (before, after))
        level = np.full(before.time.size, 2.0 * noise[channel])
        shown = [was, now, level] if changed else [was, level]
        plot = Plot(span, bounds(shown, around_zero=True, part=0.998), f"error of {channel}", (360.0, 120.0))
        plot.line(before.time, _joined(was, fresh), "before", fresh)
        if changed:
            plot.line(before.time, _joined(now, fresh), "after", fresh)
        plot.band(before.time, -level, level, "noise")
        found.append(plot.svg(unit(before.units[channel])))
    return found


def path(before: Trace, after: Trace, changed: bool) -> str:
    """Return the way over the floor, measured and simulated; empty if it was not measured."""
    if not {"x", "y"} <= set(before.channels):
        return ""
    begin, end = worst(before)
    rows = (before.time >= begin) & (before.time < end)
    i, j = before.channels.index("x"), before.channels.index("y")
    shown = [before.measured, before.simulated] + ([after.simulated] if changed else [])
    (x0, x1), (y0, y1) = bounds([s[i][rows] for s in shown]), bounds([s[j][rows] for s in shown])
    half = 0.5 * max(x1 - x0, (y1 - y0) * 306.0 / 238.0)
    x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
    room = (y - half * 238.0 / 306.0, y + half * 238.0 / 306.0)
    plot = Plot((x - half, x + half), room, "way over the floor (y over x)", (360.0, 280.0))
    for trace, kind in zip(shown, ("measured", "before", "after"), strict=False):
        fresh = [] if kind == "measured" else _fresh(before, rows)
        plot.line(_joined(trace[i][rows], fresh), _joined(trace[j][rows], fresh), kind, fresh)
    return plot.svg("m", "m")


def forces(
    before: Sequence[Missing], after: Sequence[Missing], least: Mapping[str, float], changed: bool
) -> list[str]:
    """Return for each equation the missing force over time, before and after, with its band and segments.

    Parameters
    ----------
    before, after : sequence of Missing
        Of one log, equation by equation.
    least : mapping
        By equation, the force that the axes show at least.
    changed : bool
        Whether there is an after.
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
        found.append(plot.svg(unit(was.unit)))
    return found


def dependence(
    before: Missing, after: Missing, values: Array, label: tuple[str, str], least: float, changed: bool
) -> str:
    """Return the missing force over a quantity: means over equal shares of the rows, with their spread.

    Parameters
    ----------
    before, after : Missing
    values : ndarray, shape (n,)
        The quantity.
    label : (str, str)
        Its name and unit.
    least : float
        The force that the axes show at least.
    changed : bool
    """
    means = [_binned(values, m.force) for m in ((before, after) if changed else (before,))]
    ends = [y + sign * half for _, y, half in means for sign in (-1.0, 1.0)]
    limits = bounds(ends, around_zero=True, least=least)
    x = bounds([means[0][0]])
    plot = Plot(x, limits, f"{prime(before.equation)} over {label[0]}", (360.0, 170.0))
    for (at, y, half), kind in zip(means, ("before", "after"), strict=False):
        plot.line(at, y, kind)
        plot.dots(at, y, half, kind)
    return plot.svg(unit(before.unit), unit(label[1]))


def share_explained(values: Array, force: Array) -> float:
    """Return which part of the force's variance its means over a quantity explain (correlation ratio)."""
    known = np.isfinite(values) & np.isfinite(force)
    if known.sum() < 50 or np.ptp(values[known]) < 1e-9 or not np.ptp(force[known]) > 0.0:
        return 0.0
    bins = _bins(values[known])
    f = np.clip(force[known], *np.quantile(force[known], [0.02, 0.98]))
    means = np.array([f[bins == b].mean() if (bins == b).any() else 0.0 for b in range(bins.max() + 1)])
    return float(np.var(means[bins]) / max(np.var(f), 1e-300))


def _binned(values: Array, force: Array) -> tuple[Array, Array, Array]:
    known = np.isfinite(values) & np.isfinite(force)
    v, f = values[known], force[known]
    bins = _bins(v)
    used = [b for b in range(bins.max() + 1) if (bins == b).sum() > 3]
    half = [2.0 * f[bins == b].std() / np.sqrt(max((bins == b).sum() / 25.0, 1.0)) for b in used]
    return (
        np.array([v[bins == b].mean() for b in used]),
        np.array([f[bins == b].mean() for b in used]),
        np.array(half),
    )


def _bins(values: Array, count: int = 15) -> NDArray[np.intp]:
    edges = np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    return np.searchsorted(edges, values, side="right")


def worst(trace: Trace) -> tuple[float, float]:
    """Return the stretch in which a trace errs most, the whole of a short one [s]."""
    time = trace.time
    if time[-1] - time[0] <= 1.5 * SPAN:
        return float(time[0]), float(time[-1])
    error = np.zeros(time.size)
    for measured, simulated in zip(trace.measured, trace.simulated, strict=True):
        size = float(np.nanstd(measured)) or 1.0
        gap = np.nan_to_num((simulated - measured) / size, nan=0.0, posinf=10.0, neginf=-10.0)
        error += np.minimum(gap**2, 100.0)
    total = np.concatenate([[0.0], np.cumsum(error)])
    starts = [s for s in trace.starts if s + SPAN <= time[-1]] or [float(time[0])]
    rows = [np.searchsorted(time, [s, s + SPAN]) for s in starts]
    best = int(np.argmax([total[b] - total[a] for a, b in rows]))
    return starts[best], starts[best] + SPAN


def _fresh(trace: Trace, rows: NDArray[np.bool_]) -> list[int]:
    """Return at which of the shown rows the simulation starts afresh."""
    return np.flatnonzero(np.isin(trace.time[rows], trace.starts)).tolist()


def _joined(row: Array, starts: Sequence[int] = ()) -> Array:
    """Return a row with short holes bridged, so that a sample left out does not cut the line.

    Nothing is bridged where a simulation starts afresh.
    """
    return np.concatenate([_bridged(part) for part in np.split(row, starts)])


def _bridged(row: Array) -> Array:
    known = np.flatnonzero(np.isfinite(row))
    if known.size < 2:
        return row
    joined = np.interp(np.arange(row.size), known, row[known])
    steps = np.diff(known)
    holes = steps > max(10.0, 3.0 * float(np.median(steps)))  # a slow sensor has no holes
    for a, b in zip(known[:-1][holes], known[1:][holes], strict=True):
        joined[a + 1 : b] = np.nan
    joined[: known[0]] = np.nan
    joined[known[-1] + 1 :] = np.nan
    return joined
