"""The amended equations, what is new in them marked, and their coefficients."""

from __future__ import annotations

import math
import re

import sympy as sp

from hovercontrol.discrepancy.report.html import paragraph, table
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.discrepancy.report.words import effect_words, listed, meaning, minus, plus_minus, unit
from hovercontrol.discrepancy.subject import structure
from hovercontrol.fmi.mathml import MathPrinter, symbol_markup
from hovercontrol.model import Model

#: Factor beyond which a coefficient that was fitted without the named effects no longer means what it says.
FAR = 2.0


def equations(m: Material) -> str:
    """Return the section with the equations that change, or nothing where none does."""
    if not m.changed:
        return ""
    old, new = structure(m.diagnosis.refitted), structure(m.diagnosis.amended)
    lines = [
        _line(name, e, old.derivatives.get(name), new.name, dot=True) for name, e in new.derivatives.items()
    ]
    lines += [
        _line(name, e, old.output_expressions.get(name.removesuffix("_measured")), new.name)
        for name, e in new.output_expressions.items()
        if name not in {s.name for s in (*new.states, *new.inputs)}
    ]
    clocks = [
        paragraph(f"No equation of the plant says {effect_words(n)}: {meaning(n)}")
        for n in m.named
        if m.diagnosis.amended.effect(n).parameter("seconds") in _timing(m)
    ]
    marked = "What is new is marked; c with a name below is a coefficient. " if any(lines) else ""
    text, them = marked, "them, with " if marked else ""
    if isinstance(m.diagnosis.amended, Model):
        text += f"The file model.toml has {them}the coefficients found."
    return f"<h2>The amended equations</h2>{paragraph(text.strip())}{''.join(lines)}{''.join(clocks)}"


def _timing(m: Material) -> set[str]:
    return {name.rpartition(".")[2] for name in m.diagnosis.amended.timing() if name}


def _line(name: str, e: sp.Expr, before: sp.Expr | None, owner: str, *, dot: bool = False) -> str:
    """Return an equation as MathML with its new terms marked; nothing if it is as before.

    A parameter is a c with its name below: a coefficient and a command may share a name.
    """
    if before is not None and e == before:
        return ""
    known = set(sp.Add.make_args(before)) if before is not None else set()
    terms = sorted(sp.Add.make_args(e), key=lambda term: (term not in known, sp.default_sort_key(term)))
    right = ""
    for k, term in enumerate(terms):
        negative = term.could_extract_minus_sign()
        sign = "<mo form='infix'>−</mo>" if negative else ("<mo form='infix'>+</mo>" if k else "")
        body = MathPrinter().doprint(-term if negative else term)
        right += f"{sign}{body}" if term in known else f"{sign}<mrow class='new'>{body}</mrow>"
    left = f"<msup>{symbol_markup(name)}<mo>′</mo></msup>" if dot else symbol_markup(name)
    text = f"<div class='eq'><math><mrow>{left}<mo>=</mo>{right}</mrow></math></div>"
    return re.sub(
        rf"<mtext>{re.escape(owner)}\.(.*?)</mtext>", r"<msub><mi>c</mi><mtext>\1</mtext></msub>", text
    )


def coefficients(m: Material) -> str:
    """Return the table of all coefficients, as given and as found."""
    d = m.diagnosis
    named = d.verdict != "unexplained"
    found = d.selection.final if named else d.selection.base
    w, C = found.windowed, found.covariance
    given, values = d.model.coefficients(), (d.amended if named else d.refitted).coefficients()
    without = d.refitted.coefficients() if m.changed else {}
    shown = [name for name, is_width in zip(w.names, w.is_width, strict=True) if not is_width]
    bent = [n for n in shown if n in without and n in given and _far(without[n], given[n])]
    rows: list[tuple[str, ...]] = []
    for j, name in enumerate(w.names):
        if w.is_width[j]:
            continue
        half = 1.96 * math.sqrt(max(float(C[j, j]), 0.0)) if named else 0.0
        was = minus(f"{given[name]:.4g}") if name in given else "—"
        alone = minus(f"{without[name]:.4g}") if name in without else "—"
        found_value, u = plus_minus(values[name], half), unit(w.block.parameter(name).unit)
        rows.append((name, was, alone, found_value, u) if bent else (name, was, found_value, u))
    note = (
        "Found values with half their 95 % intervals."
        if named
        else "Fitted without intervals: while something unknown is missing they would be too narrow."
    )
    effects = listed([effect_words(n) for n in m.named])
    if bent:
        far = listed(
            [f"{n} ends at {minus(f'{without[n]:.2g}')}, given {minus(f'{given[n]:.2g}')}" for n in bent]
        )
        note += (
            f" Fitted without {effects} (third column), {far}: coefficients bent so far hide what is missing."
        )
    widths = "Widths of smoothed dry friction were fitted, too, and are left out here."
    head = ("coefficient", "given", *([f"without {effects}"] if bent else []), "found", "unit")
    new = [e.parameter for e in d.effects]
    return f"<h2>Coefficients</h2>{paragraph(f'{note} {widths}')}{table(head, rows, new)}"


def _far(value: float, given: float) -> bool:
    """Whether a coefficient is off by more than a factor."""
    return given != 0.0 and not 1.0 / FAR < value / given < FAR
