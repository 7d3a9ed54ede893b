r"""The bank of change tests of a monitor, as equations of its Block.

A change theta of candidate j at the tick tau shifts the filter's errors. With the filter's gains K_i, its
measurement rows H_i and the transition matrix Phi of a tick, the mean error d of the prediction and the mean
eta_i of the i-th innovation follow

    eta_i = H_i d + theta b_i,  d <- d - K_i eta_i          (measurements i = 1 ... m)
    d <- Phi d + theta g,       g = integral of Phi(T, s) a ds,

both linear in theta. One column s_j = d/theta runs from the start for each candidate. That of a change at tau
differs by the solution of the homogeneous equation,

    d(tau) = s_j - Psi s_j(tau),   eta_i(tau) = eta_i - C_i Psi s_j(tau),

where Psi is the transition matrix of the filter's error since tau, common to all candidates, and C_i the
i-th innovation's derivative by the error before the tick. With e_i the innovations divided by their standard
deviations, N(0, 1) without a change, and eta_i divided likewise,

    b = sum of eta_i e_i,   J = sum of eta_i^2,   g = b^2/(J + J0),   theta = b/J,   std = 1/J^(1/2):

g is twice the log-likelihood ratio (Willsky and Jones, A generalized likelihood ratio approach, IEEE TAC 21,
1976). J0 is the information below which a window says little.

An alarm is raised by b with e_i limited to +-LIMIT, so that one sample of heavy-tailed noise says little
(Huber, Robust Statistics, 1981); after several outliers a change is likelier, and e_i is not limited. Where
the scores of a sound log vary more than J, by the dispersion phi_j, b and J are divided by it: see
:mod:`hovercontrol.identification.monitor.dispersion`.

Starts tau are kept in windows w = 0 ... W-1. Every ``first`` ticks window 0 begins anew; every ``2^w first``
ticks window w takes over the start of window w - 1 and its sums. The ages of the starts are then between
``(2^w - 1) first`` and ``(2^(w+1) - 1) first``. Window 0 also begins anew at an outlier: a jump of a sensor
is in the estimate after few ticks, and shows only with its onset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Correction, Equations

#: Standard deviations to which an innovation is limited in the scores. Normal noise exceeds it once in 370.
LIMIT = 3.0


@dataclass(frozen=True)
class Bank:
    """What the bank adds to the monitor's Block.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
        Without resets.
    score, limited_score, information : list of list of sympy.Expr
        b, b of limited innovations and J after this tick, divided by the dispersion, by candidate and window.
    energy : list of sympy.Expr
        Sum of squares of e since the start of each window, this tick included.
    age : list of sympy.Expr
        Ticks since the start of each window, this one included.
    columns, after : list of sympy.Matrix
        s of each candidate, before this tick and before the next.
    begun : list of list of sympy.Matrix
        s at the start of each window, by window and candidate.
    Psi : list of sympy.Matrix
        Psi of each window, before the next tick.
    pushes, jolts : list of sympy.Matrix
        Change of s, and of the innovations divided by their standard deviations, by the tick itself, by
        candidate: ``s <- M s + push``, ``eta = C s + jolt``.
    A, M, C : sympy.Matrix, shape (n, n), (n, n) and (m, n)
        Error after this tick's measurements, error before the next tick, and innovations divided by their
        standard deviations, by the error before this tick.
    whitened, limited : list of sympy.Expr
        e and its limited value, by measurement.
    own : list of list of sympy.Expr
        eta of each candidate since the start, by measurement.
    dispersion : list of sympy.Expr
        phi, by candidate.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    score: list[list[sp.Expr]]
    limited_score: list[list[sp.Expr]]
    information: list[list[sp.Expr]]
    energy: list[sp.Expr]
    age: list[sp.Expr]
    columns: list[sp.Matrix]
    after: list[sp.Matrix]
    begun: list[list[sp.Matrix]]
    Psi: list[sp.Matrix]
    pushes: list[sp.Matrix]
    jolts: list[sp.Matrix]
    A: sp.Matrix
    M: sp.Matrix
    C: sp.Matrix
    whitened: list[sp.Expr]
    limited: list[sp.Expr]
    own: list[list[sp.Expr]]
    dispersion: list[sp.Expr]


def through(
    write: Equations, name: str, steps: Sequence[Correction], error: sp.Matrix, bias: Sequence[sp.Expr]
) -> tuple[list[sp.Expr], sp.Matrix]:
    """Write the mean innovations of a mean error and of biases, and the mean error after the update.

    ``eta_i = H_i d + b_i,  d <- d - K_i eta_i``.
    """
    eta = []
    for i, (step, b) in enumerate(zip(steps, bias, strict=True)):
        one = write.define(f"{name}_eta[{i}]", (step.H * error)[0] + b)
        eta.append(one)
        if one != 0:
            error = write.matrix(f"{name}_after_{i}", error - step.K * one)
    return eta, error


def write_bank(
    write: Equations,
    plant: Sequence[Signal],
    steps: Sequence[Correction],
    Phi: sp.Matrix,
    forced: Sequence[sp.Matrix],
    bias: Sequence[Sequence[sp.Expr]],
    *,
    windows: int,
    first: int,
    dispersion: Sequence[sp.Expr],
    many: Sequence[sp.Expr],
    jump: sp.Expr,
    hold: sp.Expr,
    raised: sp.Expr,
    best_window: sp.Expr,
) -> Bank:
    """Write the tests.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    steps : sequence of Correction
        The filter's measurement updates.
    Phi : sympy.Matrix, shape (n, n)
        Transition matrix of the tick.
    forced : sequence of sympy.Matrix, shape (n, 1)
        g of each candidate.
    bias : sequence of sequence of sympy.Expr
        b of each candidate and measurement.
    windows, first : int
        W, and the number of ticks after which window 0 begins anew.
    dispersion : sequence of sympy.Expr
        phi of each candidate.
    many : sequence of sympy.Expr
        1 for each measurement that is not limited.
    jump : sympy.Expr
        1 at an outlier.
    hold : sympy.Expr
        1 while no start is moved: after an alarm.
    raised, best_window : sympy.Expr
        1 at the tick of an alarm, and the number of the window that raised it. Window 0 begins anew then;
        if it raised the alarm, window 1 takes over its start.
    """
    n, m, J = len(plant), len(steps), len(forced)
    root = [write.define(f"root_share[{i}]", sp.sqrt(s.share)) for i, s in enumerate(steps)]
    seen = [write.define(f"whitened[{i}]", s.innovation * root[i]) for i, s in enumerate(steps)]
    most = sp.Float(LIMIT)
    limited = []
    for i, (e, every) in enumerate(zip(seen, many, strict=True)):
        held = sp.Piecewise((e, every > sp.S.Half), (sp.Max(-most, sp.Min(e, most)), True))
        limited.append(write.define(f"limited[{i}]", held))
    # columns of the update of the error, and rows of the innovations by the error before the tick
    etas, afters = zip(
        *(through(write, f"unit_{k}", steps, sp.eye(n)[:, k], [sp.S.Zero] * m) for k in range(n)), strict=True
    )
    C = write.matrix("C", sp.Matrix(m, n, lambda i, k: root[i] * etas[k][i]))
    A = sp.Matrix.hstack(*afters)
    M = write.matrix("M", Phi * A)
    states: list[Signal] = []
    following: dict[str, sp.Expr] = {}

    def state(name: str, unit: str, text: str, start: float = 0.0) -> sp.Symbol:
        s = Signal(name, unit, text, start=start)
        states.append(s)
        return s.symbol

    count = state("count", "1", "ticks, modulo the longest cycle of the windows")
    longest = first * 2 ** (windows - 1)
    now = write.define("count_now", count + 1)
    following["count"] = sp.Piecewise((sp.S.Zero, now > longest - sp.S.Half), (now, True))
    moved = []
    for w in range(windows):
        cycle = first * 2**w
        rest = now - cycle * sp.floor(now / cycle)
        at_alarm = {
            0: [(1, raised > sp.S.Half)],
            1: [(1, sp.And(raised > sp.S.Half, best_window < sp.S.Half))],
        }
        pairs = [*at_alarm.get(w, []), (0, hold > sp.S.Half)]
        pairs += [(1, jump > sp.S.Half)] if w == 0 else []
        pairs += [(1, rest < sp.S.Half), (0, True)]
        moved.append(write.define(f"moved[{w}]", sp.Piecewise(*pairs, evaluate=False)))

    columns, own, after, pushes, jolts = [], [], [], [], []
    for j in range(J):
        s = sp.Matrix(
            [state(f"s[{j},{i}]", p.unit, f"error of {p.name} by candidate {j}") for i, p in enumerate(plant)]
        )
        columns.append(s)
        push, jolt = forced[j], sp.zeros(m, 1)
        if any(b != 0 for b in bias[j]):
            shift, lost = through(write, f"bias_{j}", steps, sp.zeros(n, 1), bias[j])
            jolt = write.matrix(f"jolt_{j}", sp.Matrix([root[i] * e for i, e in enumerate(shift)]))
            push = write.matrix(f"push_{j}", push + Phi * lost)
        pushes.append(push)
        jolts.append(jolt)
        own.append([write.define(f"eta[{j},{i}]", e) for i, e in enumerate(C * s + jolt)])
        new = write.matrix(f"s_next_{j}", M * s + push)
        after.append(new)
        following |= {f"s[{j},{i}]": new[i] for i in range(n)}

    score: list[list[sp.Expr]] = [[] for _ in range(J)]
    robust: list[list[sp.Expr]] = [[] for _ in range(J)]
    information: list[list[sp.Expr]] = [[] for _ in range(J)]
    age: list[sp.Expr] = []
    energy: list[sp.Expr] = []
    starts: list[list[sp.Matrix]] = []
    Psis: list[sp.Matrix] = []
    before: dict[str, sp.Expr] = {}
    for w in range(windows):
        Psi = sp.Matrix(
            n, n,
            lambda i, k, w=w: state(
                f"Psi[{w},{i},{k}]", f"({plant[i].unit})/({plant[k].unit})", "transition of the error",
                1.0 if i == k else 0.0,
            ),
        )  # fmt: skip
        R = write.matrix(f"R_{w}", C * Psi)
        Psi_next = write.matrix(f"Psi_next_{w}", M * Psi)
        old = write.define(
            f"age_now[{w}]", state(f"age[{w}]", "1", f"ticks since the start of window {w}") + 1
        )
        age.append(old)
        Psis.append(Psi_next)
        starts.append([])
        spent = state(f"energy[{w}]", "1", f"sum of squares of the innovations in window {w}")
        energy.append(write.define(f"energy_now[{w}]", spent + sum(e**2 for e in seen)))
        values = {f"age[{w}]": old, f"energy[{w}]": energy[w]}
        values |= {f"Psi[{w},{i},{k}]": Psi_next[i, k] for i in range(n) for k in range(n)}
        fresh: dict[str, sp.Expr] = {f"age[{w}]": sp.S.Zero, f"energy[{w}]": sp.S.Zero}
        fresh |= {f"Psi[{w},{i},{k}]": sp.eye(n)[i, k] for i in range(n) for k in range(n)}
        for j in range(J):
            begun = sp.Matrix(
                [
                    state(f"begun[{w},{j},{i}]", p.unit, f"s[{j},{i}] at the start of window {w}")
                    for i, p in enumerate(plant)
                ]
            )
            starts[w].append(begun)
            eta = [write.define(f"eta[{w},{j},{i}]", own[j][i] - (R[i, :] * begun)[0]) for i in range(m)]
            b = state(f"b[{w},{j}]", "1", f"score of candidate {j} in window {w}")
            info = state(f"J[{w},{j}]", "1", f"information on candidate {j} in window {w}")
            b_limited = state(f"limited_b[{w},{j}]", "1", f"b[{w},{j}] of limited innovations")
            phi, one = dispersion[j], list(zip(eta, seen, limited, strict=True))
            b_now = write.define(f"b_now[{w},{j}]", b + sum(e * x for e, x, _ in one) / phi)
            limited_now = write.define(
                f"limited_now[{w},{j}]", b_limited + sum(e * x for e, _, x in one) / phi
            )
            J_now = write.define(f"J_now[{w},{j}]", info + sum(e**2 for e in eta) / phi)
            score[j].append(b_now)
            robust[j].append(limited_now)
            information[j].append(J_now)
            values |= {f"b[{w},{j}]": b_now, f"limited_b[{w},{j}]": limited_now, f"J[{w},{j}]": J_now}
            values |= {f"begun[{w},{j},{i}]": begun[i] for i in range(n)}
            fresh |= {f"{key}[{w},{j}]": sp.S.Zero for key in ("b", "limited_b", "J")}
            fresh |= {f"begun[{w},{j},{i}]": after[j][i] for i in range(n)}
        taken = before if w else fresh
        for key, value in values.items():
            earlier = taken[key.replace(f"[{w}", f"[{w - 1}", 1)] if w else taken[key]
            following[key] = sp.Piecewise((earlier, moved[w] > sp.S.Half), (value, True))
        before = values
    return Bank(
        tuple(states), following, score, robust, information, energy, age, columns, after, starts, Psis,
        pushes, jolts, A, M, C, seen, limited, own, list(dispersion),
    )  # fmt: skip
