r"""Probes of what the named change leaves unexplained.

Is its name right, and does its amplitude still hold? After an alarm the residuals ``rho_i = e_i - r_i z`` of
the estimate (:mod:`.refined`), of variance S_i, are white if the named change explains all. Probes look for
what is left: an arbitrary acceleration in each equation p with process noise, and the named change n with
another amplitude. Both may be of any size in each segment of time. With the columns eta of a probe since the
segment began,

    b = sum of eta_i rho_i/S_i,   J_pq = sum of eta_pi eta_qi/S_i.

Generalised likelihood: a segment says ``b_n^2/J_nn`` on the amplitude, and on an acceleration beside an
arbitrary amplitude ``(b_p - J_pn/J_nn b_n)^2/(J_pp - J_pn^2/J_nn)``. Each is chi^2 of 1 degree of freedom if
the named change explains all, and their sum U over K segments is chi^2 of K. A sum that falls below its mean
K begins anew with the next segment (Page, Biometrika 41, 1954), so that what was sound long ago does not
count. By Wilson and Hilferty (PNAS 17, 1931) ``((U/K)^(1/3) - 1 + 2/(9 K))/(2/(9 K))^(1/2)`` is then standard
normal.

- An acceleration is left: no amplitude of the named candidate explains the samples, it is refuted.
- The amplitude does not hold: the estimate begins anew from here. If after :data:`MOST` times it does not
  hold for :data:`LOOKS` segments, the candidate is refuted, too: it follows something else. An amplitude with
  a rate is estimated anew every LOOKS segments.

Segments last 1, 1, 2, 4, 4, ... times a given number of ticks. The limit is such that a right name is refuted
with a probability of at most `error` within LOOKS segments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp
from scipy.special import ndtri

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen

#: Segments of time within which the error holds: a craft's last 6 s.
LOOKS = 5

#: Times that an amplitude may change at once: where the response to a large change is far from linear, the
#: first estimate is off.
MOST = 2

#: Part of its information that a probe keeps beside the named change, below which it says nothing.
ALIKE = 1e-3


@dataclass(frozen=True)
class Probes:
    """What the probes say at the end of a segment; zero between ends.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
    renewed, refuted : sympy.Expr
        1 if the amplitude does not hold, and if the name does not.
    equation, refuting : sympy.Expr
        Number of the equation with most that is unexplained, from 1, and the information of a segment on it.
    change, information : sympy.Expr
        Change of the amplitude in the segment that ends, and J_nn.
    column : sympy.Matrix, shape (n, 1)
        Error before the next tick by the named change since the segment began.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    renewed: sp.Expr
    refuted: sp.Expr
    equation: sp.Expr
    refuting: sp.Expr
    change: sp.Expr
    information: sp.Expr
    column: sp.Matrix


def write_probes(
    write: Equations,
    plant: Sequence[Signal],
    pushes: Sequence[sp.Matrix],
    jolt: Sequence[sp.Expr],
    C: sp.Matrix,
    M: sp.Matrix,
    away: Sequence[sp.Expr],
    variances: Sequence[sp.Expr],
    begins: sp.Expr,
    unknown: sp.Expr,
    steady: sp.Expr,
    segment: int,
    error: float,
) -> Probes:
    """Write the probes.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    pushes : sequence of sympy.Matrix, shape (n, 1)
        Change of the error by a tick: of an acceleration in each equation, then of the named change.
    jolt : sequence of sympy.Expr
        Change of the innovations by the named change itself.
    C, M : sympy.Matrix
        As in :mod:`.bank`.
    away, variances : sequence of sympy.Expr
        rho/S and S, by measurement.
    begins : sympy.Expr
        1 where the estimate begins.
    unknown : sympy.Expr
        1 if the named change is an arbitrary acceleration: it is never refuted.
    steady : sympy.Expr
        1 if the amplitude has no significant rate.
    segment : int
        Ticks of a segment.
    error : float
        Probability that a right name is refuted.
    """
    states: list[Signal] = []
    following: dict[str, sp.Expr] = {}

    def state(name: str, unit: str, text: str) -> sp.Symbol:
        states.append(Signal(name, unit, text))
        return states[-1].symbol

    ticks = state("segment_ticks", "1", "ticks of the segment")
    count = state("segments", "1", "segments since the estimate began")
    # of 1, 1, 2, 4, 4, ... times the ticks: longer ones tell more, shorter ones sooner
    length = sp.Piecewise((1, count < 1.5), (2, count < 2.5), (4, True), evaluate=False)
    ends = write.define("segment_ends", chosen(ticks > segment * length - 1.5, sp.S.One, sp.S.Zero))
    following["segment_ticks"] = chosen(sp.Max(ends, begins) > sp.S.Half, sp.S.Zero, ticks + 1)
    done = write.define("segments_done", count + ends)
    over = sp.Or(ends > sp.S.Half, begins > sp.S.Half)
    anew = sp.Or(begins > sp.S.Half, sp.Symbol("renewed", real=True) > sp.S.Half)
    following["segments"] = chosen(anew, sp.S.Zero, done)
    last = len(pushes) - 1
    every, columns = [], []
    for p, push in enumerate(pushes):
        c = sp.Matrix([state(f"probe[{p},{i}]", s.unit, f"error of {s.name}") for i, s in enumerate(plant)])
        seen = C * c + sp.Matrix(list(jolt)) if p == last else C * c
        every.append([write.define(f"probe_eta[{p},{i}]", e) for i, e in enumerate(seen)])
        columns.append(write.matrix(f"probe_next_{p}", M * c + push))
        following |= {f"probe[{p},{i}]": chosen(over, sp.S.Zero, columns[p][i]) for i in range(len(plant))}

    def summed(name: str, text: str, terms: Sequence[sp.Expr]) -> sp.Expr:
        now = write.define(f"now_{name}", state(name, "1", text) + sum(terms))
        following[name] = chosen(over, sp.S.Zero, now)
        return now

    def total(name: str, said: sp.Expr, counts: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        """Write a sum over segments, and their number; both since it was last below its mean."""
        U = write.define(f"now_U_{name}", state(f"U_{name}", "1", "sum over segments") + ends * said)
        K = write.define(f"now_K_{name}", state(f"K_{name}", "1", "segments of the sum") + ends * counts)
        below = sp.Or(anew, U <= K)
        following[f"U_{name}"], following[f"K_{name}"] = (chosen(below, sp.S.Zero, v) for v in (U, K))
        return U, K

    b = [summed(f"probe_b[{p}]", "score", [e * a for e, a in zip(row, away, strict=True)])
         for p, row in enumerate(every)]  # fmt: skip
    J = [summed(f"probe_J[{p}]", "information", [e**2 / S for e, S in zip(row, variances, strict=True)])
         for p, row in enumerate(every)]  # fmt: skip
    own = sp.Max(J[last], 1e-300)
    limit = sp.Float(-ndtri(error / (LOOKS * len(pushes))))

    def exceeds(U: sp.Expr, K: sp.Expr) -> sp.Expr:
        K = sp.Max(K, 1)
        return sp.cbrt(U / K) > 1 - 2 / (9 * K) + limit * sp.sqrt(2 / (9 * K))

    left, sizes = [], []
    for p in range(last):
        both = [e * a / S for e, a, S in zip(every[p], every[last], variances, strict=True)]
        cross = summed(f"probe_cross[{p}]", "information on both", both)
        share = write.define(f"probe_share[{p}]", cross / own)
        kept = write.define(f"probe_kept[{p}]", J[p] - share * cross)
        tells = kept > ALIKE * sp.Max(J[p], 1e-300)
        said = chosen(tells, (b[p] - share * b[last]) ** 2 / sp.Max(kept, 1e-300), sp.S.Zero)
        U, K = total(f"left[{p}]", said, chosen(tells, sp.S.One, sp.S.Zero))
        left.append(exceeds(U, K))
        sizes.append(total(f"whole[{p}]", b[p] ** 2 / sp.Max(J[p], 1e-300), sp.S.One)[0])
    U, K = total("named", b[last] ** 2 / own, sp.S.One)
    moved = write.define(
        "moved_amplitude", chosen(sp.And(ends > sp.S.Half, exceeds(U, K)), sp.S.One, sp.S.Zero)
    )
    renewals = state("renewals", "1", "times that the amplitude did not hold")
    young = sp.And(moved > sp.S.Half, done < LOOKS + sp.S.Half, renewals > MOST - sp.S.Half)
    wrong = sp.And(
        sp.Integer(last) > 0, unknown < sp.S.Half, ends > sp.S.Half, begins < sp.S.Half, sp.Or(*left, young)
    )
    refuted = write.define("refuted", chosen(wrong, sp.S.One, sp.S.Zero))
    following["renewals"] = chosen(begins > sp.S.Half, sp.S.Zero, renewals + moved)
    old = sp.And(ends > sp.S.Half, steady < sp.S.Half, done > LOOKS - sp.S.Half)
    again = sp.And(begins < sp.S.Half, refuted < sp.S.Half, sp.Or(moved > sp.S.Half, old))
    renewed = write.define("renewed", chosen(again, sp.S.One, sp.S.Zero))
    largest = sp.Max(*sizes, evaluate=False)

    def of_largest(values: Sequence[sp.Expr]) -> sp.Expr:
        pairs = [(v, size >= largest) for v, size in zip(values[:-1], sizes[:-1], strict=True)]
        return sp.Piecewise(*pairs, (values[-1] if values else sp.S.Zero, True), evaluate=False)

    equation = of_largest([sp.Integer(p + 1) for p in range(last)])
    told = state("refuting_information", "1", "on the unknown acceleration, of a segment")
    following["refuting_information"] = chosen(refuted > sp.S.Half, of_largest(J[:last]), told)
    change = write.define("moved_by", b[last] / own)
    return Probes(tuple(states), following, renewed, refuted, equation, told, change, own, columns[last])
