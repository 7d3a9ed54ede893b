r"""Candidates that are not proportional to their coefficient, at the estimate of the named change.

A candidate changes the derivatives by ``a(x, q)``, with its own states ``x' = f(x, q)`` and its coefficient
q. Before it is named, q has its trial value. Then q is the trial value times ``(theta + V)/(1 + V)``, the
mean of the estimate theta, of variance V, and of 1, of variance 1: a first estimate that says little does not
move q. A coefficient of either sign is neutral before it is named; then its q is the trial value times
``theta/(1 + V)``. The slope da/dq includes that of the states, S = dx/dq:

    S <- Phi_x S + Phi_q,    da/dq = a_x S + a_q,

with the derivatives of a Runge-Kutta step, Phi_x and Phi_q, and those of a, a_x and a_q. Where q moves by dq
from tick to tick, x moves by S dq.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import partial_derivatives
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.units import simplified
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.control.observers.propagation import Dynamics, runge_kutta, transition, written_at
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.memory import Memory

#: Limits of theta where the candidate is linearised: a fifth of the trial and five times the trial.
LEAST, MOST = 0.2, 5.0

#: Largest angle at which a candidate is linearised [rad]: the slope of a sine turns round a little above.
ANGLE = 1.0

#: A time constant is taken as this part of a tick at least: the Runge-Kutta step is unstable below 0.36.
SHORTEST = 0.5


@dataclass(frozen=True)
class Sized:
    """What a candidate adds to the error over a tick, linearised at the estimate: ``slope theta + left``.

    Attributes
    ----------
    slope, left : sympy.Matrix, shape (n, 1)
    """

    slope: sp.Matrix
    left: sp.Matrix


class AtTheEstimate:
    """Writes the candidates of a monitor at the estimate of the named change.

    Parameters
    ----------
    drive : mapping of int to sympy.Matrix, shape (n, 1)
        Change of the state over the tick per unit of a rate added to the derivative of each state.
    now, then : sequence of three sympy.Expr
        Number of the named candidate, from 1, its amplitude and the variance of that, before and after this
        tick.

    Attributes
    ----------
    states : list of Signal
    next_values : dict of str to sympy.Expr
    """

    def __init__(
        self,
        write: Equations,
        memory: Memory,
        drive: Mapping[int, sp.Matrix],
        period: float,
        now: Sequence[sp.Expr],
        then: Sequence[sp.Expr],
    ) -> None:
        self._write, self._memory, self._drive, self._period = write, memory, drive, period
        self._now, self._then = now, then
        self.states: list[Signal] = []
        self.next_values: dict[str, sp.Expr] = {}

    def write(self, c: Candidate, j: int, names: list[str]) -> Sized:
        """Write a candidate, the j-th from 0; `names` are those of the plant's states."""
        assert c.number is not None
        write, name = self._write, f"sized_{j}"
        own = [s.replace(name=f"{c.name}.sized.{s.name}") for s in c.memory]
        size = Signal(f"{name}_q", c.unit)
        swap = dict(zip((s.symbol for s in c.memory), (s.symbol for s in own), strict=True))
        swap[c.number] = size.symbol

        def here(e: sp.Expr) -> sp.Expr:
            return self._memory.at(c, e.xreplace(swap))

        laws = {s.name: here(law) for s, law in zip(own, c.memory.values(), strict=True)}
        rates = {key: here(e) for key, e in c.law.items()}
        block = Block("sized").unchecked(
            states=(*own, size),
            derivatives=Expressions(laws | {size.name: size.symbol if self._memory.period else sp.S.Zero}),
            outputs=tuple(Signal(key) for key in rates),
            output_expressions=Expressions(rates),
            period=self._memory.period,
        )
        q, q_next = (
            self._coefficient(f"{name}_{k}", c, j, *at) for k, at in enumerate((self._now, self._then))
        )
        x, slope = self._stepped(c, name, block, own, q, q_next)
        entries = partial_derivatives(block, "outputs", [s.name for s in block.states])
        swap = written_at(block, write, f"{name}_at", [*x, q], time, [*rates.values(), *entries.values()])
        change, by_theta = sp.zeros(len(names), 1), sp.zeros(len(names), 1)
        for i, (key, e) in enumerate(rates.items()):
            a = write.define(f"{name}_a[{i}]", e.xreplace(swap))
            turned = sum(
                (entries[i, k].xreplace(swap) * slope[k] for k in range(len(slope)) if (i, k) in entries),
                sp.S.Zero,
            )
            da = write.define(f"{name}_slope[{i}]", c.number * turned)
            drive = self._drive[names.index(key)]
            change, by_theta = change + drive * a, by_theta + drive * da
        theta = q / c.number
        by_theta = write.matrix(f"{name}_by_theta", by_theta)
        return Sized(by_theta, write.matrix(f"{name}_left", change - by_theta * theta))

    def _coefficient(
        self, name: str, c: Candidate, j: int, named: sp.Expr, theta: sp.Expr, V: sp.Expr
    ) -> sp.Expr:
        """Write q: from the estimate, within limits, if the candidate is named, else as before that."""
        assert c.number is not None
        if c.signed:
            most = min(MOST, ANGLE / abs(c.scale)) if c.unit == "rad" else MOST
            size, other = c.number * sp.Max(-most, sp.Min(theta / (1 + V), most)), sp.S.Zero
        else:
            size, other = self._of_one_sign(c, theta, V), c.number
        here = sp.Abs(named - (j + 1)) < sp.S.Half
        return self._write.define(name, sp.Piecewise((size, here), (other, True)))

    def _of_one_sign(self, c: Candidate, theta: sp.Expr, V: sp.Expr) -> sp.Expr:
        """Return q of a coefficient that has no slope at its neutral value."""
        assert c.number is not None
        least = max(LEAST, min(1.0, SHORTEST * self._period / abs(c.scale))) if c.memory else LEAST
        return c.number * sp.Max(least, sp.Min((theta + V) / (1 + V), MOST))

    def _stepped(
        self, c: Candidate, name: str, block: Block, own: list[Signal], q: sp.Expr, q_next: sp.Expr
    ) -> tuple[list[sp.Expr], list[sp.Expr]]:
        """Write the candidate's own states a tick later; return their means over the tick, and d(x, q)/dq."""
        if not own:
            return [], [sp.S.One]
        write, n = self._write, len(own)
        S = [
            s.replace(
                name=f"{s.name}_slope",
                unit=simplified(f"({s.unit})/({c.unit})"),
                description=f"slope of {s.name}",
            )
            for s in own
        ]
        x, before = sp.Matrix([s.symbol for s in own]), sp.Matrix([s.symbol for s in S])
        h = sp.Symbol("period", real=True)
        step = runge_kutta(Dynamics(block), write, name, sp.Matrix([*x, q]), time, h)
        Phi = transition(write, name, step.F, h)
        after = write.matrix(f"{name}_S", Phi[:n, :n] * before + Phi[:n, n])
        for i in range(n):
            self.next_values[own[i].name] = step.x[i] + after[i] * (q_next - q)
            self.next_values[S[i].name] = after[i]
        self.states += [*own, *S]
        if block.period:
            return list(x), [*before, sp.S.One]
        return list((x + step.x[:n, :]) / 2), [*((before + after) / 2), sp.S.One]
