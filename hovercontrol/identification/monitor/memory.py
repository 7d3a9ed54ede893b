"""What a monitor's candidates remember from tick to tick: states of their own, and late commands.

A candidate's changes of the derivatives are those at the motion after this tick's measurements, held during
the tick. Its errors of the measured values are those at the prediction, as the filter's innovations are.
"""

from __future__ import annotations

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.control.observers.propagation import Dynamics, runge_kutta
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.design import Design


class Memory:
    """What candidates remember; it gives their expressions at the estimate.

    Parameters
    ----------
    x, before : sympy.Matrix, shape (n, 1)
        The motion after this tick's measurements, and its prediction before them.

    Attributes
    ----------
    states : list of Signal
    next_values : dict of str to sympy.Expr
    period : float
        Of a sampled plant [s], else 0.
    """

    def __init__(self, design: Design, write: Equations, x: sp.Matrix, before: sp.Matrix) -> None:
        self._write, self._design, self.period = write, design, design.model.plant.period
        self._here, self._predicted = self._at(x), self._at(before)
        self.states: list[Signal] = []
        self.next_values: dict[str, sp.Expr] = {}
        self._own: dict[str, dict[sp.Expr, sp.Expr]] = {}
        self._lines: dict[str, list[sp.Expr]] = {}
        for c in design.every:
            self._own[c.name] = self._late(c) | self._remembered(c)

    def _at(self, x: sp.Matrix) -> dict[sp.Expr, sp.Expr]:
        """Return the values of the states' symbols.

        Uncertain coefficients are states of the filter, and parameters in a candidate's expressions.
        """
        states, name = self._design.model.plant.states, self._design.model.name
        found: dict[sp.Expr, sp.Expr] = {s.symbol: e for s, e in zip(states, x, strict=True)}
        return found | {sp.Symbol(f"{name}.{s.name}", real=True): e for s, e in zip(states, x, strict=True)}

    def rate(self, c: Candidate, state: str) -> sp.Expr:
        """Return a of a candidate in the derivative of a state."""
        return self.at(c, c.rates[state])

    def at(self, c: Candidate, e: sp.Expr) -> sp.Expr:
        """Return an expression of a candidate at the estimate."""
        return sp.sympify(e).xreplace(self._own[c.name]).xreplace(self._here)

    def seen(self, c: Candidate, channel: str) -> sp.Expr:
        """Return b of a candidate in a measured channel, at the prediction."""
        own = {s.symbol: sp.Symbol(f"{c.name}.{s.name}", real=True) for s in c.memory}
        value = sp.sympify(c.seen.get(channel, sp.S.Zero)).xreplace(own)
        return value.xreplace(self._own[c.name]).xreplace(self._predicted)

    def _late(self, c: Candidate) -> dict[sp.Expr, sp.Expr]:
        """Write the late commands: their mean over the tick, of commands that hold from tick to tick."""
        if not c.delay:
            return {}
        ticks = c.delay / self._design.period
        whole = int(ticks + 1e-9)
        part = max(ticks - whole, 0.0)
        found: dict[sp.Expr, sp.Expr] = {}
        for s in self._design.model.plant.inputs:
            late = [s.symbol, *self._line(s, whole + 1)]
            value = (1 - part) * late[whole] + part * late[whole + 1] if part > 1e-6 else late[whole]
            found[sp.Symbol(f"{s.name}_late", real=True)] = value
        return found

    def _line(self, s: Signal, count: int) -> list[sp.Expr]:
        """Return a command of the ticks before, the latest first."""
        line = self._lines.setdefault(s.name, [])
        while len(line) < count:
            k = len(line) + 1
            before = s.replace(
                name=f"{s.name}_before[{k}]",
                description=f"{s.name}, {k} ticks ago",
                lower=-sp.oo,
                upper=sp.oo,
            )
            self.states.append(before)
            self.next_values[before.name] = line[-1] if line else s.symbol
            line.append(before.symbol)
        return line

    def _remembered(self, c: Candidate) -> dict[sp.Expr, sp.Expr]:
        """Write the candidate's own states a tick later; return their means over the tick.

        A sampled plant sees their values at the tick.
        """
        if not c.memory:
            return {}
        own = {s.symbol: s.replace(name=f"{c.name}.{s.name}", lower=-sp.oo, upper=sp.oo) for s in c.memory}
        rename = {old: new.symbol for old, new in own.items()}
        # the commands and the estimate hold during the tick
        laws = {
            new.name: c.memory[old].xreplace(rename).xreplace(self._here)
            for old, new in zip(c.memory, own.values(), strict=True)
        }
        block = Block("memory").unchecked(
            states=tuple(own.values()), derivatives=Expressions(laws), period=self.period
        )
        x = sp.Matrix([s.symbol for s in own.values()])
        h = sp.Symbol("period", real=True)
        new = runge_kutta(Dynamics(block), self._write, f"memory_{c.name}", x, time, h, jacobian=False).x
        for s, value in zip(own.values(), new, strict=True):
            self.states.append(s)
            self.next_values[s.name] = value
        if self.period:
            return {old: s.symbol for old, s in own.items()}
        return {old: (s.symbol + value) / 2 for (old, s), value in zip(own.items(), new, strict=True)}
