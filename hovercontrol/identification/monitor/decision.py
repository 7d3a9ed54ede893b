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

Unknown changes, constant accelerations and offsets of sensors, stand beside the candidates with the same
windows and degree of freedom. Between them and a candidate only the first rule holds: the motion's response
to an acceleration is linear but for the plant itself. One is named where no candidate is possible, if no two
candidates explain the samples (:mod:`.pairs`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.after_alarm import AfterAlarm, after_alarm, lasting, likelihood
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.candidates import Candidate
from hovercontrol.identification.monitor.pairs import Paired, pair
from hovercontrol.identification.monitor.refined import DECIDES, DOUBTED, Refined, Start, refine
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
    paired : Paired
        Two changes at once.
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
        Without resets.
    """

    outputs: tuple[Signal, ...]
    values: dict[str, sp.Expr]
    alarm: sp.Expr
    refined: Refined
    paired: Paired
    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]


def least_evidence(best: sp.Expr) -> sp.Expr:
    """Return the evidence below which a rival of a candidate with the evidence `best` is excluded."""
    return sp.Min(best - sp.Float(DECIDES), sp.Float(1 - CURVATURE**2) * best)


def decide(
    write: Equations,
    candidates: Sequence[Candidate],
    unknowns: Sequence[Candidate],
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
    moves: sp.Matrix,
    turns: Sequence[sp.Matrix],
    segment: int,
) -> Decision:
    """Write the decision.

    Parameters
    ----------
    unknowns : sequence of Candidate
        Unknown changes: numbers after those of the candidates.
    plant, after : sequence of Signal, and sympy.Matrix of shape (n, n)
        States of the filter, and the covariance of its prediction at the next tick.
    floors : sequence of Signal
        J0 of each candidate and unknown change.
    limits : sequence of (sympy.Expr, sympy.Expr)
        Bounds of the theta of each.
    latched : sympy.Expr
        1 if an alarm was raised before.
    settled : sympy.Expr
        1 once the tests have begun.
    dead : sequence of sympy.Expr
        1 for each dead sensor, of `channels`.
    sized : mapping of int to Sized
        Candidates that are not proportional to their coefficient, by number from 0.
    moves, turns, segment
        As for :func:`~hovercontrol.identification.monitor.refined.refine`.
    """
    limited = _limited_evidence(write, bank, floors, limits)
    exceeds = sp.Max(*(g for row in limited for g in row), evaluate=False) > threshold
    alarm = write.define(
        "test_alarm", sp.Piecewise((1, sp.And(exceeds, settled > sp.S.Half)), (latched, True))
    )
    write.define("raised", sp.Piecewise((0, latched > sp.S.Half), (alarm, True)))
    told = alarm > sp.S.Half
    refuted = [Signal(f"refuted[{j}]", "1", f"1 if {c.name} is refuted") for j, c in enumerate(candidates)]
    scores = _scores(write, bank, floors, limits, limited, told)
    largest = [
        write.define(f"evidence_{c.name}", sp.Max(*row, evaluate=False))
        for c, row in zip([*candidates, *unknowns], scores, strict=True)
    ]
    J = len(candidates)
    forces = {j: floors[j].symbol for j, c in enumerate(unknowns, J) if c.rates}
    several = Signal("several", "1", "1 if two changes are likely")
    since = after_alarm(write, candidates, len(forces), bank, limits, several.symbol)
    best, most, possible, lost, in_play = _in_play(write, refuted, since, largest, J)
    likeliest = write.define("best_in_play", sp.Max(*in_play, evaluate=False))
    which, age, start = _start(write, bank, scores, in_play, likeliest, most)
    refined = refine(
        write, bank, plant, which, alarm, start, after, limits, sized, moves, turns, segment, J,
        lasting(candidates), forces,
    )  # fmt: skip
    paired = pair(
        write, bank, plant, latched, likeliest * refined.phi * after, refined.phi, refined.likelihoods, J,
        list(forces), DECIDES,
    )  # fmt: skip
    rivals = _unknown_rivals(candidates, unknowns, largest[J:], most, possible, refined.doubts)
    two, possible = _both(write, paired, told, lost, possible)
    said = chosen(two > sp.S.Half, paired.numbers[0], which)
    number = chosen(sp.And(lost, two < sp.S.Half), which + len(channels), said)
    outputs = _alarm_outputs(write, candidates, channels, dead, alarm, number)
    outputs[Signal("evidence", "1", "largest g; alarm above the threshold")] = best
    outputs |= _size_outputs(write, candidates, refined, said, told, age, period, two, paired, bank.age[0])
    outputs |= _outputs_of_each(candidates, largest, possible, told)
    for s, d in zip(channels, dead, strict=True):
        outputs[Signal(f"dead_{s.name}", "1", f"1 while no new sample of {s.name} comes")] = d
    outputs |= _unknown_outputs(unknowns, J, which, sp.And(told, two < sp.S.Half), rivals)
    refutes = refined.refuted > sp.S.Half
    following = {
        s.name: chosen(sp.And(refutes, sp.Abs(which - (j + 1)) < sp.S.Half), sp.S.One, s.symbol)
        for j, s in enumerate(refuted)
    }
    following[several.name] = paired.likely
    values = {s.name: e for s, e in outputs.items()}
    return Decision(tuple(outputs), values, alarm, refined, paired, (*refuted, several), following)


def _start(
    write: Equations,
    bank: Bank,
    scores: Sequence[Sequence[sp.Expr]],
    in_play: Sequence[sp.Expr],
    likeliest: sp.Expr,
    most: sp.Expr,
) -> tuple[sp.Expr, sp.Expr, Start]:
    """Write the number of the likeliest change, from 1, its age, and the start of its estimate."""
    at = [(j, w) for j, row in enumerate(scores) for w in range(len(row))]
    tops = [sp.And(scores[j][w] >= in_play[j], in_play[j] >= likeliest) for j, w in at]

    def of_best(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        pairs = list(zip(values[:-1], tops[:-1], strict=True))
        return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    which = of_best("which", [sp.Integer(j + 1) for j, _ in at])
    b = of_best("best_b", [bank.score[j][w] for j, w in at])
    info = sp.Max(of_best("best_J", [bank.information[j][w] for j, w in at]), 1e-300)
    of_best("best_window", [sp.Integer(w) for _, w in at])
    age = of_best("best_age", [bank.age[w] for _, w in at])
    energy = of_best("best_energy", [bank.energy[w] for _, w in at])
    return which, age, Start(b / info, most, likeliest, info, energy, len(bank.whitened) * age)


def _limited_evidence(
    write: Equations,
    bank: Bank,
    floors: Sequence[Signal],
    limits: Sequence[tuple[sp.Expr, sp.Expr]],
) -> list[list[sp.Expr]]:
    """Write g of limited innovations, by candidate and window."""
    each = zip(bank.limited_score, bank.information, floors, limits, strict=False)
    return [
        [
            write.define(f"limited_g[{w},{j}]", likelihood(b, info + floor.symbol, *limit))
            for w, (b, info) in enumerate(zip(row, infos, strict=True))
        ]
        for j, (row, infos, floor, limit) in enumerate(each)
    ]


def _in_play(
    write: Equations,
    refuted: Sequence[Signal],
    after: AfterAlarm,
    largest: Sequence[sp.Expr],
    J: int,
) -> tuple[sp.Expr, sp.Expr, list[sp.Expr], sp.Expr, list[sp.Expr]]:
    """Write which of the J candidates are possible, and what may be named: unknown changes only if none is.

    Return the largest evidence of a candidate and that of all, whether each candidate is possible, whether
    none is, and the evidence of each that may be named, else -1.
    """
    best = write.define("evidence", sp.Max(*largest[:J], evaluate=False))
    rest = [sp.false] * (len(largest) - len(after.outdone))
    left = [
        g if out == sp.false else write.define(f"left_evidence[{j}]", chosen(out, -sp.S.One, g))
        for j, (out, g) in enumerate(zip([*after.outdone, *rest], largest, strict=True))
    ]
    likely = write.define("best_left", sp.Max(*left[:J], evaluate=False))
    most = write.define("most_evidence", sp.Max(likely, *left[J:], evaluate=False))
    least = write.define("least", sp.Max(0, least_evidence(likely)))
    beside = write.define("least_beside_unknown", most - sp.Float(DECIDES))
    possible = [
        sp.And(sp.Or(s.symbol < sp.S.Half, safe), g >= least, sp.Or(g >= beside, near))
        for s, g, near, safe in zip(refuted, left, after.near, after.safe, strict=False)
    ]
    lost = write.define("any_possible", chosen(sp.Or(*possible), sp.S.One, sp.S.Zero)) < sp.S.Half
    may = [*possible, *[lost] * (len(largest) - J)]
    in_play = [
        write.define(f"in_play[{j}]", chosen(p, g, -sp.S.One))
        for j, (p, g) in enumerate(zip(may, largest, strict=True))
    ]
    return best, most, possible, lost, in_play


def _unknown_rivals(
    candidates: Sequence[Candidate],
    unknowns: Sequence[Candidate],
    evidence: Sequence[sp.Expr],
    most: sp.Expr,
    possible: Sequence[sp.Expr],
    doubts: Sequence[sp.Expr],
) -> list[sp.Expr]:
    """Return whether an alarm may be due to each unknown change; not to one like a possible candidate."""
    found = []
    for p, (u, g) in enumerate(zip(unknowns, evidence, strict=True)):
        twins = [e for c, e in zip(candidates, possible, strict=True) if c.like(u)]
        doubt = doubts[p] if p < len(doubts) else sp.false
        found.append(sp.And(sp.Or(g >= most - sp.Float(DOUBTED), doubt), sp.Not(sp.Or(*twins))))
    return found


def _both(
    write: Equations, paired: Paired, told: sp.Expr, lost: sp.Expr, possible: Sequence[sp.Expr]
) -> tuple[sp.Expr, list[sp.Expr]]:
    """Write whether two changes are told; return it, and whether each candidate is possible.

    They are told where no candidate alone is possible, or accelerations explain more than what was named. In
    the latter case they are possible, too, if another pair explains as much.
    """
    half = sp.S.Half
    sought = sp.Or(lost, paired.sought > half)
    two = write.define("two_changes", chosen(sp.And(told, sought, paired.only > half), sp.S.One, sp.S.Zero))
    doubt = sp.And(told, sp.Not(lost), paired.sought > half, paired.likely > half)
    shown = write.define("pair_shown", chosen(doubt, sp.S.One, two))
    mine = [[sp.Abs(shown * k - (j + 1)) < half for k in paired.numbers] for j in range(len(possible))]
    return two, [sp.Or(sp.And(p, two < half), *own) for p, own in zip(possible, mine, strict=True)]


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
        sums = zip(bank.score[j], bank.information[j], strict=True)
        whole = [likelihood(b, info + floor.symbol, *limit) for b, info in sums]
        few = limited[j] if j < len(limited) else whole
        pairs = enumerate(zip(whole, few, strict=True))
        scores.append(
            [write.define(f"g[{w},{j}]", a if a == f else chosen(told, a, f)) for w, (a, f) in pairs]
        )
    return scores


def _alarm_outputs(
    write: Equations,
    candidates: Sequence[Candidate],
    channels: Sequence[Signal],
    dead: Sequence[sp.Expr],
    alarm: sp.Expr,
    number: sp.Expr,
) -> dict[Signal, sp.Expr]:
    """Return the alarm and the number of what it names; dead sensors come behind the candidates."""
    anything = write.define("any_dead", sp.Max(*dead))
    names = [*(c.name for c in candidates), *(s.name for s in channels)]
    listed = ", ".join(f"{k} {n}" for k, n in enumerate(names, 1))
    first = len(candidates) + 1
    sensors = [(sp.Integer(first + k), d > sp.S.Half) for k, d in enumerate(dead)]
    return {
        Signal("alarm", "1", "1 from an alarm on until a reset, and while a sensor is dead"): (
            sp.Max(alarm, anything)
        ),
        Signal("effect", "1", f"0 none; {listed}; {first} to {len(names)}: dead; above: unknown"): (
            sp.Piecewise(*sensors, (number, alarm > sp.S.Half), (sp.S.Zero, True), evaluate=False)
        ),
    }


def _size_outputs(
    write: Equations,
    candidates: Sequence[Candidate],
    refined: Refined,
    which: sp.Expr,
    told: sp.Expr,
    age: sp.Expr,
    period: sp.Expr,
    two: sp.Expr,
    paired: Paired,
    since_alarm: sp.Expr,
) -> dict[Signal, sp.Expr]:
    """Return the size of the named change, or of both, its rate, and for how long."""

    def scale(name: str, number: sp.Expr) -> sp.Expr:
        pairs = [(sp.Float(c.scale), number < j + 1.5) for j, c in enumerate(candidates)]
        return write.define(name, sp.Piecewise(*pairs, (sp.S.One, True), evaluate=False))

    size, other = scale("scale", which), scale("second_scale", paired.numbers[1])
    both = two > sp.S.Half
    theta, variance, held = (
        chosen(both, a, b)
        for a, b in (
            (paired.theta[0], refined.theta),
            (paired.variance[0], refined.variance),
            (since_alarm, refined.age),
        )
    )
    text = "change of the named candidate's coefficient, or unknown acceleration, in its SI unit"

    def std(variance: sp.Expr, size: sp.Expr) -> sp.Expr:
        return sp.sqrt(sp.Max(0, variance)) * sp.Abs(size)

    return {
        Signal("change", "1", text): theta * size,
        Signal("change_std", "1", "standard deviation of the change"): std(variance, size),
        Signal("second", "1", "number of a second candidate that has changed at once, or 0"): (
            chosen(both, paired.numbers[1], sp.S.Zero)
        ),
        Signal("second_change", "1", "change of its coefficient, in its SI unit"): two
        * paired.theta[1]
        * other,
        Signal("second_change_std", "1", "standard deviation of that"): two * std(paired.variance[1], other),
        Signal("rate", "1/s", "of the change, with its rate_std"): (1 - two) * refined.rate * size / period,
        Signal("rate_std", "1/s", "standard deviation of the rate"): std(refined.rate_variance, size)
        / period,
        Signal("ended", "1", "1 if the named change has ended"): (
            chosen(sp.And(told, two < sp.S.Half), refined.ended, sp.S.Zero)
        ),
        Signal("since", "s", "time since the estimated onset"): chosen(told, age * period, 0 * period),
        Signal("held", "s", "time for which the amplitude has held"): chosen(told, held * period, 0 * period),
    }


def _outputs_of_each(
    candidates: Sequence[Candidate],
    largest: Sequence[sp.Expr],
    possible: Sequence[sp.Expr],
    told: sp.Expr,
) -> dict[Signal, sp.Expr]:
    """Return the evidence of each candidate, and whether it is possible."""
    names = [c.name for c in candidates]
    evidence = {
        Signal(f"evidence_{n}", "1", f"largest g of {n}"): g for n, g in zip(names, largest, strict=False)
    }
    return evidence | {
        Signal(f"possible_{n}", "1", f"1 if an alarm may be due to {n}"): (
            chosen(sp.And(told, p), sp.S.One, sp.S.Zero)
        )
        for n, p in zip(names, possible, strict=True)
    }


def _unknown_outputs(
    unknowns: Sequence[Candidate], J: int, which: sp.Expr, told: sp.Expr, rivals: Sequence[sp.Expr]
) -> dict[Signal, sp.Expr]:
    """Return for each unknown change whether it is named, and whether an alarm may be due to it."""
    named = [sp.Abs(which - (j + 1)) < sp.S.Half for j in range(J, J + len(unknowns))]
    outputs = {}
    for u, mine in zip(unknowns, named, strict=True):
        outputs[Signal(u.name, "1", f"1 if no candidate explains the change: {_kind(u)}")] = sp.And(
            told, mine
        )
    for u, mine, rival in zip(unknowns, named, rivals, strict=True):
        text = f"1 if an alarm may be due to {_kind(u)} that is in no candidate"
        outputs[Signal(f"possible_{u.name}", "1", text)] = sp.And(told, sp.Or(mine, rival))
    return {s: chosen(e, sp.S.One, sp.S.Zero) for s, e in outputs.items()}


def _kind(unknown: Candidate) -> str:
    where = next(iter((*unknown.rates, *unknown.seen)))
    return f"an unknown term in {where}'" if unknown.rates else f"an offset of {where}"
