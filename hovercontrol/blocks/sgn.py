"""The sign of a velocity in dry friction, and its regularised form.

``sgn(v, w)`` is kept unevaluated in a Block's expressions, so that each backend can choose its form. The
NumPy and python-control backends compute ``tanh(v/w)``; a runtime with events can treat it as set-valued at v
= 0.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from hovercontrol.base.boundary import checked


class sgn(sp.Function):  # noqa: N801  (reads as in the papers)
    """Sign of `v`, smoothed over the width `w`: regularised as ``tanh(v/w)``.

    Parameters
    ----------
    v : sympy.Expr
        Velocity [m/s or rad/s].
    w : sympy.Expr
        Width, in the unit of `v`; the smooth form is 0.76 at ``v = w``.

    Examples
    --------
    >>> v, w = sp.symbols("v w", real=True)
    >>> regularise(sgn(v, w))
    tanh(v/w)
    """

    nargs = 2

    def _eval_is_real(self) -> bool:
        return True

    @checked
    def fdiff(self, argindex: int = 1) -> Any:
        """Return the derivative of the regularised form.

        Parameters
        ----------
        argindex : int, optional
            Differentiate with respect to the velocity (1) or the width (2).
        """
        # d/dv tanh(v/w) = (1 - tanh^2(v/w))/w,  d/dw tanh(v/w) = -(v/w) (1 - tanh^2(v/w))/w
        v, w = self.args
        slope = (1 - sgn(v, w) ** 2) / w
        return slope if argindex == 1 else -slope * v / w

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        text = rf"\operatorname{{sgn}}\left({printer._print(self.args[0])}\right)"
        return text if exp is None else f"{text}^{{{exp}}}"


def regularise(expression: sp.Expr) -> sp.Expr:
    """Return the expression with every ``sgn(v, w)`` written as ``tanh(v/w)``."""
    signs = expression.atoms(sgn)
    return expression.replace(sgn, lambda v, w: sp.tanh(v / w)) if signs else expression
