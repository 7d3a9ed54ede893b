"""Print a Block's equations as plain text or LaTeX."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import sympy as sp

from hovercontrol.blocks.sgn import sgn

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block


def text_equations(block: Block) -> str:
    """Return one equation per line: definitions, derivatives, ticks, computed outputs, delays."""

    def _text(e: sp.Expr) -> str:
        return str(e.replace(sgn, lambda v, w: sp.Function("sgn")(v)))

    lines = [f"{name} = {_text(e)}" for name, e in block.definitions.items()]
    lines += [f"{block.update_text(name)} = {_text(e)}" for name, e in _changing(block)]
    for tick in block.ticks:
        lines += [f"every {tick.period:g} s: next {n} = {_text(e)}" for n, e in tick.updates.items()]
    lines += [f"{name} = {_text(e)}" for name, e in _computed_outputs(block)]
    lines += [f"{name} acts late by {_text(e)}" for name, e in block.delays.items()]
    return "\n".join(lines)


def latex_equations(block: Block) -> str:
    """Return the same equations as one ``align*`` environment (sgn is written as in the papers)."""
    symbols = _latex_names(block)

    def latex(e: sp.Expr) -> str:
        return str(sp.latex(e, symbol_names=symbols))

    mark = "{}^{{+}}" if block.period else r"\dot{{{}}}"

    def line(name: str, e: sp.Expr, mark: str = "{}", after: str = "") -> str:
        return mark.format(latex(sp.Symbol(name, real=True))) + " &= " + latex(e) + after

    lines = [line(name, e) for name, e in block.definitions.items()]
    lines += [line(name, e, mark) for name, e in _changing(block)]
    for tick in block.ticks:
        after = rf" \quad \text{{every {tick.period:g} s}}"
        lines += [line(name, e, "{}^{{+}}", after) for name, e in tick.updates.items()]
    lines += [line(name, e) for name, e in _computed_outputs(block)]
    for name, e in block.delays.items():
        lines.append(latex(sp.Symbol(name, real=True)) + r" &\text{ acts late by } " + latex(e))
    return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}"


def _changing(block: Block) -> list[tuple[str, sp.Expr]]:
    return list(block.derivatives.items())[: block.n_continuous]


def _computed_outputs(block: Block) -> list[tuple[str, sp.Expr]]:
    known = {s.name for s in (*block.states, *block.inputs)} | set(block.definitions)
    return [(name, e) for name, e in block.output_expressions.items() if name not in known]


_GREEK = {"psi": r"\psi", "theta": r"\theta", "delta": r"\delta"}


def _latex_names(block: Block) -> dict[sp.Symbol, str]:
    names = {s.name for s in (*block.states, *block.inputs, *block.outputs, *block.parameters)}
    return {sp.Symbol(name, real=True): _latex_name(name) for name in names | set(block.definitions)}


def _latex_name(name: str) -> str:
    stem, index = re.fullmatch(r"([^\[]*)(?:\[(.*)\])?", name).groups()  # type: ignore[union-attr]
    *path, last = stem.split(".")
    if last in _GREEK:
        body = _GREEK[last]
    elif len(last) == 1:
        body = last
    else:
        body = r"\mathrm{" + last.replace("_", r"\_") + "}"
    below = [r"\mathrm{" + ".".join(path).replace("_", r"\_") + "}"] if path else []
    below += [index] if index else []
    return body + (f"_{{{','.join(below)}}}" if below else "")
