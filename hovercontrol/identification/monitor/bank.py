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
the scores of a reference log vary more than J, by the dispersion phi_j, b and J are divided by it: see
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
from hovercontrol.control.observers.ins.kalman import Correction, Equations, chosen

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
    forced, lost : list of sympy.Matrix
        g of each candidate, and the error after this tick's measurements by its b alone.
    pushes, jolts : list of sympy.Matrix
        Change of s, and of the innovations divided by their standard deviations, by the tick itself, by
        candidate: ``s <- M s + push``, ``push = g + Phi lost``, ``eta = C s + jolt``.
    A, M, C : sympy.Matrix, shape (n, n), (n, n) and (m, n)
        Error after this tick's measurements, error before the next tick, and innovations divided by their
        standard deviations, by the error before this tick.
    whitened, limited : list of sympy.Expr
        e and its limited value, by measurement.
    own, since : list of list of sympy.Expr
        eta of each candidate since the start, and since that of window 0, by measurement.
    rows : sympy.Matrix, shape (m, n)
        C Psi of window 0. After an alarm, it begins at the tick after that.
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
    forced: list[sp.Matrix]
    lost: list[sp.Matrix]
    pushes: list[sp.Matrix]
    jolts: list[sp.Matrix]
    A: sp.Matrix
    M: sp.Matrix
    C: sp.Matrix
    whitened: list[sp.Expr]
    limited: list[sp.Expr]
    own: list[list[sp.Expr]]
    since: list[list[sp.Expr]]
    rows: sp.Matrix
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
    tested: int,
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
    tested : int
        Number of candidates that raise an alarm, the first ones.
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
    root = [write.define(f"root_share[{i}]", sp.sqrt(s.share)) for i, s in enumerate(steps)]
    seen = [write.define(f"whitened[{i}]", s.innovation * root[i]) for i, s in enumerate(steps)]
    limited = [
        write.define(f"limited[{i}]", _limited(e, every))
        for i, (e, every) in enumerate(zip(seen, many, strict=True))
    ]
    A, M, C = _of_error_before(write, steps, root, Phi)
    memory = _Memory([], {})
    moved = _moved(write, memory, windows, first, raised, best_window, jump=jump, hold=hold)
    columns = [
        _column(write, memory, j, plant, steps, root, Phi, M, C, forced[j], bias[j])
        for j in range(len(forced))
    ]
    found = [
        _window(write, memory, w, plant, M, C, columns, seen, limited, dispersion, tested)
        for w in range(windows)
    ]
    for w, window in enumerate(found):
        for key, value in window.values.items():
            earlier = found[w - 1].values[key.replace(f"[{w}", f"[{w - 1}", 1)] if w else window.fresh[key]
            memory.following[key] = chosen(moved[w] > sp.S.Half, earlier, value)

    def by_candidate(key: str, count: int = len(columns)) -> list[list[sp.Expr]]:
        return [[w.values[f"{key}[{k},{j}]"] for k, w in enumerate(found)] for j in range(count)]

    return Bank(
        states=tuple(sorted(memory.states, key=_side_by_side)),
        next_values=memory.following,
        score=by_candidate("b"),
        limited_score=by_candidate("limited_b", tested),
        information=by_candidate("J"),
        energy=[w.values[f"energy[{k}]"] for k, w in enumerate(found)],
        age=[w.values[f"age[{k}]"] for k, w in enumerate(found)],
        columns=[c.s for c in columns],
        after=[c.after for c in columns],
        begun=[w.begun for w in found],
        Psi=[w.Psi for w in found],
        forced=list(forced),
        lost=[c.lost for c in columns],
        pushes=[c.push for c in columns],
        jolts=[c.jolt for c in columns],
        A=A,
        M=M,
        C=C,
        whitened=seen,
        limited=limited,
        own=[c.own for c in columns],
        since=found[0].eta,
        rows=found[0].rows,
        dispersion=list(dispersion),
    )


@dataclass(frozen=True)
class _Memory:
    """States of the bank, and their values after the tick."""

    states: list[Signal]
    following: dict[str, sp.Expr]

    def state(self, name: str, unit: str, text: str, start: float = 0.0) -> sp.Symbol:
        self.states.append(Signal(name, unit, text, start=start))
        return self.states[-1].symbol

    def column(self, name: str, plant: Sequence[Signal], text: str) -> sp.Matrix:
        """Return states in the units of the filter's; {} in the text is the filter's state."""
        rows = enumerate(plant)
        return sp.Matrix([self.state(f"{name}{i}]", p.unit, text.format(i, p.name)) for i, p in rows])


@dataclass(frozen=True)
class _Column:
    """s of a candidate before and after the tick, lost, push and jolt, and eta since the start."""

    s: sp.Matrix
    after: sp.Matrix
    lost: sp.Matrix
    push: sp.Matrix
    jolt: sp.Matrix
    own: list[sp.Expr]


@dataclass(frozen=True)
class _Window:
    """Values of a window's states after the tick: as they go on, and for a new start; C Psi and eta."""

    values: dict[str, sp.Expr]
    fresh: dict[str, sp.Expr]
    begun: list[sp.Matrix]
    Psi: sp.Matrix
    rows: sp.Matrix
    eta: list[list[sp.Expr]]


def _limited(innovation: sp.Expr, unlimited: sp.Expr) -> sp.Expr:
    most = sp.Float(LIMIT)
    within = sp.Max(-most, sp.Min(innovation, most))
    return sp.Piecewise((innovation, unlimited > sp.S.Half), (within, True))


def _of_error_before(
    write: Equations, steps: Sequence[Correction], root: Sequence[sp.Expr], Phi: sp.Matrix
) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """Write A, M and C: the updates of each unit vector of the error before the tick."""
    n, m = Phi.rows, len(steps)
    units = [through(write, f"unit_{k}", steps, sp.eye(n)[:, k], [sp.S.Zero] * m) for k in range(n)]
    C = write.matrix("C", sp.Matrix(m, n, lambda i, k: root[i] * units[k][0][i]))
    A = sp.Matrix.hstack(*(after for _, after in units))
    return A, write.matrix("M", Phi * A), C


def _moved(
    write: Equations,
    memory: _Memory,
    windows: int,
    first: int,
    raised: sp.Expr,
    best_window: sp.Expr,
    *,
    jump: sp.Expr,
    hold: sp.Expr,
) -> list[sp.Symbol]:
    """Write for each window whether it takes over a new start at this tick: 1 or 0."""
    half = sp.S.Half
    count = memory.state("count", "1", "ticks, modulo the longest cycle of the windows")
    longest = first * 2 ** (windows - 1)
    now = write.define("count_now", count + 1)
    memory.following["count"] = sp.Piecewise((sp.S.Zero, now > longest - half), (now, True))
    moved = []
    for w in range(windows):
        cycle = first * 2**w
        rest = now - cycle * sp.floor(now / cycle)
        at_alarm = {0: [(1, raised > half)], 1: [(1, sp.And(raised > half, best_window < half))]}
        pairs = [*at_alarm.get(w, []), (0, hold > half)]
        pairs += [(1, jump > half)] if w == 0 else []
        pairs += [(1, rest < half), (0, True)]
        moved.append(write.define(f"moved[{w}]", sp.Piecewise(*pairs, evaluate=False)))
    return moved


def _column(
    write: Equations,
    memory: _Memory,
    j: int,
    plant: Sequence[Signal],
    steps: Sequence[Correction],
    root: Sequence[sp.Expr],
    Phi: sp.Matrix,
    M: sp.Matrix,
    C: sp.Matrix,
    forced: sp.Matrix,
    bias: Sequence[sp.Expr],
) -> _Column:
    """Write a candidate's column: ``eta = C s + jolt, s <- M s + push``."""
    s = memory.column(f"s[{j},", plant, f"error of {{1}} by candidate {j}")
    push, jolt, lost = forced, sp.zeros(len(steps), 1), sp.zeros(len(plant), 1)
    if any(b != 0 for b in bias):
        shift, lost = through(write, f"bias_{j}", steps, lost, bias)
        jolt = write.matrix(f"jolt_{j}", sp.Matrix([r * e for r, e in zip(root, shift, strict=True)]))
        push = push + Phi * lost
    push = write.matrix(f"push_{j}", push)
    own = [write.define(f"eta[{j},{i}]", e) for i, e in enumerate(C * s + jolt)]
    after = write.matrix(f"s_next_{j}", M * s + push)
    memory.following.update({f"s[{j},{i}]": e for i, e in enumerate(after)})
    return _Column(s, after, lost, push, jolt, own)


def _window(
    write: Equations,
    memory: _Memory,
    w: int,
    plant: Sequence[Signal],
    M: sp.Matrix,
    C: sp.Matrix,
    columns: Sequence[_Column],
    seen: Sequence[sp.Expr],
    limited: Sequence[sp.Expr],
    dispersion: Sequence[sp.Expr],
    tested: int,
) -> _Window:
    """Write a window's transition matrix, age, energy, and the sums b, limited b and J of each candidate."""
    n = len(plant)
    Psi = sp.Matrix(
        n, n,
        lambda i, k: memory.state(
            f"Psi[{w},{i},{k}]", f"({plant[i].unit})/({plant[k].unit})", "transition of the error",
            1.0 if i == k else 0.0,
        ),
    )  # fmt: skip
    R = write.matrix(f"R_{w}", C * Psi)
    after = write.matrix(f"Psi_next_{w}", M * Psi)
    age = memory.state(f"age[{w}]", "1", f"ticks since the start of window {w}")
    age = write.define(f"age_now[{w}]", age + 1)
    energy = memory.state(f"energy[{w}]", "1", f"sum of squares of the innovations in window {w}")
    energy = write.define(f"energy_now[{w}]", energy + sum(e**2 for e in seen))
    values = {f"age[{w}]": age, f"energy[{w}]": energy}
    values |= {f"Psi[{w},{i},{k}]": after[i, k] for i in range(n) for k in range(n)}
    fresh: dict[str, sp.Expr] = {f"age[{w}]": sp.S.Zero, f"energy[{w}]": sp.S.Zero}
    fresh |= {f"Psi[{w},{i},{k}]": sp.eye(n)[i, k] for i in range(n) for k in range(n)}
    starts, shown = [], []
    for j, column in enumerate(columns):
        begun = memory.column(f"begun[{w},{j},", plant, f"s[{j},{{0}}] at the start of window {w}")
        starts.append(begun)
        before = R * begun
        eta = [write.define(f"eta[{w},{j},{i}]", e - before[i]) for i, e in enumerate(column.own)]
        shown.append(eta)
        sums = {
            "b": (f"score of candidate {j} in window {w}", _dot(eta, seen)),
            "J": (f"information on candidate {j} in window {w}", _dot(eta, eta)),
        }
        if j < tested:
            sums["limited_b"] = f"b[{w},{j}] of limited innovations", _dot(eta, limited)
        for key, (text, more) in sums.items():
            value = memory.state(f"{key}[{w},{j}]", "1", text)
            now = f"{key.removesuffix('_b')}_now[{w},{j}]"
            values[f"{key}[{w},{j}]"] = write.define(now, value + more / dispersion[j])
            fresh[f"{key}[{w},{j}]"] = sp.S.Zero
        values |= {f"begun[{w},{j},{i}]": e for i, e in enumerate(begun)}
        fresh |= {f"begun[{w},{j},{i}]": e for i, e in enumerate(column.after)}
    return _Window(values, fresh, starts, after, R, shown)


def _side_by_side(state: Signal) -> tuple[str, list[int]]:
    """Return a state's kind, window, row and candidate: in this order all candidates are adjacent.

    The same operation on them is then a loop over adjacent numbers in C.
    """
    kind, _, indices = state.name.partition("[")
    numbers = [int(n) for n in indices.strip("]").split(",") if n]
    if kind in ("s", "begun"):
        *window, candidate, row = numbers
        numbers = [*window, row, candidate]
    return kind, numbers


def _dot(a: Sequence[sp.Expr], b: Sequence[sp.Expr]) -> sp.Expr:
    return sum(x * y for x, y in zip(a, b, strict=True))
