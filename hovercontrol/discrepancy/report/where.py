"""Where and when the model disagrees: the force that is missing, over time and over what it depends on."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from hovercontrol.discrepancy.laws import THERE, is_there, law, small, worst
from hovercontrol.discrepancy.localize import Missing, Quantity
from hovercontrol.discrepancy.report import pictures
from hovercontrol.discrepancy.report.html import folded, grid, paragraph
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.discrepancy.report.words import effect_words, listed, prime, unit

#: Part of a force's variance that its means over a quantity must explain to be shown.
TELLING = 0.1

#: Logs whose forces are drawn, and stretches that are named, at most.
LOGS, STRETCHES = 3, 5


def where(m: Material) -> str:
    """Return the section on the missing force."""
    d = m.diagnosis
    if not d.missing:
        return ""
    most = worst(d.missing)
    there = most is not None and most.share > THERE
    if most is None or not there:
        lead = "The missing force stays within its band: "
        if m.changed:
            lead += "what is named is too small to be seen here, and shows over longer windows only."
        else:
            lead += "there is nothing to be seen beyond noise."
    else:
        size = f"{most.rms:.2g} {unit(most.unit)}".strip()
        lead = (
            f"Most {prime(d.regime)}. {_whose(m)} lacks a force in {prime(most.equation)} whose root mean "
            f"square is {size}. It stands out of its band in {100 * most.share:.0f} % of the rows of "
            f"{most.log}{stretches(most.segments)}."
        )
    before, after = _by_log(d.missing), _by_log(m.missing_after)
    first = next((k for k, forces in enumerate(before) if most in forces), 0)
    order = sorted(range(len(before)), key=lambda k: k != first)
    parts = []
    for k in order[:LOGS]:
        plots = grid(
            pictures.forces(before[k], after[k], {f.equation: small(f) for f in before[k]}, m.changed)
        )
        log = before[k][0].log
        parts.append(folded(log, plots) if k != first else f"<h3>Over time, in {escape(log)}</h3>{plots}")
    how = (
        "Force per mass, torque per inertia, reconstructed from the logs as an unknown addition to each "
        "equation (Kalman smoother); the band is twice its standard error. Marked at the foot: stretches in "
        f"which {'what the amended model lacks' if m.changed else 'it'} stands out of its band."
    )
    over = _dependences(m, first, before[first], after[first]) if there else ""
    return f"<h2>Where it is</h2>{paragraph(lead)}{paragraph(how)}{_legend(m)}{over}{''.join(parts)}"


def _by_log(forces: Sequence[Missing]) -> list[list[Missing]]:
    """Return the forces of each log; two logs may share a name."""
    count = len({f.equation for f in forces})
    return [list(forces[k : k + count]) for k in range(0, len(forces), count)]


def _dependences(m: Material, log: int, before: Sequence[Missing], after: Sequence[Missing]) -> str:
    """Return for each equation of a log the force over the quantity that explains most of it."""
    plots = []
    for was, now in zip(before, after, strict=True):
        quantity = _depends_on(m, was)
        if quantity:
            label = (quantity.name, quantity.unit)
            plots.append(pictures.dependence(was, now, quantity.values, label, small(was), m.changed))
    if not plots:
        return ""
    text = (
        "Means over equal shares of the rows, against the velocity or command that explains most of the "
        f"force in {before[0].log}."
    )
    return f"<h3>Over what it depends on most</h3>{paragraph(text)}{grid(plots)}"


def _depends_on(m: Material, force: Missing) -> Quantity | None:
    """Return the quantity in the law that the equation's force follows, or else that explains most of it."""
    if not is_there(force):
        return None
    found = law([f for f in m.diagnosis.missing if f.equation == force.equation])
    if found:
        name = found.quantity or force.equation.removesuffix("'")  # a constant: over its own velocity
        return next(q for q in force.over if q.name == name)
    shares = [pictures.share_explained(q.values, force.force) for q in force.over]
    best = int(np.argmax(shares))
    return force.over[best] if shares[best] > TELLING else None


def _whose(m: Material) -> str:
    """Return which model the force is missing in."""
    if not m.changed:
        return "The model as it was, its coefficients fitted anew,"
    return f"The amended model without its {listed([effect_words(n) for n in m.named])}"


def _legend(m: Material) -> str:
    who = _whose(m).rstrip(",")
    sides = {"before": f"{who[0].lower()}{who[1:]}"} | ({"after": "the amended model"} if m.changed else {})
    spans = "".join(f'<span class="{kind}">{escape(text)}</span>' for kind, text in sides.items())
    return f'<p class="legend">{spans}</p>'


def stretches(segments: Sequence[tuple[float, float]]) -> str:
    """Return when a force is there: the longest stretches, and how many more there are.

    Examples
    --------
    >>> stretches([(0.0, 2.5), (4.0, 9.26)])
    ': from 0 to 2.5 s and 4 to 9.3 s'
    """
    longest = sorted(sorted(segments, key=lambda s: s[0] - s[1])[:STRETCHES])
    if not longest:
        return ""
    named = [f"{round(begin, 1):g} to {round(end, 1):g} s" for begin, end in longest]
    more = len(segments) - len(longest)
    return f"{', longest' if more else ':'} from {listed(named)}{f', and {more} shorter' if more else ''}"
