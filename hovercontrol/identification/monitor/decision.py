"""The decision of a monitor: alarm, name, coefficient and rivals, as equations of its Block.

The alarm is raised when the largest g of all candidates and windows exceeds the threshold, and stays until a
reset. Up to the alarm g is that of limited innovations, from then on that of whole ones, by which the change
is named and sized. The name is the candidate with the largest g. A rival cannot be told apart yet if one of
two holds.

- Noise: its largest g is within ``2 ln(1/error)`` of that of the best, so that its likelihood is at least
  `error` times as large. If the rival is right, the likelihood ratio of the best to it exceeds ``1/error``
  with a probability of `error` at most (Wald; with several rivals Nikiforov, IEEE Trans. Information Theory
  41, 1995, and Lai, IEEE Trans. Information Theory 46, 2000).
- Linearisation: its g is at least ``1 - curvature^2`` of that of the best. The test of a candidate is linear
  in its change. If what the change does differs from that by a part `curvature` of its size, at right angles,
  the right candidate explains only ``1 - curvature^2`` of the evidence; a rival may explain more. For a small
  change this part is less than the noise, for a large one the first rule would exclude the right name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.refined import Refined, refine, within
from hovercontrol.identification.monitor.sized import Sized

#: Likelihood ratio below which a rival is excluded: the probability that a right name is.
ERROR = 0.01

#: Error of the linear response to a change, as a part of it. Measured: see `benchmarks/monitor.py`.
CURVATURE = 0.45


@dataclass(frozen=True)
class Decision:
    """Outputs of a monitor and their expressions.

    Attributes
    ----------
    outputs : tuple of Signal
    values : dict of str to sympy.Expr
    alarm : sympy.Expr
        1 if a test has raised an alarm, at this tick or before.
    refined : Refined
        Estimate of the named change.
    """

    outputs: tuple[Signal, ...]
    values: dict[str, sp.Expr]
    alarm: sp.Expr
    refined: Refined


def likelihood(b: sp.Expr, information: sp.Expr, lower: sp.Expr, upper: sp.Expr) -> sp.Expr:
    """Return g, the largest ``2 b theta - I theta^2`` with theta between bounds."""
    if lower.is_infinite and upper.is_infinite:
        return b**2 / information
    if lower == 0 and upper.is_infinite:
        return sp.Max(0, b) ** 2 / information
    theta = within(b / information, lower, upper)
    return theta * (2 * b - information * theta)


def least_evidence(best: sp.Expr) -> sp.Expr:
    """Return the evidence below which a rival of a candidate with the evidence `best` is excluded."""
    return sp.Min(best - sp.Float(2 * math.log(1 / ERROR)), sp.Float(1 - CURVATURE**2) * best)


def decide(
    write: Equations,
    candidates: Sequence[Candidate],
    bank: Bank,
    plant: Sequence[Signal],
    after: sp.Matrix,
    floors: Sequence[Signal],
    limits: Sequence[tuple[sp.Expr, sp.Expr]],
    threshold: sp.Expr,
    latched: sp.Expr,
    settled: sp.Expr,
    dead: Sequence[sp.Expr],
    channels: Sequence[Signal],
    period: sp.Expr,
    sized: Mapping[int, Sized],
) -> Decision:
    """Write the decision.

    Parameters
    ----------
    plant, after : sequence of Signal, and sympy.Matrix of shape (n, n)
        States of the filter, and the covariance of its prediction at the next tick.
    floors : sequence of Signal
        J0 of each candidate.
    limits : sequence of (sympy.Expr, sympy.Expr)
        Bounds of each candidate's theta.
    latched : sympy.Expr
        1 if an alarm was raised before.
    settled : sympy.Expr
        1 once the tests have begun.
    dead : sequence of sympy.Expr
        1 for each dead sensor, of `channels`.
    sized : mapping of int to Sized
        Candidates that are not proportional to their coefficient, by number from 0.
    """
    tests = [
        [likelihood(b, info + floor.symbol, *limit) for b, info in zip(row, infos, strict=True)]
        for row, infos, floor, limit in zip(bank.limited_score, bank.information, floors, limits, strict=True)
    ]
    limited = [
        [write.define(f"limited_g[{w},{j}]", g) for w, g in enumerate(row)] for j, row in enumerate(tests)
    ]
    exceeds = sp.Max(*(g for row in limited for g in row)) > threshold
    alarm = write.define(
        "test_alarm", sp.Piecewise((1, sp.And(exceeds, settled > sp.S.Half)), (latched, True))
    )
    write.define("raised", sp.Piecewise((0, latched > sp.S.Half), (alarm, True)))
    told = alarm > sp.S.Half
    scores = _scores(write, bank, floors, limits, limited, told)
    largest = [
        write.define(f"evidence_{c.name}", sp.Max(*row)) for c, row in zip(candidates, scores, strict=True)
    ]
    best = write.define("evidence", sp.Max(*largest))
    every = [(j, w) for j, row in enumerate(scores) for w in range(len(row))]

    def of_best(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        pairs = [(v, scores[j][w] >= best) for v, (j, w) in zip(values[:-1], every[:-1], strict=True)]
        return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    which = of_best("best", [sp.Integer(j + 1) for j, _ in every])
    b = of_best("best_b", [bank.score[j][w] for j, w in every])
    info = sp.Max(of_best("best_J", [bank.information[j][w] for j, w in every]), 1e-300)
    of_best("best_window", [sp.Integer(w) for _, w in every])
    age = of_best("best_age", [bank.age[w] for _, w in every])
    energy = of_best("best_energy", [bank.energy[w] for _, w in every])
    dof = len(channels) * age
    refined = refine(
        write, bank, plant, which, alarm, b / info, best, after, info, energy, dof, limits, sized
    )
    size = write.define("scale", _scale(candidates, which))
    outputs = _alarm_outputs(write, candidates, channels, dead, alarm, which)
    outputs |= {
        Signal("evidence", "1", "largest g; alarm above the threshold"): best,
        Signal("change", "1", "change of the named candidate's coefficient, in its SI unit"): (
            refined.theta * size
        ),
        Signal("change_std", "1", "standard deviation of the change"): (
            sp.sqrt(sp.Max(0, refined.variance)) * sp.Abs(size)
        ),
        Signal("since", "s", "time since the estimated onset"): sp.Piecewise((age * period, told), (0, True)),
    }
    least = write.define("least", least_evidence(best))
    for c, g in zip(candidates, largest, strict=True):
        outputs[Signal(f"evidence_{c.name}", "1", f"largest g of {c.name}")] = g
    for c, g in zip(candidates, largest, strict=True):
        possible = Signal(f"possible_{c.name}", "1", f"1 if an alarm may be due to {c.name}")
        outputs[possible] = sp.Piecewise((1, sp.And(told, g >= least)), (0, True))
    for s, d in zip(channels, dead, strict=True):
        outputs[Signal(f"dead_{s.name}", "1", f"1 while no new sample of {s.name} comes")] = d
    return Decision(tuple(outputs), {s.name: e for s, e in outputs.items()}, alarm, refined)


def _scores(
    write: Equations,
    bank: Bank,
    floors: Sequence[Signal],
    limits: Sequence[tuple[sp.Expr, sp.Expr]],
    limited: Sequence[Sequence[sp.Expr]],
    told: sp.Expr,
) -> list[list[sp.Expr]]:
    """Write g by candidate and window: of limited innovations until an alarm, of all from then on."""
    scores = []
    for j, (floor, limit) in enumerate(zip(floors, limits, strict=True)):
        infos = bank.information[j]
        whole = [
            likelihood(b, info + floor.symbol, *limit) for b, info in zip(bank.score[j], infos, strict=True)
        ]
        pairs = enumerate(zip(whole, limited[j], strict=True))
        scores.append(
            [write.define(f"g[{w},{j}]", sp.Piecewise((all_, told), (few, True))) for w, (all_, few) in pairs]
        )
    return scores


def _scale(candidates: Sequence[Candidate], which: sp.Expr) -> sp.Expr:
    """Return the scale of the named candidate."""
    pairs = [(sp.Float(c.scale), which < j + 1.5) for j, c in enumerate(candidates[:-1])]
    return sp.Piecewise(*pairs, (sp.Float(candidates[-1].scale), True), evaluate=False)


def _alarm_outputs(
    write: Equations,
    candidates: Sequence[Candidate],
    channels: Sequence[Signal],
    dead: Sequence[sp.Expr],
    alarm: sp.Expr,
    which: sp.Expr,
) -> dict[Signal, sp.Expr]:
    """Return the alarm and the number of what it names: a candidate, or a dead sensor behind them."""
    anything = write.define("any_dead", sp.Max(*dead))
    names = [*(c.name for c in candidates), *(s.name for s in channels)]
    listed = ", ".join(f"{k} {n}" for k, n in enumerate(names, 1))
    first = len(candidates) + 1
    sensors = [(sp.Integer(first + k), d > sp.S.Half) for k, d in enumerate(dead)]
    return {
        Signal("alarm", "1", "1 from an alarm on until a reset, and while a sensor is dead"): (
            sp.Max(alarm, anything)
        ),
        Signal("effect", "1", f"0 none; {listed}; from {first} on: dead sensors"): (
            sp.Piecewise(*sensors, (which, alarm > sp.S.Half), (sp.S.Zero, True), evaluate=False)
        ),
    }
