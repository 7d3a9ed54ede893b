"""Whether equations have no solution, decided exactly."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp


def unsolvable(equations: Sequence[sp.Expr], unknowns: Sequence[sp.Symbol], nonzero: sp.Symbol) -> bool:
    """Return whether equations, each to be zero, have provably no solution in which one unknown is not zero.

    Parameters
    ----------
    equations : sequence of sympy.Expr
        Polynomials with rational coefficients in the unknowns, and in sine and cosine of one unknown each.
    unknowns : sequence of sympy.Symbol
    nonzero : sympy.Symbol
        The unknown that is not zero.

    Returns
    -------
    bool
        False also where it is not decided: solutions in complex numbers count, and equations that are not
        of that kind.

    Notes
    -----
    By a Groebner basis, with Rabinowitsch's equation ``nonzero * inverse = 1``: it is 1 exactly where there
    is no complex solution.

    Examples
    --------
    >>> x, y = sp.symbols("x y", real=True)
    >>> unsolvable([x - y, x + y], [x, y], nonzero=x)
    True
    >>> unsolvable([x * sp.cos(y), x * sp.sin(y)], [x, y], nonzero=x)
    True
    >>> unsolvable([x - y], [x, y], nonzero=x)
    False
    """
    system, symbols = [sp.expand(sp.expand_trig(e)) for e in equations], list(unknowns)
    for angle in unknowns:
        if any(e.has(sp.sin(angle), sp.cos(angle)) for e in system):
            s, c = sp.Dummy("s"), sp.Dummy("c")
            system = [e.xreplace({sp.sin(angle): s, sp.cos(angle): c}) for e in system]
            system.append(s**2 + c**2 - 1)
            symbols += [s, c]
    inverse = sp.Dummy("inverse")
    system = [e for e in [*system, nonzero * inverse - 1] if e != 0]
    used = [s for s in [*symbols, inverse] if any(e.has(s) for e in system)]
    if not all(e.is_polynomial(*used) for e in system):
        return False
    return sp.groebner(system, *used, order="grevlex").exprs == [sp.S.One]
