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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.refined import DECIDES, Refined, Start, refine, within
from hovercontrol.identification.monitor.sized import Sized

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
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
        Without resets.
    """

    outputs: tuple[Signal, ...]
    values: dict[str, sp.Expr]
    alarm: sp.Expr
    refined: Refined
    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]


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
    return sp.Min(best - sp.Float(DECIDES), sp.Float(1 - CURVATURE**2) * best)


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
    equations: Sequence[str],
    accelerations: Sequence[sp.Matrix],
    moves: sp.Matrix,
    turns: Sequence[sp.Matrix],
    segment: int,
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
    equations : sequence of str
        States in whose equations an arbitrary acceleration is looked for.
    accelerations, moves, turns, segment
        As for :func:`~hovercontrol.identification.monitor.refined.refine`.
    """
    tests = [
        [likelihood(b, info + floor.symbol, *limit) for b, info in zip(row, infos, strict=True)]
        for row, infos, floor, limit in zip(bank.limited_score, bank.information, floors, limits, strict=True)
    ]
    limited = [
        [write.define(f"limited_g[{w},{j}]", g) for w, g in enumerate(row)] for j, row in enumerate(tests)
    ]
    exceeds = sp.Max(*(g for row in limited for g in row), evaluate=False) > threshold
    alarm = write.define(
        "test_alarm", sp.Piecewise((1, sp.And(exceeds, settled > sp.S.Half)), (latched, True))
    )
    write.define("raised", sp.Piecewise((0, latched > sp.S.Half), (alarm, True)))
    told = alarm > sp.S.Half
    J = len(candidates)
    unknown = Signal("unknown", "1", "number of the equation with an unknown acceleration; 0: none")
    refuted = [Signal(f"refuted[{j}]", "1", f"1 if {c.name} is refuted") for j, c in enumerate(candidates)]
    every = []  # (g, candidate, window), of a candidate that is not refuted
    largest, in_play = [], []
    for j, c in enumerate(candidates):
        mine = []
        for w, (b, info) in enumerate(zip(bank.score[j], bank.information[j], strict=True)):
            whole = likelihood(b, info + floors[j].symbol, *limits[j])
            mine.append(write.define(f"g[{w},{j}]", chosen(told, whole, limited[j][w])))
        largest.append(write.define(f"evidence_{c.name}", sp.Max(*mine, evaluate=False)))
        out = sp.And(refuted[j].symbol > sp.S.Half, unknown.symbol < sp.S.Half)
        in_play.append(write.define(f"in_play[{j}]", chosen(out, -sp.S.One, largest[-1])))
        every += [(g, j, w) for w, g in enumerate(mine)]
    best = write.define("evidence", sp.Max(*largest, evaluate=False))
    likeliest = write.define("best_in_play", sp.Max(*in_play, evaluate=False))
    tops = [sp.And(g >= in_play[j], in_play[j] >= likeliest) for g, j, _ in every]

    def of_best(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        pairs = list(zip(values[:-1], tops[:-1], strict=True))
        return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    at = [(j, w) for _, j, w in every]
    named = of_best("best", [sp.Integer(j + 1) for j, _ in at])
    lost = unknown.symbol > sp.S.Half
    which = write.define("which", chosen(lost, J + unknown.symbol, named))
    b = of_best("best_b", [bank.score[j][w] for j, w in at])
    info = of_best("best_J", [bank.information[j][w] for j, w in at])
    of_best("best_window", [sp.Integer(w) for _, w in at])
    age = of_best("best_age", [bank.age[w] for _, w in at])
    energy = of_best("best_energy", [bank.energy[w] for _, w in at])
    outputs, values = [], {}

    def output(signal: Signal, value: sp.Expr) -> None:
        outputs.append(signal)
        values[signal.name] = value

    names = [c.name for c in candidates]
    anything = write.define("any_dead", sp.Max(*dead))
    listed = [f"{k + 1} {n}" for k, n in enumerate(names)]
    listed += [f"{len(names) + k + 1} {s.name}" for k, s in enumerate(channels)]
    output(
        Signal("alarm", "1", "1 from an alarm on until a reset, and while a sensor is dead"),
        sp.Max(alarm, anything),
    )
    sensors = [(sp.Integer(J + k + 1), d > sp.S.Half) for k, d in enumerate(dead)]
    number = chosen(lost, J + len(channels) + unknown.symbol, which)
    output(
        Signal("effect", "1", f"0 none; {', '.join(listed)}; {J + 1} to {J + len(channels)}: dead sensors"),
        sp.Piecewise(*sensors, (number, told), (sp.S.Zero, True), evaluate=False),
    )
    output(Signal("evidence", "1", "largest g; alarm above the threshold"), best)
    info = sp.Max(info, 1e-300)
    start = Start(b / info, best, info, energy, len(channels) * age)
    refined = refine(
        write, bank, plant, which, alarm, start, after, limits, sized, accelerations, moves, turns, segment
    )
    scales = [sp.Float(c.scale) for c in candidates]
    pairs = [(scale, which < j + 1.5) for j, scale in enumerate(scales)]
    size = write.define("scale", sp.Piecewise(*pairs, (sp.S.One, True), evaluate=False))
    text = "change of the named candidate's coefficient, or unknown acceleration, in its SI unit"
    output(Signal("change", "1", text), refined.theta * size)
    output(
        Signal("change_std", "1", "standard deviation of the change"),
        sp.sqrt(sp.Max(0, refined.variance)) * sp.Abs(size),
    )
    output(Signal("rate", "1/s", "of the change, with its rate_std"), refined.rate * size / period)
    output(
        Signal("rate_std", "1/s", "standard deviation of the rate"),
        sp.sqrt(sp.Max(0, refined.rate_variance)) * sp.Abs(size) / period,
    )
    output(Signal("ended", "1", "1 if the named change has ended"), chosen(told, refined.ended, sp.S.Zero))
    output(Signal("since", "s", "time since the estimated onset"), chosen(told, age * period, 0 * period))
    output(
        Signal("held", "s", "time for which the amplitude has held"),
        chosen(told, refined.age * period, 0 * period),
    )
    least = write.define("least", least_evidence(best))
    for c, g in zip(candidates, largest, strict=True):
        output(Signal(f"evidence_{c.name}", "1", f"largest g of {c.name}"), g)
    open_ = [sp.And(told, sp.Not(lost), g >= least) for g in in_play]
    for c, possible in zip(candidates, open_, strict=True):
        output(
            Signal(f"possible_{c.name}", "1", f"1 if an alarm may be due to {c.name}"),
            chosen(possible, sp.S.One, sp.S.Zero),
        )
    for s, d in zip(channels, dead, strict=True):
        output(Signal(f"dead_{s.name}", "1", f"1 while no new sample of {s.name} comes"), d)
    for e, name in enumerate(equations):
        found = sp.And(told, sp.Abs(unknown.symbol - (e + 1)) < sp.S.Half)
        text = f"1 if no candidate explains the change: an unknown acceleration in {name}'"
        output(Signal(f"unknown_{name}", "1", text), chosen(found, sp.S.One, sp.S.Zero))
    # a name that is refuted leaves the next likely one, or none
    refutes = refined.probes.refuted > sp.S.Half
    following = {}
    others = []
    for j, (s, g) in enumerate(zip(refuted, in_play, strict=True)):
        mine = sp.And(refutes, sp.Abs(which - (j + 1)) < sp.S.Half)
        following[s.name] = chosen(mine, sp.S.One, s.symbol)
        others.append(sp.And(g >= least, sp.Not(mine)))
    gone = sp.And(refutes, sp.Not(sp.Or(*others)))
    following[unknown.name] = chosen(gone, refined.probes.equation, unknown.symbol)
    return Decision(tuple(outputs), values, alarm, refined, (unknown, *refuted), following)
