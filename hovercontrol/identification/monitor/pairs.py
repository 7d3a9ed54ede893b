r"""Two changes at once, from the samples after the alarm.

With d0 the error of the prediction at the tick after the alarm, C_i and Psi as in :mod:`.bank` and eta_ij the
signature of candidate j, both since that tick (window 0), the innovations divided by their standard
deviations are

    e_i = r_i d0 + sum of theta_j eta_ij + n_i,   r_i = C_i Psi,   n_i ~ N(0, phi).

One recursion estimates d0 as without a change. The sensitivity U_j of its estimate to theta_j gives the
residual's, zeta_ij, and so the sums for every candidate beside every other one (Friedland's second stage):

    S = phi + r V r',  k = V r'/S,  rho = e - r z,  zeta_j = eta_j - r U_j,
    z <- z + k rho,  V <- V - k (r V),  U_j <- U_j + k zeta_j,
    b_j += zeta_j rho/S,   J_jk += zeta_j zeta_k/S,   E += rho^2/S.

Two changes explain g, twice the logarithm of a likelihood ratio, of which h_j is explained by one of them:

    g = h_j + q,   h_j = b_j^2/J_jj,   q = (b_k - J_jk b_j/J_jj)^2/(J_kk - J_jk^2/J_jj).

For their evidence G each part is divided by its dispersion: h_j by phi_j, and q by phi_k; the larger of both
orders. Unknown accelerations stand beside the candidates. With ``D = 2 ln(1/error)`` and M pairs of
candidates, two changes are likely if all of these hold:

- each explains more than ``D + 2 ln M`` beside the other one, and more than the response to the other one
  leaves if it is not linear by a part :data:`BENT`;
- no pair with an unknown acceleration has a larger G;
- G is above what the samples' likelihoods say, since the alarm, for what was named in turn, and for
  accelerations that wander (:mod:`.judged`), by ``D + 2 ln M``;
- what they leave is noise: ``E - g - N`` is within two of its standard deviations, ``(2 N)^(1/2)``, for N
  innovations.

They are the only ones if G is above that of every other pair by D. They are told where no candidate alone is
possible, or the accelerations explain more than what was named in turn by D.

Source: Friedland, Treatment of bias in recursive filtering, IEEE TAC 14, 1969.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.bank import Bank

#: Standard deviations beyond which what two changes leave is more than noise.
LEFT = 2.0

#: Error of the linear response to a change at the estimate, as a part of it: it leaves the square of this
#: part of the evidence, which another change may seem to explain. Chosen: a cart's drag five times as
#: large leaves 0.04, and the pairs of `benchmarks/monitor_several.py` are told with it as without.
BENT = 0.1

#: Part of its information that a change has beside another one, at least: below, both are alike.
APART = 1e-4


@dataclass(frozen=True)
class Paired:
    """Two changes at once.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
        Without resets.
    likely, only : sympy.Expr
        1 if two changes are likely, and if no other two are.
    sought : sympy.Expr
        1 if accelerations explain more than what was named.
    numbers, theta, variance : tuple of two sympy.Expr
        Numbers of the candidates, from 1, their amplitudes and variances; the one of more evidence is the
        first.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    likely: sp.Expr
    only: sp.Expr
    sought: sp.Expr
    numbers: tuple[sp.Expr, sp.Expr]
    theta: tuple[sp.Expr, sp.Expr]
    variance: tuple[sp.Expr, sp.Expr]


def pair(
    write: Equations,
    bank: Bank,
    plant: Sequence[Signal],
    goes_on: sp.Expr,
    prior: sp.Matrix,
    phi: sp.Expr,
    rivals: Sequence[sp.Expr],
    tested: int,
    forces: Sequence[int],
    decides: float,
) -> Paired:
    """Write the two changes; none are told if there are no two candidates.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    goes_on : sympy.Expr
        1 after the tick of the alarm, else 0: all begins anew.
    prior : sympy.Matrix, shape (n, n)
        Covariance of d0.
    phi : sympy.Expr
        Dispersion of the named change.
    rivals : sequence of sympy.Expr
        Twice the log-likelihood of the tick's samples by what is named, and by accelerations that wander, if
        there are any.
    tested : int
        Number of candidates.
    forces : sequence of int
        Unknown accelerations, by number from 0.
    decides : float
        D.
    """
    if tested < 2:
        none = sp.S.Zero, sp.S.Zero
        return Paired((), {}, sp.S.Zero, *none, none, none, none)
    it = _Pairs(write, bank, plant, goes_on, phi, tested, forces, decides)
    it.update(prior, rivals)
    return it.told()


class _Pairs:
    """The equations, written one part after the other; changes are numbered from 0, accelerations last."""

    def __init__(
        self,
        write: Equations,
        bank: Bank,
        plant: Sequence[Signal],
        goes_on: sp.Expr,
        phi: sp.Expr,
        tested: int,
        forces: Sequence[int],
        decides: float,
    ) -> None:
        self._write, self._bank, self._plant, self._phi = write, bank, plant, phi
        self._goes_on, self._tested = goes_on, tested
        self._decides, self._beyond = decides, decides + 2.0 * math.log(tested * (tested - 1) / 2)
        self._which = [*range(tested), *forces]
        self._pairs = [p for p in itertools.combinations(range(len(self._which)), 2) if p[0] < tested]
        self._own: list[Signal] = []
        self._following: dict[str, sp.Expr] = {}

    def _state(self, name: str, text: str, unit: str = "1") -> sp.Symbol:
        self._own.append(Signal(f"pair_{name}", unit, text))
        return self._own[-1].symbol

    def update(self, prior: sp.Matrix, rivals: Sequence[sp.Expr]) -> None:
        """Write the recursion of this tick's measurements and the sums."""
        write, K, (z, V, U) = self._write, range(len(self._which)), self._first_stage()
        added = dict.fromkeys([*((j,) for j in K), *((j, j) for j in K), *self._pairs], sp.S.Zero)
        energy = logs = sp.S.Zero
        for i, seen in enumerate(self._bank.whitened):
            row = self._bank.rows[i, :]
            Vr = write.matrix(f"pair_{i}_Vr", V * row.T)
            S = write.define(f"pair_{i}_S", self._phi + (row * Vr)[0])
            rho = write.define(f"pair_{i}_rho", seen - (row * z)[0])
            gain = write.matrix(f"pair_{i}_gain", Vr / S)
            zeta = [
                write.define(f"pair_{i}_zeta[{j}]", self._bank.since[c][i] - (row * U[j])[0])
                for j, c in enumerate(self._which)
            ]
            z = write.matrix(f"pair_{i}_z", z + gain * rho)
            entries = {(a, b): V[a, b] - gain[a] * Vr[b] for a, b in self._upper}
            V = write.symmetric(f"pair_{i}_V", len(z), entries)
            U = [write.matrix(f"pair_{i}_U{j}", U[j] + gain * zeta[j]) for j in K]
            over = [write.define(f"pair_{i}_over[{j}]", zeta[j] / S) for j in K]
            for key in added:
                added[key] += over[key[0]] * (zeta[key[1]] if len(key) == 2 else rho)
            energy, logs = energy + rho**2 / S, logs + sp.log(S)
        goes_on, following = self._goes_on, self._following
        following |= {f"pair_z[{i}]": goes_on * e for i, e in enumerate(z)}
        following |= {f"pair_U[{j},{i}]": goes_on * e for j in K for i, e in enumerate(U[j])}
        following |= {
            f"pair_V[{i},{k}]": chosen(goes_on > sp.S.Half, V[i, k], prior[i, k]) for i, k in self._upper
        }
        self._b = [self._sum(f"b[{j}]", f"score of change {j}", added.pop((j,))) for j in K]
        self._J = {
            (j, k): self._sum(f"J[{j},{k}]", "information on changes", e) for (j, k), e in added.items()
        }
        self._energy = self._sum("energy", "sum of squares without a change", energy)
        text = "twice the log-likelihood of another explanation, over that of no change"
        said = write.define("pair_spread", energy + logs)
        self._rivals = [self._sum(f"rival[{r}]", text, e + said) for r, e in enumerate(rivals)]

    def _first_stage(self) -> tuple[sp.Matrix, sp.Matrix, list[sp.Matrix]]:
        """Return the estimate of d0, its covariance and its sensitivity to each change."""
        units, n = [s.unit for s in self._plant], len(self._plant)
        self._upper = [(i, k) for i in range(n) for k in range(i, n)]
        z = sp.Matrix([self._state(f"z[{i}]", "error at the alarm", u) for i, u in enumerate(units)])
        V = {
            (i, k): self._state(f"V[{i},{k}]", "its covariance", f"({units[i]})*({units[k]})")
            for i, k in self._upper
        }
        U = [
            sp.Matrix(
                [self._state(f"U[{j},{i}]", f"its sensitivity to change {j}", u) for i, u in enumerate(units)]
            )
            for j in range(len(self._which))
        ]
        return z, sp.Matrix(n, n, lambda i, k: V[min(i, k), max(i, k)]), U

    def _sum(self, name: str, text: str, more: sp.Expr) -> sp.Expr:
        value = self._write.define(f"pair_now_{name}", self._state(name, text) + more)
        self._following[f"pair_{name}"] = self._goes_on * value
        return value

    def told(self) -> Paired:
        """Write which two changes explain most, and whether they are told."""
        write, K = self._write, range(len(self._which))
        info = [write.define(f"pair_info[{j}]", sp.Max(self._J[j, j], 1e-300)) for j in K]
        size = [write.define(f"pair_size[{j}]", self._b[j] / info[j]) for j in K]
        alone = [write.define(f"pair_alone[{j}]", self._b[j] * size[j]) for j in K]
        share = [self._share(j) for j in K]
        evidence = self._evidence(info, size, alone, share)
        best = sp.Max(*(g for p, g in evidence.items() if p[1] < self._tested), evaluate=False)
        best = write.define("pair_best", best)
        at, both = self._best(evidence, best)
        i, t, h, f = (
            [self._of(at[r], f"pair_of_{key}[{r}]", values) for r in (0, 1)]
            for key, values in (("info", info), ("size", size), ("alone", alone), ("share", share))
        )
        rest, theta, beside = [], [], []
        for a, b in ((0, 1), (1, 0)):
            left = sp.Max(i[a] - both**2 / i[b], APART * i[a])
            rest.append(write.define(f"pair_rest[{a}]", left))
            theta.append(write.define(f"pair_theta[{a}]", (i[a] * t[a] - both * t[b]) / rest[a]))
            beside.append(write.define(f"pair_beside[{a}]", theta[a] ** 2 * rest[a]))
        parts = [beside[0] * f[0], beside[1] * f[1]]
        wide, swap = 1 / sp.Min(*f), write.define("pair_swap", h[1] * f[1] - h[0] * f[0]) > 0

        def ordered(name: str, a: sp.Expr, b: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
            first = write.define(f"{name}_first", chosen(swap, b, a))
            return first, write.define(f"{name}_second", chosen(swap, a, b))

        return Paired(
            tuple(self._own),
            self._following,
            *self._verdict(evidence, best, parts, h[0] + beside[1]),
            ordered("pair_number", at[0] + 1, at[1] + 1),
            ordered("pair_amplitude", *theta),
            ordered("pair_variance", wide / rest[0], wide / rest[1]),
        )

    def _best(self, evidence: dict[tuple[int, int], sp.Expr], best: sp.Expr) -> tuple[list[sp.Expr], sp.Expr]:
        """Write the numbers of the two candidates of most evidence, and their J_jk."""
        own = [p for p in evidence if p[1] < self._tested]

        def of_best(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
            pieces = [(v, evidence[p] >= best) for p, v in zip(own[:-1], values[:-1], strict=True)]
            return self._write.define(name, sp.Piecewise(*pieces, (values[-1], True), evaluate=False))

        at = [of_best(f"pair_at[{r}]", [sp.Integer(p[r]) for p in own]) for r in (0, 1)]
        return at, of_best("pair_both", [self._J[p] for p in own])

    def _of(self, number: sp.Expr, name: str, values: Sequence[sp.Expr]) -> sp.Expr:
        """Write the value of a candidate, by its number from 0."""
        *some, last = values[: self._tested]
        if all(v == last for v in some):
            return last
        pieces = [(v, number < j + 0.5) for j, v in enumerate(some)]
        return self._write.define(name, sp.Piecewise(*pieces, (last, True), evaluate=False))

    def _evidence(
        self,
        info: Sequence[sp.Expr],
        size: Sequence[sp.Expr],
        alone: Sequence[sp.Expr],
        share: Sequence[sp.Expr],
    ) -> dict[tuple[int, int], sp.Expr]:
        """Write G of each pair."""
        write, b, J, found = self._write, self._b, self._J, {}
        part = [
            write.define(f"pair_part[{j}]", e * s) for j, (e, s) in enumerate(zip(alone, share, strict=True))
        ]
        apart = [write.define(f"pair_apart[{j}]", APART * e) for j, e in enumerate(info)]
        for j, k in self._pairs:
            beside = sp.Max(info[k] - J[j, k] ** 2 / info[j], apart[k])
            q = write.define(f"pair_q[{j},{k}]", (b[k] - J[j, k] * size[j]) ** 2 / beside)
            G = part[j] + q * share[k]
            if share[j] != 1 or share[k] != 1:
                G = sp.Max(G, part[k] + (alone[j] + q - alone[k]) * share[j])
            found[j, k] = write.define(f"pair_g[{j},{k}]", G)
        return found

    def _verdict(
        self,
        evidence: dict[tuple[int, int], sp.Expr],
        best: sp.Expr,
        parts: Sequence[sp.Expr],
        explained: sp.Expr,
    ) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """Write whether two changes are likely, if they are the only ones, and if they are sought."""
        write, N = self._write, len(self._bank.whitened) * self._bank.age[0]
        unknown = [g for p, g in evidence.items() if p[1] >= self._tested]
        near = [
            chosen(g > best - self._decides, sp.S.One, sp.S.Zero)
            for p, g in evidence.items()
            if p[1] < self._tested
        ]
        least = write.define("pair_least", sp.Min(*parts, evaluate=False))
        others = write.define("pair_others", sum(near, sp.S.Zero))
        most = write.define("pair_unknown", sp.Max(sp.S.Zero, *unknown, evaluate=False))
        rival = write.define("pair_rival", sp.Max(*self._rivals, evaluate=False))
        left = write.define("pair_left", self._energy - explained - N - LEFT * sp.sqrt(2 * N))
        likely = sp.And(
            least > sp.Max(self._beyond, BENT**2 * best), best >= most, rival < best - self._beyond, left < 0
        )
        likely = write.define("pair_likely", chosen(likely, sp.S.One, sp.S.Zero))
        only = sp.And(others < sp.Float(1.5), most < best - self._decides)
        sought = write.define("pair_sought", self._rivals[-1] - self._rivals[0]) > self._decides
        return (
            likely,
            write.define("pair_only", chosen(only, likely, sp.S.Zero)),
            chosen(sought, sp.S.One, sp.S.Zero),
        )

    def _share(self, j: int) -> sp.Expr:
        """Write by what the evidence of a change is divided, beyond phi: its own dispersion, if larger."""
        own = self._bank.dispersion[self._which[j]]
        if own == self._phi:
            return sp.S.One
        return self._write.define(f"pair_share[{j}]", sp.Min(1, self._phi / own))
