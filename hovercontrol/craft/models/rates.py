"""A sampled Block in rate form, and back: one engine fits continuous and sampled models.

A sampled Block holds next values, ``x(k+1) = f(x(k), u(k))`` every T seconds. Its rate is the change over the
period; Euler's method with steps of T then gives exactly the next values::

    r(x, u) = (f(x, u) - x) / T,    x(k+1) = x(k) + T r(x(k), u(k))

Effects, process noise and statistics of accelerations are stated in rates, in units of a continuous model.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import dimension


def rate_form(block: Block, known: Collection[Signal]) -> Block:
    """Return the continuous Block with the rates of a sampled one; it is not checked, its units lack 1/s.

    Parameters
    ----------
    known : collection of Signal
        Parameters that are the period; its value replaces them.

    Examples
    --------
    >>> q, v = Signal("q", "rad"), Signal("v", "rad/s")
    >>> c, T = Signal("c", "1/s", start=2.0), Signal("T", "s", start=0.05)
    >>> steps = {"q": q.symbol + T.symbol * v.symbol, "v": (1 - T.symbol * c.symbol) * v.symbol}
    >>> print(rate_form(Block("wheel", [q, v], [], [q], [c, T], steps, period=0.05), [T]).equations())
    q' = v
    v' = -c*v
    """
    value = {s.symbol: sp.Float(block.period) for s in known}
    expressions = (block.derivatives, block.output_expressions, block.definitions)
    laws, shown, definitions = ({n: e.xreplace(value) for n, e in es.items()} for es in expressions)
    rates = {s.name: _rate(laws[s.name] - s.symbol, block.period) for s in block.states}
    return block.unchecked(
        derivatives=Expressions(rates),
        output_expressions=Expressions(shown),
        definitions=Expressions(definitions),
        period=0.0,
    )


def equals_period(block: Block, parameter: Signal) -> bool:
    """Return whether a parameter of a sampled Block is a time [s] with the value of the period."""
    return block.period > 0.0 and parameter.start == block.period and parameter.dimension == dimension("s")


def _rate(change: sp.Expr, period: float) -> sp.Expr:
    """Return a change over the period; a number that rounding keeps from a whole one is that (1.0 v is v)."""
    terms = []
    for term in sp.Add.make_args(sp.expand_mul(change)):
        number, rest = term.as_coeff_Mul()
        value = float(number) / period
        whole = abs(value - round(value)) <= 1e-12 * abs(value)
        terms.append((sp.Integer(round(value)) if whole else sp.Float(value)) * rest)
    return sp.Add(*terms)


def next_value(state: Signal, rate: sp.Expr, step: sp.Expr) -> sp.Expr:
    """Return the next value of an effect's own state after a step: the exponential Euler method.

    With a the slope of the rate along the state itself, outside of limits::

        z(k+1) = z(k) + (exp(a T) - 1)/a z'(k),    exact for z' = a z + b

    Examples
    --------
    >>> z, T = Signal("z", "1"), sp.Symbol("T", positive=True)
    >>> next_value(z, (1 - z.symbol) / 2, T)
    z + (-1 + exp(-T/2))*(z - 1)
    """
    within = rate.replace(lambda e: isinstance(e, sp.Max | sp.Min), lambda e: sp.Dummy())
    a = sp.diff(within, state.symbol)
    if a == 0:
        return state.symbol + step * rate
    return state.symbol + sp.factor_terms((sp.exp(a * step) - 1) * sp.cancel(rate / a))


def late_inputs(inputs: tuple[Signal, ...], delay: float, period: float) -> dict[Signal, list[Signal]]:
    """Return memories of past values of each input, latest first, for a delay [s] in a sampled model.

    A delay of (n + r) periods, 0 <= r < 1, needs n + 1 values: u arrives as (1 - r) u(k-n) + r u(k-n-1).
    """
    count = math.floor(delay / period + 1e-9) + 1
    return {
        s: [Signal(f"{s.name}_late_{k}", s.unit, f"{s.name} {k} periods ago") for k in range(1, count + 1)]
        for s in inputs
    }
