"""Dependencies between variables: the ModelStructure of an FMU, from the equations alone.

A known v enters an unknown as ``c v`` with a factor of numbers (constant), of tunable parameters (tunable),
of friction modes besides (discrete), or otherwise (dependent). The result may be weaker than possible, but is
never too strong: cancelling terms are not detected, and the arguments of jumps (``floor``, ``Piecewise``) are
dependent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.friction import with_modes
from hovercontrol.blocks.signals import time
from hovercontrol.fmi.exporter.variables import Interface

#: By symbol the symbols of its factor, or None where it does not enter linearly.
Form = dict[sp.Symbol, frozenset[sp.Symbol] | None]


@dataclass(frozen=True)
class Unknown:
    """A variable and its dependencies: sorted value references, each with its kind."""

    reference: int
    knowns: tuple[tuple[int, str], ...]


class Structure:
    """Dependencies of outputs, derivatives and event indicators.

    Attributes
    ----------
    outputs, derivatives, events : tuple of Unknown
        Knowns are time, states (states set by ticks at initialization only), inputs and parameters.
    """

    def __init__(self, interface: Interface) -> None:
        block = with_modes(interface.block, interface.frictions)
        groups = (("state", block.states), ("input", block.inputs), ("parameter", block.parameters))
        self._references = {time: 0} | {
            s.symbol: interface.first(kind) + k  # type: ignore[arg-type]
            for kind, signals in groups
            for k, s in enumerate(signals)
        }
        parameters = frozenset(s.symbol for s in block.parameters)
        modes = frozenset(f.symbol for f in interface.frictions)
        self._constants = (parameters, parameters | modes)
        self._late = {s.symbol for s in block.inputs if s.name in block.delays}
        defined: dict[sp.Symbol, Form] = {}
        for name, e in block.definitions.items():
            defined[sp.Symbol(name, real=True)] = _form(e, defined)

        def unknown(reference: int, form: Form, sticks: bool = False) -> Unknown:
            return Unknown(reference, tuple(sorted(self._knowns(form, sticks))))

        velocities = {f.state for f in interface.frictions}
        self.derivatives = tuple(
            unknown(interface.first("derivative") + k, _form(e, defined), name in velocities)
            for k, (name, e) in enumerate(block.derivatives.items())
            if name not in interface.held
        )
        self.outputs = tuple(
            unknown(v.reference, _form(e, defined))
            for v, e in zip(interface.outputs, block.output_expressions.values(), strict=True)
        )
        events = []
        for k, f in enumerate(interface.frictions):
            inside = _form(f.a, defined) | _form(f.b, defined) | {sp.Symbol(f.state, real=True): None}
            events.append(unknown(interface.first("event") + k, dict.fromkeys(inside)))
        self.events = tuple(events)

    def _knowns(self, form: Form, sticks: bool) -> list[tuple[int, str]]:
        tunable, discrete = self._constants
        found = []
        for symbol, factor in form.items():
            if symbol not in self._references:  # a mode: no known of FMI's
                continue
            kind = "dependent"
            if factor is not None and factor <= discrete and symbol not in self._late:
                kind = "discrete" if sticks or not factor <= tunable else "tunable" if factor else "constant"
            found.append((self._references[symbol], kind))
        return found


def _form(e: sp.Basic, defined: Mapping[sp.Symbol, Form]) -> Form:
    """Return how an expression depends on the symbols that are not defined by others."""
    if e.is_Symbol:
        return defined.get(e, {e: frozenset()})
    if not e.free_symbols:
        return {}
    parts = [_form(part, defined) for part in e.args]
    if e.is_Add:
        total: Form = {}
        for part in parts:
            for symbol, factor in part.items():
                total[symbol] = _either(total.get(symbol, frozenset()), factor)
        return total
    if e.is_Mul:
        result: Form = {}
        for k, part in enumerate(parts):
            others = frozenset[sp.Symbol]().union(*(p for j, p in enumerate(parts) if j != k))
            for symbol, factor in part.items():
                once = factor is not None and symbol not in others
                result[symbol] = factor | others if once and factor is not None else None
        return result
    return {symbol: None for part in parts for symbol in part}


def _either(a: frozenset[sp.Symbol] | None, b: frozenset[sp.Symbol] | None) -> frozenset[sp.Symbol] | None:
    return None if a is None or b is None else a | b
