r"""Judges whether the amplitude of the named change holds, and whether its name is right.

Beside the estimate of a constant amplitude, or of one that grows (:mod:`.refined`), two explanations are
followed by :mod:`.tracking` from the same start: the named change with an amplitude that wanders, and an
acceleration in each equation with process noise that wanders. The named amplitude may change by its own size
in :data:`WANDERS` segments of time; the acceleration in equation p by a_p, whose square is the evidence at
the alarm divided by the information on p. With ``D = 2 ln(1/error)``, twice logarithms of likelihood ratios
decide:

- wandering over constant amplitude above D: the amplitude does not hold, and the estimate begins anew from
  the wandering one. This is how a monitor forgets;
- accelerations over the better of the two above D: the name is refuted. That of a lag or a delay is not: its
  response at another size has another shape;
- constant over wandering amplitude, or it over the accelerations, not above D less the prior odds, or the
  amplitude has a rate, or it is not significant: the alarm may be due to an unknown acceleration, the one
  that is largest in units of its standard deviation. If the change has ended, the name stands alone if it did
  so before the estimate that finds no change: within one estimate a constant amplitude does not end.

With the amplitude theta and its variance V, ``theta^2/V`` is twice the logarithm of the likelihood ratio of
the named change to none: below D, what was named may be no change.

Each ratio is held below 2 D, so that what has held for long may still change soon. At the start the
accelerations have the evidence that the one with most has in the bank beside that of the name, at most 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.tracking import Tracked, track

#: Segments of time in which an amplitude may change by its own size: 2 s for a craft.
WANDERS = 4


@dataclass(frozen=True)
class Named:
    """The estimate that is judged.

    Attributes
    ----------
    M, push, jolt : sympy.Matrix
        Error a tick later by the error, per amplitude, and of the innovations per amplitude.
    curved, known : sympy.Matrix, shape (n, 1)
        What the error changes by besides: by the model, ``f(x + d) - f(x) - Phi d``, and by the change, too.
    phi, likelihood, square : sympy.Expr
        Dispersion, twice the log-likelihood of the tick's samples, and the square of the amplitude.
    first, spread : sympy.Matrix, shape (n + 1, 1) and (n + 1, n + 1)
        Error and amplitude with which an estimate begins, and their covariance.
    evidence, explained : sympy.Expr
        Largest g of all, and that of the named change.
    begins, spared, steady, sure : sympy.Expr
        1 where the estimate begins, if it is never refuted, if the amplitude has no significant rate, and if
        it is significant, or has ended and the name stood alone before this estimate.
    """

    M: sp.Matrix
    push: sp.Matrix
    jolt: sp.Matrix
    curved: sp.Matrix
    known: sp.Matrix
    phi: sp.Expr
    likelihood: sp.Expr
    square: sp.Expr
    first: sp.Matrix
    spread: sp.Matrix
    evidence: sp.Expr
    explained: sp.Expr
    begins: sp.Expr
    spared: sp.Expr
    steady: sp.Expr
    sure: sp.Expr


@dataclass(frozen=True)
class Judged:
    """What is found.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
    renewed, refuted, holds : sympy.Expr
        1 if the amplitude does not hold, if the name does not, and if the amplitude does hold.
    doubts : list of sympy.Expr
        For each unknown acceleration, whether the alarm may be due to it.
    doubt : sympy.Expr
        Whether it may be due to any.
    wandering : Tracked
        The named change with an amplitude that wanders.
    others : list of sympy.Expr
        Twice the log-likelihood of the tick's samples by accelerations that wander, if there are any.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    renewed: sp.Expr
    refuted: sp.Expr
    holds: sp.Expr
    doubts: list[sp.Expr]
    doubt: sp.Expr
    wandering: Tracked
    others: list[sp.Expr]


def judge(
    write: Equations,
    plant: Sequence[Signal],
    bank: Bank,
    named: Named,
    forces: Mapping[int, sp.Expr],
    segment: int,
    decides: float,
    doubted: float,
) -> Judged:
    """Write the judgement.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    forces : mapping of int to sympy.Expr
        J0 of unknown accelerations, by number from 0 in the bank.
    segment : int
        Ticks of a segment.
    decides, doubted : float
        D, and D less the prior odds.
    """
    starts, ticks = named.begins > sp.S.Half, sp.Integer(WANDERS * segment)
    wandering = track(
        write, "wandering", plant, bank, named.M, named.push, named.jolt,
        write.matrix("wandering_known", named.known), named.phi, [named.square / ticks], named.begins,
        named.first, named.spread,
    )  # fmt: skip
    lead = Signal("lead", "1", "evidence for a constant amplitude, not one that wanders")
    more = lead.symbol + named.likelihood - wandering.likelihood
    ahead = write.define("lead_now", sp.Min(more, 2 * decides))
    moved = sp.And(sp.Not(starts), ahead < -decides)
    states, following = [lead, *wandering.states], dict(wandering.next_values)
    refuted: sp.Expr = sp.S.Zero
    unsure = sp.Or(named.steady < sp.S.Half, named.sure < sp.S.Half)
    doubt = sp.Or(starts, ahead < doubted, unsure)
    doubts: list[sp.Expr] = []
    likelihoods: list[sp.Expr] = []
    if forces:
        others, less = _accelerations(write, plant, bank, named, forces, ticks)
        likelihoods = [others.likelihood]
        against = Signal("against", "1", "evidence for unknown accelerations, not the named change")
        more = against.symbol + others.likelihood - named.likelihood
        now = write.define("against_now", sp.Max(more, -2 * decides))
        caught = chosen(moved, sp.Max(now + ahead, -2 * decides), now)
        following |= {against.name: chosen(starts, sp.Max(-2 * decides, sp.Min(less, 0)), caught)}
        following |= others.next_values
        states += [against, *others.states]
        wrong = sp.And(sp.Not(starts), named.spared < sp.S.Half, now + sp.Min(ahead, 0) > decides)
        refuted = write.define("refuted", chosen(wrong, sp.S.One, sp.S.Zero))
        doubt = sp.Or(now > -doubted, doubt)
        at = range(len(plant), len(plant) + len(forces))
        shares = [others.x[i] ** 2 / sp.Max(others.P[i, i], 1e-300) for i in at]
        shares = [write.define(f"unknown_share[{p}]", e) for p, e in enumerate(shares)]
        doubts = [sp.And(doubt, e >= sp.Max(*shares, evaluate=False)) for e in shares]
    renewed = write.define("renewed", chosen(sp.And(moved, refuted < sp.S.Half), sp.S.One, sp.S.Zero))
    following[lead.name] = chosen(sp.Or(starts, renewed > sp.S.Half), sp.S.Zero, ahead)
    holds = chosen(ahead < doubted, sp.S.Zero, sp.S.One)
    return Judged(tuple(states), following, renewed, refuted, holds, doubts, doubt, wandering, likelihoods)


def _accelerations(
    write: Equations,
    plant: Sequence[Signal],
    bank: Bank,
    named: Named,
    forces: Mapping[int, sp.Expr],
    ticks: sp.Expr,
) -> tuple[Tracked, sp.Expr]:
    """Write accelerations that wander; return them, and their evidence beside that of the name at the start.

    They begin with the error that the named change explains, and with the acceleration of most evidence. J0
    keeps them finite where the window is a tick long.
    """
    n, r = len(plant), len(forces)
    info = [
        write.define(f"unknown_info[{p}]", of_window(write, f"unknown_J[{p}]", bank.information[j]) + floor)
        for p, (j, floor) in enumerate(forces.items())
    ]
    score = [of_window(write, f"unknown_b[{p}]", bank.score[j]) for p, j in enumerate(forces)]
    shown = [
        write.define(f"unknown_g[{p}]", b**2 / J) for p, (b, J) in enumerate(zip(score, info, strict=True))
    ]
    most = write.define("unknown_most", sp.Max(*shown, evaluate=False))
    first = [chosen(g >= most, b / J, sp.S.Zero) for g, b, J in zip(shown, score, info, strict=True)]
    first = [write.define(f"unknown_first[{p}]", e) for p, e in enumerate(first)]
    spread = sp.diag(named.spread[:n, :n], *(e**2 for e in first))
    others = track(
        write, "others", plant, bank, bank.M, sp.Matrix.hstack(*(bank.pushes[j] for j in forces)),
        sp.zeros(len(bank.whitened), r), named.curved, named.phi,
        [named.evidence / J / ticks for J in info], named.begins,
        sp.Matrix([*named.first[:n], *first]), spread,
    )  # fmt: skip
    return others, most - named.explained


def of_window(write: Equations, name: str, values: Sequence[sp.Expr]) -> sp.Expr:
    """Write the value of the best window."""
    window = sp.Symbol("best_window", real=True)
    pairs = [(v, window < w + 0.5) for w, v in enumerate(values[:-1])]
    return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))
