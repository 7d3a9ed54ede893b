"""What remains: in which equation, how much, when and where on the floor."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.evidence.laws import is_there, regime, small, worst
from hovercontrol.discrepancy.evidence.missing import Missing
from hovercontrol.discrepancy.report import pictures
from hovercontrol.discrepancy.report.context import Context
from hovercontrol.discrepancy.report.formatting import listed, percent, prime, unit
from hovercontrol.discrepancy.report.formatting import small as digits
from hovercontrol.discrepancy.report.free_run import on_rows
from hovercontrol.discrepancy.report.html import folded, grid, legend, paragraph, table

Array = NDArray[np.float64]

#: Logs whose forces are drawn, and stretches that are named, at most.
LOGS, STRETCHES = 3, 3


def remainder(m: Context) -> str:
    """Return the section on what remains."""
    d = m.diagnosis
    if not d.missing:
        return ""
    before, after = _by_log(d.missing), _by_log(d.missing_after)
    most = worst(d.missing_after)
    first = next((k for k, forces in enumerate(after) if most in forces), 0)
    order = sorted(range(len(before)), key=lambda k: k != first)
    parts = []
    for k in order[:LOGS]:
        least = {f.equation: small(f) for f in before[k]}
        plots = grid(pictures.forces(before[k], after[k], least, m.changed))
        log = before[k][0].log
        parts.append(folded(log, plots) if k != first else f"<h3>Over time, in {escape(log)}</h3>{plots}")
    kinds = ("before", "after") if m.changed else ("before",)
    how = (
        "The acceleration that the model lacks, smoothed from the logs as an unknown addition to each "
        "equation; the band is twice its standard error. Marked at the foot: where it stands out of the band."
    )
    return f"<h2>What remains</h2>{_sizes(m)}{_maps(m)}{paragraph(how)}{legend(*kinds)}{''.join(parts)}"


def _by_log(forces: Sequence[Missing]) -> list[list[Missing]]:
    """Return the forces of each log; two logs may share a name."""
    count = len({f.equation for f in forces})
    return [list(forces[k : k + count]) for k in range(0, len(forces), count)]


def _sizes(m: Context) -> str:
    """Return what remains in each equation, and which part of what was missing is explained."""
    d = m.diagnosis
    rows = []
    for r in d.remainders:
        same = [f for f in d.missing_after if f.equation == r.equation]
        size = f"{digits(r.rms)} {unit(r.unit)}" if r.there else "nothing beyond noise"
        share = percent(r.share_explained)
        where = prime(regime(same)) if r.there and any(is_there(f) for f in same) else ""
        longest = max(same, key=lambda f: f.share, default=None)
        when = f"{longest.log}{stretches(longest.segments)}" if r.there and longest else ""
        rows.append((prime(r.equation), size, *([share] if m.changed else []), where, when))
    over = d.remainders[0].over if d.remainders else 0.0
    explained = ("explained",) if m.changed else ()
    text = f"Root mean square of the missing acceleration, averaged over {over:.2g} s."
    if m.changed:
        text += " Explained: the part of its mean square that the named effects took."
    return paragraph(text) + table(("equation", "remains", *explained, "largest", "when"), rows)


def _maps(m: Context) -> str:
    """Return where on the floor what remains is large."""
    d = m.diagnosis
    fit = d.selection.final
    problem = fit.problem
    names = [s.name for s in problem.block.states]
    moving = [names[problem.free[i]] for i in problem.driven]
    if not {"x", "y"} <= set(names) or not any(r.there for r in d.remainders):
        return ""
    every = [
        on_rows(fit, np.concatenate([fit.path, fit.missing], axis=2), k)[1] for k in range(len(problem.logs))
    ]
    rows = np.concatenate(every)
    x, y = rows[:, names.index("x")], rows[:, names.index("y")]
    forces = {name: rows[:, len(names) + j] for j, name in enumerate(moving)}
    kind = "after" if m.changed else "before"
    plots = []
    if {"u", "v"} <= set(forces):
        planar = np.hypot(forces.pop("u"), forces.pop("v"))
        plots.append(pictures.floor_map("force in u′ and v′", x, y, planar, "m/s²", kind))
    for r in d.remainders:
        name = r.equation.removesuffix("'")
        if name in forces and r.there:
            plots.append(
                pictures.floor_map(f"in {prime(r.equation)}", x, y, forces[name], unit(r.unit), kind)
            )
    shown = grid(plots)
    text = "Root mean square of what remains by place, over all training logs."
    return f"<h3>On the floor</h3>{paragraph(text)}{shown}" if any(plots) else ""


def stretches(segments: Sequence[tuple[float, float]]) -> str:
    """Return when a force is there: the longest stretches, and how many more there are.

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
