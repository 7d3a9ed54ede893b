"""Effects that are not named: rivals, the nearest candidates, and the experiment that would decide."""

from __future__ import annotations

import math

from hovercontrol.discrepancy.criteria import CRITERIA
from hovercontrol.discrepancy.report.context import Context
from hovercontrol.discrepancy.report.formatting import effect_words, prime, rounded
from hovercontrol.discrepancy.report.html import paragraph, table


def others(m: Context) -> str:
    """Return the section on rivals, leads and the next experiment."""
    sections = f"{_rivals(m)}{_leads(m)}{_next(m)}"
    return f"<h2>Other explanations</h2>{sections}" if sections else ""


def _rivals(m: Context) -> str:
    rows = [
        (
            effect_words(r.name),
            effect_words(r.instead_of),
            "both have the same effect on every log" if r.same else _odds(r.behind),
            "" if r.same else f"{r.t:.1f}",
        )
        for r in m.diagnosis.rivals
    ]
    if not rows:
        return ""
    text = (
        "Each was fitted in place of a named effect. Less likely: the likelihood ratio of the logs, with "
        f"the same penalty per parameter. A ratio of {rounded(math.exp(CRITERIA.apart / 2))} and a "
        f"difference of {CRITERIA.apart_t:g} standard errors over blocks would distinguish the two."
    )
    head = ("effect", "instead of", "less likely", "standard errors")
    return f"<h3>Not distinguished by these logs</h3>{paragraph(text)}{table(head, rows)}"


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
        f"Of {d.selection.candidates} candidates these gained most beside the named effects; the last "
        f"column says why they are not named. They are hints, not findings."
    )
    head = ("candidate", "likelihood gained", "t over blocks", "why it is not named")
    return f"<h3>Nearest candidates</h3>{paragraph(text)}{table(head, rows)}"


def _next(m: Context) -> str:
    d = m.diagnosis
    if not d.advice:
        return ""
    where = " The commands are in next_experiment.csv." if d.experiment else ""
    advice = d.advice[0].upper() + d.advice[1:].rstrip(".")
    return f"<h3>Next experiment</h3>{paragraph(advice + '.' + where)}"
