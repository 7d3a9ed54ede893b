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

- An acceleration is left: no amplitude of the named candidate explains the samples, it is refuted. A lag or
  a delay is not: its response at another size has another shape.
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
    change, information : sympy.Expr
        Change of the amplitude in the segment that ends, and J_nn.
    column : sympy.Matrix, shape (n, 1)
        Error before the next tick by the named change since the segment began.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    renewed: sp.Expr
    refuted: sp.Expr
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
    spared: sp.Expr,
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
    spared : sympy.Expr
        1 if the named change is never refuted: an arbitrary acceleration, a lag, a delay.
    steady : sympy.Expr
        1 if the amplitude has no significant rate.
    segment : int
        Ticks of a segment.
    error : float
        Probability that a right name is refuted.
    """
    sums = _Sums(write, begins, segment)
    last, every, columns = len(pushes) - 1, [], []
    for p, push in enumerate(pushes):
        c = sums.column(p, plant, M, push)
        seen = C * c + sp.Matrix(list(jolt)) if p == last else C * c
        every.append([write.define(f"probe_eta[{p},{i}]", e) for i, e in enumerate(seen)])
        columns.append(sp.Matrix([sp.Symbol(f"probe_next_{p}[{i}]", real=True) for i in range(len(plant))]))
    b = [
        sums.segment(f"probe_b[{p}]", "score", [e * a for e, a in zip(row, away, strict=True)])
        for p, row in enumerate(every)
    ]
    J = [
        sums.segment(f"probe_J[{p}]", "information", [e**2 / S for e, S in zip(row, variances, strict=True)])
        for p, row in enumerate(every)
    ]
    own = sp.Max(J[last], 1e-300)
    limit = sp.Float(-ndtri(error / (LOOKS * len(pushes))))
    left = []
    for p in range(last):
        both = [e * a / S for e, a, S in zip(every[p], every[last], variances, strict=True)]
        cross = sums.segment(f"probe_cross[{p}]", "information on both", both)
        share = write.define(f"probe_share[{p}]", cross / own)
        kept = write.define(f"probe_kept[{p}]", J[p] - share * cross)
        tells = kept > ALIKE * sp.Max(J[p], 1e-300)
        said = chosen(tells, (b[p] - share * b[last]) ** 2 / sp.Max(kept, 1e-300), sp.S.Zero)
        counts = chosen(tells, sp.S.One, sp.S.Zero)
        left.append(_exceeds(limit, *sums.total(f"left[{p}]", said, counts, sums.begins)))
    held = _exceeds(limit, *sums.total("named", b[last] ** 2 / own, sp.S.One, sums.anew))
    moved = write.define("moved_amplitude", chosen(sp.And(sums.ends > sp.S.Half, held), sp.S.One, sp.S.Zero))
    refuted, renewed = _judged(write, sums, moved, left, begins, spared, steady)
    change = write.define("moved_by", b[last] / own)
    return Probes(tuple(sums.states), sums.following, renewed, refuted, change, own, columns[last])


class _Sums:
    """Sums within a segment, and over segments.

    Attributes
    ----------
    states : list of Signal
    following : dict of str to sympy.Expr
    ends, done : sympy.Expr
        1 at the end of a segment, and the segments since the estimate began, this one included.
    """

    def __init__(self, write: Equations, begins: sp.Expr, segment: int) -> None:
        self._write = write
        self.states: list[Signal] = []
        self.following: dict[str, sp.Expr] = {}
        ticks = self.state("segment_ticks", "1", "ticks of the segment")
        count = self.state("segments", "1", "segments since the estimate began")
        # of 1, 1, 2, 4, 4, ... times the ticks: longer ones tell more, shorter ones sooner
        length = sp.Piecewise((1, count < 1.5), (2, count < 2.5), (4, True), evaluate=False)
        self.ends = write.define("segment_ends", chosen(ticks > segment * length - 1.5, sp.S.One, sp.S.Zero))
        self.done = write.define("segments_done", count + self.ends)
        self.begins = begins > sp.S.Half
        self._over = sp.Or(self.ends > sp.S.Half, self.begins)
        self.anew = sp.Or(self.begins, sp.Symbol("renewed", real=True) > sp.S.Half)
        self.following["segment_ticks"] = chosen(self._over, sp.S.Zero, ticks + 1)
        self.following["segments"] = chosen(self.anew, sp.S.Zero, self.done)

    def state(self, name: str, unit: str, text: str) -> sp.Symbol:
        self.states.append(Signal(name, unit, text))
        return self.states[-1].symbol

    def column(self, p: int, plant: Sequence[Signal], M: sp.Matrix, push: sp.Matrix) -> sp.Matrix:
        """Write the column of a probe since the segment began."""
        c = sp.Matrix(
            [self.state(f"probe[{p},{i}]", s.unit, f"error of {s.name}") for i, s in enumerate(plant)]
        )
        then = self._write.matrix(f"probe_next_{p}", M * c + push)
        for i, e in enumerate(then):
            self.following[f"probe[{p},{i}]"] = chosen(self._over, sp.S.Zero, e)
        return c

    def segment(self, name: str, text: str, terms: Sequence[sp.Expr]) -> sp.Expr:
        """Write a sum within the segment."""
        now = self._write.define(f"now_{name}", self.state(name, "1", text) + sum(terms))
        self.following[name] = chosen(self._over, sp.S.Zero, now)
        return now

    def total(
        self, name: str, said: sp.Expr, counts: sp.Expr, anew: sp.Expr
    ) -> tuple[sp.Expr, sp.Expr]:
        """Write a sum over segments, and their number; both since it was last below its mean."""
        sums = []
        for key, text, what in (("U", "sum over segments", said), ("K", "segments of the sum", counts)):
            before = self.state(f"{key}_{name}", "1", text)
            sums.append(self._write.define(f"now_{key}_{name}", before + self.ends * what))
        below = sp.Or(anew, sums[0] <= sums[1])
        for key, now in zip("UK", sums, strict=True):
            self.following[f"{key}_{name}"] = chosen(below, sp.S.Zero, now)
        return sums[0], sums[1]


def _exceeds(limit: sp.Expr, U: sp.Expr, K: sp.Expr) -> sp.Expr:
    K = sp.Max(K, 1)
    return sp.cbrt(U / K) > 1 - 2 / (9 * K) + limit * sp.sqrt(2 / (9 * K))


def _judged(
    write: Equations,
    sums: _Sums,
    moved: sp.Expr,
    left: Sequence[sp.Expr],
    begins: sp.Expr,
    spared: sp.Expr,
    steady: sp.Expr,
) -> tuple[sp.Expr, sp.Expr]:
    """Write whether the name is refuted, and whether the estimate begins anew."""
    begun, ends = begins < sp.S.Half, sums.ends > sp.S.Half
    renewals = sums.state("renewals", "1", "times that the amplitude did not hold")
    young = sp.And(moved > sp.S.Half, sums.done < LOOKS + sp.S.Half, renewals > MOST - sp.S.Half)
    wrong = sp.And(sp.Integer(len(left)) > 0, spared < sp.S.Half, ends, begun, sp.Or(*left, young))
    refuted = write.define("refuted", chosen(wrong, sp.S.One, sp.S.Zero))
    sums.following["renewals"] = chosen(begun, renewals + moved, sp.S.Zero)
    old = sp.And(ends, steady < sp.S.Half, sums.done > LOOKS - sp.S.Half)
    again = sp.And(begun, refuted < sp.S.Half, sp.Or(moved > sp.S.Half, old))
    return refuted, write.define("renewed", chosen(again, sp.S.One, sp.S.Zero))
