r"""The coefficient of the named change, from the samples after the alarm.

Before the alarm the onset is known only as one of a few windows, so that the estimate b/J of a large change
is off by more than 1/J^(1/2). After the alarm no onset is needed: with d0 the unknown error of the prediction
at the tick after the alarm, theta the amplitude then and theta' its rate per tick, C_i and Psi as in
:mod:`.bank` with Psi since that tick, and eta_i and eta'_i the signatures of a constant and of a growing
change since that tick, the innovations divided by their standard deviations are

    e_i = C_i (Psi d0 + o) + theta eta_i + theta' eta'_i + n_i,   n_i ~ N(0, 1).

All columns are slopes at the present estimate, as in an extended filter, and o is the rest. With d the error
by the named change after this tick's measurements, the error that they bring among it, f the motion of a tick
by the model and g(x, q) the change of the state over the tick by the candidate, with its coefficient q,

    d <- f(x + d) - f(x) + g(x + d, q),
    Psi <- (Phi + g_x) A Psi,  s <- (Phi + g_x) A s + g_q,  s' <- (Phi + g_x) A s' + k g_q,
    o <- d - Psi d0 - theta s - theta' s',

k being the ticks since the estimate began. If the candidate is not proportional to its coefficient (a lag, a
dead zone), g and g_q are those at the estimate of q.

Recursive least squares estimate z = (d0, theta, theta') with the row r = (C_i Psi, eta_i, eta'_i):

    S = phi + r V r',  k = V r'/S,  z <- z + k (e - r z),  V <- V - k (r V).

A rate is believed if it is more than ``(2 ln(1/ERROR))^(1/2)`` of its standard deviation; else the estimate
is that given theta' = 0.

They start from the estimate theta of the best window, and from the error that it explains, ``d0 = theta c``
with the column c of the window. The onset lies between the starts of two windows, so that the true signature
differs from that of the window. What is unexplained of the sum of squares E of its N innovations, more than
noise brings in the mean plus twice the standard deviation of that, bounds the difference:

    std^2 = (1 + max(0, E - theta^2 J - N) + 2 (2 N)^(1/2))/J,

at most theta^2. Besides, d0 has the covariance g phi P: the evidence g at the alarm bounds the error in units
of the filter's covariance P. phi is the dispersion of the named candidate, 1 where the noise is as stated.

The slopes of a candidate that is not proportional to its coefficient change with the estimate, and samples
before took other ones. Once the estimate has moved by D, a response of the curvature 1/theta is off by the
second order D^2/theta, at most D. If that is more than the standard deviation, its square is added to the
variance of theta, and as a part of each tick to that of theta'; D then begins anew.

If another candidate is named, all begin anew. If the amplitude does not hold (:mod:`.judged`), the estimate
begins anew from one that wanders. The change has ended if the likelihood of no change is more than 1/ERROR
times that of the largest amplitude that was significant, no change is possible, and that holds.

The estimate is limited to the bounds of theta.

Source: Friedland, Treatment of bias in recursive filtering, IEEE TAC 14, 1969.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.judged import Named, judge, of_window
from hovercontrol.identification.monitor.sized import Sized

#: Stands for an infinite bound of theta among finite ones.
FAR = 1e30

#: Likelihood ratio below which a rival is excluded: the probability that a right name is.
ERROR = 0.01

#: Twice the logarithm of the likelihood ratio that decides.
DECIDES = 2.0 * math.log(1.0 / ERROR)

#: Prior odds of the candidates to a change that is none of them: who lists them takes them for likelier.
FAMILIAR = 10.0

#: Twice the logarithm of the likelihood ratio that excludes an unknown change.
DOUBTED = DECIDES - 2.0 * math.log(FAMILIAR)


@dataclass(frozen=True)
class Refined:
    """The estimate of the named change.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
        Without resets.
    theta, variance : sympy.Expr
        Amplitude now and its variance; zero before an alarm.
    rate, rate_variance : sympy.Expr
        Of the amplitude per tick, and its variance.
    ended : sympy.Expr
        1 if the named change has ended.
    age : sympy.Expr
        Ticks since the estimate began.
    shift : sympy.Matrix, shape (n, 1)
        Error of the updated estimate by the change: truth minus estimate; zero before an alarm.
    refuted : sympy.Expr
        1 if unknown accelerations explain more than the name.
    doubts : list of sympy.Expr
        For each unknown acceleration, whether it may be the cause, and is the largest one.
    phi : sympy.Expr
        Dispersion of the named change.
    likelihoods : list of sympy.Expr
        Twice the log-likelihood of the tick's samples by the name, and by accelerations that wander.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    theta: sp.Expr
    variance: sp.Expr
    rate: sp.Expr
    rate_variance: sp.Expr
    ended: sp.Expr
    age: sp.Expr
    shift: sp.Matrix
    refuted: sp.Expr
    doubts: list[sp.Expr]
    phi: sp.Expr
    likelihoods: list[sp.Expr]


@dataclass(frozen=True)
class Start:
    """From what an estimate begins.

    Attributes
    ----------
    first, evidence : sympy.Expr
        Estimate from the best window, and its g.
    explained : sympy.Expr
        g of the named change.
    info, energy, dof : sympy.Expr
        J of the best window, the sum of squares of its innovations and their number.
    """

    first: sp.Expr
    evidence: sp.Expr
    explained: sp.Expr
    info: sp.Expr
    energy: sp.Expr
    dof: sp.Expr


def within(value: sp.Expr, lower: sp.Expr, upper: sp.Expr) -> sp.Expr:
    """Return a value limited to bounds; infinite ones are left out."""
    value = value if upper.is_infinite else sp.Min(value, upper)
    return value if lower.is_infinite else sp.Max(value, lower)


def refine(
    write: Equations,
    bank: Bank,
    plant: Sequence[Signal],
    which: sp.Expr,
    told: sp.Expr,
    start: Start,
    after: sp.Matrix,
    limits: Sequence[tuple[sp.Expr, sp.Expr]],
    sized: Mapping[int, Sized],
    moves: sp.Matrix,
    turns: Sequence[sp.Matrix],
    segment: int,
    tested: int,
    lasting: Sequence[int],
    forces: Mapping[int, sp.Expr],
) -> Refined:
    """Write the estimate.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    which : sympy.Expr
        Number of the named change, from 1: candidates, then unknown changes.
    told : sympy.Expr
        1 from the alarm on.
    start : Start
    after : sympy.Matrix, shape (n, n)
        Covariance of the filter's prediction at the next tick.
    limits : sequence of (sympy.Expr, sympy.Expr)
        Bounds of each theta.
    sized : mapping of int to Sized
        Candidates that are not proportional to their coefficient, by number from 0.
    moves : sympy.Matrix, shape (n, 1)
        ``f(x + d) - f(x)`` of the tick.
    turns : sequence of sympy.Matrix, shape (n, n)
        Slope by the state of each one's change of the state over the tick.
    segment : int
        Ticks of a segment of time.
    tested : int
        Number of candidates.
    lasting : sequence of int
        Candidates with a memory (lags, delays), by number from 0. Their response at another size has another
        shape, so what their linearisation leaves is no evidence against them.
    forces : mapping of int to sympy.Expr
        J0 of unknown accelerations, by number from 0.
    """
    it = _Estimate(write, bank, plant, which, told, tested, segment)
    it.choose(sized)
    it.update()
    it.size(start, limits)
    it.predict(moves, turns)
    never = [which > tested + sp.S.Half, *(sp.Abs(which - (j + 1)) < sp.S.Half for j in lasting)]
    spared = chosen(sp.Or(*never), sp.S.One, sp.S.Zero)
    it.judge(start, after, spared, forces)
    it.begin()
    it.remember()
    return it.result()


class _Estimate:
    """The equations of the estimate, written one part after the other.

    Parameters
    ----------
    tested : int
        Number of candidates; unknown changes come after them.
    segment : int
        Ticks of a segment.
    """

    def __init__(
        self,
        write: Equations,
        bank: Bank,
        plant: Sequence[Signal],
        which: sp.Expr,
        told: sp.Expr,
        tested: int,
        segment: int,
    ) -> None:
        self._segment = segment
        self._write, self._bank, self._plant = write, bank, plant
        self._which, self._told, self._tested = which, told, tested
        self._own: list[Signal] = []
        self._following: dict[str, sp.Expr] = {}
        n = self._n = len(plant)
        named = self._state("named", "1", "number of the named change; 0 before an alarm")
        units = [*(s.unit for s in plant), "1", "1"]
        z = [self._state(f"z[{i}]", u, "error at the alarm, amplitude, rate") for i, u in enumerate(units)]
        V = {
            (i, k): self._state(
                f"V[{i},{k}]", f"({units[i]})*({units[k]})", f"covariance of z[{i}] and z[{k}]"
            )
            for i in range(n + 2)
            for k in range(i, n + 2)
        }
        self._upper = list(V)
        self.now, self.cov = sp.Matrix(z), sp.Matrix(n + 2, n + 2, lambda i, k: V[min(i, k), max(i, k)])
        other = sp.Abs(which - named) > sp.S.Half
        self.anew = write.define("anew", chosen(sp.And(told > sp.S.Half, other), sp.S.One, sp.S.Zero))
        # columns since the estimate began: s of a constant change, s' of a growing one, o and Psi
        self.s, self.grown, self.o = (
            sp.Matrix(
                [self._state(f"named_{key}[{i}]", p.unit, f"{text}, {p.name}") for i, p in enumerate(plant)]
            )
            for key, text in (
                ("s", "error by the change"), ("ramp", "error by its growth"), ("o", "known error"),
            )
        )  # fmt: skip
        self.Psi = sp.Matrix(
            n, n,
            lambda i, k: self._state(
                f"named_Psi[{i},{k}]", f"({plant[i].unit})/({plant[k].unit})", "transition of the error",
                float(i == k),
            ),
        )  # fmt: skip
        self.age = self._state("named_age", "1", "ticks since the estimate began")
        self.peak = self._state("peak", "1", "largest amplitude that was significant")

    def _state(self, name: str, unit: str, text: str, start: float = 0.0) -> sp.Symbol:
        self._own.append(Signal(name, unit, text, start=start))
        return self._own[-1].symbol

    def _of_named(self, name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        if all(v == values[0] for v in values):
            return values[0]
        pairs = [(v, self._which < j + 1.5) for j, v in enumerate(values[:-1])]
        return self._write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    def _of_named_column(self, name: str, columns: Sequence[sp.Matrix]) -> sp.Matrix:
        rows = range(columns[0].rows)
        return sp.Matrix([self._of_named(f"{name}[{i}]", [c[i] for c in columns]) for i in rows])

    def choose(self, sized: Mapping[int, Sized]) -> None:
        """Write what the named change does in the tick, and its dispersion."""
        bank, J, zero = self._bank, range(len(self._bank.pushes)), sp.zeros(self._n, 1)
        pushes, forced = (
            [sized[j].slope if j in sized else some[j] for j in J] for some in (bank.pushes, bank.forced)
        )
        self.push = self._of_named_column("named_push", pushes)
        self.forced = self._of_named_column("named_forced", forced)
        self.lost = self._of_named_column("named_lost", bank.lost)
        self.jolt = self._of_named_column("named_jolt", bank.jolts)
        self.left = self._of_named_column("named_left", [sized[j].left if j in sized else zero for j in J])
        self.phi = self._of_named("named_dispersion", bank.dispersion)
        self.bent = self._of_named("named_bent", [sp.S.One if j in sized else sp.S.Zero for j in J])

    def update(self) -> None:
        """Write the recursive least squares of this tick's measurements."""
        write, C, n = self._write, self._bank.C, self._n
        rows, known = write.matrix("refined_rows", C * self.Psi), write.matrix("known", C * self.o)
        constant, growing = C * self.s + self.jolt, C * self.grown + self.age * self.jolt
        likelihood = sp.S.Zero
        for i, seen in enumerate(self._bank.whitened):
            eta = write.define(f"named_eta[{i}]", constant[i])
            row = sp.Matrix([[*rows[i, :], eta, write.define(f"named_ramp_eta[{i}]", growing[i])]])
            Vr = write.matrix(f"refined_{i}_Vr", self.cov * row.T)
            S = write.define(f"refined_{i}_S", self.phi + (row * Vr)[0])
            off = write.define(f"refined_{i}_away", (seen - known[i] - (row * self.now)[0]) / S)
            likelihood -= off**2 * S + sp.log(S)
            self.now = write.matrix(f"refined_{i}_z", self.now + Vr * off)
            entries = {(a, b): self.cov[a, b] - Vr[a] * Vr[b] / S for a, b in self._upper}
            self.cov = write.symmetric(f"refined_{i}_V", n + 2, entries)
        self.likelihood = write.define("named_likelihood", likelihood)

    def size(self, start: Start, limits: Sequence[tuple[sp.Expr, sp.Expr]]) -> None:
        """Write the amplitude, of a constant change unless the rate is significant, and its variance."""
        write, n, now, cov, age = self._write, self._n, self.now, self.cov, self.age
        r, spread = n + 1, sp.Max(self.cov[n + 1, n + 1], 1e-300)
        self.steady = write.define("steady", chosen(now[r] ** 2 > DECIDES * spread, sp.S.Zero, sp.S.One))
        share = [write.define(f"rate_share[{i}]", self.steady * cov[i, r] / spread) for i in range(n + 1)]
        given = [*(now[i] - share[i] * now[r] for i in range(n + 1)), (1 - self.steady) * now[r]]
        part = self.part = write.matrix("given", sp.Matrix(given))
        grows = (1 - self.steady) * (2 * age * cov[n, r] + age**2 * cov[r, r])
        held = cov[n, n] + grows - share[n] * cov[n, r]
        bounds = [self._of_named(f"named_{k}", [_finite(b[k]) for b in limits]) for k in (0, 1)]
        self.first = write.define("theta_first", within(start.first, *bounds))
        beginning = self.anew > sp.S.Half
        self.amplitude = write.define("amplitude", chosen(beginning, self.first, part[n] + age * part[r]))
        self.theta = write.define("theta", within(self.amplitude, *bounds))
        over = start.energy / self.phi - self.first**2 * start.info - start.dof
        unexplained = sp.Max(0, over) + 2 * sp.sqrt(2 * start.dof)
        wide, unknown = (1 + unexplained) / start.info, self._which > self._tested + sp.S.Half
        self.wide = write.define("first_variance", chosen(unknown, wide, sp.Min(self.first**2, wide)))
        self.variance = write.define("theta_variance", chosen(beginning, self.wide, sp.Max(held, 0)))

    def predict(self, moves: sp.Matrix, turns: Sequence[sp.Matrix]) -> None:
        """Write the slopes a tick later, at this estimate, and the error d that they leave to o."""
        write, bank, part, n = self._write, self._bank, self.part, self._n
        g_x = sp.zeros(n, n)
        for i, k in sorted({(i, k) for turn in turns for i in range(n) for k in range(n) if turn[i, k] != 0}):
            g_x[i, k] = self.amplitude * self._of_named(f"turn[{i},{k}]", [t[i, k] for t in turns])
        # d = Psi d0 + theta s + theta' s' + o, before this tick's measurements
        before = self.Psi * part[:n, :] + part[n] * self.s + part[n + 1] * self.grown + self.o
        self.moved = write.matrix("named_error", before)
        self.M = write.matrix("named_M", bank.M + g_x * bank.A)
        self.Psi_next = write.matrix("named_Psi_next", self.M * self.Psi)
        s_next = write.matrix("named_s_next", self.M * self.s + self.push)
        ramp_next = write.matrix("named_ramp_next", self.M * self.grown + self.age * self.push)
        amplitude = part[n] + self.age * part[n + 1]
        self.shift = bank.A * self.moved + amplitude * self.lost
        # f(x + d) - f(x) - Phi d, with the error d after this tick's measurements
        linear = bank.M * self.moved + amplitude * (self.push - self.forced)
        self.curved = write.matrix("curved", moves - linear)
        self.error_next = write.matrix("named_error_next", moves + amplitude * self.forced + self.left)
        explained = self.Psi_next * part[:n, :] + part[n] * s_next + part[n + 1] * ramp_next
        self.then = {"named_s": s_next, "named_ramp": ramp_next, "named_o": self.error_next - explained}

    def judge(self, start: Start, after: sp.Matrix, spared: sp.Expr, forces: Mapping[int, sp.Expr]) -> None:
        """Write whether the amplitude holds, and whether the name does."""
        write, n = self._write, self._n
        along = [*_explained(write, self._bank, n, self._of_named), sp.S.One]
        spread = sp.Matrix(n + 1, n + 1, lambda i, k: self.wide * along[i] * along[k])
        spread[:n, :n] += start.evidence * self.phi * after
        begins = write.define("estimate_begins", chosen(self._told < sp.S.Half, sp.S.One, self.anew))
        none, same, least = self.theta**2, (self.theta - self.peak) ** 2, DECIDES * self.variance
        self.gone = write.define(
            "gone", chosen(sp.And(same - none > least, none < least), sp.S.One, sp.S.Zero)
        )
        self.stands = self._state("stands", "1", "1 once the name has stood alone in this estimate")
        self.stood = self._state("stood", "1", "1 once the name has stood alone before this estimate")
        sure = chosen(none < least, self.gone * self.stood, sp.S.One)
        known = self.curved + self.left - (self.M - self._bank.M) * self.moved
        self.start = Named(
            self.M, self.push, self.jolt, self.curved, known, self.phi, self.likelihood,
            sp.Max(self.peak**2, self.theta**2 + self.variance), self.first * sp.Matrix(along), spread,
            start.evidence, start.explained, begins, spared, self.steady, sure,
        )  # fmt: skip
        self.judged = judge(
            write, self._plant, self._bank, self.start, forces, self._segment, DECIDES, DOUBTED
        )

    def begin(self) -> None:
        """Write the next estimate: this one, or where it begins anew."""
        n, r, renews = self._n, self._n + 1, self.judged.renewed > sp.S.Half
        self.begins = sp.Or(self.anew > sp.S.Half, renews)
        x, P = self.judged.wandering.x, self.judged.wandering.P
        for i in range(n + 2):
            value = sp.S.Zero if i == r else chosen(renews, x[i], self.start.first[i])
            self._following[f"z[{i}]"] = chosen(self.begins, value, self.now[i])
        more = self._by_bend()
        for i, k in self._upper:
            now = self.cov[i, k] + {n: more, r: more / sp.Max(self.age, 1) ** 2}.get(i, 0) * int(i == k)
            value = sp.S.Zero if k == r else chosen(renews, P[i, k], self.start.spread[i, k])
            if i == r:  # it may grow by its standard deviation in a segment
                value = chosen(renews, P[n, n], self.start.spread[n, n]) / sp.Integer(self._segment) ** 2
            self._following[f"V[{i},{k}]"] = chosen(self.begins, value, now)

    def _by_bend(self) -> sp.Expr:
        """Write what the variance of the amplitude grows by, because samples before took other slopes."""
        if self.bent == 0:
            return sp.S.Zero
        at = self._state("linear_at", "1", "amplitude at which the variance grew last")
        moved = (self.amplitude - at) ** 2
        off = moved**2 / sp.Max(self.theta**2, moved, 1e-300)
        bends = sp.And(self.bent > sp.S.Half, off > self.variance)
        more = self._write.define("more_variance", chosen(bends, off, sp.S.Zero))
        self._following["linear_at"] = chosen(sp.Or(self.begins, bends), self.amplitude, at)
        return more

    def remember(self) -> None:
        """Write the other next values: columns, age, and the amplitude for what asks for it."""
        write, n, following = self._write, self._n, self._following
        anew = sp.Or(self.begins, self._told < sp.S.Half)
        for key, column in self.then.items():
            following.update({f"{key}[{i}]": chosen(anew, sp.S.Zero, column[i]) for i in range(n)})
        for i in range(n):
            for k in range(n):
                following[f"named_Psi[{i},{k}]"] = chosen(anew, sp.eye(n)[i, k], self.Psi_next[i, k])
        following["named_age"] = chosen(anew, sp.S.Zero, self.age + 1)
        following["named"] = write.define(
            "named_next", chosen(self._told > sp.S.Half, self._which, sp.S.Zero)
        )
        squared, least = self.theta**2, DECIDES * self.variance
        higher = sp.And(squared > self.peak**2, squared > least, self.steady > sp.S.Half)
        kept = chosen(higher, self.theta, self.peak)
        stands = write.define("stands_now", chosen(self.judged.doubt, self.stands, sp.S.One))
        following["stands"] = chosen(self.begins, sp.S.Zero, stands)
        stood = chosen(self.begins, sp.Max(stands, self.stood), self.stood)
        for key, value in (("peak", kept), ("stood", stood)):
            following[key] = chosen(self.anew > sp.S.Half, sp.S.Zero, value)
        self._state("named_theta", "1", "amplitude")
        self._state("named_variance", "1", "variance of the amplitude")
        following["named_theta"], following["named_variance"] = self.amplitude, self.variance

    def result(self) -> Refined:
        """Return the estimate."""
        r, ended = self._n + 1, sp.And(self.gone > sp.S.Half, self.judged.holds > sp.S.Half)
        return Refined(
            (*self._own, *self.judged.states),
            self._following | self.judged.next_values,
            self.theta,
            self.variance,
            self.now[r],
            self.cov[r, r],
            chosen(ended, sp.S.One, sp.S.Zero),
            self.age,
            self.shift,
            self.judged.refuted,
            self.judged.doubts,
            self.phi,
            [self.likelihood, *self.judged.others],
        )


def _explained(
    write: Equations, bank: Bank, n: int, of_named: Callable[[str, Sequence[sp.Expr]], sp.Expr]
) -> sp.Matrix:
    """Write c, the column of the named candidate since the start of the best window, before the next tick."""
    W = range(len(bank.Psi))

    def begun(i: int) -> sp.Expr:
        values = [of_named(f"named_begun[{w},{i}]", [c[i] for c in bank.begun[w]]) for w in W]
        return of_window(write, f"best_begun[{i}]", values)

    s = sp.Matrix([of_named(f"named_after[{i}]", [c[i] for c in bank.after]) for i in range(n)])
    start = sp.Matrix([begun(i) for i in range(n)])
    Psi = sp.Matrix(n, n, lambda i, k: of_window(write, f"best_Psi[{i},{k}]", [P[i, k] for P in bank.Psi]))
    return write.matrix("explained", s - Psi * start)


def _finite(bound: sp.Expr) -> sp.Expr:
    return sp.Float(math.copysign(FAR, float(bound))) if bound.is_infinite else bound
