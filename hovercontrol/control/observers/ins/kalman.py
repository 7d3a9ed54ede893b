"""A discrete Kalman filter written as equations of a sampled Block.

The system is [K06 eq 3.11, 3.12], with measurements [K06 eq 3.13, 3.14]. One tick computes::

    x <- F x,  P <- F P F^T + Q                               time update [K06 eq 3.19]
    S = H P H^T + R,  K = P H^T / S,  x <- x + K (z - H x)    measurement update
    P <- (I - K H) P (I - K H)^T + K R K^T                    [K06 eq 3.15, 3.16, 3.17], Joseph's form

An extended filter replaces F x and H x by nonlinear functions, and F and H by their Jacobians. Scalar
measurements are processed one after the other, so S is a number and no matrix is inverted. Joseph's form
keeps P positive for any gain K. Only the upper triangle of P is computed, so P is symmetric by construction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.signals import Signal


@dataclass(frozen=True)
class Estimate:
    """An estimate at one stage of a tick: the values x and their symmetric covariance P, as expressions."""

    x: sp.Matrix
    P: sp.Matrix


@dataclass(frozen=True)
class Correction:
    """What the update by one scalar measurement computes, as expressions.

    Attributes
    ----------
    H : sympy.Matrix, shape (1, n)
        Derivative of the measured number with respect to the values.
    K : sympy.Matrix, shape (n, 1)
        Gain; zero without a measurement.
    innovation, variance, share : sympy.Expr
        Innovation, its variance S, and 1/S; innovation and share are zero without a measurement.
    estimate : Estimate
        After the update.
    """

    H: sp.Matrix
    K: sp.Matrix
    innovation: sp.Expr
    variance: sp.Expr
    share: sp.Expr
    estimate: Estimate


def chosen(condition: sp.Expr, value: sp.Expr, other: sp.Expr) -> sp.Expr:
    """Return `value` where a condition holds, else `other`; SymPy does not look for a simpler form."""
    return sp.Piecewise((value, condition), (other, True), evaluate=False)


class Equations:
    """Collect the named intermediate expressions (definitions) of a Block.

    Attributes
    ----------
    definitions : dict of str to sympy.Expr
    """

    def __init__(self) -> None:
        self.definitions: dict[str, sp.Expr] = {}

    def define(self, name: str, e: sp.Expr) -> sp.Expr:
        """Name an expression and return the symbol of that name; return a symbol or a number unchanged."""
        e = sp.sympify(e)
        if e.is_Atom:
            return e
        self.definitions[name] = e
        return sp.Symbol(name, real=True)

    def matrix(self, name: str, m: sp.Matrix) -> sp.Matrix:
        """Name the entries of a matrix ``name[i,j]``, or those of a column ``name[i]``."""
        if m.cols == 1:
            return sp.Matrix(m.rows, 1, lambda i, _: self.define(f"{name}[{i}]", m[i]))
        return sp.Matrix(*m.shape, lambda i, j: self.define(f"{name}[{i},{j}]", m[i, j]))

    def symmetric(self, name: str, size: int, entry: Mapping[tuple[int, int], sp.Expr]) -> sp.Matrix:
        """Name the upper triangle of a symmetric matrix."""
        upper = {(i, j): self.define(f"{name}[{i},{j}]", e) for (i, j), e in entry.items()}
        return sp.Matrix(size, size, lambda i, j: upper[min(i, j), max(i, j)])

    def predict(self, name: str, x: sp.Matrix, F: sp.Matrix, P: sp.Matrix, noise: sp.Matrix) -> Estimate:
        """Add the time update [K06 eq 3.19]: P becomes F P F^T + noise.

        Parameters
        ----------
        name : str
            Prefix of the names of the predicted values and of their covariance.
        x : sympy.Matrix, shape (n, 1)
            The predicted values.
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
    ) -> Correction:
        """Add the update by one scalar measurement; without a measurement the estimate does not change.

        [K06 eq 3.15, 3.16, 3.17]

        The innovation is defined as ``NAME_innovation`` (zero without a measurement) and its variance as
        ``NAME_innovation_variance``.

        Parameters
        ----------
        name : str
            Name of the aid.
        H : sympy.Matrix, shape (1, n)
            Derivative of the measured number with respect to the values.
        innovation, R : sympy.Expr
            Measured minus expected value, and the variance of the measurement noise.
        valid : sympy.Symbol
            1 at a tick with a measurement.
        considered : mapping of int to sympy.Expr, optional
            Factors on the gains of some values. With a factor of 0 the measurement changes neither the value
            nor its variance, but the uncertainty of the value still enters all other updates
            (Schmidt-Kalman filter).

        Returns
        -------
        Correction
        """
        # S = H P H^T + R,  K_i = a_i (P H^T)_i / S with the factors a_i = considered[i] (1 if not given),
        # x+ = x + K nu.  Joseph's form, expanded with kept = (I - K H) P and rest = kept H^T:
        # P+ = (I - K H) P (I - K H)^T + K R K^T = kept + (K R - rest) K^T.
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
        return Correction(H, K, seen, S, share, Estimate(x, self.symmetric(f"{name}_P", n, entries)))


@dataclass(frozen=True)
class Memory:
    """The states that store a sampled filter's estimate between ticks.

    Attributes
    ----------
    values, covariance : tuple of Signal
        ``last_X[i]`` and the upper triangle of ``last_P[i,j]``.
    estimate : Estimate
        The estimate of the last tick, in the symbols of these states.
    """

    values: tuple[Signal, ...]
    covariance: tuple[Signal, ...]
    estimate: Estimate

    @property
    def states(self) -> tuple[Signal, ...]:
        """The values, followed by the upper triangle of the covariance."""
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
        """Return the next value of each state, by name."""
        n = new.P.rows
        upper = [new.P[i, j] for i in range(n) for j in range(i, n)]
        return {s.name: e for s, e in zip(self.states, [*new.x, *upper], strict=True)}

    def output_values(self, new: Estimate) -> dict[str, sp.Expr]:
        """Return the expression of each covariance output, by name."""
        new_values = self.next_values(new)
        return {s.name.removeprefix("last_"): new_values[s.name] for s in self.covariance}


def remember(x: str, P: str, quantities: Sequence[Signal], variances: Sequence[float]) -> Memory:
    """Return the states that store an estimate.

    Parameters
    ----------
    x, P : str
        Prefixes of the state names, such as ``xhat`` and ``P``.
    quantities : sequence of Signal
        The estimated quantities.
    variances : sequence of float
        Their initial variances.
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
    """Return an angle wrapped to the interval from -pi to pi."""
    return angle - 2 * sp.pi * sp.floor((angle + sp.pi) / (2 * sp.pi))
