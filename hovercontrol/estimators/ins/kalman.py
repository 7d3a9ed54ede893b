"""A discrete Kalman filter as equations of a sampled Block: what each update adds to its definitions.

Of the system [K06 eq 3.11, 3.12] with measurements [K06 eq 3.13, 3.14].

Only the upper triangle of a covariance is computed, so that it is symmetric by construction. Measurements
are taken one by one, numbers rather than vectors, so that nothing is inverted, in Joseph's form
``(I - K H) P (I - K H)^T + K R K^T``, which stays positive for any gain K.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.core.signals import Signal


@dataclass(frozen=True)
class Estimate:
    """An estimate at some point of a tick: the values and the covariance (symmetric) as expressions."""

    x: sp.Matrix
    P: sp.Matrix


class Equations:
    """The definitions of a Block while it is being written.

    Attributes
    ----------
    definitions : dict of str to sympy.Expr
    """

    def __init__(self) -> None:
        self.definitions: dict[str, sp.Expr] = {}

    def define(self, name: str, e: sp.Expr) -> sp.Expr:
        """Give an expression a name and return the name's symbol; what is a plain symbol needs none."""
        e = sp.sympify(e)
        if e.is_Atom:
            return e
        self.definitions[name] = e
        return sp.Symbol(name, real=True)

    def matrix(self, name: str, m: sp.Matrix) -> sp.Matrix:
        """Name the entries of a matrix ``name[i,j]``, those of a column ``name[i]``."""
        if m.cols == 1:
            return sp.Matrix(m.rows, 1, lambda i, _: self.define(f"{name}[{i}]", m[i]))
        return sp.Matrix(*m.shape, lambda i, j: self.define(f"{name}[{i},{j}]", m[i, j]))

    def symmetric(self, name: str, size: int, entry: Mapping[tuple[int, int], sp.Expr]) -> sp.Matrix:
        """Name the upper triangle of a symmetric matrix."""
        upper = {(i, j): self.define(f"{name}[{i},{j}]", e) for (i, j), e in entry.items()}
        return sp.Matrix(size, size, lambda i, j: upper[min(i, j), max(i, j)])

    def predict(self, name: str, x: sp.Matrix, F: sp.Matrix, P: sp.Matrix, noise: sp.Matrix) -> Estimate:
        """Write the time update [K06 eq 3.19]: P becomes F P F^T + noise.

        Parameters
        ----------
        name : str
            First part of the names of the values and their covariance.
        x : sympy.Matrix, shape (n, 1)
            What the values become.
        F, P, noise : sympy.Matrix, shape (n, n)
        """
        n, F = P.rows, self.matrix("F", F)
        FP = self.matrix("FP", F * P)
        entries = {
            (i, j): sum(FP[i, k] * F[j, k] for k in range(n)) + noise[i, j]
            for i in range(n)
            for j in range(i, n)
        }
        return Estimate(self.matrix(f"{name}_x", x), self.symmetric(f"{name}_P", n, entries))

    def correct(
        self,
        name: str,
        estimate: Estimate,
        H: sp.Matrix,
        innovation: sp.Expr,
        R: sp.Expr,
        valid: sp.Symbol,
        *,
        considered: Mapping[int, sp.Expr] | None = None,
    ) -> Estimate:
        """Write the measurement update of one number; at a tick without it nothing changes.

        [K06 eq 3.15, 3.16, 3.17]

        Its innovation, zero without a measurement, is defined as ``NAME_innovation``, the variance thereof as
        ``NAME_innovation_variance``.

        Parameters
        ----------
        name : str
            Of the aid.
        estimate : Estimate
        H : sympy.Matrix, shape (1, n)
            Derivative of the measured number by the values.
        innovation, R : sympy.Expr
            Measured less expected; its variance if the values were exact.
        valid : sympy.Symbol
            1 at a tick with a measurement.
        considered : mapping of int to sympy.Expr, optional
            Factors of the gains of some values: where it is 0 the measurement does not change the value nor
            its variance, but its uncertainty is still considered in all others (Schmidt).
        """
        P, n = estimate.P, estimate.P.rows
        H = self.matrix(f"{name}_H", H.T).T
        HP = self.matrix(f"{name}_HP", (H * P).T)
        S = self.define(f"{name}_innovation_variance", (H * HP)[0] + R)
        seen = sp.Symbol(f"{name}_innovation", real=True)
        self.definitions[seen.name] = sp.Piecewise((innovation, valid > sp.S.Half), (0, True))
        share = self.define(f"{name}_share", sp.Piecewise((1 / S, valid > sp.S.Half), (0, True)))
        factors = considered or {}
        K = self.matrix(f"{name}_K", sp.Matrix([HP[i] * share * factors.get(i, 1) for i in range(n)]))
        used = [j for j in range(n) if H[j] != 0]
        kept = {
            (i, j): self.define(f"{name}_kept[{i},{j}]", P[i, j] - K[i] * HP[j])
            for i in range(n)
            for j in range(n)
            if j >= i or j in used
        }
        rest = [self.define(f"{name}_rest[{i}]", sum(kept[i, j] * H[j] for j in used)) for i in range(n)]
        entries = {(i, j): kept[i, j] + (K[i] * R - rest[i]) * K[j] for i in range(n) for j in range(i, n)}
        x = self.matrix(f"{name}_x", estimate.x + K * seen)
        return Estimate(x, self.symmetric(f"{name}_P", n, entries))


@dataclass(frozen=True)
class Memory:
    """The states in which a sampled filter keeps its estimate from tick to tick.

    Attributes
    ----------
    values, covariance : tuple of Signal
        ``last_X[i]`` and the upper triangle of ``last_P[i,j]``.
    estimate : Estimate
        Made of their symbols.
    """

    values: tuple[Signal, ...]
    covariance: tuple[Signal, ...]
    estimate: Estimate

    @property
    def states(self) -> tuple[Signal, ...]:
        """Values, then the covariance."""
        return (*self.values, *self.covariance)

    def outputs(self) -> tuple[Signal, ...]:
        """Return the covariance as outputs ``P[i,j]``."""
        return tuple(
            s.replace(
                name=s.name.removeprefix("last_"), description=s.description.removesuffix(" of the last tick")
            )
            for s in self.covariance
        )

    def next_values(self, new: Estimate) -> dict[str, sp.Expr]:
        """Return what the states become."""
        n = new.P.rows
        upper = [new.P[i, j] for i in range(n) for j in range(i, n)]
        return {s.name: e for s, e in zip(self.states, [*new.x, *upper], strict=True)}

    def output_values(self, new: Estimate) -> dict[str, sp.Expr]:
        """Return what the outputs are."""
        new_values = self.next_values(new)
        return {s.name.removeprefix("last_"): new_values[s.name] for s in self.covariance}


def remember(x: str, P: str, quantities: Sequence[Signal], variances: Sequence[float]) -> Memory:
    """Return the states for an estimate.

    Parameters
    ----------
    x, P : str
        First part of the names, ``xhat`` and ``P``.
    quantities : sequence of Signal
        What is estimated.
    variances : sequence of float
        At the start.
    """
    n = len(quantities)
    values = tuple(
        s.replace(name=f"last_{x}[{i}]", description=f"estimate of {s.description} of the last tick")
        for i, s in enumerate(quantities)
    )
    covariance = {
        (i, j): Signal(
            f"last_{P}[{i},{j}]",
            f"({quantities[i].unit})*({quantities[j].unit})",
            f"covariance of the errors of {quantities[i].name} and {quantities[j].name} of the last tick",
            start=variances[i] if i == j else 0.0,
        )
        for i in range(n)
        for j in range(i, n)
    }
    matrix = sp.Matrix(n, n, lambda i, j: covariance[min(i, j), max(i, j)].symbol)
    return Memory(values, tuple(covariance.values()), Estimate(sp.Matrix([s.symbol for s in values]), matrix))


def variance_parameters(name: str, units: Sequence[str], values: Sequence[float]) -> tuple[Signal, ...]:
    """Return the diagonal of a covariance as parameters ``NAME[i,i]``."""
    return tuple(
        Signal(f"{name}[{i},{i}]", f"({unit})^2", "variance of noise", start=value, lower=0.0)
        for i, (unit, value) in enumerate(zip(units, values, strict=True))
    )


def wrapped(angle: sp.Expr) -> sp.Expr:
    """Return an angle less whole turns, from -pi to pi."""
    return angle - 2 * sp.pi * sp.floor((angle + sp.pi) / (2 * sp.pi))
