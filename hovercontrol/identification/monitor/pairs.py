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

- each explains more than ``D + 2 ln M`` beside the other one;
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
        return Paired((), {}, *[sp.S.Zero] * 3, none, none, none)
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
        write, n, K = self._write, len(self._plant), range(len(self._which))
        units, text = [s.unit for s in self._plant], "error at the alarm without a change"
        z = sp.Matrix([self._state(f"z[{i}]", text, u) for i, u in enumerate(units)])
        upper = [(i, k) for i in range(n) for k in range(i, n)]
        V = {
            (i, k): self._state(f"V[{i},{k}]", "its covariance", f"({units[i]})*({units[k]})")
            for i, k in upper
        }
        V = sp.Matrix(n, n, lambda i, k: V[min(i, k), max(i, k)])
        text = "its sensitivity to change {}"
        U = [
            sp.Matrix([self._state(f"U[{j},{i}]", text.format(j), u) for i, u in enumerate(units)]) for j in K
        ]
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
            V = write.symmetric(f"pair_{i}_V", n, {(a, b): V[a, b] - gain[a] * Vr[b] for a, b in upper})
            U = [write.matrix(f"pair_{i}_U{j}", U[j] + gain * zeta[j]) for j in K]
            over = [write.define(f"pair_{i}_over[{j}]", zeta[j] / S) for j in K]
            for key in added:
                added[key] += over[key[0]] * (zeta[key[1]] if len(key) == 2 else rho)
            energy, logs = energy + rho**2 / S, logs + sp.log(S)
        for i in range(n):
            self._following[f"pair_z[{i}]"] = self._goes_on * z[i]
            self._following.update({f"pair_U[{j},{i}]": self._goes_on * U[j][i] for j in K})
        for i, k in upper:
            self._following[f"pair_V[{i},{k}]"] = chosen(self._goes_on > sp.S.Half, V[i, k], prior[i, k])
        self._b = [self._sum(f"b[{j}]", f"score of change {j}", added[j,]) for j in K]
        self._J = {
            key: self._sum(f"J[{key[0]},{key[1]}]", "information on changes", more)
            for key, more in added.items()
            if len(key) == 2
        }
        self._energy = self._sum("energy", "sum of squares without a change", energy)
        text = "twice the log-likelihood of another explanation, over that of no change"
        said = write.define("pair_spread", energy + logs)
        self._rivals = [self._sum(f"rival[{r}]", text, e + said) for r, e in enumerate(rivals)]

    def _sum(self, name: str, text: str, more: sp.Expr) -> sp.Expr:
        value = self._write.define(f"pair_now_{name}", self._state(name, text) + more)
        self._following[f"pair_{name}"] = self._goes_on * value
        return value

    def told(self) -> Paired:
        """Write which two changes explain most, and whether they are told."""
        write, b, J, K = self._write, self._b, self._J, range(len(self._which))
        info = [write.define(f"pair_info[{j}]", sp.Max(J[j, j], 1e-300)) for j in K]
        size = [write.define(f"pair_size[{j}]", b[j] / info[j]) for j in K]
        alone = [write.define(f"pair_alone[{j}]", b[j] * size[j]) for j in K]
        share = [self._share(j) for j in K]
        part = [write.define(f"pair_part[{j}]", alone[j] * share[j]) for j in K]
        apart = [write.define(f"pair_apart[{j}]", APART * info[j]) for j in K]
        evidence = []
        for j, k in self._pairs:
            beside = sp.Max(info[k] - J[j, k] ** 2 / info[j], apart[k])
            q = write.define(f"pair_q[{j},{k}]", (b[k] - J[j, k] * size[j]) ** 2 / beside)
            G = part[j] + q * share[k]
            if share[j] != 1 or share[k] != 1:
                G = sp.Max(G, part[k] + (alone[j] + q - alone[k]) * share[j])
            evidence.append(write.define(f"pair_g[{j},{k}]", G))
        own = [g for p, g in zip(self._pairs, evidence, strict=True) if p[1] < self._tested]
        pairs = [p for p in self._pairs if p[1] < self._tested]
        unknown = [g for p, g in zip(self._pairs, evidence, strict=True) if p[1] >= self._tested]
        best = write.define("pair_best", sp.Max(*own, evaluate=False))
        near = [chosen(g > best - self._decides, sp.S.One, sp.S.Zero) for g in own]
        most = write.define("pair_unknown", sp.Max(sp.S.Zero, *unknown, evaluate=False))
        tops = [g >= best for g in own]

        def of_best(name: str, values: Sequence[sp.Expr]) -> sp.Expr:
            pieces = list(zip(values[:-1], tops[:-1], strict=True))
            return write.define(name, sp.Piecewise(*pieces, (values[-1], True), evaluate=False))

        at = [of_best(f"pair_at[{r}]", [sp.Integer(p[r]) for p in pairs]) for r in (0, 1)]
        both = of_best("pair_both", [J[p] for p in pairs])

        def of_one(name: str, r: int, values: Sequence[sp.Expr]) -> sp.Expr:
            pieces = [(v, at[r] < j + 0.5) for j, v in enumerate(values[: self._tested - 1])]
            last = values[self._tested - 1]
            if all(v == last for v in values):
                return last
            return write.define(f"{name}[{r}]", sp.Piecewise(*pieces, (last, True), evaluate=False))

        i, t, h, f = (
            [of_one(f"pair_of_{key}", r, values) for r in (0, 1)]
            for key, values in (("info", info), ("size", size), ("alone", alone), ("share", share))
        )
        rest = [
            write.define(f"pair_rest[{r}]", sp.Max(i[r] - both**2 / i[1 - r], APART * i[r])) for r in (0, 1)
        ]
        theta = [write.define(f"pair_theta[{r}]", (i[r] * t[r] - both * t[1 - r]) / rest[r]) for r in (0, 1)]
        beside = [write.define(f"pair_beside[{r}]", theta[r] ** 2 * rest[r]) for r in (0, 1)]
        wide = 1 / sp.Min(*f)
        N = len(self._bank.whitened) * self._bank.age[0]
        least = sp.Min(*(e * s for e, s in zip(beside, f, strict=True)), evaluate=False)
        least = write.define("pair_least_part", least)
        others = write.define("pair_others", sum(near, sp.S.Zero))
        rival = write.define("pair_rival", sp.Max(*self._rivals, evaluate=False))
        left = write.define("pair_left", self._energy - h[0] - beside[1] - N - LEFT * sp.sqrt(2 * N))
        likely = sp.And(least > self._beyond, best >= most, rival < best - self._beyond, left < 0)
        likely = write.define("pair_likely", chosen(likely, sp.S.One, sp.S.Zero))
        only = sp.And(others < sp.Float(1.5), most < best - self._decides)
        sought = write.define("pair_sought", self._rivals[-1] - self._rivals[0]) > self._decides
        swap = write.define("pair_swap", h[1] * f[1] - h[0] * f[0]) > 0

        def ordered(name: str, pair: Sequence[sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
            first, second = pair
            return (
                write.define(f"{name}_first", chosen(swap, second, first)),
                write.define(f"{name}_second", chosen(swap, first, second)),
            )

        return Paired(
            tuple(self._own),
            self._following,
            likely,
            write.define(
                "pair_only",
                chosen(sp.And(others < sp.Float(1.5), most < best - self._decides), likely, sp.S.Zero),
            ),
            chosen(sought, sp.S.One, sp.S.Zero),
            ordered("pair_number", [a + 1 for a in at]),
            ordered("pair_amplitude", theta),
            ordered("pair_variance", [wide / r for r in rest]),
        )

    def _share(self, j: int) -> sp.Expr:
        """Write by what the evidence of a change is divided, beyond phi: its own dispersion, if larger."""
        own = self._bank.dispersion[self._which[j]]
        if own == self._phi:
            return sp.S.One
        return self._write.define(f"pair_share[{j}]", sp.Min(1, self._phi / own))
