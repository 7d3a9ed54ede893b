r"""The coefficient of the named change, from the samples after the alarm.

Before the alarm the onset is known only as one of a few windows, so that the estimate b/J of a large change
is off by more than 1/J^(1/2). After the alarm no onset is needed: with d0 the unknown error of the prediction
at the tick after the alarm, theta the amplitude, C_i and Psi as in :mod:`.bank` with Psi since that tick, and
eta_i the signature since that tick, the innovations divided by their standard deviations are

    e_i = C_i Psi d0 + theta eta_i + n_i,   n_i ~ N(0, 1).

A candidate that is not proportional to its coefficient q (a lag, a dead zone) is linearised at the estimate
of each tick instead of between zero and the trial value. Its change of the state over the tick is
``g(q) = g(q_k) + g'(q_k) (q - q_k)``: eta_i follows from g', and the part that is left, ``g(q_k) - g' q_k``,
adds a known offset o to the error, ``o <- M o + g(q_k) - g' q_k``:

    e_i - C_i o = C_i Psi d0 + theta eta_i + n_i.

Recursive least squares estimate z = (d0, theta) with the row r = (C_i Psi, eta_i):

    S = phi + r V r',  k = V r'/S,  z <- z + k (e - r z),  V <- V - k (r V).

They start from the estimate theta of the best window, and from the error that it explains, ``d0 = theta c``
with the column c of the window. The onset lies between the starts of two windows, so that the true signature
differs from that of the window. What is unexplained of the sum of squares E of its N innovations, more than
noise brings in the mean plus twice the standard deviation of that, bounds the difference:

    std^2 = (1 + max(0, E - theta^2 J - N) + 2 (2 N)^(1/2))/J,

at most theta^2. Besides, d0 has the covariance g phi P: the evidence g at the alarm bounds the error in units
of the filter's covariance P. phi is the dispersion of the named candidate, 1 where the noise is as stated.
If another candidate is named, all begin anew.

The estimate is limited to the bounds of theta.

Source: Friedland, Treatment of bias in recursive filtering, IEEE TAC 14, 1969.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations
from hovercontrol.identification.monitor.bank import Bank
from hovercontrol.identification.monitor.sized import Sized

#: Stands for an infinite bound of theta among finite ones.
FAR = 1e30


@dataclass(frozen=True)
class Refined:
    """The estimate of the named change.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
        Without resets.
    theta, variance : sympy.Expr
        Amplitude and its variance; zero before an alarm.
    shift : sympy.Matrix, shape (n, 1)
        Error of the updated estimate by the change: truth minus estimate; zero before an alarm.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    theta: sp.Expr
    variance: sp.Expr
    shift: sp.Matrix


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
    first: sp.Expr,
    evidence: sp.Expr,
    after: sp.Matrix,
    info: sp.Expr,
    energy: sp.Expr,
    dof: sp.Expr,
    limits: Sequence[tuple[sp.Expr, sp.Expr]],
    sized: Mapping[int, Sized],
) -> Refined:
    """Write the estimate.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    which : sympy.Expr
        Number of the named candidate, from 1.
    told : sympy.Expr
        1 from the alarm on.
    first, evidence : sympy.Expr
        Estimate from the best window, and its g.
    after : sympy.Matrix, shape (n, n)
        Covariance of the filter's prediction at the next tick.
    info, energy, dof : sympy.Expr
        J of the best window, the sum of squares of its innovations and their number.
    limits : sequence of (sympy.Expr, sympy.Expr)
        Bounds of each candidate's theta.
    sized : mapping of int to Sized
        Candidates that are not proportional to their coefficient, by number from 0.
    """
    n = len(plant)
    named = Signal("named", "1", "number of the named candidate; 0 before an alarm")
    units = [*(s.unit for s in plant), "1"]
    z = [Signal(f"z[{i}]", u, "error at the alarm, and the amplitude") for i, u in enumerate(units)]
    V = {
        (i, k): Signal(f"V[{i},{k}]", f"({units[i]})*({units[k]})", f"covariance of z[{i}] and z[{k}]")
        for i in range(n + 1)
        for k in range(i, n + 1)
    }
    other = sp.Abs(which - named.symbol) > sp.S.Half
    anew = write.define("anew", sp.Piecewise((0, told < sp.S.Half), (1, other), (0, True), evaluate=False))

    def of_named(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        if all(v == values[0] for v in values):
            return values[0]
        pairs = [(v, which < j + 1.5) for j, v in enumerate(values[:-1])]
        return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    Psi, column, offset, moves, more = _columns(write, bank, plant, of_named, anew, sized)
    phi = of_named("named_dispersion", bank.dispersion)
    now = sp.Matrix([s.symbol for s in z])
    cov = sp.Matrix(n + 1, n + 1, lambda i, k: V[min(i, k), max(i, k)].symbol)
    rows, known = write.matrix("refined_rows", bank.C * Psi), write.matrix("known", bank.C * offset)
    for i, seen in enumerate(bank.whitened):
        jolt = of_named(f"jolt[{i}]", [one[i] for one in bank.jolts])
        eta = write.define(f"named_eta[{i}]", (bank.C[i, :] * column)[0] + jolt)
        row = sp.Matrix([[*rows[i, :], eta]])
        Vr = write.matrix(f"refined_{i}_Vr", cov * row.T)
        S = write.define(f"refined_{i}_S", phi + (row * Vr)[0])
        away = write.define(f"refined_{i}_away", (seen - known[i] - (row * now)[0]) / S)
        now = write.matrix(f"refined_{i}_z", now + Vr * away)
        entries = {(a, b): cov[a, b] - Vr[a] * Vr[b] / S for a, b in V}
        cov = write.symmetric(f"refined_{i}_V", n + 1, entries)
    bounds = [of_named(f"named_{k}", [_finite(b[k]) for b in limits]) for k in range(2)]
    first = write.define("theta_first", within(first, *bounds))
    amplitude = write.define("amplitude", sp.Piecewise((first, anew > sp.S.Half), (now[n], True)))
    theta = write.define("theta", within(amplitude, *bounds))
    unexplained = sp.Max(0, energy / phi - first**2 * info - dof) + 2 * sp.sqrt(2 * dof)
    spread = write.define("first_variance", sp.Min(first**2, (1 + unexplained) / info))
    variance = write.define("theta_variance", sp.Piecewise((spread, anew > sp.S.Half), (cov[n, n], True)))

    def begun(value: sp.Expr, start: sp.Expr) -> sp.Expr:
        return sp.Piecewise((start, anew > sp.S.Half), (value, True))

    name = write.define("named_next", sp.Piecewise((which, told > sp.S.Half), (0, True)))
    following = {"named": name}
    along = [*_explained(write, bank, n, of_named), sp.S.One]
    following |= {s.name: begun(now[i], first * along[i]) for i, s in enumerate(z[:n])}
    following |= {z[n].name: amplitude}
    for (i, k), s in V.items():
        start = variance * along[i] * along[k] + (evidence * phi * after[i, k] if k < n else 0)
        following[s.name] = begun(cov[i, k], start)
    # d = Psi d0 + theta s + o since the estimate began, before this tick's measurements
    moved = write.matrix("named_error", Psi * now[:n, :] + theta * column + offset)
    shift = bank.A * moved
    return Refined((named, *z, *V.values(), *more), following | moves, theta, variance, shift)


def _explained(
    write: Equations, bank: Bank, n: int, of_named: Callable[[str, Sequence[sp.Expr]], sp.Expr]
) -> sp.Matrix:
    """Write c, the column of the named candidate since the start of the best window, before the next tick."""
    window, W = sp.Symbol("best_window", real=True), range(len(bank.Psi))

    def of_window(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        pairs = [(v, window < w + 0.5) for w, v in enumerate(values[:-1])]
        return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    def begun(i: int) -> sp.Expr:
        values = [of_named(f"named_begun[{w},{i}]", [c[i] for c in bank.begun[w]]) for w in W]
        return of_window(f"best_begun[{i}]", values)

    s = sp.Matrix([of_named(f"named_after[{i}]", [c[i] for c in bank.after]) for i in range(n)])
    start = sp.Matrix([begun(i) for i in range(n)])
    Psi = sp.Matrix(n, n, lambda i, k: of_window(f"best_Psi[{i},{k}]", [P[i, k] for P in bank.Psi]))
    return write.matrix("explained", s - Psi * start)


def _finite(bound: sp.Expr) -> sp.Expr:
    return sp.Float(math.copysign(FAR, float(bound))) if bound.is_infinite else bound


def _columns(
    write: Equations,
    bank: Bank,
    plant: Sequence[Signal],
    of_named: Callable[[str, Sequence[sp.Expr]], sp.Expr],
    anew: sp.Expr,
    sized: Mapping[int, Sized],
) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix, dict[str, sp.Expr], tuple[Signal, ...]]:
    """Write Psi, the column s of the named candidate and the offset o, all since the estimate began.

    Returns
    -------
    Psi, column, offset : sympy.Matrix
        Before this tick.
    next_values : dict of str to sympy.Expr
    states : tuple of Signal
    """
    n, J = len(plant), range(len(bank.pushes))

    def states(name: str, text: str) -> list[Signal]:
        return [Signal(f"named_{name}[{i}]", p.unit, f"{text} of {p.name}") for i, p in enumerate(plant)]

    def since(name: str, signals: Sequence[Signal], then: sp.Matrix, start: sp.Matrix) -> dict[str, sp.Expr]:
        new = write.matrix(name, then)
        return {
            x.name: sp.Piecewise((a, anew > sp.S.Half), (b, True))
            for x, a, b in zip(signals, start, new, strict=True)
        }

    def named(name: str, columns: Sequence[sp.Matrix]) -> sp.Matrix:
        return sp.Matrix([of_named(f"{name}[{i}]", [c[i] for c in columns]) for i in range(n)])

    zero = sp.zeros(n, 1)
    s, o = (
        states("s", "error by the named candidate"),
        states("o", "known part of the error") if sized else [],
    )
    column, offset = sp.Matrix([x.symbol for x in s]), sp.Matrix([x.symbol for x in o]) if o else zero
    pushes = [sized[j].slope if j in sized else bank.pushes[j] for j in J]
    moves = since("named_s_next", s, bank.M * column + named("named_push", pushes), zero)
    if sized:
        left = named("named_left", [sized[j].left if j in sized else zero for j in J])
        moves |= since("named_o_next", o, bank.M * offset + left, zero)
    text = "transition of the error since the estimate began"
    entries = [
        Signal(f"named_Psi[{i},{k}]", f"({a.unit})/({b.unit})", text, start=float(i == k))
        for i, a in enumerate(plant)
        for k, b in enumerate(plant)
    ]
    Psi = sp.Matrix(n, n, [x.symbol for x in entries])
    moves |= since("named_Psi_next", entries, bank.M * Psi, sp.eye(n))
    return Psi, column, offset, moves, (*s, *o, *entries)
