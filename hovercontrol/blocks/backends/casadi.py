"""Convert a Block to CasADi functions, for optimisation with exact derivatives.

The functions are built from the same straight-line program as every other backend. They consist of scalar
operations (``casadi.SX``); those of a Block with a lookup table of two axes are matrix expressions
(``casadi.MX``), because only these can index a table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanFunction

from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.lookup import entry
from hovercontrol.blocks.program import Program
from hovercontrol.blocks.signals import time


@dataclass(frozen=True, repr=False)
class CasadiFunctions:
    """The functions of one Block, from ``block.to_casadi()``.

    Each function has the arguments ``t`` [s], ``x``, ``u`` and ``p``: time, states, inputs and parameters in
    the Block's order and units. All derivatives by CasADi are exact; dry friction is smoothed.

    Parameters
    ----------
    block : Block
    derivatives : casadi.Function
        Result ``dx``, the states' time derivatives; of a sampled Block ``x_next``, their next values.
    outputs : casadi.Function
        Result ``y``.
    ticks : tuple of casadi.Function
        For each tick of a hybrid Block: result ``x_next``, the new values of the states that it sets.
    parameters : tuple of float
        The parameters' default values, for ``p``.
    """

    block: Block
    derivatives: Any
    outputs: Any
    ticks: tuple[Any, ...]
    parameters: tuple[float, ...]

    __repr__ = short_repr


def to_casadi(block: Block) -> CasadiFunctions:
    """Return a Block as CasADi functions.

    Parameters
    ----------
    block : Block
        Continuous, sampled or hybrid.

    Raises
    ------
    InputError
        If CasADi is not installed, an input acts late, or an expression has no form in CasADi.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=2.0)
    >>> f = to_casadi(hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
    >>> f.derivatives
    Function(derivatives:(t,x,u[0],p)->(dx) SXFunction)
    >>> float(f.derivatives(0.0, [3.0], [], f.parameters))
    -6.0
    """
    ca = import_casadi()
    rate = ("next", "x_next") if block.period else ("derivatives", "dx")
    made = [
        _function(ca, block, *names, list(wanted.values()))
        for names, wanted in (
            (rate, block.derivatives),
            (("outputs", "y"), block.output_expressions),
            *(((f"tick_{k}", "x_next"), tick.updates) for k, tick in enumerate(block.ticks)),
        )
    ]
    return CasadiFunctions(block, made[0], made[1], tuple(made[2:]), block.parameter_values())


def import_casadi() -> Any:
    """Return the module ``casadi``.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        import casadi
    except ImportError:
        raise InputError('CasADi is not installed: pip install ".[mpc]"') from None
    return casadi


def _function(ca: Any, block: Block, name: str, result: str, wanted: Sequence[sp.Expr]) -> Any:
    program = Program(block, wanted)
    tables = any(e.has(entry) for e in (*(e for _, e in program.steps), *program.results))
    kind = ca.MX if tables else ca.SX
    t = kind.sym("t")
    groups = (("x", block.states), ("u", block.inputs), ("p", block.parameters))
    arguments = [kind.sym(letter, len(signals)) for letter, signals in groups]
    values: dict[sp.Symbol, Any] = {time: t}
    for (_, signals), vector in zip(groups, arguments, strict=True):
        values |= {s.symbol: vector[k] for k, s in enumerate(signals)}
    converter = _Converter(ca, kind, values, block)
    for symbol, e in program.steps:
        values[symbol] = converter(e)
    results = [converter(e) for e in program.results]
    column = ca.vertcat(*results) if results else kind(0, 1)
    return ca.Function(name, [t, *arguments], [column], ["t", "x", "u", "p"], [result])


class _Converter:
    """Computes SymPy expressions with CasADi's numbers; `values` are those of the symbols."""

    def __init__(self, ca: Any, kind: Any, values: Mapping[sp.Symbol, Any], block: Block) -> None:
        self._ca, self._kind, self._values, self._block = ca, kind, values, block
        #: functions of SymPy whose arguments are CasADi's
        self._named: dict[type[sp.Basic], Callable[..., Any]] = {
            sp.sin: ca.sin, sp.cos: ca.cos, sp.tan: ca.tan,
            sp.asin: ca.asin, sp.acos: ca.acos, sp.atan: ca.atan, sp.atan2: ca.atan2,
            sp.sinh: ca.sinh, sp.cosh: ca.cosh, sp.tanh: ca.tanh,
            sp.asinh: ca.asinh, sp.acosh: ca.acosh, sp.atanh: ca.atanh,
            sp.exp: ca.exp, sp.log: ca.log, sp.erf: ca.erf,
            sp.Abs: ca.fabs, sp.sign: ca.sign, sp.floor: ca.floor, sp.ceiling: ca.ceil,
            sp.Add: lambda *a: reduce(lambda x, y: x + y, a),
            sp.Mul: lambda *a: reduce(lambda x, y: x * y, a),
            sp.Min: lambda *a: reduce(ca.fmin, a),
            sp.Max: lambda *a: reduce(ca.fmax, a),
            # a mod b = a - b floor(a/b), with the sign of b as in Python
            sp.Mod: lambda a, b: a - b * ca.floor(a / b),
            sp.Heaviside: lambda a, half=0.5: ca.if_else(a > 0, 1.0, ca.if_else(a < 0, 0.0, half)),
            sp.And: lambda *a: reduce(ca.logic_and, a),
            sp.Or: lambda *a: reduce(ca.logic_or, a),
            sp.Not: ca.logic_not,
            sp.ITE: ca.if_else,
            sp.Lt: lambda a, b: a < b, sp.Le: lambda a, b: a <= b,
            sp.Gt: lambda a, b: a > b, sp.Ge: lambda a, b: a >= b,
            sp.Eq: lambda a, b: a == b, sp.Ne: lambda a, b: a != b,
        }  # fmt: skip

    def __call__(self, e: Any) -> Any:
        if e in self._values:
            return self._values[e]
        if e in (sp.true, sp.false):
            return self._kind(1.0 if e == sp.true else 0.0)
        if isinstance(e, sp.Rational):
            return self._kind(e.p / e.q)
        if isinstance(e, (sp.Number, sp.NumberSymbol)):
            return self._kind(float(e))
        if isinstance(e, sp.Pow):
            return self._power(*e.as_base_exp())
        if isinstance(e, sp.Piecewise):
            return self._pieces(e)
        if isinstance(e, entry):
            return self._entry(e)
        function = self._named.get(e.func)
        known = isinstance(e, (sp.Expr, Relational, BooleanFunction))
        if function is None or not known:
            raise InputError(self._block.where(f"CasADi has no {e.func.__name__}: {e}"))
        return function(*(self(a) for a in e.args))

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> Any:
        b = self(base)
        if exponent.is_Integer and 1 <= abs(exponent) <= 3:
            product = reduce(lambda x, y: x * y, [b] * abs(int(exponent)))
            return product if exponent > 0 else 1.0 / product
        if abs(exponent) == sp.S.Half:
            root = self._ca.sqrt(b)
            return root if exponent > 0 else 1.0 / root
        return b ** self(exponent)

    def _pieces(self, e: sp.Piecewise) -> Any:
        value: Any = self._kind(float("nan"))
        for piece, condition in reversed(e.args):
            found = self(piece)
            value = found if condition == sp.true else self._ca.if_else(self(condition), found, value)
        return value

    def _entry(self, e: entry) -> Any:
        index, table = e.args
        last = len(table.values) - 1
        place = self._ca.floor(self._ca.fmax(0, self._ca.fmin(last, self(index))))
        return self._kind(self._ca.DM(table.values))[place]
