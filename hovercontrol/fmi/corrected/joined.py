"""What stands around an FMU as one Block, and how its signals belong to the FMU's variables.

With v the inputs as they are given, x the FMU's states and y its outputs::

    u = before(v),   x' = f(x, u) + added(x, u),   y_measured = after(y)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import sympy as sp

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.signals import Signal
from hovercontrol.fmi.corrected.inner_fmu import InnerFmu, Variable

#: Endings of the names of a Block's outputs: an input as the FMU gets it, an output as it is measured.
GIVEN, MEASURED = "_given", "_measured"


@dataclass(frozen=True)
class Joined:
    """One Block around an FMU.

    Attributes
    ----------
    block : Block
        Continuous or hybrid. Inputs: the driven inputs as they are given, then the sources. Outputs: the
        driven inputs as the FMU gets them, the measured outputs, what is added to derivatives.
    driven, sources, measured : tuple of Variable
        The FMU's variables in these orders; the first `n_early` sources are inputs that pass unchanged.
    added : tuple of int
        Places of the states in the FMU's order of states.
    """

    block: Block
    driven: tuple[Variable, ...]
    sources: tuple[Variable, ...]
    n_early: int
    measured: tuple[Variable, ...]
    added: tuple[int, ...]

    @property
    def late_given(self) -> dict[str, sp.Expr]:
        """Delays of inputs as they are given [s], by the Block's input."""
        return {n: e for n, e in self.block.delays.items() if n.startswith("given_")}

    @property
    def late_sources(self) -> dict[int, sp.Expr]:
        """Delays of sources [s], by place."""
        names = [s.name for s in self.block.inputs[len(self.driven) :]]
        return {names.index(n): e for n, e in self.block.delays.items() if n.startswith("source_")}


def joined(inner: InnerFmu, before: Block | None, after: Block | None, added: Mapping[str, Block]) -> Joined:
    """Return the Blocks around an FMU as one.

    Parameters
    ----------
    before : Block or None
        Inputs named like inputs of the FMU; outputs ``NAME_given``.
    after : Block or None
        Inputs named like variables of the FMU; outputs ``NAME_measured``.
    added : mapping of str to Block
        By the name of a derivative or of its state; each with one output.

    Raises
    ------
    InputError
        If a signal is no variable of the FMU, or nothing stands around it.
    """
    parts: list[Block] = []
    sources: dict[str, tuple[str, Variable]] = {}
    driven = _driven(inner, before) if before else {}
    if before:
        sources = _sources(inner, before, driven)
        names = {n: f"given_{k}" for k, n in enumerate(driven)} | {n: sources[n][0] for n in sources}
        parts.append(_part(before, names, _numbered("driven", driven.values())))
    n_early = len(sources)
    passed = dict(sources)

    def source_names(block: Block, what: str) -> dict[str, str]:
        for s in block.inputs:
            if s.name not in passed:
                passed[s.name] = (f"source_{len(passed)}", inner.variable(s.name, what))
        return {s.name: passed[s.name][0] for s in block.inputs}

    measured = _measured(inner, after) if after else {}
    if after:
        parts.append(_part(after, source_names(after, "after"), _numbered("measured", measured.values())))
    places = _places(inner, added)
    if added:
        sums = [
            _part(b, source_names(b, "added"), {b.outputs[0].name: f"added_{k}"})
            for k, b in enumerate(added.values())
        ]
        parts.append(_sums(sums))
    counts = {"driven": len(driven), "measured": len(measured), "added": len(places)}
    order = [f"{kind}_{k}" for kind, count in counts.items() for k in range(count)]
    if not order:
        raise InputError(f"{inner.path}: no Block around it changes an input, an output or a derivative")
    block = interconnect(parts, "around", outputs=order).in_continuous_time
    inputs = [f"given_{k}" for k in range(len(driven))] + [name for name, _ in passed.values()]
    return Joined(
        _with_inputs(block, inputs),
        tuple(inner.by_name[n] for n in driven),
        tuple(v for _, v in passed.values()),
        n_early,
        tuple(inner.by_name[n] for n in measured),
        tuple(places),
    )


def _numbered(kind: str, names: Iterable[str]) -> dict[str, str]:
    """Return names of the joined Block for others, in their order."""
    return {name: f"{kind}_{k}" for k, name in enumerate(names)}


def _sources(inner: InnerFmu, before: Block, driven: Mapping[str, str]) -> dict[str, tuple[str, Variable]]:
    """Return the inputs of the Block before the FMU that drive nothing, with the FMU's variable."""
    found: dict[str, tuple[str, Variable]] = {}
    for s in before.inputs:
        if s.name in driven:
            continue
        if s.name in before.delays:
            raise InputError(f"block {before.name!r}: {s.name} arrives late but has no output {s.name}_given")
        found[s.name] = (f"source_{len(found)}", inner.variable(s.name, "before", "input"))
    return found


def _with_inputs(block: Block, names: list[str]) -> Block:
    """Return the Block with its inputs in an order; those that nothing reads are added."""
    own = {s.name: s for s in block.inputs}
    return replace(block, inputs=tuple(own.get(n) or Signal(n) for n in names))


def _stem(name: str, ending: str) -> str:
    """Return ``u[1]`` for ``u_given[1]``; a name without the ending is returned unchanged."""
    first, bracket, rest = name.partition("[")
    return f"{first.removesuffix(ending)}{bracket}{rest}"


def _changed(inner: InnerFmu, block: Block, ending: str, causality: str) -> dict[str, str]:
    """Return for each variable that a Block changes the name of the Block's output."""
    found = {}
    for s in block.outputs:
        name = _stem(s.name, ending)
        inner.variable(name, f"block {block.name!r}, output {s.name!r}", causality)
        same = block.expand(block.output_expressions[s.name]) == sp.Symbol(name, real=True)
        if not same or name in block.delays or block.period:
            found[name] = s.name
    return found


def _driven(inner: InnerFmu, before: Block) -> dict[str, str]:
    found = _changed(inner, before, GIVEN, "input")
    for name in found:
        if inner.exchange is not None and inner.by_name[name].element.get("variability") == "discrete":
            raise InputError(
                f"{inner.path}: the input {name!r} is discrete; what drives it changes continuously"
            )
        if name not in [s.name for s in before.inputs]:
            raise InputError(
                f"block {before.name!r}: expected an input {name!r} for the output {name}{GIVEN}"
                + did_you_mean(name, [s.name for s in before.inputs])
            )
    return found


def _measured(inner: InnerFmu, after: Block) -> dict[str, str]:
    return _changed(inner, after, MEASURED, "output")


def _places(inner: InnerFmu, added: Mapping[str, Block]) -> list[int]:
    pairs = inner.derivatives()
    names = [d.name for _, d in pairs]
    states = [s.name for s, _ in pairs]
    found = []
    for name, block in added.items():
        if name not in names and name not in states:
            raise InputError(
                f"added: {inner.path} has no derivative {name!r}" + did_you_mean(name, [*names, *states])
                if names
                else f"added: {inner.path} has no continuous states of Model Exchange"
            )
        if len(block.outputs) != 1:
            raise InputError(f"added: block {block.name!r} has {len(block.outputs)} outputs; expected one")
        found.append(names.index(name) if name in names else states.index(name))
    return found


def _part(block: Block, inputs: Mapping[str, str], outputs: Mapping[str, str]) -> Block:
    """Return a Block with the names of the joined one; outputs that pass unchanged are left out."""
    kept = tuple(s for s in block.outputs if s.name in outputs)
    expressions = Expressions((s.name, block.output_expressions[s.name]) for s in kept)
    chosen = replace(block, outputs=kept, output_expressions=expressions)
    return rename(chosen, {**inputs, **outputs})


def _sums(blocks: list[Block]) -> Block:
    """Return Blocks side by side as one; parameters and states of the same name are the same."""

    def every(kind: str) -> tuple[Signal, ...]:
        return tuple({s.name: s for b in blocks for s in getattr(b, kind)}.values())

    for b in blocks:
        b.need_continuous("place in an equation", hybrid=False)
        b.need_prompt_inputs("a term of an equation")
    own = [(f"{b.parameter_key(p.name)}", p) for b in blocks for p in b.parameters]
    named = [b.with_parameter_names({p.name: b.parameter_key(p.name) for p in b.parameters}) for b in blocks]
    return Block(
        "added",
        states=every("states"),
        inputs=every("inputs"),
        outputs=every("outputs"),
        parameters=tuple({key: p.replace(name=key) for key, p in own}.values()),
        derivatives={n: b.expand(e) for b in named for n, e in b.derivatives.items()},
        output_expressions={n: b.expand(e) for b in named for n, e in b.output_expressions.items()},
    )
