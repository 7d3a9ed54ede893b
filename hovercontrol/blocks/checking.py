"""Check the names, symbols and units of a Block, and complete the parts that a Block may omit.

Called once, when a Block is created. Each function sets the fields that it sorts or completes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import sympy as sp

from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import (
    DIMENSIONLESS,
    Dimension,
    DimensionChecker,
    UnitError,
    dimension,
    unit_text,
)

if TYPE_CHECKING:
    from hovercontrol.blocks.block import Block


def check(block: Block) -> None:
    """Check a new Block and complete it.

    Raises
    ------
    InputError
        If a name is used twice, a symbol is unknown, an expression is missing, definitions are circular, or
        a Block is both sampled and hybrid.
    UnitError
        If an expression adds different units, or its unit differs from its signal's.
    """
    if not 0 <= block.period < math.inf:
        raise InputError(block.where(f"period must not be negative, found {block.period!r}"))
    _check_names(block)
    _complete_outputs(block)
    _order(block, "derivative", "derivatives", block.states)
    _order(block, "output", "output_expressions", block.outputs)
    _set(block, "definitions", _sorted_definitions(block))
    _check_ticks(block)
    _check_symbols(block)
    _check_units(block)
    _check_delays(block)


def _set(block: Block, field: str, value: Any) -> None:
    object.__setattr__(block, field, value)


def _check_names(block: Block) -> None:
    seen: set[str] = set()
    own = [s.name for s in (*block.states, *block.inputs, *block.parameters)] + list(block.definitions)
    for name in own:
        if name in seen:
            raise InputError(block.where(f"the name {name!r} is used twice"))
        seen.add(name)
    keys = [block.parameter_key(p.name) for p in block.parameters]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(block.where(f"two parameters have the key {key!r}"))
    names = [s.name for s in block.outputs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(block.where(f"two outputs are named {name!r}"))


def _complete_outputs(block: Block) -> None:
    known = {s.name for s in (*block.states, *block.inputs)} | set(block.definitions)
    full = {}
    for output in block.outputs:
        given = block.output_expressions.get(output.name)
        if output.name in known:
            if given is not None and given != output.symbol:
                text = f"output {output.name!r} has the name of another signal but is {given}"
                raise InputError(block.where(text))
            given = output.symbol
        if given is not None:
            full[output.name] = given
    extra = {k: v for k, v in block.output_expressions.items() if k not in full}
    _set(block, "output_expressions", Expressions(full | extra))


def _order(block: Block, kind: str, field: str, signals: Sequence[Signal]) -> None:
    """Put the expressions in the order of their signals; raise if one is missing or has no signal."""
    expressions: Mapping[str, sp.Expr] = getattr(block, field)
    names = [s.name for s in signals]
    for name in names:
        if name not in expressions:
            raise InputError(block.where(f"no {kind} expression for {name!r}"))
    for name in expressions:
        check_known(name, names, block.where(f"{kind} expression for unknown signal {name!r}"))
    _set(block, field, Expressions((name, expressions[name]) for name in names))


def _sorted_definitions(block: Block) -> Expressions:
    symbols = {sp.Symbol(name, real=True): name for name in block.definitions}
    done: dict[str, sp.Expr] = {}

    def visit(name: str, path: tuple[str, ...]) -> None:
        if name in path:
            circle = " -> ".join((*path[path.index(name) :], name))
            raise InputError(block.where(f"definitions are circular: {circle}"))
        if name not in done:
            needed = block.definitions[name].free_symbols & symbols.keys()
            for symbol in sorted(needed, key=str):
                visit(symbols[symbol], (*path, name))
            done[name] = block.definitions[name]

    for name in block.definitions:
        visit(name, ())
    return Expressions(done)


def _check_ticks(block: Block) -> None:
    if block.ticks and block.period:
        raise InputError(block.where("a sampled block has a period, a hybrid one has ticks, found both"))
    held = [name for tick in block.ticks for name in tick.updates]
    names = [s.name for s in block.states]
    for name in held:
        if held.count(name) > 1:
            raise InputError(block.where(f"two ticks set the state {name!r}"))
        check_known(name, names, block.where(f"a tick sets {name!r}, which is not a state"))
        if block.derivatives[name] != 0:
            raise InputError(block.where(f"state {name!r} is set by a tick and has a derivative as well"))
    if names[len(names) - len(held) :] != [n for n in names if n in held]:
        raise InputError(block.where("states set by ticks must come after the continuous ones"))


def _check_symbols(block: Block) -> None:
    known = {s.symbol for s in (*block.states, *block.inputs, *block.parameters)}
    known |= {sp.Symbol(name, real=True) for name in block.definitions} | {time}
    for name, expression in block.all_expressions():
        for symbol in sorted(expression.free_symbols - known, key=str):
            hint = did_you_mean(symbol.name, [s.name for s in known])
            if symbol.name in {s.name for s in known}:
                hint = " (it must be real: use Signal.symbol)"
            raise InputError(block.where(f"unknown symbol {symbol.name!r} in {name}{hint}"))


def _check_units(block: Block) -> None:
    symbols = {s.symbol: s.dimension for s in (*block.states, *block.inputs, *block.parameters)}
    units = {s.symbol: s.unit for s in (*block.states, *block.inputs, *block.parameters)}
    derive = DimensionChecker({**symbols, time: dimension("s")}, units)
    given = {s.name: s for s in block.definition_signals}
    described = []
    for name, expression in block.definitions.items():
        found = _dimension(block, derive, name, expression)
        signal = given.get(name) or Signal(name, unit_text(found or DIMENSIONLESS))
        _need(block, name, expression, found, signal.dimension, signal.unit)
        derive.declare(signal.symbol, signal.dimension)
        described.append(signal)
    _set(block, "definition_signals", tuple(described))
    # [x'] = [x]/s for a continuous state x; [next x] = [x] for a sampled one
    per = DIMENSIONLESS if block.period else dimension("s")
    for state in block.states:
        e, label = block.derivatives[state.name], block.update_text(state.name)
        wanted = tuple(a - b for a, b in zip(state.dimension, per, strict=True))
        _need(block, label, e, _dimension(block, derive, label, e), wanted, unit_text(wanted))
    states = {s.name: s for s in block.states}
    for tick in block.ticks:
        for name, e in tick.updates.items():
            found, label = _dimension(block, derive, f"next {name}", e), f"next {name}"
            _need(block, label, e, found, states[name].dimension, states[name].unit)
    for output in block.outputs:
        e = block.output_expressions[output.name]
        found = _dimension(block, derive, output.name, e)
        _need(block, output.name, e, found, output.dimension, output.unit)


def _check_delays(block: Block) -> None:
    inputs, parameters = [s.name for s in block.inputs], {s.symbol: s for s in block.parameters}
    if block.delays and block.period:
        raise InputError(block.where("a sampled block has no delays: hovercontrol.craft.hardware.links has"))
    derive = DimensionChecker(
        {symbol: s.dimension for symbol, s in parameters.items()},
        {symbol: s.unit for symbol, s in parameters.items()},
    )
    for name, e in block.delays.items():
        check_known(name, inputs, block.where(f"a delay of {name!r}, which is not an input"))
        for symbol in sorted(e.free_symbols - parameters.keys(), key=str):
            hint = did_you_mean(symbol.name, [s.name for s in block.parameters])
            raise InputError(
                block.where(
                    f"the delay of {name!r} depends on {symbol.name!r}, which is not a parameter{hint}"
                )
            )
        label = f"the delay of {name!r}"
        _need(block, label, e, _dimension(block, derive, label, e), dimension("s"), "s")
    _set(block, "delays", Expressions((n, block.delays[n]) for n in inputs if n in block.delays))


def _dimension(block: Block, derive: DimensionChecker, name: str, e: sp.Expr) -> Dimension | None:
    try:
        return derive(e)
    except UnitError as error:
        raise UnitError(block.where(f"{name}: {error}")) from None


def _need(block: Block, name: str, e: sp.Expr, found: Dimension | None, wanted: Dimension, unit: str) -> None:
    if found is not None and found != wanted:
        text = f"{name} must be in {unit}, but '{e}' is in {unit_text(found)}"
        raise UnitError(block.where(text))
