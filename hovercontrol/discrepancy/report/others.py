"""What is not named: candidates that came near, what cannot be told apart, and what would tell."""

from __future__ import annotations

import math

from hovercontrol.discrepancy.criteria import CRITERIA
from hovercontrol.discrepancy.report.context import Context
from hovercontrol.discrepancy.report.formatting import effect_words, prime, rounded
from hovercontrol.discrepancy.report.html import paragraph, table


def others(m: Context) -> str:
    """Return the section on rivals, leads and the next experiment."""
    told = f"{_rivals(m)}{_leads(m)}{_next(m)}"
    return f"<h2>What else it may be</h2>{told}" if told else ""


def _rivals(m: Context) -> str:
    rows = [
        (
            effect_words(r.name),
            effect_words(r.instead_of),
            "every log shows both alike" if r.same else _odds(r.behind),
            "" if r.same else f"{r.t:.1f}",
        )
        for r in m.diagnosis.rivals
    ]
    if not rows:
        return ""
    text = (
        "Each was fitted in the place of a named effect. Less likely: by how many times it makes the logs, "
        f"numbers penalised alike. {rounded(math.exp(CRITERIA.apart / 2))} times, by {CRITERIA.apart_t:g} "
        "standard errors over blocks, would tell the two apart."
    )
    head = ("effect", "instead of", "less likely", "standard errors")
    return f"<h3>Cannot be told apart by these logs</h3>{paragraph(text)}{table(head, rows)}"


def _odds(behind: float) -> str:
    """Return how many times less likely, from twice the difference of log likelihoods."""
    return "as likely" if behind < 0.1 else f"{rounded(math.exp(min(behind, 700.0) / 2))} times"


def _leads(m: Context) -> str:
    d = m.diagnosis
    if not d.leads:
        return ""
    rows = [
        (effect_words(lead.name), rounded(lead.gain), f"{lead.blocks_t:.1f}", prime(lead.reason))
        for lead in d.leads
    ]
    text = (
        f"Of {d.selection.candidates} candidates these gained most beside what is named; with the reason why "
        "no name is given. They are leads, not findings."
    )
    head = ("candidate", "likelihood gained", "t over blocks", "why it is not named")
    return f"<h3>Candidates that came near</h3>{paragraph(text)}{table(head, rows)}"


def _next(m: Context) -> str:
    d = m.diagnosis
    if not d.advice:
        return ""
    where = " The commands are in next_experiment.csv." if d.experiment else ""
    advice = d.advice[0].upper() + d.advice[1:].rstrip(".")
    return f"<h3>What to drive next</h3>{paragraph(advice + '.' + where)}"
