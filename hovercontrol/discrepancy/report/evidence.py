"""Candidates with their evidence: what was named, what else was tried, what cannot be told apart, and why."""

from __future__ import annotations

import math

from hovercontrol.discrepancy.candidates import Scored, Scores
from hovercontrol.discrepancy.diagnosis import Diagnosis
from hovercontrol.discrepancy.holdout import Gap
from hovercontrol.discrepancy.probes import Sign
from hovercontrol.discrepancy.report.html import folded, items, paragraph, table
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.discrepancy.report.verdict import first_of_kind, sign_words
from hovercontrol.discrepancy.report.words import effect_words, rounded, small, times, unit
from hovercontrol.discrepancy.weighing import APART, EACH, LEAST
from hovercontrol.effects.base import resolved_unit

#: Signs whose weight is that of a test: the others have no number that chance could give.
TESTED = ("drift", "place", "memory", "oscillation", "bursts")

#: Candidates shown before the rest is folded away.
SHOWN = 8


def evidence(m: Material) -> str:
    """Return the section on candidates, rivals, what was rejected, and signs of the unknown."""
    rejected = [f"{effect_words(name)}: {why}" for name, why in m.diagnosis.selection.rejected]
    signs = [_sign(m, s) for s in first_of_kind(m.diagnosis.signs)]
    return (
        f"<h2>Evidence</h2>{_named(m)}{_rivals(m)}{_next(m)}"
        f"{items('Signs of something outside the catalogue', signs)}{_candidates(m)}"
        f"{items('Rejected', rejected)}"
    )


def _sign(m: Material, sign: Sign) -> str:
    others = sum(s.kind == sign.kind for s in m.diagnosis.signs) - 1
    more = f", and {others} more of this kind" if others else ""
    if sign.kind not in TESTED:
        return f"{sign_words(sign)}{more}"
    return (
        f"{sign_words(sign)} (evidence {rounded(sign.gain)}, where chance alone gives about "
        f"{sign.numbers}){more}"
    )


def _named(m: Material) -> str:
    if not m.named:
        return ""
    gains = m.diagnosis.selection.gains
    rows = [(effect_words(name), _size(gains.get(name, math.nan))) for name in m.named]
    said = (
        "Each named effect is needed: how many standard errors it is away from not being there, squared. "
        f"{LEAST:g} is the least that counts."
    )
    return paragraph(said) + table(("named", "evidence"), rows)


def _rivals(m: Material) -> str:
    """Return what cannot be told from the named effects, and how each errs on the hold-out log."""
    d = m.diagnosis
    if not d.rivals:
        return ""
    rows = [(f"{effect_words(n)} (named)", "", "", "", _error(d.after)) for n in m.named if _rivalled(d, n)]
    rows += [
        (
            effect_words(r.name),
            effect_words(r.instead_of),
            _odds(r.behind),
            f"{r.correlation:.3f}",
            _error(d.rival_gaps.get(r.name)),
        )
        for r in d.rivals
    ]
    head = ["effect", "in the place of", "less likely", "correlation", "error on the hold-out log"]
    said = (
        "Each rival was fitted in the place of a named effect. Less likely: by how many times it makes the "
        f"training logs less likely, {rounded(math.exp(EACH / 2))} times charged for each number that one "
        f"has more than the other; {rounded(math.exp(APART / 2))} times would tell the two apart. "
        "Correlation: how alike they are in what they leave in these logs once the coefficients are fitted; "
        "1 is the same."
    )
    if d.rival_gaps:
        said += (
            " Error: root mean square over all channels of the log that took no part, in multiples of the "
            "noise. It is shown, and decides nothing."
        )
    else:
        head = head[:-1]
    told = table(head, [row[: len(head)] for row in rows])
    return f"<h3>Cannot be told apart by these logs</h3>{paragraph(said)}{told}"


def _rivalled(d: Diagnosis, name: str) -> bool:
    return any(r.instead_of == name for r in d.rivals)


def _odds(behind: float) -> str:
    """Return how many times less likely, from twice the difference of log likelihoods."""
    return "as likely" if abs(behind) < 0.1 else f"{rounded(math.exp(behind / 2))} times"


def _error(gap: Gap | None) -> str:
    return times(math.sqrt(gap.chi2 / max(gap.count, 1))) if gap else ""


def _next(m: Material) -> str:
    if not m.diagnosis.advice:
        return ""
    where = " The commands are in next_experiment.csv." if m.diagnosis.experiment else ""
    advice = m.diagnosis.advice[0].upper() + m.diagnosis.advice[1:].rstrip(".")
    return f"<h3>What to drive next</h3>{paragraph(advice + '.' + where)}"


def _candidates(m: Material) -> str:
    if m.diagnosis.verdict == "unexplained":
        return paragraph(
            "Candidates are not listed: with something unknown in the logs the best of them would be a wrong "
            "name."
        )
    rows = [_row(m, s) for s in m.scores.best()]
    head = ("effect", "gain", "at its best", "would show from", "")
    text = (
        "How much twice the log likelihood would rise if the effect were added to the model as it was and "
        f"everything fitted again, to first order, in windows of {m.over:g} s. Effects alike gain alike: "
        "naming is decided by fits of the best, in longer windows too, not by this list. The fourth column "
        "is the size from which on windows of this length would show it."
    )
    more = folded(f"{len(rows) - SHOWN} more", table(head, rows[SHOWN:])) if len(rows) > SHOWN else ""
    return f"<h3>All candidates, one at a time</h3>{paragraph(text)}{table(head, rows[:SHOWN])}{more}"


def _row(m: Material, s: Scored) -> tuple[str, ...]:
    name = s.candidate.name
    note = "" if s.allowed else "not with this sign"
    note = "rival" if any(r.name == name for r in m.diagnosis.rivals) else note
    note = "named" if name in m.named else note
    return effect_words(name), _size(s.gain), *_sizes(m.scores, s, m), note


def _sizes(scores: Scores, s: Scored, m: Material) -> tuple[str, str]:
    """Return an effect's numbers at its linear best, and from which size on it would show."""
    trial = s.candidate.trial
    units = m.diagnosis.model.input_units()
    bar = (LEAST + EACH * len(s.candidate.amplitudes)) * scores.inflation
    best, least = [], []
    for key, part, column in zip(s.candidate.amplitudes, s.parts, s.columns, strict=False):
        number = type(trial).numbers[key]
        step = trial.values[key] - number.neutral
        text = unit(resolved_unit(number.unit, units))
        size = small(number.neutral + part * step)
        best.append(f"{size} {text}".strip() if size else "")
        information = float(scores.S[column, column])
        if information > 0:
            size = small(abs(step) * math.sqrt(bar / information), 1)
            least.append(f"{size} {text}".strip() if size else "")
    return ", ".join(filter(None, best)), ", ".join(filter(None, least))


def _size(gain: float) -> str:
    return "" if not math.isfinite(gain) else f"{gain:,.0f}".replace(",", "\u202f")
