"""The equations of a Block with added effects: its commands, measurements, derivatives or next values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import sympy as sp

from hovercontrol.base.errors import check_known
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.effects.actuator import clipped
from hovercontrol.craft.models.base import as_measured, delays_of, rate_limit
from hovercontrol.craft.models.rates import late_inputs, next_value

if TYPE_CHECKING:
    from hovercontrol.craft.models.blockmodel import BlockModel


@dataclass(frozen=True)
class BlockEquations:
    """The equations of a model made of a Block and effects."""

    model: BlockModel

    def commands(self, limited: bool = False) -> tuple[dict[Signal, sp.Expr], SimpleNamespace]:
        """Return the states of effects on inputs with their rates, and the inputs as they act."""
        way = SimpleNamespace(
            thrusts={s.name: _limited(s) if limited else s.symbol for s in self.model.block.inputs},
            rudder=sp.Symbol("rudder", real=True),
            time=time,
            inputs={s.name: s.symbol for s in self.model.block.inputs},
            units=self.model.input_units(),
            delay=None,
        )
        states: dict[Signal, sp.Expr] = {}
        for e in sorted(self.model.effects, key=lambda e: e.order):
            states |= e.commands(e.symbols(self.model.name), way)
        return states, way

    def measurements(self) -> SimpleNamespace:
        """Return the outputs as measured and, as ``true``, as they are."""
        every: dict[str, Any] = {s.name: s.symbol for s in self.model.block.states}
        every |= {s.name: self.model.block.output_expressions[s.name] for s in self.model.block.outputs}
        seen = SimpleNamespace(**every, true=SimpleNamespace(**every), late=None)
        for e in sorted(self.model.effects, key=lambda e: e.order):
            e.measured(e.symbols(self.model.name), seen)
        return seen

    def motion(self, inputs: Mapping[str, sp.Expr], limit: Signal | None = None) -> SimpleNamespace:
        """Return the symbols that effects use in ``terms`` and ``states``."""
        return SimpleNamespace(
            **{
                # unless the Block has a signal of that name
                "fastest": limit.symbol if limit else None,
                "inputs": {s.name: s.symbol for s in self.model.block.inputs},
                "thrusts": dict(inputs),
                **{s.name: s.symbol for s in (*self.model.block.states, *self.model.block.parameters)},
                **inputs,
                "time": time,
            }
        )

    def amended(self, late: bool, fastest: float | None, *, rates: bool = False) -> Block:
        """Return the Block with the effects, or, of a sampled Block, its rates with the effects."""
        model = self.model
        block = model.rate_form() if rates else undelayed(model.block)
        step = Signal("period", "s", "sampling period", start=block.period) if block.period else None
        lags, way = self.commands(limited=rates and model.limited)
        memory = self._remembered(way, lags, step) if step and not late else {}
        swap = {s.symbol: way.thrusts[s.name] for s in block.inputs}
        derivatives = {name: e.xreplace(swap) for name, e in block.derivatives.items()}
        limit = rate_limit(model.name, fastest)
        motion = self.motion(way.thrusts, limit)
        own = self._add_terms(derivatives, lags, motion, step)
        used = set().union(
            *(e.free_symbols for e in (*derivatives.values(), *own.values(), *memory.values()))
        )
        derivatives |= {s.name: e for s, e in (own | memory).items()}
        measured = self._changed_outputs(block)
        shown = {
            s.name: block.output_expressions[s.name].xreplace(swap)
            for s in block.outputs
            if rates or s.name not in block.derivatives
        }
        parts: dict[str, Any] = {
            "states": (*block.states, *own, *memory),
            "outputs": (*block.outputs, *measured),
            "parameters": (
                *block.parameters,
                *(p for e in model.effects for p in e.signals(model.name, model.shared_units())),
                *(s for s in (limit, step) if s and s.symbol in used),
            ),
            "derivatives": Expressions(derivatives),
            "output_expressions": Expressions({**shown, **{s.name: e for s, e in measured.items()}}),
            "definitions": Expressions({name: e.xreplace(swap) for name, e in block.definitions.items()}),
        }
        if rates:
            return block.unchecked(**parts)
        delays = {} if late or step else delays_of(model.timing(), block.inputs, model.coefficients())
        return Block(block.name, inputs=block.inputs, delays=delays, period=block.period, **parts)

    def _add_terms(
        self,
        derivatives: dict[str, sp.Expr],
        lags: Mapping[Signal, sp.Expr],
        motion: SimpleNamespace,
        step: Signal | None,
    ) -> dict[Signal, sp.Expr]:
        """Add the effects' terms to the derivatives; return the equations of the effects' own states."""
        model = self.model
        own = dict(lags)
        for e in model.effects:
            own |= e.states(e.symbols(model.name), motion)
            for state, term in e.terms(e.symbols(model.name), motion).items():
                check_known(state, derivatives, f"effect {e.name}: {model.name!r} has no state {state!r}")
                derivatives[state] += step.symbol * term if step else term
        return {s: next_value(s, rate, step.symbol) for s, rate in own.items()} if step else own

    def _changed_outputs(self, block: Block) -> dict[Signal, sp.Expr]:
        """Return the outputs that effects of sensors change, as measured."""
        seen = self.measurements()
        pairs = [(s, getattr(seen, s.name)) for s in block.outputs]
        return {as_measured(s): e for s, e in pairs if e != getattr(seen.true, s.name)}

    def _remembered(
        self, way: SimpleNamespace, lags: dict[Signal, sp.Expr], step: Signal
    ) -> dict[Signal, sp.Expr]:
        """Let the inputs of a sampled plant arrive late; return the memories of their past values."""
        arriving = delays_of(self.model.timing(), self.model.block.inputs, self.model.coefficients())
        if not arriving:
            return {}
        names = [name for name in self.model.timing() if name]
        delay = sum(self.model.coefficients()[name.rpartition(".")[2]] for name in names)
        swap: dict[sp.Symbol, sp.Expr] = {}
        memory: dict[Signal, sp.Expr] = {}
        for s, past in late_inputs(self.model.block.inputs, delay, step.start).items():
            values = [s.symbol, *(m.symbol for m in past)]
            # d = (n + r) T, 0 <= r < 1:  u arrives as (1 - r) u(k-n) + r u(k-n-1)
            n = len(past) - 1
            r = arriving[s.name] / step.symbol - n
            swap[s.symbol] = values[n] + r * (values[n + 1] - values[n])
            memory |= dict(zip(past, values, strict=False))
        for name, e in way.thrusts.items():
            way.thrusts[name] = e.xreplace(swap)
        lags.update({state: e.xreplace(swap) for state, e in lags.items()})
        return memory


def _limited(s: Signal) -> sp.Expr:
    """Return an input between its bounds."""
    low, high = (sp.Float(b) if math.isfinite(b) else None for b in (s.lower, s.upper))
    return clipped(s.symbol, low, high)
