"""Section on the remainder: its size by equation, its times, and its place on the floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hovercontrol.base.percent import percent
from hovercontrol.craft.effects.base import resolved_unit
from hovercontrol.craft.effects.law import TableLaw
from hovercontrol.identification.diagnose.evidence.laws import regime_of, small, worst
from hovercontrol.identification.diagnose.evidence.missing import Missing
from hovercontrol.identification.diagnose.laws.scan import Yardstick
from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context, numbers_by_effect
from hovercontrol.identification.diagnose.report.formatting import listed, prime, rounded, unit
from hovercontrol.identification.diagnose.report.formatting import small as digits
from hovercontrol.identification.diagnose.report.free_run import on_rows
from hovercontrol.identification.diagnose.report.templates import Table, legend, render, table

#: Maximum number of logs whose forces are drawn, and of intervals that are listed.
LOGS, STRETCHES = 3, 3


def remainder(m: Context) -> str:
    """Return the section on the remainder."""
    d = m.diagnosis
    if not d.missing or not d.remainders:
        return ""
    was, now = d.missing, d.missing_after
    before, after, most = _by_log(was), _by_log(now), worst(now)
    first = next((k for k, forces in enumerate(after) if most in forces), 0)
    order = sorted(range(len(before)), key=lambda k: k != first)
    logs = []
    for k in order[:LOGS]:
        least = {f.equation: small(f) for f in before[k]}
        logs.append((before[k][0].log, pictures.forces(before[k], after[k], least, m.changed)))
    return render(
        "remainder.html",
        changed=m.changed,
        over=f"{d.remainders[0].over:.2g}",
        sizes=_sizes(m, now),
        sensors=_sensors(m),
        maps=_maps(m, now),
        laws=_laws(m),
        curves=_curves(m),
        functions=_functions(m),
        kinds=legend("before", "after") if m.changed else legend("before"),
        logs=logs,
    )


def _by_log(forces: Sequence[Missing]) -> list[list[Missing]]:
    """Return the forces of each log; two logs may share a name."""
    count = len({f.equation for f in forces})
    return [list(forces[k : k + count]) for k in range(0, len(forces), count)]


def _sizes(m: Context, missing: Sequence[Missing]) -> Table:
    """Return the table of the remainder of each equation, with the fraction explained."""
    d = m.diagnosis
    rows = []
    for r in d.remainders:
        same = [f for f in missing if f.equation == r.equation]
        size = f"{digits(r.rms)} {unit(r.unit)}" if r.there else "none beyond noise"
        share = percent(r.share_explained) if r.there or r.share_explained > 0.0 else "–"
        where = prime(regime_of(same)) if r.there else ""
        longest = max(same, key=lambda f: f.share, default=None)
        when = f"{longest.log}{stretches(longest.segments)}" if r.there and longest else ""
        rows.append((prime(r.equation), size, *([share] if m.changed else []), where, when))
    explained = ("explained",) if m.changed else ()
    return table(("equation", "remains", *explained, "largest", "when"), rows)


def _laws(m: Context) -> Table | None:
    """Return the table of what any law of a few signals could still take; None if it is not asked."""
    d = m.diagnosis
    rows = []
    for y in d.yardsticks:
        taken = d.taken(y.equation)
        function = "a function of each of" if len(y.signals) > 2 else "any function of"
        told = f"{function} {listed(y.signals)}" if y.gain > 0.0 else "no function of one to three signals"
        rows.append((prime(y.equation), told, rounded(y.gain), rounded(taken), percent(y.share(taken))))
    head = ("equation", "could still be explained by", "gain", "gain of the named effects", "explained")
    return table(head, rows) if rows else None


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


def _curves(m: Context) -> list[str]:
    """Return plots of what is missing as a function of the signal that tells most of it."""
    d, units = m.diagnosis, m.diagnosis.amended.law_units()
    of = {r.equation: r.unit for r in d.remainders}
    return [
        pictures.over_signal(y, of[y.equation], units[y.signals[0]])
        for y in d.yardsticks
        if y.at.size > 1 and y.gain > 0.0
    ]


def _sensors(m: Context) -> Table | None:
    """Return the table of channels with slow errors; None if there are none."""
    rows = [
        (s.channel, f"{digits(s.rms)} {unit(s.unit)}", f"{digits(s.noise)} {unit(s.unit)}")
        for s in m.diagnosis.slow_errors
    ]
    return table(("measured", "error", "noise from sample to sample"), rows) if rows else None


def _maps(m: Context, missing: Sequence[Missing]) -> list[str]:
    """Return maps of where on the floor the remainder is large."""
    d = m.diagnosis
    fit = d.selection.final
    problem = fit.problem
    names = [s.name for s in problem.block.states]
    if not {"x", "y"} <= set(names) or not any(r.there for r in d.remainders):
        return []
    places = []
    for k, log in enumerate(problem.logs):
        time, path = on_rows(fit, fit.path[..., [names.index("x"), names.index("y")]], k)
        places += [path[np.searchsorted(time, log.time - log.origin).clip(0, time.size - 1)]]
    x, y = np.concatenate(places).T
    equations = dict.fromkeys(f.equation for f in missing)
    forces = {e: np.concatenate([f.force for f in missing if f.equation == e]) for e in equations}
    kind = "after" if m.changed else "before"
    plots = []
    if {"u'", "v'"} <= set(forces):
        planar = np.hypot(forces.pop("u'"), forces.pop("v'"))
        plots.append(pictures.floor_map("force in u′ and v′", x, y, planar, "m/s²", kind))
    for r in d.remainders:
        if r.equation in forces and r.there:
            title = f"in {prime(r.equation)}"
            plots.append(pictures.floor_map(title, x, y, forces[r.equation], unit(r.unit), kind))
    return [plot for plot in plots if plot]


def stretches(segments: Sequence[tuple[float, float]]) -> str:
    """Return as text when a force is significant: the longest intervals and the number of others.

    Examples
    --------
    >>> stretches([(0.0, 2.5), (4.0, 9.26)])
    ', 0 to 2.5 s and 4 to 9.3 s'
    """
    longest = sorted(sorted(segments, key=lambda s: s[0] - s[1])[:STRETCHES])
    if not longest:
        return ""
    named = [f"{round(begin, 1):g} to {round(end, 1):g} s" for begin, end in longest]
    more = len(segments) - len(longest)
    return f", {listed(named)}{f', and {more} shorter' if more else ''}"
