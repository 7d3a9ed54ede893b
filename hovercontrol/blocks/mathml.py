"""Equations as MathML, which browsers set without any script."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any
from xml.sax.saxutils import escape

import sympy as sp
from sympy.printing.mathml import MathMLPresentationPrinter

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import sgn

#: Longer expressions are set as text, which wraps on a narrow screen.
_LONGEST = 40

_GREEK = {"psi": "ψ", "theta": "θ", "delta": "δ", "phi": "φ", "omega": "ω", "alpha": "α", "beta": "β"}


def equations(block: Block) -> Iterator[tuple[str, str]]:
    """Yield group and HTML of each equation: definitions, derivatives, outputs that are more than a name."""
    known = {s.name for s in (*block.states, *block.inputs)} | set(block.definitions)
    for name, e in block.definitions.items():
        yield "Definitions", _equation(name, e)
    for name, e in block.derivatives.items():
        yield "Differential equations", _equation(name, e, dot=True)
    for name, e in block.output_expressions.items():
        if name not in known:
            yield "Outputs", _equation(name, e)


def _equation(name: str, e: sp.Expr, dot: bool = False) -> str:
    if e.count_ops() > _LONGEST:
        e = e.xreplace({number: sp.Float(number, 6) for number in e.atoms(sp.Float)})
        text = str(e.replace(sgn, lambda v, w: sp.Function("sgn")(v))).replace("**", "^").replace("*", " · ")
        return f"<p class='long'>{escape(name)}{'′' if dot else ''} = {escape(text)}</p>"
    left = symbol_markup(name)
    if dot:
        rate = "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
        short = left.startswith("<mi>")
        left = f"<mover accent='true'>{left}<mo>˙</mo></mover>" if short else f"{rate}{left}"
    right = MathPrinter().doprint(e)
    return f"<div class='eq'><math><mrow>{left}<mo>=</mo>{right}</mrow></math></div>"


def symbol_markup(name: str) -> str:
    """Return a name as MathML: one letter in italics, words upright, an index below."""
    stem, _, index = name.partition("[")
    owner, dot, last = stem.rpartition(".")
    shown = _GREEK.get(last, last)
    if owner or len(shown) > 1:
        letter = f"<mtext>{escape(owner + dot + shown)}</mtext>"
    else:
        letter = f"<mi>{escape(shown)}</mi>"
    return f"<msub>{letter}<mn>{escape(index.rstrip(']'))}</mn></msub>" if index else letter


class MathPrinter(MathMLPresentationPrinter):
    """SymPy's printer with our names, numbers, cases and sgn; symbols pass as marks, replaced in the text."""

    def __init__(self) -> None:
        super().__init__({"mul_symbol": "dot"})

    def doprint(self, expr: sp.Basic) -> str:
        """Return an expression as MathML."""
        text = self._print(expr).toxml().replace("<mo><</mo>", "<mo>&lt;</mo>")
        text = re.sub(r"<mo>([()])</mo>", r"<mo stretchy='false'>\1</mo>", text)
        return re.sub(r"<mi>\x24(.*?)\x24</mi>", lambda found: symbol_markup(found[1]), text)

    def _node(self, tag: str, *inside: Any) -> Any:
        node = self.dom.createElement(tag)
        for part in inside:
            node.appendChild(self.dom.createTextNode(part) if isinstance(part, str) else part)
        return node

    def _print_Symbol(self, sym: sp.Symbol, style: str = "plain") -> Any:
        return self._node("mi", f"${sym.name}$")

    def _print_Float(self, expr: sp.Float) -> Any:
        return self._node("mn", f"{float(expr):.6g}")

    def _call(self, name: str, *arguments: sp.Basic) -> Any:
        inside = [self._node("mo", "(")]
        for argument in arguments:
            inside += [self._print(argument), self._node("mo", ",")]
        return self._node("mrow", self._node("mi", name), *inside[:-1], self._node("mo", ")"))

    def _print_sgn(self, expr: sgn) -> Any:
        return self._call("sgn", expr.args[0])

    def _print_atan2(self, expr: sp.atan2) -> Any:
        return self._call("atan2", *expr.args)

    def _print_Piecewise(self, expr: sp.Piecewise) -> Any:
        rows = []
        for value, condition in expr.args:
            case = self._node("mrow", self._node("mtext", "if\u00a0"), self._print(condition))
            case = self._node("mtext", "otherwise") if condition == sp.true else case
            rows.append(self._node("mtr", self._node("mtd", self._print(value)), self._node("mtd", case)))
        return self._node("mrow", self._node("mo", "{"), self._node("mtable", *rows))
