"""One step of a Block in time as equations: its state, its transition matrix and the noise that it collects.

Written for estimators that predict inside a tick: a classical Runge-Kutta step of

    x' = f(x, u, t) + w,    E[w(t) w(s)'] = Q delta(t - s),    u held,

of the transition matrix ``Phi' = F Phi``, with the exact Jacobian ``F = df/dx`` at the same four stages, and
Simpson's rule for the covariance of the noise,

    P(t + h) = Phi (P + h/6 Q) Phi' + 4 h/6 Phi_2 Q Phi_2' + h/6 Q,

where Phi is the transition from t and Phi_2 that from t + h/2, both to t + h. Each term is positive
semidefinite, whatever h is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp

from hovercontrol.core.block import Block
from hovercontrol.core.derivatives import needed_definitions, partial_derivatives
from hovercontrol.core.functions import numpy_functions
from hovercontrol.core.signals import time
from hovercontrol.errors import InputError, shown
from hovercontrol.estimators.ins.kalman import Equations, Estimate

#: A step is at most this long in units of the plant's shortest time constant: Runge-Kutta's is stable up to
#: 2.78. At 2 it leaves a third of what decays within it, where exp(-2) is 0.14.
LONGEST = 2.0

#: Most steps from tick to tick: each adds some two thousand operations to the filter of a craft.
MOST_STEPS = 32


@dataclass(frozen=True)
class Dynamics:
    """The derivatives of a continuous Block and their exact Jacobian, to be written at any point.

    Parameters
    ----------
    block : Block
    """

    block: Block

    @cached_property
    def _jacobian(self) -> dict[tuple[int, int], sp.Expr]:
        return partial_derivatives(self.block, "derivatives", [s.name for s in self.block.states])

    def at(
        self, write: Equations, name: str, x: Sequence[sp.Expr], when: sp.Expr, *, jacobian: bool = True
    ) -> tuple[sp.Matrix, sp.Matrix]:
        """Return f and F at a point.

        Parameters
        ----------
        write : Equations
            Where intermediate quantities are defined, under names that begin with `name`.
        name : str
        x : sequence of sympy.Expr
            The states.
        when : sympy.Expr
            Time [s].
        jacobian : bool, optional
            Whether F is wanted; it is empty otherwise.
        """
        rates = list(self.block.derivatives.values())
        entries = self._jacobian if jacobian else {}
        swap = written_at(self.block, write, name, x, when, [*rates, *entries.values()])
        f = write.matrix(f"{name}_rate", sp.Matrix([e.xreplace(swap) for e in rates]))
        n = len(rates)
        F = sp.Matrix(n, n, lambda i, j: entries.get((i, j), sp.S.Zero).xreplace(swap))
        return f, write.matrix(f"{name}_F", F) if jacobian else sp.zeros(0, 0)


def written_at(
    block: Block,
    write: Equations,
    name: str,
    x: Sequence[sp.Expr],
    when: sp.Expr,
    wanted: Sequence[sp.Expr],
) -> dict[sp.Expr, sp.Expr]:
    """Define what some expressions of a Block need at a point; return what to put for its symbols.

    Parameters
    ----------
    block : Block
    write : Equations
    name : str
        First part of the definitions' names.
    x : sequence of sympy.Expr
        The states.
    when : sympy.Expr
        Time [s].
    wanted : sequence of sympy.Expr
    """
    swap: dict[sp.Expr, sp.Expr] = {s.symbol: e for s, e in zip(block.states, x, strict=True)}
    swap[time] = when
    for key in needed_definitions(block, wanted):
        swap[sp.Symbol(key, real=True)] = write.define(f"{name}_{key}", block.definitions[key].xreplace(swap))
    return swap


@dataclass(frozen=True)
class Step:
    """A Runge-Kutta step of the state: where it leads and the Jacobians at its four stages."""

    x: sp.Matrix
    F: tuple[sp.Matrix, ...]


def runge_kutta(
    dynamics: Dynamics,
    write: Equations,
    name: str,
    x: sp.Matrix,
    when: sp.Expr,
    h: sp.Expr,
    *,
    jacobian: bool = True,
) -> Step:
    """Write one classical Runge-Kutta step of the state.

    Parameters
    ----------
    dynamics : Dynamics
    write : Equations
    name : str
        First part of the definitions' names.
    x : sympy.Matrix, shape (n, 1)
    when, h : sympy.Expr
        Where it begins and how long it is [s].
    jacobian : bool, optional
        Whether the Jacobians at the stages are wanted.
    """
    rates: list[sp.Matrix] = []
    matrices: list[sp.Matrix] = []
    for k, part in enumerate((sp.S.Zero, sp.S.Half, sp.S.Half, sp.S.One)):
        point = x + part * h * rates[-1] if k else x
        stage = f"{name}_{k + 1}"
        values = write.matrix(f"{stage}_x", point)
        f, F = dynamics.at(write, stage, list(values), when + part * h, jacobian=jacobian)
        rates.append(f)
        matrices.append(F)
    k1, k2, k3, k4 = rates
    return Step(write.matrix(f"{name}_x", x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)), tuple(matrices))


def transition(write: Equations, name: str, F: Sequence[sp.Matrix], h: sp.Expr) -> sp.Matrix:
    """Write the transition matrix of a step from the Jacobians at its stages: ``Phi' = F Phi``."""
    one = sp.eye(F[0].rows)
    slopes: list[sp.Matrix] = []
    for k, part in enumerate((sp.S.Zero, sp.S.Half, sp.S.Half, sp.S.One)):
        inner = one + part * h * slopes[-1] if k else one
        slopes.append(write.matrix(f"{name}_{k + 1}_slope", F[k] * inner))
    k1, k2, k3, k4 = slopes
    return write.matrix(f"{name}_Phi", one + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


def middle_columns(
    write: Equations, name: str, F: Sequence[sp.Matrix], h: sp.Expr, wanted: Sequence[int]
) -> dict[int, sp.Matrix]:
    """Write some columns of the transition matrix from the middle of a step to its end.

    A Runge-Kutta step of h/2; between its ends F is the mean of both.
    """
    middle, end = F[2], F[3]
    mean = write.matrix(f"{name}_mean_F", (middle + end) / 2) if middle != end else end
    stages, half = (middle, mean, mean, end), h / 2
    columns = {}
    for j in wanted:
        start = sp.eye(end.rows)[:, j]
        slopes: list[sp.Matrix] = []
        for k, part in enumerate((sp.S.Zero, sp.S.Half, sp.S.Half, sp.S.One)):
            inner = start + part * half * slopes[-1] if k else start
            # Entries keep their column in the name: units differ from column to column.
            slopes.append(write.matrix(f"{name}_middle_{j}_{k + 1}", stages[k] * inner))
        k1, k2, k3, k4 = slopes
        columns[j] = write.matrix(f"{name}_middle_{j}", start + half / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return columns


def collected(
    P: sp.Matrix, columns: Mapping[int, sp.Matrix], Q: Mapping[int, sp.Expr], h: sp.Expr
) -> sp.Matrix:
    """Return a covariance with the noise of the middle and the end of a step [Simpson's rule]."""

    def entry(i: int, j: int) -> sp.Expr:
        middle = sum(q * columns[k][i] * columns[k][j] for k, q in Q.items())
        return P[i, j] + 4 * h / 6 * middle + (h / 6 * Q[i] if i == j and i in Q else 0)

    return sp.Matrix(*P.shape, entry)


def predict(
    dynamics: Dynamics,
    write: Equations,
    name: str,
    estimate: Estimate,
    Q: Mapping[int, sp.Expr],
    when: sp.Expr,
    h: sp.Expr,
) -> Estimate:
    """Write the state and its covariance one step later.

    Parameters
    ----------
    dynamics : Dynamics
    write : Equations
    name : str
        First part of the definitions' names, for this step alone.
    estimate : Estimate
    Q : mapping of int to sympy.Expr
        Intensity of the noise of each state that has some.
    when, h : sympy.Expr
        Where the step begins and how long it is [s].
    """
    n = estimate.P.rows
    step = runge_kutta(dynamics, write, name, estimate.x, when, h)
    Phi = transition(write, name, step.F, h)
    begin = write.symmetric(
        f"{name}_begin",
        n,
        {
            (i, j): estimate.P[i, j] + (h / 6 * Q[i] if i == j and i in Q else 0)
            for i in range(n)
            for j in range(i, n)
        },
    )
    half = write.matrix(f"{name}_half", Phi * begin)
    moved = sp.Matrix(n, n, lambda i, j: sum(half[i, k] * Phi[j, k] for k in range(n)))
    whole = collected(moved, middle_columns(write, name, step.F, h, list(Q)), Q, h)
    upper = {(i, j): whole[i, j] for i in range(n) for j in range(i, n)}
    return Estimate(step.x, write.symmetric(f"{name}_P", n, upper))


def steps_between(plant: Block, period: float, name: str, given: int | None = None) -> int:
    """Return how many Runge-Kutta steps go from tick to tick.

    Parameters
    ----------
    plant : Block
    period : float
        [s]
    name : str
        Of the estimator: for the error.
    given : int, optional
        What the user asks for; otherwise the fastest mode decides, at the plant's start values or with all
        states at zero, where dry friction is stiffest.

    Raises
    ------
    InputError
        If the user asks for less than one or too many, or the plant is too fast for the period.
    """
    if given is not None:
        if not 1 <= given <= MOST_STEPS:
            raise InputError(f"{name}: substeps: expected 1 to {MOST_STEPS}, found {shown(given)}")
        return given
    f, u = numpy_functions(plant), [s.start for s in plant.inputs]
    start = [s.start for s in plant.states]
    fastest = 0.0
    for x in (start, [0.0] * len(start)):
        F = f.jacobian(0.0, x, u)
        if np.isfinite(F).all():
            fastest = max(fastest, float(np.abs(np.linalg.eigvals(F)).max()))
        elif x is start:
            raise InputError(f"{name}: the plant's Jacobian is not finite at its start values: give others")
    needed = max(1, int(np.ceil(period * fastest / LONGEST)))
    if needed > MOST_STEPS:
        raise InputError(
            f"{name}: the plant's fastest mode, {fastest:.3g} 1/s at its start values or at rest, takes "
            f"{needed} steps in a period of {period:g} s: shorten the period, or give substeps={MOST_STEPS}"
        )
    return needed
