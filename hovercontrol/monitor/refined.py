r"""The coefficient of the named change, from the samples after the alarm.

Before the alarm the onset is known only as one of a few windows, so that the estimate b/J of a large change
is off by more than 1/J^(1/2). After the alarm no onset is needed: with d0 the unknown error of the prediction
at the tick after the alarm, theta the amplitude, C_i and Psi as in :mod:`.bank` with Psi since that tick, and
eta_i the signature since that tick, the innovations divided by their standard deviations are

    e_i = C_i Psi d0 + theta eta_i + n_i,   n_i ~ N(0, 1).

Recursive least squares estimate z = (d0, theta) with the row r = (C_i Psi, eta_i):

    S = 1 + r V r',  k = V r'/S,  z <- z + k (e - r z),  V <- V - k (r V).

They start from the estimate theta of the best window, with the standard deviation abs(theta), and from d0 = 0
with the covariance g P: the evidence g at the alarm bounds the error in units of the filter's covariance P.

Source: Friedland, Treatment of bias in recursive filtering, IEEE TAC 14, 1969.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.core.signals import Signal
from hovercontrol.estimators.ins.kalman import Equations
from hovercontrol.monitor.bank import Bank


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


def refine(
    write: Equations,
    bank: Bank,
    plant: Sequence[Signal],
    which: sp.Expr,
    told: sp.Expr,
    first: sp.Expr,
    evidence: sp.Expr,
    after: sp.Matrix,
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
    anew = write.define(
        "anew",
        sp.Piecewise(
            (0, told < sp.S.Half), (1, sp.Abs(which - named.symbol) > sp.S.Half), (0, True), evaluate=False
        ),
    )

    def of_named(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        pairs = [(v, which < j + 1.5) for j, v in enumerate(values[:-1])]
        return write.define(name, sp.Piecewise(*pairs, (values[-1], True), evaluate=False))

    J = range(len(bank.columns))
    now = sp.Matrix([s.symbol for s in z])
    cov = sp.Matrix(n + 1, n + 1, lambda i, k: V[min(i, k), max(i, k)].symbol)
    for i, seen in enumerate(bank.whitened):
        eta = of_named(f"named_eta[{i}]", [bank.signature[j][0][i] for j in J])
        row = sp.Matrix([[*bank.rows[0][i, :], eta]])
        Vr = write.matrix(f"refined_{i}_Vr", cov * row.T)
        S = write.define(f"refined_{i}_S", 1 + (row * Vr)[0])
        away = write.define(f"refined_{i}_away", (seen - (row * now)[0]) / S)
        now = write.matrix(f"refined_{i}_z", now + Vr * away)
        entries = {(a, b): cov[a, b] - Vr[a] * Vr[b] / S for a, b in V}
        cov = write.symmetric(f"refined_{i}_V", n + 1, entries)
    theta = write.define("theta", sp.Piecewise((first, anew > sp.S.Half), (now[n], True)))
    variance = write.define("theta_variance", sp.Piecewise((first**2, anew > sp.S.Half), (cov[n, n], True)))

    def begun(value: sp.Expr, start: sp.Expr) -> sp.Expr:
        return sp.Piecewise((start, anew > sp.S.Half), (value, True))

    following = {"named": sp.Piecewise((which, told > sp.S.Half), (0, True))}
    following |= {s.name: begun(now[i], sp.S.Zero) for i, s in enumerate(z[:n])} | {z[n].name: theta}
    for (i, k), s in V.items():
        start = variance if i == k == n else evidence * after[i, k] if k < n else sp.S.Zero
        following[s.name] = begun(cov[i, k], start)
    # d = Psi d0 + theta s since the alarm, before this tick's measurements
    column = sp.Matrix([of_named(f"named_s[{i}]", [bank.columns[j][i] for j in J]) for i in range(n)])
    begin = sp.Matrix([of_named(f"named_begun[{i}]", [bank.begun[0][j][i] for j in J]) for i in range(n)])
    free = write.matrix("named_free", now[:n, :] - now[n] * begin)
    moved = write.matrix("named_error", bank.Psi[0] * free + now[n] * column)
    shift = bank.A * moved
    return Refined((named, *z, *V.values()), following, theta, variance, shift)
