"""Equations of a model with an effect, what the effect changes marked."""

from __future__ import annotations

import re

import sympy as sp

from hovercontrol.blocks.mathml import MathPrinter, symbol_markup
from hovercontrol.craft.models.model import Model


def changed_lines(base: Model, model: Model) -> str:
    """Return the equations of a plant that an effect changes, as MathML, new terms marked."""
    old, new = base.plant(late=True), model.plant(late=True)
    known = {s.name for s in (*new.states, *new.inputs)}
    lines = [_line(n, e, old.derivatives.get(n), dot=True) for n, e in new.derivatives.items()]
    lines += [
        _line(n, e, old.output_expressions.get(n))
        for n, e in new.output_expressions.items()
        if n not in known
    ]
    return "".join(lines)


def _line(name: str, e: sp.Expr, before: sp.Expr | None, *, dot: bool = False) -> str:
    """Return one equation, what is new in it first; nothing where it is as before."""
    if e == before:
        return ""
    known = set(sp.Add.make_args(before)) if before is not None else set()
    terms = sorted(sp.Add.make_args(e), key=lambda term: (term in known, sp.default_sort_key(term)))
    right = ""
    for k, term in enumerate(terms):
        negative = term.could_extract_minus_sign()
        sign = "<mo form='infix'>−</mo>" if negative else ("<mo form='infix'>+</mo>" if k else "")
        body = MathPrinter().doprint(-term if negative else term)
        right += f"{sign}{body}" if term in known else f"{sign}<mrow class='new'>{body}</mrow>"
    left = f"<msup>{symbol_markup(name)}<mo>′</mo></msup>" if dot else symbol_markup(name)
    text = f"<div class='eq'><math><mrow>{left}<mo>=</mo>{right}</mrow></math></div>"
    return re.sub(r"<mtext>plant\.(.*?)</mtext>", r"<msub><mi>c</mi><mtext>\1</mtext></msub>", text)
