"""Evidence for named effects: likelihood, the same size on disjoint blocks, better predictions."""

from __future__ import annotations

import numpy as np

from hovercontrol.base.percent import percent
from hovercontrol.identification.diagnose.evidence.effect_evidence import Evidence
from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context, numbers_by_effect
from hovercontrol.identification.diagnose.report.formatting import effect_words, rounded, unit
from hovercontrol.identification.diagnose.report.templates import legend, render, table
from hovercontrol.identification.diagnose.report.verdict import SIGNIFICANCE, key_of, most_fallen

#: Rows of the evidence table.
MEASURES = (
    "likelihood gained",
    "segments of the same sign",
    "t over segments",
    "spread",
    "gained on the held-out log",
    "held-out errors",
)


def evidence(m: Context) -> str:
    """Return the section on the evidence for each named effect; empty if none is named."""
    d = m.diagnosis
    if not m.changed:
        return ""
    columns = [_column(d.evidence[name]) for name in numbers_by_effect(d)]
    rows = list(zip(MEASURES, *columns, strict=True))
    head = ("", *(effect_words(name) for name in numbers_by_effect(d)))
    return render("evidence.html", measures=table(head, rows), **_blocks(m))


def _column(e: Evidence) -> tuple[str, ...]:
    b = e.blocks
    spread = percent(b.spread) if np.isfinite(b.std).any() else "–"
    there = (
        f"{rounded(e.gained.gain)} (t = {e.gained.t:.1f})".replace("-", "−") if e.gained else "none held out"
    )
    return (rounded(e.gain), f"{b.same_sign} of {b.n}", f"{b.t:.1f}", spread, there, _held(e))


def _held(e: Evidence) -> str:
    """Return how predictions of the held-out log change."""
    far = e.holdout.each
    if not far:
        return "none held out"
    falls = sum(a.t >= SIGNIFICANCE.sure and a.after < a.before for a in far)
    rises = sum(a.t <= -SIGNIFICANCE.sure and a.after > a.before for a in far)
    best = most_fallen(far)
    most = ""
    if best:
        fall = percent(1.0 - best.after / best.before)
        most = f", most by {fall} ({best.channel}, {best.horizon:.2g} s ahead)"
    return f"{falls} of {len(far)} reduced, {rises} increased{most}"


def _blocks(m: Context) -> dict[str, object]:
    """Return figures of each effect's size by block, the colours of logs, and whether one has no size."""
    d = m.diagnosis
    problem = d.selection.final.problem
    shown, logs = [], set[int]()
    for name, numbers in numbers_by_effect(d).items():
        blocks = d.evidence[name].blocks
        e = problem.model.effect(name)
        scaling = [n for n in numbers if not np.isnan(e.numbers[_key(n.effect, n.parameter)].neutral)]
        title, scale = (
            f"{effect_words(name)}, relative to the size on all logs",
            pictures.Scale(0.0, 1.0, "1"),
        )
        if len(scaling) == 1 and np.isfinite(blocks.std).any():
            one = scaling[0]
            neutral = e.numbers[_key(name, one.parameter)].neutral
            title = f"{effect_words(name)} {key_of(one)}".strip()
            scale = pictures.Scale(neutral, one.value - neutral, one.unit)
        elif not np.isfinite(blocks.std).any():
            title = f"{effect_words(name)}: likelihood"
        shown.append(pictures.blocks_of(title, blocks, scale))
        logs |= set(blocks.log[pictures.telling(blocks)].tolist())
    named = {f"log{k % pictures.COLOURS}": problem.logs[k].name for k in sorted(logs)}
    without_size = any(np.isnan(d.evidence[name].blocks.std).all() for name in d.evidence)
    return {"blocks": shown, "logs": legend(**named, whole="on all"), "without_size": without_size}


def _key(effect: str, parameter: str) -> str:
    """Return the name of a parameter within its effect."""
    return "value" if parameter == effect else parameter.removeprefix(f"{effect}_")


def holdout(m: Context) -> str:
    """Return the section with errors over the prediction horizon, in units."""
    if not m.ahead:
        return ""
    rows = []
    for a in sorted(m.ahead, key=lambda a: [b.channel for b in m.ahead].index(a.channel)):
        figures = (f"{a.before:.3g} {unit(a.unit)}", f"{a.after:.3g} {unit(a.unit)}")
        fall = percent(1.0 - a.after / a.before).replace("-", "−") if a.before > 0 else "–"
        sure = f"{a.t:.1f}".replace("-", "−") if np.isfinite(a.t) else "–"
        rows.append((a.channel, f"{a.horizon:.2g} s", *figures, fall, sure))
    head = ("channel", "ahead", "given", "amended", "less by", "t")
    kinds = ("before", "after") if m.changed else ("before",)
    return render(
        "holdout.html",
        shown_on=m.shown_on,
        kinds=legend(*kinds, whole="noise of the measurement"),
        horizons=pictures.horizons(m.ahead, m.changed, m.noise),
        errors=table(head, rows) if m.changed else None,
    )
