"""Section on where a model lacks something: over velocities, commands, place and time, in which rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.percent import percent
from hovercontrol.craft.effects.base import resolved_unit
from hovercontrol.craft.effects.law import TableLaw
from hovercontrol.identification.diagnose.evidence.laws import is_there, small, worst
from hovercontrol.identification.diagnose.evidence.missing import Missing
from hovercontrol.identification.diagnose.laws.regions import Range
from hovercontrol.identification.diagnose.laws.scan import Yardstick
from hovercontrol.identification.diagnose.places import acts_in
from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context, numbers_by_effect
from hovercontrol.identification.diagnose.report.formatting import (
    effect_words,
    prime,
    range_words,
    stretches,
    unit,
)
from hovercontrol.identification.diagnose.report.free_run import on_rows
from hovercontrol.identification.diagnose.report.templates import Table, legend, render, table

#: Maximum number of logs drawn over time, and of signals drawn for an equation.
LOGS, SIGNALS = 3, 4

#: Number of bins of a signal.
BINS = 12


@dataclass(frozen=True, eq=False)
class Binned:
    """A force in bins of a signal.

    Attributes
    ----------
    at, mean, std : ndarray, shape (b,)
        Mean signal and force of each bin, and the standard error of the latter.
    share : float
        Fraction of the mean square of the force that these means explain.
    """

    at: Array
    mean: Array
    std: Array
    share: float


def binned(signal: Array, force: Array, band: Array) -> Binned | None:
    """Return a force in bins of a signal with as many rows each; None for a signal that does not change.

    Rows that follow each other are not independent, so the standard error counts visits of a bin: with the
    variance s^2 of the force in its rows, the mean square b^2 of the force's own standard error, and m
    visits, it is ``((s^2 + b^2)/m)^(1/2)``.

    Parameters
    ----------
    signal, force, band : ndarray, shape (n,)
        In order of time; NaN where not known.

    Examples
    --------
    >>> x = np.tile(np.linspace(0.0, 1.0, 100), 5)
    >>> found = binned(x, np.where(x > 0.5, 2.0, 0.0), np.full(500, 0.1))
    >>> [round(float(v), 2) for v in (found.mean[0], found.mean[-1], found.std[0], found.share)]
    [0.0, 2.0, 0.04, 1.0]
    """
    known = np.isfinite(signal) & np.isfinite(force) & np.isfinite(band)
    signal, force, band = signal[known], force[known], band[known]
    edges = np.unique(np.quantile(signal, np.linspace(0.0, 1.0, BINS + 1))) if known.any() else np.zeros(1)
    if edges.size < 3:
        return None
    own = np.searchsorted(edges[1:-1], signal, side="right")
    enters = np.concatenate([[True], own[1:] != own[:-1]])
    n = np.bincount(own, minlength=edges.size - 1)
    keep = n > 0

    def mean_of(values: Array) -> Array:
        return np.bincount(own, weights=values, minlength=n.size)[keep] / n[keep]

    mean, visits = mean_of(force), np.bincount(own, weights=enters, minlength=n.size)[keep]
    std = np.sqrt((np.maximum(mean_of(force**2) - mean**2, 0.0) + mean_of(band**2)) / visits)
    share = float((n[keep] * mean**2).sum() / max(float((force**2).sum()), 1e-300))
    return Binned(mean_of(signal), mean, std, share)


def where(m: Context) -> str:
    """Return the section on where the given model lacks something, and where the amended one still does."""
    d = m.diagnosis
    if not d.missing or not d.remainders:
        return ""
    before, after = _by_log(d.missing), _by_log(d.missing_after)
    most = worst(d.missing_after)
    first = next((k for k, forces in enumerate(after) if most in forces), 0)
    logs = []
    for k in sorted(range(len(before)), key=lambda k: k != first)[:LOGS]:
        least = {f.equation: small(f) for f in before[k]}
        logs.append((before[k][0].log, pictures.forces(before[k], after[k], least, m.changed)))
    return render(
        "where.html",
        changed=m.changed,
        over=f"{d.remainders[0].over:.2g}",
        acting=_acting(m),
        functions=_functions(m),
        equations=[(prime(e), _over(m, e)) for e in _lacking(m)],
        kinds=legend("before", "after") if m.changed else legend("before"),
        logs=logs,
    )


def _lacking(m: Context) -> list[str]:
    """Return the equations in which the given model lacks something."""
    d = m.diagnosis
    left = {r.equation for r in d.remainders if r.there}
    named = {e for name in numbers_by_effect(d) for e in acts_in(d.selection.final, name).split()}
    there = {f.equation for f in d.missing if is_there(f)}
    return [r.equation for r in d.remainders if r.equation in left | (named & there)]


def _by_log(forces: Sequence[Missing]) -> list[list[Missing]]:
    """Return the forces of each log; two logs may share a name."""
    count = len({f.equation for f in forces})
    return [list(forces[k : k + count]) for k in range(0, len(forces), count)]


def _acting(m: Context) -> Table | None:
    """Return the table of what acts where: named effects, regions without a name, and rows that carry it."""
    d, units = m.diagnosis, m.diagnosis.amended.law_units()
    rows = []
    for name in numbers_by_effect(d):
        acts = prime(acts_in(d.selection.final, name).replace(" ", ", "))
        place = range_words(d.region(name), units) or "everywhere"
        rows.append((prime(effect_words(name)), acts, place, ""))
    for left in d.selection.regions:
        acts = prime(f"{left.equation}'")
        rows.append(("without a name", acts, range_words(left.region(), units), ""))
    for equation in _lacking(m):
        same = [f for f in d.missing if f.equation == equation]
        longest = max(same, key=lambda f: f.share)
        share = percent(float(np.mean([f.share for f in same])))
        carried = f"{share} of the rows; in {longest.log}{stretches(longest.segments)}"
        rows.append(("all that the given model lacks", prime(equation), "", carried))
    return table(("what", "acts in", "where", "rows that carry it"), rows) if rows else None


def _functions(m: Context) -> list[str]:
    """Return plots of the named effects that are functions of one signal, with their bands."""
    d, units = m.diagnosis, m.diagnosis.amended.law_units()
    tables = []
    for name in numbers_by_effect(d):
        law, function = d.amended.effect(name), d.function(name)
        if function is not None and isinstance(law, TableLaw) and (own := law.curve()) is not None:
            at, force, std = (np.array(function[key]) for key in ("grid", "values", "std"))
            named = Yardstick(f"{law.equation}'", (own.argument,), d.selection.gains[name], at, force, std)
            factor = resolved_unit(law.numbers["y1"].unit, {})
            tables.append(pictures.over_signal(named, factor, units[own.signal]))
    return tables


def _over(m: Context, equation: str) -> list[str]:
    """Return plots of what one equation lacks over the signals that explain most of it, and by position."""
    d = m.diagnosis
    before, after = ([f for f in forces if f.equation == equation] for forces in (d.missing, d.missing_after))
    was, now = _all_rows(before), _all_rows(after)
    positions, force_unit = _positions(m, before), before[0].unit
    over = {q.name: (q.unit, _rows_of(before, k)) for k, q in enumerate(before[0].over)} | positions
    found = {n: b for n, (_, v) in over.items() if (b := binned(v, *was)) is not None}
    regions = _regions(m, equation)
    drawn = []
    for name in sorted(found, key=lambda n: -found[n].share)[:SIGNALS]:
        own, values = over[name]
        amended = binned(values, *now) if m.changed else None
        title = f"over {name}: {percent(found[name].share)} of what is missing"
        marked = [r for r in regions if r["signal"] == name]
        drawn.append(pictures.in_bins(title, found[name], amended, marked, force_unit, (name, own)))
    if {"x", "y"} <= set(positions):
        (length, x), (_, y) = positions["x"], positions["y"]
        left = m.changed and any(r.there and r.equation == equation for r in d.remainders)
        for kind, (force, _) in (("before", was), ("after", now))[: 1 + left]:
            drawn.append(pictures.floor_map("by position", x, y, force, unit(force_unit), kind, length))
    return [plot for plot in drawn if plot]


def _all_rows(same: Sequence[Missing]) -> tuple[Array, Array]:
    """Return the force of one equation and its standard error in the rows of all logs."""
    return np.concatenate([f.force for f in same]), np.concatenate([f.band for f in same])


def _rows_of(same: Sequence[Missing], k: int) -> Array:
    """Return a quantity on which a force may depend in the rows of all logs."""
    return np.concatenate([f.over[k].values for f in same])


def _regions(m: Context, equation: str) -> list[Range]:
    """Return the ranges of signals in which something acts in an equation, named or not."""
    d = m.diagnosis
    final, left = d.selection.final, d.selection.regions
    named = [r for n in numbers_by_effect(d) if equation in acts_in(final, n).split() for r in d.region(n)]
    return [*named, *(r for one in left if f"{one.equation}'" == equation for r in one.region())]


def _positions(m: Context, same: Sequence[Missing]) -> dict[str, tuple[str, Array]]:
    """Return the positions of a model, states whose equations take no force, in the rows of the logs."""
    fit = m.diagnosis.selection.final
    problem = fit.problem
    states = [problem.block.states[i] for i in problem.free]
    places = [k for k in range(len(states)) if k not in problem.driven]
    found: dict[str, list[Array]] = {states[k].name: [] for k in places}
    for log, f in enumerate(same):
        time, path = on_rows(fit, fit.path, log)
        at = np.searchsorted(time, f.time - problem.logs[log].origin).clip(0, time.size - 1)
        for k in places:
            found[states[k].name].append(path[at, problem.free[k]])
    return {states[k].name: (states[k].unit, np.concatenate(found[states[k].name])) for k in places}
