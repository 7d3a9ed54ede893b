"""Section on the remainder: its size by equation, and what laws could still explain of it."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.base.percent import percent
from hovercontrol.identification.diagnose.evidence.laws import regime_of
from hovercontrol.identification.diagnose.evidence.missing import Missing
from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context
from hovercontrol.identification.diagnose.report.formatting import listed, prime, rounded, stretches, unit
from hovercontrol.identification.diagnose.report.formatting import small as digits
from hovercontrol.identification.diagnose.report.templates import Table, render, table


def remainder(m: Context) -> str:
    """Return the section on the remainder."""
    d = m.diagnosis
    if not d.missing or not d.remainders:
        return ""
    return render(
        "remainder.html",
        changed=m.changed,
        over=f"{d.remainders[0].over:.2g}",
        sizes=_sizes(m, d.missing_after),
        sensors=_sensors(m),
        laws=_laws(m),
        curves=_curves(m),
    )


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
