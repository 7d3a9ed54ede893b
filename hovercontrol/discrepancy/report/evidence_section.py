"""Why a name is given: likelihood, the same size on disjoint blocks, better predictions."""

from __future__ import annotations

import numpy as np

from hovercontrol.discrepancy.evidence.of_effects import Evidence
from hovercontrol.discrepancy.report import pictures
from hovercontrol.discrepancy.report.context import Context, numbers_by_effect
from hovercontrol.discrepancy.report.formatting import effect_words, percent, rounded, unit
from hovercontrol.discrepancy.report.html import folded, grid, legend, paragraph, table
from hovercontrol.discrepancy.report.verdict import SURE, key_of, most_fallen

#: What is told of each name.
MEASURES = ("likelihood gained", "blocks with its sign", "t over blocks", "spread", "held-out log")


def evidence(m: Context) -> str:
    """Return the section on the evidence for each name; nothing where none is given."""
    d = m.diagnosis
    if not m.changed:
        return ""
    columns = [_column(d.evidence[name]) for name in numbers_by_effect(d)]
    rows = list(zip(MEASURES, *columns, strict=True))
    head = ("", *(effect_words(name) for name in numbers_by_effect(d)))
    text = (
        "Three independent things speak for a name. Likelihood gained: fall of twice the negative log "
        "likelihood, with random forces allowed for. Blocks: the logs are cut into disjoint pieces, each of "
        "which tells the size by itself; t is the size over its standard error by their scatter, spread what "
        "they differ by beyond noise. Held-out log: in how many channels and horizons the error falls, and "
        "rises, beyond chance, and the largest fall."
    )
    return f"<h2>Evidence</h2>{paragraph(text)}{table(head, rows)}{_blocks(m)}"


def _column(e: Evidence) -> tuple[str, ...]:
    b = e.blocks
    spread = percent(b.spread) if np.isfinite(b.std).any() else "–"
    return (rounded(e.gain), f"{b.same_sign} of {b.n}", f"{b.t:.1f}", spread, _held(e))


def _held(e: Evidence) -> str:
    """Return how predictions of the held-out log change."""
    far = e.holdout.each
    if not far:
        return "none held out"
    falls = sum(a.t >= SURE and a.after < a.before for a in far)
    rises = sum(a.t <= -SURE and a.after > a.before for a in far)
    best = most_fallen(far)
    most = ""
    if best:
        fall = percent(1.0 - best.after / best.before)
        most = f", most by {fall} ({best.channel}, {best.horizon:.2g} s ahead)"
    return f"{falls} of {len(far)} fall, {rises} rise{most}"


def _blocks(m: Context) -> str:
    """Return each effect's size block by block."""
    d = m.diagnosis
    problem = d.selection.final.problem
    shown, logs = [], set[int]()
    for name, numbers in numbers_by_effect(d).items():
        blocks = d.evidence[name].blocks
        e = problem.model.effect(name)
        scaling = [n for n in numbers if not np.isnan(e.numbers[_key(n.effect, n.parameter)].neutral)]
        title, scale = f"{effect_words(name)}, in parts of the whole", pictures.Scale(0.0, 1.0, "1")
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
    text = (
        "The size that each block tells, all else as the whole logs have it, with its standard error. The "
        "line is the size on all. Blocks that tell nothing are left out. A real cause is everywhere the same."
    )
    if any(np.isnan(d.evidence[name].blocks.std).all() for name in d.evidence):
        text += " Where no number scales an effect, the likelihood that it gains is shown, over the mean."
    return f"<h3>Block by block</h3>{paragraph(text)}{legend(**named, whole='on all')}{grid(shown)}"


def _key(effect: str, parameter: str) -> str:
    """Return which of an effect's numbers a parameter is."""
    return "value" if parameter == effect else parameter.removeprefix(f"{effect}_")


def holdout(m: Context) -> str:
    """Return errors over the horizon, in units."""
    if not m.ahead:
        return ""
    kinds = ("before", "after") if m.changed else ("before",)
    text = (
        f"Root mean square error on the {m.shown_on}, over how far ahead the models predict: each prediction "
        "starts on the smoothed path and follows the commands alone. No coefficient was fitted to a held-out "
        "log."
    )
    if m.changed:
        rows = []
        for a in m.ahead:
            figures = (f"{a.before:.3g} {unit(a.unit)}", f"{a.after:.3g} {unit(a.unit)}")
            fall = percent(1.0 - a.after / a.before).replace("-", "−") if a.before > 0 else "–"
            sure = f"{a.t:.1f}".replace("-", "−") if np.isfinite(a.t) else "–"
            rows.append((a.channel, f"{a.horizon:.2g} s", *figures, fall, sure))
        head = ("channel", "ahead", "as it was", "amended", "less by", "t")
        rows.sort(key=lambda row: [a.channel for a in m.ahead].index(row[0]))
        numbers = folded("In numbers", table(head, rows))
    else:
        numbers = ""
    return (
        f"<h2>Predicting the {m.shown_on}</h2>{paragraph(text)}"
        f"{legend(*kinds, whole='noise of the measurement')}"
        f"{grid(pictures.horizons(m.ahead, m.changed, m.noise))}{numbers}"
    )
