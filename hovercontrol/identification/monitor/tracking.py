r"""Explanations whose size wanders, beside which the monitor's estimate of the named change is judged.

An explanation of r causes with the sizes a, that of a cause p changing the error of the prediction by g_p in
a tick and the innovations by b_p, has the state (d, a): d is the error of the prediction. With C, M and the
innovations e, of variance phi, as in :mod:`.bank`,

    e_i = C_i d + b_i a + n_i,   d <- M d + g a + known,   a <- a + w,   w ~ N(0, q),

and a Kalman filter gives the likelihood of each sample given those before, of variance S:

    2 ln p = -rho^2/S - ln S,   rho = e_i - C_i d - b_i a.

Such likelihoods pay for what they leave free, so that explanations with more causes, or with a size that
wanders, are compared fairly with the one that has a constant size. If one of two explanations is right, the
likelihood ratio of the other one to it ever exceeds 1/error with a probability of `error` at most (Ville).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.kalman import Equations, chosen
from hovercontrol.identification.monitor.bank import Bank


@dataclass(frozen=True)
class Tracked:
    """An explanation whose sizes wander.

    Attributes
    ----------
    states : tuple of Signal
    next_values : dict of str to sympy.Expr
    likelihood : sympy.Expr
        Twice the logarithm of the likelihood of this tick's samples.
    x, P : sympy.Matrix, shape (n + r, 1) and (n + r, n + r)
        d and a before the next tick, and their covariance.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    likelihood: sp.Expr
    x: sp.Matrix
    P: sp.Matrix


def track(
    write: Equations,
    name: str,
    plant: Sequence[Signal],
    bank: Bank,
    M: sp.Matrix,
    pushes: sp.Matrix,
    jolts: sp.Matrix,
    known: sp.Matrix,
    phi: sp.Expr,
    walk: Sequence[sp.Expr],
    begins: sp.Expr,
    first: sp.Matrix,
    spread: sp.Matrix,
) -> Tracked:
    """Write an explanation.

    Parameters
    ----------
    plant : sequence of Signal
        States of the filter.
    bank : Bank
        Of which C and e are used.
    M : sympy.Matrix, shape (n, n)
    pushes, jolts : sympy.Matrix, shape (n, r) and (m, r)
        g and b.
    known : sympy.Matrix, shape (n, 1)
        What the error changes by besides.
    phi : sympy.Expr
        Dispersion.
    walk : sequence of sympy.Expr
        q of each size.
    begins : sympy.Expr
        1 where it begins: with `first`, of the covariance `spread`.
    """
    n, r = pushes.shape
    units = [*(s.unit for s in plant), *["1"] * r]
    own = [Signal(f"{name}[{i}]", u, "error, then sizes") for i, u in enumerate(units)]
    upper = [(i, k) for i in range(n + r) for k in range(i, n + r)]
    cov = {
        (i, k): Signal(f"{name}_P[{i},{k}]", f"({units[i]})*({units[k]})", "their covariance")
        for i, k in upper
    }
    x = sp.Matrix([s.symbol for s in own])
    P = sp.Matrix(n + r, n + r, lambda i, k: cov[min(i, k), max(i, k)].symbol)
    likelihood = sp.S.Zero
    for i, e in enumerate(bank.whitened):
        row = sp.Matrix([[*bank.C[i, :], *jolts[i, :]]])
        Pr = write.matrix(f"{name}_{i}_Pr", P * row.T)
        S = write.define(f"{name}_{i}_S", phi + (row * Pr)[0])
        away = write.define(f"{name}_{i}_away", (e - (row * x)[0]) / S)
        likelihood -= away**2 * S + sp.log(S)
        x = write.matrix(f"{name}_{i}_x", x + Pr * away)
        P = write.symmetric(f"{name}_{i}_P", n + r, {(a, b): P[a, b] - Pr[a] * Pr[b] / S for a, b in upper})
    F = sp.Matrix(sp.BlockMatrix([[M, pushes], [sp.zeros(r, n), sp.eye(r)]]))
    then = write.matrix(f"{name}_next", F * x + sp.Matrix([*known, *[0] * r]))
    FP = write.matrix(f"{name}_FP", F * P)
    entries = {(i, k): (FP[i, :] * F[k, :].T)[0] for i, k in upper}
    for p, q in enumerate(walk):
        entries[n + p, n + p] += q
    after = write.symmetric(f"{name}_P_next", n + r, entries)
    start = begins > sp.S.Half
    following = {s.name: chosen(start, first[i], then[i]) for i, s in enumerate(own)}
    following |= {s.name: chosen(start, spread[i, k], after[i, k]) for (i, k), s in cov.items()}
    told = write.define(f"{name}_likelihood", likelihood)
    return Tracked((*own, *cov.values()), following, told, then, after)
