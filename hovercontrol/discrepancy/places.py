"""Where an effect acts: in equations, in measured channels, or on commands."""

from __future__ import annotations

import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.estimation.fit import Fit
from hovercontrol.models.base import quantity_of


def acts_in(fit: Fit, name: str) -> str:
    """Return where an effect acts, as text: equations, outputs, commands or clock."""
    block = fit.problem.block
    e = fit.problem.model.effect(name)
    own = {block.parameter(e.parameter(k)).symbol for k in e.numbers}
    motion = fit.problem.model.motion
    rows = [
        f"{s.name}'"
        for s in block.states
        if s.name in motion and block.expand(block.derivatives[s.name]).free_symbols & own
    ]
    rows += [
        f"{quantity_of(o.name)[0]} as measured" if quantity_of(o.name)[1] else o.name
        for o in block.outputs
        if block.expand(block.output_expressions[o.name]).free_symbols & own
    ]
    return " ".join(rows) or (commands_of(block, own) if type(e).kind() == "input" else "the log's clock")


def commands_of(block: Block, own: set[sp.Symbol]) -> str:
    """Return the commands that pass through states whose equations contain given symbols; all if none does.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_experiment").with_effects([hc.effect("rudder_lag", seconds=0.1)])
    >>> plant = craft.plant()
    >>> commands_of(plant, {plant.parameter("rudder_lag_seconds").symbol})
    'command rudder'
    """
    of = {s.symbol: block.expand(block.derivatives[s.name]).free_symbols for s in block.states}
    inputs = {s.symbol: s.name for s in block.inputs}

    def passing(state: sp.Symbol) -> frozenset[str]:
        behind = {state}
        while more := {s for symbol in behind for s in of[symbol]} & of.keys() - behind:
            behind |= more
        return frozenset(inputs[s] for symbol in behind for s in of[symbol] if s in inputs)

    # A lag shares its symbols with the motion, which all commands reach: take the smallest sets of commands.
    ways = {passing(symbol) for symbol, law in of.items() if law & own}
    fewest = {way for way in ways if not any(other < way for other in ways if other)}
    names = [name for name in inputs.values() if any(name in way for way in fewest)]
    if not names or len(names) == len(block.inputs):
        return "all commands" if len(block.inputs) > 1 else f"command {block.inputs[0].name}"
    return f"command{'s' * (len(names) > 1)} {', '.join(names)}"
