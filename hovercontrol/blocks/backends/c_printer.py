"""Print expressions as C99, with Python's conventions for the sign of remainders and for jumps."""

from __future__ import annotations

import re
from collections.abc import Container

import sympy as sp
from sympy.printing.c import C99CodePrinter

#: Functions of the runtime, hc_math.h, in place of those of math.h.
_OWN = {name: f"hc_{name}" for name in ("sin", "cos", "tanh")}


def identifier(text: str, taken: Container[str]) -> str:
    """Return a C identifier that resembles a text and is not taken."""
    stem = re.sub(r"\W+", "_", text).strip("_")
    name, k = stem, 2
    while name in taken:
        name, k = f"{stem}_{k}", k + 1
    return name


class CPrinter(C99CodePrinter):
    """C99 printer that writes numbers with 17 digits, small powers as products, and calls of hc_math.h.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> CPrinter().doprint(x**2 + sp.Mod(x, y) / 3)
    '((x)*(x)) + (1.0/3.0)*(((x) - (y)*floor((x)/(y))))'
    >>> CPrinter().doprint(sp.tanh(x) + sp.exp(x))
    'exp(x) + hc_tanh(x)'
    """

    def __init__(self) -> None:
        super().__init__({"precision": 17, "math_macros": {}, "user_functions": _OWN})  # C99 has no M_PI

    def _print_NumberSymbol(self, expr: sp.NumberSymbol) -> str:
        return str(self._print(expr.evalf(17)))

    def _print_Mod(self, expr: sp.Mod) -> str:
        """Print a mod b = a - b floor(a/b), with the sign of b as in Python; fmod has the sign of a."""
        a, b = (f"({self._print(part)})" for part in expr.args)
        return f"({a} - {b}*floor({a}/{b}))"

    def _print_BooleanTrue(self, expr: sp.Basic) -> str:
        return "1"

    def _print_BooleanFalse(self, expr: sp.Basic) -> str:
        return "0"

    def _print_And(self, expr: sp.And) -> str:  # compilers warn about && within || without parentheses
        return f"({super()._print_And(expr)})"

    def _print_entry(self, expr: sp.Expr) -> str:
        index, table = expr.args
        return f"{table.identifier}[(int)fmax(0.0, fmin({len(table.values) - 1}.0, {self._print(index)}))]"

    def _print_Heaviside(self, expr: sp.Heaviside) -> str:
        x = f"({self._print(expr.args[0])})"
        return f"({x} > 0 ? 1.0 : {x} < 0 ? 0.0 : 0.5)"

    def _print_Pow(self, expr: sp.Pow) -> str:
        base, exponent = expr.as_base_exp()
        if exponent.is_Integer and 2 <= abs(exponent) <= 3:
            product = "(" + "*".join([f"({self._print(base)})"] * int(abs(exponent))) + ")"
            return product if exponent > 0 else f"(1.0/{product})"
        return str(super()._print_Pow(expr))
