"""Switches between two sources of a signal, as a parameter of the loop: switching needs no rebuild."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal


def selector(
    name: str, description: str, ways: Mapping[Signal, tuple[sp.Expr | str, sp.Expr | str]]
) -> Block:
    """Return a Block that selects signals from one of two sources.

    Parameters
    ----------
    description : str
        Description of the switched function.
    ways : mapping of Signal to two str or sympy.Expr
        For each output its source while the parameter ``on`` is 1, and while it is 0: the name of an input
        with the same unit, or an expression of such inputs.

    Returns
    -------
    Block
        Without states and period: its outputs follow its inputs directly. Parameter ``on``, initially 1.

    Examples
    --------
    >>> block = selector("link", "the radio", {Signal("u", "m/s"): ("u_late", "u_now")})
    >>> block.to_numpy().outputs(0.0, (), [1.0, 2.0], {"link.on": 0.0}).tolist()
    [2.0]
    """
    on = Signal("on", "1", description, start=1.0, modes=("off", "on"))
    inputs: dict[str, Signal] = {}
    expressions: dict[str, sp.Expr] = {}
    for signal, pair in ways.items():
        found = []
        for way in pair:
            e = sp.Symbol(way, real=True) if isinstance(way, str) else sp.sympify(way)
            for symbol in sorted(e.free_symbols, key=str):
                inputs.setdefault(symbol.name, signal.replace(name=symbol.name))
            found.append(e)
        expressions[signal.name] = sp.Piecewise((found[0], on.symbol > 0), (found[1], True))
    return Block(
        name,
        inputs=tuple(inputs.values()),
        outputs=tuple(ways),
        parameters=(on,),
        output_expressions=expressions,
    )


#: The former name.
choice = selector
