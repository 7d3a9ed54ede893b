"""Why an effect is named: likelihood, the same size on disjoint blocks, better predictions."""

from __future__ import annotations

import numpy as np

from hovercontrol.discrepancy.evidence.of_effects import Evidence
from hovercontrol.discrepancy.report import pictures
from hovercontrol.discrepancy.report.context import Context, numbers_by_effect
from hovercontrol.discrepancy.report.formatting import effect_words, percent, rounded, unit
from hovercontrol.discrepancy.report.html import folded, grid, legend, paragraph, table
from hovercontrol.discrepancy.report.verdict import SIGNIFICANCE, key_of, most_fallen

#: Rows of the evidence table.
MEASURES = ("likelihood gained", "blocks of the same sign", "t over blocks", "spread", "held-out log")


def evidence(m: Context) -> str:
    """Return the section on the evidence for each named effect; empty without one."""
    d = m.diagnosis
    if not m.changed:
        return ""
    columns = [_column(d.evidence[name]) for name in numbers_by_effect(d)]
    rows = list(zip(MEASURES, *columns, strict=True))
    head = ("", *(effect_words(name) for name in numbers_by_effect(d)))
    text = (
        "Three independent kinds of evidence support a name. Likelihood gained: decrease of twice the "
        "negative log likelihood, with process noise in the model. Blocks: the logs are cut into disjoint "
        "blocks, each with its own estimate of the size; t is the size over its standard error from the "
        "scatter between blocks, spread the standard deviation between blocks beyond noise. Held-out log: "
        "the number of channels and horizons in which the error falls or rises significantly, and the "
        "largest fall."
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
    falls = sum(a.t >= SIGNIFICANCE.sure and a.after < a.before for a in far)
    rises = sum(a.t <= -SIGNIFICANCE.sure and a.after > a.before for a in far)
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
    text = (
        "The size estimated from each block, all other coefficients as estimated from all logs, with its "
        "standard error. The line is the size from all logs. Blocks without information are left out. A "
        "real cause has the same size in all blocks."
    )
    if any(np.isnan(d.evidence[name].blocks.std).all() for name in d.evidence):
        text += " Where no parameter scales an effect, its gain in likelihood over the mean is shown."
    return f"<h3>Block by block</h3>{paragraph(text)}{legend(**named, whole='on all')}{grid(shown)}"


def _key(effect: str, parameter: str) -> str:
    """Return which of an effect's numbers a parameter is."""
    return "value" if parameter == effect else parameter.removeprefix(f"{effect}_")


def holdout(m: Context) -> str:
    """Return the section with errors over the prediction horizon, in units."""
    if not m.ahead:
        return ""
    kinds = ("before", "after") if m.changed else ("before",)
    text = (
        f"Root mean square error on the {m.shown_on} over the prediction horizon. Each prediction starts on "
        f"the smoothed path and uses only the commands. No coefficient was fitted to a held-out log."
    )
    if m.changed:
        rows = []
        for a in m.ahead:
            figures = (f"{a.before:.3g} {unit(a.unit)}", f"{a.after:.3g} {unit(a.unit)}")
            fall = percent(1.0 - a.after / a.before).replace("-", "−") if a.before > 0 else "–"
            sure = f"{a.t:.1f}".replace("-", "−") if np.isfinite(a.t) else "–"
            rows.append((a.channel, f"{a.horizon:.2g} s", *figures, fall, sure))
        head = ("channel", "ahead", "given", "amended", "less by", "t")
        rows.sort(key=lambda row: [a.channel for a in m.ahead].index(row[0]))
        numbers = folded("In numbers", table(head, rows))
    else:
        numbers = ""
    return (
        f"<h2>Predicting the {m.shown_on}</h2>{paragraph(text)}"
        f"{legend(*kinds, whole='noise of the measurement')}"
        f"{grid(pictures.horizons(m.ahead, m.changed, m.noise))}{numbers}"
    )
