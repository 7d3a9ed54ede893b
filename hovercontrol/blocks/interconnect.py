"""Join Blocks by signal name into one Block (over 400 lines: the wiring rules and their messages).

An output drives every input of the same name. Inputs without a source become inputs of the joined Block.
States and parameters get their Block's name as a prefix (``plant.u``, ``plant.yaw_coulomb``); outputs and
inputs do not.

Continuous and sampled Blocks, or sampled Blocks of different periods, give a hybrid Block. Each output of a
sampled Block then becomes a state that holds it (``pilot.held_rudder``), and the updates of the sampled Block
become a :class:`~hovercontrol.blocks.block.Tick`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.block import Block, Tick
from hovercontrol.blocks.expressions import Expressions, with_symbols
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.tick_order import tick_order

#: What the name of a held output begins with, after its Block's.
HELD = "held_"


@checked
def rename(block: Block, signals: Mapping[str, str]) -> Block:
    """Return the Block with some of its inputs and outputs renamed.

    Parameters
    ----------
    block : Block
    signals : mapping of str to str
        Old name to new name. A state keeps its own name when an output of the same name is renamed.

    Raises
    ------
    InputError
        If the Block has no such input or output, or the new name is taken.

    Examples
    --------
    >>> v, a = Signal("v", "m/s"), Signal("a", "m/s^2")
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> rename(cart, {"a": "push"}).equations()
    "v' = push"
    """
    ports = [s.name for s in (*block.inputs, *block.outputs)]
    for old in signals:
        check_known(old, ports, f"block {block.name!r}: no input or output {old!r} to rename")
    inputs = {s.name for s in block.inputs}
    swap = {
        sp.Symbol(old, real=True): sp.Symbol(new, real=True) for old, new in signals.items() if old in inputs
    }

    def renamed(group: Iterable[Signal]) -> list[Signal]:
        return [s.replace(name=signals.get(s.name, s.name)) for s in group]

    outputs = [
        (signals.get(name, name), with_symbols(e, swap)) for name, e in block.output_expressions.items()
    ]
    return replace(
        block,
        inputs=tuple(renamed(block.inputs)),
        outputs=tuple(renamed(block.outputs)),
        **block.swapped(swap)
        | {
            "output_expressions": Expressions(outputs),
            "delays": Expressions((signals.get(name, name), e) for name, e in block.delays.items()),
        },
    )


@checked
def prefix(block: Block, name: str) -> Block:
    """Return the Block renamed to `name`, with all its inputs and outputs prefixed ``name_``.

    Use it for two craft of the same kind in one system: join each craft with its controller, then prefix the
    result (``prefix(interconnect([plant, controller]), "left")``). Parameter keys begin with ``name.``.

    Parameters
    ----------
    block : Block
    name : str
        An identifier.

    Examples
    --------
    >>> v, a = Signal("v", "m/s"), Signal("a", "m/s^2")
    >>> left = prefix(Block("cart", [v], [a], [v], derivatives={"v": a.symbol}), "left")
    >>> left.name, left.inputs[0].name, left.outputs[0].name
    ('left', 'left_a', 'left_v')
    """
    ports = {s.name: f"{name}_{s.name}" for s in (*block.inputs, *block.outputs)}
    own = f"{block.name}."
    inner = {
        p.name: f"{name}.{p.name}" for p in block.parameters if "." in p.name and not p.name.startswith(own)
    }
    return rename(block, ports).with_parameter_names(inner).named(name)


@dataclass(frozen=True)
class _Part:
    """One Block to be joined: the new symbol of each of its symbols and, if it ticks, its held outputs."""

    block: Block
    own: dict[sp.Symbol, sp.Symbol]
    held: tuple[Signal, ...] = ()


@dataclass
class _Equations:
    """The equations of the joined Block, collected part by part; `outside` is what other parts give."""

    outside: dict[sp.Symbol, sp.Expr]
    definitions: dict[str, sp.Expr] = field(default_factory=dict)
    signals: list[Signal] = field(default_factory=list)
    states: list[Signal] = field(default_factory=list)
    held: list[Signal] = field(default_factory=list)
    derivatives: dict[str, sp.Expr] = field(default_factory=dict)
    ticks: dict[str, list[Tick]] = field(default_factory=dict)

    def add(self, part: _Part, plain: Mapping[str, sp.Expr], *, hybrid: bool) -> None:
        block, swap = part.block, {**self.outside, **part.own}
        for signal in block.definition_signals:
            self.signals.append(_moved(part, signal))
            self.definitions[self.signals[-1].name] = with_symbols(block.definitions[signal.name], swap)
        for output in block.outputs:
            if output.name not in plain:
                self.signals.append(output)
                self.definitions[output.name] = with_symbols(block.output_expressions[output.name], swap)
        moved = [_moved(part, s) for s in block.states]
        if hybrid and block.period:
            self._add_sampled(part, moved, swap)
        else:
            self._add_states(block, moved, swap)

    def _add_sampled(self, part: _Part, moved: list[Signal], swap: Mapping[sp.Symbol, sp.Expr]) -> None:
        block = part.block
        self.held += [*part.held, *moved]
        self.derivatives.update({s.name: sp.S.Zero for s in (*part.held, *moved)})
        tells = _renamed(part.held, block.output_expressions, swap)
        takes = _renamed(moved, block.derivatives, swap)
        self.ticks[block.name] = [Tick(block.name, block.period, updates) for updates in (tells, takes)]

    def _add_states(self, block: Block, moved: list[Signal], swap: Mapping[sp.Symbol, sp.Expr]) -> None:
        self.states += moved[: block.n_continuous]
        self.held += moved[block.n_continuous :]
        self.derivatives.update(_renamed(moved, block.derivatives, swap))
        self.ticks[block.name] = [
            Tick(
                tick.name,
                tick.period,
                Expressions((f"{block.name}.{n}", with_symbols(e, swap)) for n, e in tick.updates.items()),
            )
            for tick in block.ticks
        ]


def _renamed(
    signals: Iterable[Signal], expressions: Mapping[str, sp.Expr], swap: Mapping[sp.Symbol, sp.Expr]
) -> Expressions:
    pairs = zip(signals, expressions.values(), strict=True)
    return Expressions((s.name, with_symbols(e, swap)) for s, e in pairs)


@checked
def interconnect(
    blocks: Sequence[Block],
    name: str = "system",
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    hybrid: bool = False,
) -> Block:
    """Join Blocks by signal name into one Block.

    Parameters
    ----------
    blocks : sequence of Block
        Blocks with different names; their order does not matter. If sampled Blocks tick at the same instant,
        each reads the others' outputs of that instant.
    name : str, optional
        Name of the joined Block.
    inputs : sequence of str, optional
        Inputs of the joined Block, in this order (default: all inputs without a source).
    outputs : sequence of str, optional
        Outputs of the joined Block (default: all).
    hybrid : bool, optional
        If true, sampled Blocks of one period also give a hybrid Block, which has continuous-time backends.

    Returns
    -------
    Block
        Sampled if all Blocks that tick or have states tick with one period; hybrid if only some of them tick
        or periods differ; else continuous.

    Raises
    ------
    InputError
        If two outputs or two Blocks have the same name, the units of a connection differ, a requested signal
        does not exist, an input without a source is missing in `inputs`, or there is an algebraic loop (the
        message lists it). Also if an output drives a delayed input, or an open input has different delays in
        two Blocks.

    Examples
    --------
    >>> v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> brake = Block("brake", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})
    >>> print(interconnect([cart, brake], "loop").equations())
    a = -brake.k*cart.v
    cart.v' = a
    v = cart.v

    The same brake on a computer that ticks every 0.25 s:

    >>> sampled = Block("brake", [], [v], [a], [k], brake.derivatives, brake.output_expressions, period=0.25)
    >>> print(interconnect([cart, sampled], "loop").equations())
    cart.v' = brake.held_a
    every 0.25 s: next brake.held_a = -brake.k*cart.v
    v = cart.v
    a = brake.held_a
    """
    if isinstance(blocks, Block) or not all(isinstance(b, Block) for b in blocks):
        raise InputError(f"interconnect: expected a sequence of Blocks, found {blocks!r:.80}")
    if not len(blocks):
        raise InputError("interconnect: no blocks given")
    _refuse_clashes(blocks)
    drivers = {s.name: (block, s) for block in blocks for s in block.outputs}
    open_inputs = _open_inputs(blocks, drivers)
    _refuse_late_wires(blocks, drivers)
    period = _common_period(blocks)
    period = None if hybrid and period else period
    _refuse_loops(blocks, drivers)

    parts = [_part(block, hybrid=period is None) for block in blocks]
    plain = _plain_outputs(parts)
    joined = _Equations({sp.Symbol(n, real=True): e for n, e in plain.items()})
    for part in parts:
        joined.add(part, plain, hybrid=period is None)
    shown = _chosen({n: s for n, (_, s) in drivers.items()}, outputs, "output")
    return Block(
        name=name,
        states=(*joined.states, *joined.held),
        inputs=tuple(_chosen(open_inputs, inputs, "input", strict=True)),
        outputs=tuple(shown),
        parameters=tuple(_moved(part, s) for part in parts for s in part.block.parameters),
        derivatives=Expressions(joined.derivatives),
        output_expressions=Expressions((s.name, plain[s.name]) for s in shown if s.name in plain),
        definitions=Expressions(joined.definitions),
        definition_signals=tuple(joined.signals),
        period=period or 0.0,
        ticks=tuple(_in_order(blocks, drivers, joined.ticks)) if period is None else (),
        delays=_open_delays(parts),
    )


def _in_order(
    blocks: Sequence[Block],
    drivers: Mapping[str, tuple[Block, Signal]],
    ticks: Mapping[str, Sequence[Tick]],
) -> list[Tick]:
    """Return all ticks in execution order; a Block's outputs and next states share one tick if possible."""
    first: list[Tick] = []
    last: list[Tick] = []
    for block, late in tick_order(blocks, {name: driver for name, (driver, _) in drivers.items()}):
        if block.ticks:
            first += ticks[block.name]
            continue
        tells, takes = ticks[block.name]
        if late:
            first.append(tells)
            last.append(takes)
        else:
            first.append(replace(tells, updates=Expressions({**tells.updates, **takes.updates})))
    return [tick for tick in (*first, *last) if tick.updates]


def _common_period(blocks: Sequence[Block]) -> float | None:
    """Return the period of the joined Block [s], None if hybrid; static Blocks tick with the others."""
    periods = {block.period for block in blocks if block.period or block.states}
    if len(periods) > 1 or any(block.ticks for block in blocks):
        return None
    return periods.pop() if periods else 0.0


def _plain_outputs(parts: Sequence[_Part]) -> dict[str, sp.Expr]:
    """Return the outputs that equal a state or a definition; they need no equation of their own."""
    found = {}
    for part in parts:
        outputs = part.block.output_expressions
        if part.held:
            found.update({name: s.symbol for name, s in zip(outputs, part.held, strict=True)})
        else:
            found.update({name: part.own[e] for name, e in outputs.items() if e in part.own})
    return found


def _part(block: Block, hybrid: bool) -> _Part:
    local = [*block.states, *block.parameters, *block.definition_signals]
    holds = block.outputs if hybrid and block.period else ()
    return _Part(
        block,
        {
            s.symbol: sp.Symbol(f"{block.name}.{s.name}" if _is_local(block, s) else s.name, real=True)
            for s in local
        },
        tuple(s.replace(name=f"{block.name}.{HELD}{s.name}") for s in holds),
    )


def _is_local(block: Block, signal: Signal) -> bool:
    """Return whether a signal gets the Block's name as a prefix; a parameter with a dotted name does not."""
    return not (signal in block.parameters and "." in signal.name)


def _moved(part: _Part, signal: Signal) -> Signal:
    return signal.replace(name=part.own[signal.symbol].name)


def _refuse_clashes(blocks: Sequence[Block]) -> None:
    seen: dict[str, str] = {}
    names: list[str] = []
    for block in blocks:
        if block.name in names:
            raise InputError(f"two blocks are named {block.name!r}: give one another name with .named()")
        names.append(block.name)
        for output in block.outputs:
            if output.name in seen:
                raise InputError(
                    f"blocks {seen[output.name]!r} and {block.name!r} both have an output "
                    f"{output.name!r}: use rename() or prefix() on one of them"
                )
            seen[output.name] = block.name
    keys: dict[str, str] = {}
    for block in blocks:
        for key in block.default_parameters:
            if key in keys:
                raise InputError(f"blocks {keys[key]!r} and {block.name!r} share the parameter {key!r}")
            keys[key] = block.name


def _open_inputs(blocks: Sequence[Block], drivers: Mapping[str, tuple[Block, Signal]]) -> dict[str, Signal]:
    found: dict[str, tuple[Block, Signal]] = {}
    for block in blocks:
        for signal in block.inputs:
            other, source = drivers.get(signal.name) or found.setdefault(signal.name, (block, signal))
            if source.dimension != signal.dimension:
                raise InputError(
                    f"{signal.name!r} is in {source.unit} in block {other.name!r} "
                    f"but in {signal.unit} in block {block.name!r}"
                )
    return {name: signal for name, (_, signal) in found.items()}


def _refuse_late_wires(blocks: Sequence[Block], drivers: Mapping[str, tuple[Block, Signal]]) -> None:
    """Raise if an output drives a delayed input: the joined Block would have to store past values."""
    for block in blocks:
        for name in block.delays:
            if name in drivers:
                driver = drivers[name][0].name
                raise InputError(
                    f"{name!r} acts with a delay in block {block.name!r}, but block {driver!r} "
                    "drives it and stores no past values: replace the delay by a sampled link of "
                    "hovercontrol.craft.hardware.links (with hovercontrol.blocks.delays.undelayed()) or by "
                    "hovercontrol.blocks.delays.pade()"
                )


def _open_delays(parts: Sequence[_Part]) -> Expressions:
    """Return the delay of each open input; raise if it differs between two Blocks with that input."""
    found: dict[str, tuple[Block, sp.Expr]] = {}
    for part in parts:
        for signal in part.block.inputs:
            delay = part.block.delays.get(signal.name, sp.S.Zero).xreplace(part.own)
            other, before = found.setdefault(signal.name, (part.block, delay))
            if before != delay:
                raise InputError(
                    f"the input {signal.name!r} acts {_late(before)} in block {other.name!r} but "
                    f"{_late(delay)} in block {part.block.name!r}: rename() one of them"
                )
    return Expressions((name, delay) for name, (_, delay) in found.items() if delay != 0)


def _late(delay: sp.Expr) -> str:
    return f"late by {delay}" if delay != 0 else "at once"


def _refuse_loops(blocks: Sequence[Block], drivers: Mapping[str, tuple[Block, Signal]]) -> None:
    """Follow the direct feedthrough of each output; raise if it closes an algebraic loop."""
    done: set[str] = set()

    def visit(output: str, path: list[str]) -> None:
        block = drivers[output][0]
        here = f"{block.name}.{output}"
        if here in path:
            circle = " -> ".join(reversed([*path[path.index(here) :], here]))
            raise InputError(f"algebraic loop: {circle}; break it with a state (a lag or a delay)")
        if output in done:
            return
        for needed in block.feedthrough[output]:
            if needed in drivers:
                visit(needed, [*path, here])
        done.add(output)

    for name in drivers:
        visit(name, [])


def _chosen(
    there: Mapping[str, Signal], wanted: Sequence[str] | None, kind: str, strict: bool = False
) -> list[Signal]:
    if wanted is None:
        return list(there.values())
    for name in wanted:
        check_known(name, there, f"interconnect: no {kind} {name!r}")
    missing = [name for name in there if name not in wanted]
    if strict and missing:
        raise InputError(f"interconnect: nothing drives the {kind} {missing[0]!r}")
    return [there[name] for name in wanted]
