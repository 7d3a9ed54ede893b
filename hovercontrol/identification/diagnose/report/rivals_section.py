"""Section on effects that are not named: rivals, best candidates, and the experiment that would decide."""

from __future__ import annotations

import math

from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.places import place_of_rival
from hovercontrol.identification.diagnose.report.context import Context
from hovercontrol.identification.diagnose.report.formatting import effect_words, prime, rounded
from hovercontrol.identification.diagnose.report.templates import Table, render, table


def rivals_section(m: Context) -> str:
    """Return the section on rivals, leads and the next experiment."""
    rivals, leads, advice = _rivals(m), _leads(m), _next(m)
    trace = _trace(m)
    if not (rivals or leads or advice or trace):
        return ""
    return render(
        "others.html",
        rivals=rivals,
        leads=leads,
        advice=advice,
        trace=trace,
        candidates=m.diagnosis.selection.candidates,
        apart=rounded(math.exp(CRITERIA.apart / 2)),
        apart_t=f"{CRITERIA.apart_t:g}",
    )


def _rivals(m: Context) -> Table | None:
    rows = [
        (
            effect_words(r.name),
            prime(place_of_rival(r)),
            effect_words(r.instead_of),
            "both have the same effect on every log" if r.same else _odds(r.behind),
            "" if r.same else f"{r.t:.1f}",
        )
        for r in m.diagnosis.rivals
    ]
    return table(("effect", "place", "instead of", "less likely", "standard errors"), rows) if rows else None


def _odds(behind: float) -> str:
    """Return a likelihood ratio as text, from twice the difference of log likelihoods."""
    times = f"{rounded(math.exp(min(abs(behind), 700.0) / 2))} times"
    return "as likely" if abs(behind) < 0.1 else times if behind > 0.0 else f"it is {times} likelier"


def _leads(m: Context) -> Table | None:
    rows = [
        (effect_words(lead.name), rounded(lead.gain), f"{lead.blocks_t:.1f}", prime(lead.reason))
        for lead in m.diagnosis.leads
    ]
    head = ("candidate", "likelihood gained", "t over segments", "why it is not named")
    return table(head, rows) if rows else None


def _trace(m: Context) -> Table | None:
    """Return every decision of the search; of the scores only the last of each effect."""
    last = {row.effect: row for row in m.diagnosis.trace if row.step == "score"}
    shown = [row for row in m.diagnosis.trace if row.step != "score" or last[row.effect] is row]
    rows = [
        (
            row.step,
            effect_words(row.effect),
            prime(row.rule),
            _number(row.value),
            _number(row.limit),
            "yes" if row.passed else "no",
        )
        for row in shown
    ]
    return table(("step", "effect", "what is asked", "value", "limit", "passed"), rows) if rows else None


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else ""


def _next(m: Context) -> str:
    d = m.diagnosis
    if not d.advice:
        return ""
    where = " The commands are in next_experiment.csv." if d.experiment else ""
    advice = d.advice[0].upper() + d.advice[1:].rstrip(".")
    return f"{advice}.{where}"
