"""A Block as a linear regression: ``x' = h + G c`` [C17 eq 1], for chosen coefficients c.

G is the symbolic derivative of x' with respect to the coefficients, and h is x' with c = 0. Of a sampled
Block the next values are meant: ``x(k+1) = h + G c`` at the tick k.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import linear_parameters, partial_derivatives
from hovercontrol.blocks.signals import Signal, suffixed


@checked
@dataclass(frozen=True)
class Regression:
    """``x' = h + G c`` for some states and coefficients of a Block; ``x(k+1) = h + G c`` of a sampled one.

    Parameters
    ----------
    block : Block
        The Block of the regression.
    states : tuple of Signal
        The states x, length n: those whose derivative, or next value, depends on a coefficient.
    coefficients : tuple of Signal
        The coefficients c, length m, as parameters of the Block.
    names : tuple of str
        Their names without the Block's.
    h : tuple of sympy.Expr
        Length n.
    G : sympy.ImmutableMatrix
        Shape (n, m).

    Examples
    --------
    >>> import hovercontrol as hc
    >>> found = regression(hc.vehicle("c17_simulation").plant(), ["surge_linear_drag"])
    >>> found.names, found.G
    (('surge_linear_drag',), Matrix([[-u]]))
    """

    block: Block
    states: tuple[Signal, ...]
    coefficients: tuple[Signal, ...]
    names: tuple[str, ...]
    h: tuple[sp.Expr, ...]
    G: sp.ImmutableMatrix

    __repr__ = short_repr

    @property
    def hats(self) -> tuple[Signal, ...]:
        """Return the estimates of the coefficients as outputs ``NAME_hat``."""
        return tuple(
            c.replace(
                name=suffixed(short, "hat"), description=f"estimate of {short}", lower=-sp.oo, upper=sp.oo
            )
            for c, short in zip(self.coefficients, self.names, strict=True)
        )


@checked
def regression(block: Block, coefficients: Sequence[str] | None = None) -> Regression:
    """Return the regression of a Block in chosen coefficients.

    Parameters
    ----------
    block : Block
    coefficients : sequence of str, optional
        Names of parameters; default: every parameter in which the Block is linear when all of them
        vary together (parameters such as widths stay fixed).

    Raises
    ------
    InputError
        If a name is unknown, a coefficient is given twice or acts on no state, the Block is not linear in
        them (the message names the equation and the expression), or its inputs are delayed.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import hoverdemon
    >>> regression(hoverdemon().plant()).G[2, :]
    Matrix([[0, -thrust*sin(rudder)]])
    >>> y, u, a = Signal("y", "V"), Signal("u", "V"), Signal("a", "1", start=0.2)
    >>> steps = {"y": y.symbol + a.symbol * (u.symbol - y.symbol)}
    >>> found = regression(Block("filter", [y], [u], [y], [a], steps, period=0.05))
    >>> found.h, found.G  # the next y is h + G a
    ((y,), Matrix([[u - y]]))
    """
    block.need_prompt_inputs("a regression")
    names = _coefficients(block, coefficients)
    parameters = {p.name: p for p in block.parameters}
    entries = {k: block.expand(e) for k, e in partial_derivatives(block, "derivatives", names).items()}
    symbols = [parameters[name].symbol for name in names]
    for (i, j), e in sorted(entries.items(), key=lambda item: item[0]):
        bad = e.free_symbols & set(symbols)
        if bad:
            state = block.states[i].name
            raise InputError(
                f"block {block.name!r} is not linear in {names[j]!r}: in {block.update_text(state)} its "
                f"factor is '{e}', "
                f"which depends on {', '.join(sorted(s.name for s in bad))}"
            )
    rows, what = sorted({i for i, _ in entries}), "next value" if block.period else "derivative"
    for j, name in enumerate(names):
        if not any((i, j) in entries for i in rows):
            raise InputError(f"block {block.name!r}: {name!r} acts in no {what}, it cannot be estimated")
    zero = dict.fromkeys(symbols, sp.S.Zero)
    expressions = list(block.derivatives.values())
    return Regression(
        block,
        tuple(block.states[i] for i in rows),
        tuple(parameters[name] for name in names),
        tuple(name.rpartition(".")[2] for name in names),
        tuple(block.expand(expressions[i]).xreplace(zero) for i in rows),
        sp.ImmutableMatrix(len(rows), len(names), lambda i, j: entries.get((rows[i], j), sp.S.Zero)),
    )


def _coefficients(block: Block, given: Sequence[str] | None) -> list[str]:
    """Return the names of the coefficients, each once."""
    if isinstance(given, str):
        raise InputError(f"expected a list of coefficients, found the text {given!r}")
    if given is None:
        names = list(linear_parameters(block))
        if not names:
            raise InputError(f"block {block.name!r} is linear in none of its parameters")
        return names
    names = [block.parameter(name).name for name in given]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"block {block.name!r}: the coefficient {name!r} is given twice")
    return names
