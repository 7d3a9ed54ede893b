"""The SymPy function that stands for an unknown one: units know it, no printer prints it."""

from __future__ import annotations

from typing import Any, NoReturn

import sympy as sp
from sympy.core.symbol import Str

from hovercontrol.base.errors import InputError


class UnknownFunction(sp.Function):
    """A function of which the name, the unit and the arguments are known (:func:`hovercontrol.unknown`).

    Examples
    --------
    >>> mu = UnknownFunction(Str("mu"), Str("1/s"), sp.Symbol("C_s"))
    >>> mu, mu.function, mu.unit, mu.arguments
    (mu(C_s), 'mu', '1/s', (C_s,))
    """

    @property
    def function(self) -> str:
        """Its name."""
        return str(self.args[0].name)

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return str(self.args[1].name)

    @property
    def arguments(self) -> tuple[sp.Expr, ...]:
        """What it is a function of."""
        return self.args[2:]

    def _eval_is_real(self) -> bool:
        return True

    def _eval_derivative(self, s: Any) -> sp.Expr:
        # df/ds = sum_i f_i da_i/ds, each f_i another unknown function
        own, unit = self.args[:2]
        slopes = (UnknownFunction(Str(f"{own.name}_{i}"), unit, *self.arguments) for i in range(99))
        return sp.Add(*(slope * a.diff(s) for slope, a in zip(slopes, self.arguments, strict=False)))

    def _sympystr(self, printer: Any) -> str:
        return f"{self.function}({', '.join(map(printer._print, self.arguments))})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        inside = ", ".join(map(printer._print, self.arguments))
        text = rf"\mathrm{{{self.function}}}\left({inside}\right)".replace("_", r"\_")
        return text if exp is None else f"{text}^{{{exp}}}"

    def _mathml_presentation(self, printer: Any) -> Any:
        node = printer.dom.createElement("mrow")
        name = printer.dom.createElement("mtext")
        name.appendChild(printer.dom.createTextNode(f"{self.function}("))
        end = printer.dom.createElement("mtext")
        end.appendChild(printer.dom.createTextNode(")"))
        for part in (name, *map(printer._print, self.arguments), end):
            node.appendChild(part)
        return node

    def _refused(self, printer: Any = None) -> NoReturn:
        raise InputError(
            f"the function {self.function!r} is not known: hc.identify(block, logs).block has it as a table"
        )

    _pythoncode = _numpycode = _ccode = _casadi = _jaxcode = _refused
