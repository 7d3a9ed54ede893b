"""The amended equations, with new terms marked, and their coefficients."""

from __future__ import annotations

import re
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.mathml import MathPrinter, symbol_markup
from hovercontrol.craft.models.base import quantity_of
from hovercontrol.identification.diagnose.report.context import Context, numbers_by_effect
from hovercontrol.identification.diagnose.report.formatting import (
    effect_words,
    listed,
    meaning,
    minus,
    plus_minus,
    prime,
    unit,
)
from hovercontrol.identification.diagnose.report.templates import Table, render, table
from hovercontrol.identification.engine.subject import Subject, structure, timing


@dataclass(frozen=True)
class CoefficientCriteria:
    """Settings that decide when a coefficient fitted without the named effects is called biased.

    No published source: set by hand.

    Attributes
    ----------
    far : float
        Ratio of the fitted value to the given one, or its inverse.
    """

    far: float = 2.0


#: The values in use.
COEFFICIENTS = CoefficientCriteria()


#: Number of equations shown before the rest is folded, and of places listed where an effect acts.
SHOWN, PLACES = 4, 3


def equations(m: Context) -> str:
    """Return the section with the equations that change; empty if none does."""
    if not m.changed:
        return ""
    old, new = _shown(m.diagnosis.refitted), _shown(m.diagnosis.amended)
    mark = "+" if new.period else "′"
    lines = [_line(name, e, old.derivatives.get(name), new.name, mark) for name, e in new.derivatives.items()]
    lines += [
        _line(name, e, old.output_expressions.get(quantity_of(name)[0]), new.name)
        for name, e in new.output_expressions.items()
        if name not in {s.name for s in (*new.states, *new.inputs)}
    ]
    clocks = [
        f"No equation of the plant contains {effect_words(n)}: {meaning(m.diagnosis.amended.effect(n))}"
        for n in numbers_by_effect(m.diagnosis)
        if m.diagnosis.amended.effect(n).parameter("seconds") in _timing(m)
    ]
    marked = "New terms are marked; c with a subscript is a coefficient. " if any(lines) else ""
    text, them = marked, "them, with " if marked else ""
    if m.diagnosis.amended.is_craft:
        text += f"The file model.toml has {them}the coefficients found."
    else:
        text += "The file parameters.toml has the coefficients and effects found."
    lines = [line for line in lines if line]
    return render(
        "equations.html", added=_added(m), text=text.strip(), lines=lines, shown=SHOWN, clocks=clocks
    )


def _added(m: Context) -> Table:
    """Return the parameters of the named effects, with where they act and the source of the effect."""
    rows = [
        (
            e.parameter,
            _places(e.acts_in) if e.place.startswith("force") else prime(e.place),
            plus_minus(e.value, e.std),
            unit(e.unit),
            m.diagnosis.amended.effect(e.effect).source or "your own",
        )
        for e in m.diagnosis.effects
    ]
    return table(("number", "place", "found ± standard error", "unit", "source"), rows)


def _places(acts_in: str) -> str:
    """Return where an effect acts: the first equation and the number of others, or all if they are few."""
    places = acts_in.split()
    if "'" not in acts_in or len(places) <= PLACES:
        return prime(acts_in)
    return f"{prime(places[0])} and {len(places) - 1} more"


def _timing(m: Context) -> set[str]:
    return {name.rpartition(".")[2] for name in timing(m.diagnosis.amended) if name}


def _shown(model: Subject) -> Block:
    """Return the Block whose equations are shown: of a sampled model with its next values."""
    return model.plant(late=True) if model.period else structure(model)


def _line(name: str, e: sp.Expr, before: sp.Expr | None, owner: str, mark: str = "") -> str:
    """Return an equation as MathML with its new terms marked; empty if it has not changed.

    A parameter is written as c with its name below, since a coefficient and a command may share a name.
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
    left = f"<msup>{symbol_markup(name)}<mo>{mark}</mo></msup>" if mark else symbol_markup(name)
    text = f"<div class='eq'><math><mrow>{left}<mo>=</mo>{right}</mrow></math></div>"
    return re.sub(
        rf"<mtext>{re.escape(owner)}\.(.*?)</mtext>", r"<msub><mi>c</mi><mtext>\1</mtext></msub>", text
    )


def coefficients(m: Context) -> str:
    """Return the table of all coefficients, given and fitted."""
    d = m.diagnosis
    found = d.selection.final
    problem = found.problem
    given, values, without = d.model.coefficients(), d.amended.coefficients(), d.refitted.coefficients()
    widths = {e.friction_width() for e in problem.model.effects}
    both = [n for n in problem.names if n not in widths and m.changed and n in without and n in given]
    bent = [n for n in both if _far(without[n], given[n]) and not _far(values[n], given[n])]
    rows: list[tuple[str, ...]] = []
    for c in (c for c in d.coefficients if c.name not in widths):
        was = minus(f"{given[c.name]:.4g}") if c.name in given else "–"
        alone = minus(f"{without[c.name]:.4g}") if c.name in without else "–"
        value = f"{minus(f'{c.value:.4g}')} kept: {c.kept}" if c.kept else plus_minus(c.value, c.std)
        rows.append((c.name, was, *([alone] if bent else []), value, unit(c.unit)))
    for g in d.groups:
        rows.append((g.name, "–", *(["–"] if bent else []), plus_minus(g.value, g.std), unit(g.unit)))
    note = "Found values with their standard errors."
    effects = listed([effect_words(n) for n in numbers_by_effect(m.diagnosis)])
    if bent:
        far = listed(
            [f"{n} ends at {minus(f'{without[n]:.2g}')}, given {minus(f'{given[n]:.2g}')}" for n in bent]
        )
        note += (
            f" Fitted without {effects} (third column), {far}: such biased coefficients hide the missing "
            f"effect."
        )
    note += " Widths of smoothed dry friction were fitted too and are not listed." if widths else ""
    head = ("coefficient", "given", *([f"without {effects}"] if bent else []), "found", "unit")
    new = [e.parameter for e in d.effects]
    return render("coefficients.html", note=note, coefficients=table(head, rows, new))


def _far(value: float, given: float) -> bool:
    """Whether a coefficient differs from its given value by more than the factor `far`."""
    return given != 0.0 and not 1.0 / COEFFICIENTS.far < value / given < COEFFICIENTS.far
