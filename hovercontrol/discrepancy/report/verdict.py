"""The answer in one sentence, with number, interval and unit; first on the page, and all of the terminal."""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

from hovercontrol.discrepancy.diagnosis import Diagnosis, Found
from hovercontrol.discrepancy.holdout import Gap
from hovercontrol.discrepancy.localize import rate
from hovercontrol.discrepancy.probes import Sign
from hovercontrol.discrepancy.report.html import paragraph
from hovercontrol.discrepancy.report.words import effect_words, listed, meaning, number_of, prime, times, unit

_TIED = "\u00a0±\u00a0"
_COUNT = ("no", "one", "two", "three", "four", "five", "six")


def headline(d: Diagnosis) -> str:
    """Return the verdict as one plain sentence."""
    if d.verdict == "none":
        if d.selection.process:
            return "No effect can be named above the disturbances in these logs."
        return "No disagreement beyond noise."
    if d.verdict == "unexplained":
        return "The model disagrees with the logs in a way that no effect of the catalogue explains."
    doubtful = {r.instead_of for r in d.rivals}
    names = dict.fromkeys(e.effect for e in d.effects)
    sure = [_with_numbers(name, d.effects) for name in names if name not in doubtful]
    said = []
    if len(sure) == 1:
        name = next(n for n in names if n not in doubtful)
        said.append(f"The model has no {effect_words(name)}: {_numbers(name, d.effects)}.")
    elif sure:
        said.append(f"The model lacks {_COUNT[len(sure)]} effects: {listed(sure)}.")
    for name in names:
        if name in doubtful:
            others = [effect_words(r.name) for r in d.rivals if r.instead_of == name]
            more = "more" if sure else "something"
            either = listed([_with_numbers(name, d.effects), *others], "or")
            said.append(f"The model lacks {more}, and these logs cannot tell what: {either}.")
    return " ".join(said)


def _with_numbers(name: str, effects: Sequence[Found]) -> str:
    return f"{effect_words(name)} ({_numbers(name, effects)})"


def _numbers(name: str, effects: Sequence[Found]) -> str:
    return listed([f"{e.parameter} {number_of(e)}" for e in effects if e.effect == name])


def explanation(d: Diagnosis) -> list[str]:
    """Return what the verdict means, in sentences."""
    if d.verdict == "none":
        return _none(d)
    if d.verdict == "unexplained":
        said = [f"{_sentence(sign_words(s))}." for s in first_of_kind(d.signs)]
        where = f"It shows {prime(d.regime)}." if d.missing else ""
        return [
            *said,
            where,
            "So no name is given: the best fitting effect of the catalogue would be a wrong one.",
        ]
    said = [
        f"{effect_words(n).capitalize()}: {meaning(n)}" for n in dict.fromkeys(e.effect for e in d.effects)
    ]
    if d.verdict == "ambiguous":
        said += [f"{effect_words(r.name).capitalize()}: {meaning(r.name)}" for r in d.rivals]
    if d.selection.process:
        said.append(f"Besides, {disturbances(d)}.")
    return said


def first_of_kind(signs: Sequence[Sign]) -> list[Sign]:
    """Return the weightiest sign of each kind."""
    return list({s.kind: s for s in reversed(signs)}.values())[::-1]


def sign_words(sign: Sign) -> str:
    """Return what a sign says, effects in words."""
    text = prime(sign.text)
    if sign.kind not in ("weak", "hold-out"):  # the others speak of states and inputs, whose names stay
        return text
    return re.sub(r"\b[a-z]+(_[a-z]+)+\b", lambda m: effect_words(m[0]), text)


def _sentence(text: str) -> str:
    """Return a text with a capital, if it begins with a word."""
    return text[0].upper() + text[1:] if text[:2].isalpha() else text


def _none(d: Diagnosis) -> list[str]:
    if d.selection.process:
        return [
            f"The model with coefficients fitted anew explains the logs but for {disturbances(d)}.",
            "An effect weaker than that may still be missing: the table of candidates says from which size "
            "on each would have shown.",
        ]
    return [
        "With its coefficients fitted anew, the model explains these logs down to the noise of their "
        "measurements.",
        "An effect that these logs do not excite would not show: the table of candidates says from which "
        "size on each would have.",
    ]


def disturbances(d: Diagnosis) -> str:
    """Return the process noise in words."""
    final = d.selection.final
    states = [final.windowed.block.states[i] for i in final.windowed.free]
    levels = [
        f"{level:.2g} {unit(rate(s.unit))} in {s.name}′"
        for s, level in zip(states, final.noise.process, strict=True)
        if level > 0
    ]
    return (
        f"forces that come and go within about {final.noise.seconds:g} s, as of gusts or an uneven floor "
        f"({listed(levels)})"
    )


def gap_sentence(d: Diagnosis) -> str:
    """Return what happens to the gap in the channel that gains most."""
    before, after, where = shown_gap(d)
    if not before.nrmse:
        return ""
    start = where[0].upper() + where[1:]
    ratios = {c: [g.nrmse[c] / max(before.floor[c], 1e-12) for g in (before, after)] for c in before.nrmse}
    still = d.verdict in ("none", "unexplained")
    worst = max(ratios, key=lambda c: ratios[c][0] / (1.0 if still else max(ratios[c][1], 1e-12)))
    was, now = ratios[worst]
    if still:
        return f"{start}, the error of {worst} is {times(was)} times its noise, the largest of all channels."
    return f"{start}, the error of {worst} falls from {times(was)} to {times(now)} times its noise."


def shown_gap(d: Diagnosis) -> tuple[Gap, Gap, str]:
    """Return the gap before and after, and on which logs that is."""
    if d.before is not None and d.after is not None:
        return d.before, d.after, "on the log that took no part"
    return d.train_before, d.train_after, "on the training logs (none was held out)"


def verdict(d: Diagnosis) -> str:
    """Return the first section of the page."""
    sentences = "".join(paragraph(s) for s in explanation(d))
    first = paragraph(f"Verdict: {d.verdict}", "kicker")
    title = escape(headline(d).replace(" ± ", _TIED))
    return f"{first}<h1>{title}</h1>{paragraph(gap_sentence(d), 'lead')}{sentences}"
