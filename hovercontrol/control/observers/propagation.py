"""One time step of a Block as equations: its state, its transition matrix and the accumulated noise.

Estimators use it to predict from tick to tick. A classical Runge-Kutta step integrates the state,

    x' = f(x, u, t) + w,    E[w(t) w(s)'] = Q delta(t - s),    u held,

and the transition matrix, ``Phi' = F Phi``, with the exact Jacobian ``F = df/dx`` at the same four stages.
Simpson's rule gives the covariance of the noise,

    P(t + h) = Phi (P + h/6 Q) Phi' + 4 h/6 Phi_2 Q Phi_2' + h/6 Q,

where Phi is the transition matrix from t to t + h, and Phi_2 that from t + h/2 to t + h. Each term is
positive semidefinite for every h.

A sampled Block takes its step at once: ``x+ = f(x, u, t) + w`` with w of covariance Q,

    P+ = Phi P Phi' + Q,    Phi = F.

Both are ``Phi (P + w_0 Q) Phi' + w_1 Phi_2 Q Phi_2' + w_2 Q`` with the weights of :func:`noise_weights`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp

from hovercontrol.base.arguments import whole_periods
from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import needed_definitions, partial_derivatives
from hovercontrol.blocks.functions import numpy_functions
from hovercontrol.blocks.signals import time
from hovercontrol.control.observers.ins.kalman import Equations, Estimate

#: Maximum length of a step in units of the plant's shortest time constant. The Runge-Kutta method is stable
#: up to 2.78. At 2, a third of a decaying mode remains after the step; the exact value is exp(-2) = 0.14.
LONGEST = 2.0

#: Maximum number of steps per tick; each adds some two thousand operations to the filter of a craft.
MOST_STEPS = 32


@dataclass(frozen=True)
class Dynamics:
    """The derivatives, or next values, of a Block and their exact Jacobian, as equations at any point."""

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
            Receives the intermediate quantities as definitions, with names that begin with `name`.
        x : sequence of sympy.Expr
            The states.
        when : sympy.Expr
            Time [s].
        jacobian : bool, optional
            Whether to return F; it is empty otherwise.
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
    """Write a Block's definitions at a point; return the substitutions for its symbols.

    Parameters
    ----------
    name : str
        Prefix of the definitions' names.
    x : sequence of sympy.Expr
        The states.
    when : sympy.Expr
        Time [s].
    wanted : sequence of sympy.Expr
        The expressions to evaluate; only the definitions that they need are written.
    """
    swap: dict[sp.Expr, sp.Expr] = {s.symbol: e for s, e in zip(block.states, x, strict=True)}
    swap[time] = when
    for key in needed_definitions(block, wanted):
        swap[sp.Symbol(key, real=True)] = write.define(f"{name}_{key}", block.definitions[key].xreplace(swap))
    return swap


@dataclass(frozen=True)
class Step:
    """Result of a step: the new state and the Jacobians at its four stages, or of a sampled plant its own."""

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
    """Write one classical Runge-Kutta step of the state; of a sampled plant its own step.

    Parameters
    ----------
    name : str
        Prefix of the definitions' names.
    x : sympy.Matrix, shape (n, 1)
    when, h : sympy.Expr
        Start time and length of the step [s].
    jacobian : bool, optional
        Whether to return the Jacobians at the stages.
    """
    # k1 = f(x, t),  k2 = f(x + h/2 k1, t + h/2),  k3 = f(x + h/2 k2, t + h/2),  k4 = f(x + h k3, t + h),
    # x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4);  F_i = df/dx at stage i.
    if dynamics.block.period:
        following, F = dynamics.at(write, name, list(x), when, jacobian=jacobian)
        return Step(following, (F,))
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
    if len(F) == 1:  # of a sampled plant
        return F[0]
    # k1 = F1,  k2 = F2 (I + h/2 k1),  k3 = F3 (I + h/2 k2),  k4 = F4 (I + h k3),
    # Phi = I + h/6 (k1 + 2 k2 + 2 k3 + k4).
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
    """Write columns of Phi_2, the transition matrix from the middle of a step to its end.

    They follow from a Runge-Kutta step of length h/2. Its two inner stages use the mean of F at both ends.
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
            # The names contain the column, because units differ between columns.
            slopes.append(write.matrix(f"{name}_middle_{j}_{k + 1}", stages[k] * inner))
        k1, k2, k3, k4 = slopes
        columns[j] = write.matrix(f"{name}_middle_{j}", start + half / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return columns


def noise_weights(block: Block, h: sp.Expr) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return the weights of the noise at the begin, the middle and the end of a step.

    Those of Simpson's rule, h/6, 4 h/6 and h/6. A sampled plant's step ends with its noise: 0, 0 and 1.
    """
    return (sp.S.Zero, sp.S.Zero, sp.S.One) if block.period else (h / 6, 4 * h / 6, h / 6)


def collected(
    P: sp.Matrix,
    columns: Mapping[int, sp.Matrix],
    Q: Mapping[int, sp.Expr],
    weights: tuple[sp.Expr, sp.Expr, sp.Expr],
) -> sp.Matrix:
    """Return ``P + w_1 Phi_2 Q Phi_2' + w_2 Q``: the noise of the middle and the end of a step."""
    _, middle, end = weights

    def entry(i: int, j: int) -> sp.Expr:
        inside = sum(Q[k] * column[i] * column[j] for k, column in columns.items() if k in Q)
        return P[i, j] + middle * inside + (end * Q[i] if i == j and i in Q else 0)

    return sp.Matrix(*P.shape, entry)


@dataclass(frozen=True)
class Prediction:
    """A state and its covariance one step later, and how the state before the step enters.

    Attributes
    ----------
    estimate : Estimate
        After the step.
    Phi : sympy.Matrix, shape (n, n)
        Transition matrix of the step.
    drive : dict of int to sympy.Matrix, shape (n, 1)
        For each driven state, the change of the state after the step per unit of a rate that is added to its
        derivative during the step; of a sampled plant per unit that is added to its next value.
    """

    estimate: Estimate
    Phi: sp.Matrix
    drive: dict[int, sp.Matrix]


def predict(
    dynamics: Dynamics,
    write: Equations,
    name: str,
    estimate: Estimate,
    Q: Mapping[int, sp.Expr],
    when: sp.Expr,
    h: sp.Expr,
    *,
    driven: Sequence[int] = (),
) -> Prediction:
    """Write the state and its covariance one step later.

    Parameters
    ----------
    name : str
        Prefix of the definitions' names, unique to this step.
    Q : mapping of int to sympy.Expr
        Noise intensity by the index of the state, of a sampled plant its variance per step; states without
        noise are omitted.
    when, h : sympy.Expr
        Start time and length of the step [s].
    driven : sequence of int, optional
        States for which the result has ``drive``.
    """
    # P(t + h) = Phi (P + w_0 Q) Phi' + w_1 Phi_2 Q Phi_2' + w_2 Q.
    n, weights = estimate.P.rows, noise_weights(dynamics.block, h)
    first, inside, last = weights
    step = runge_kutta(dynamics, write, name, estimate.x, when, h)
    Phi = transition(write, name, step.F, h)
    begin = write.symmetric(
        f"{name}_begin",
        n,
        {
            (i, j): estimate.P[i, j] + (first * Q[i] if i == j and i in Q else 0)
            for i in range(n)
            for j in range(i, n)
        },
    )
    half = write.matrix(f"{name}_half", Phi * begin)
    moved = sp.Matrix(n, n, lambda i, j: sum(half[i, k] * Phi[j, k] for k in range(n)))
    middle = middle_columns(write, name, step.F, h, sorted({*Q, *driven})) if inside else {}
    whole = collected(moved, middle, Q, weights)
    upper = {(i, j): whole[i, j] for i in range(n) for j in range(i, n)}
    # Simpson's rule for the integral of Phi(t + h, s) e_j ds: h/6 (Phi e_j + 4 Phi_2 e_j + e_j).
    drive = {}
    for j in driven:
        whole_step = first * Phi[:, j] + last * sp.eye(n)[:, j]
        whole_step += inside * middle[j] if middle else sp.zeros(n, 1)
        drive[j] = write.matrix(f"{name}_drive_{j}", whole_step)
    return Prediction(Estimate(step.x, write.symmetric(f"{name}_P", n, upper)), Phi, drive)


def steps_between(plant: Block, period: float, name: str, given: int | None = None) -> int:
    """Return the number of Runge-Kutta steps from tick to tick; of a sampled plant that of its own steps.

    Parameters
    ----------
    period : float
        Length of a tick [s].
    name : str
        Name of the estimator, for the error message.
    given : int, optional
        The number that the user asked for. By default it follows from the largest magnitude of the plant's
        eigenvalues, at its start values or with all states at zero, where dry friction is stiffest.

    Raises
    ------
    InputError
        If `given` is less than 1 or too large, the plant is too fast for the period, or the period is no
        multiple of a sampled plant's.
    """
    if plant.period:
        if given is not None:
            raise InputError(
                f"{name}: substeps: block {plant.name!r} is sampled and takes its own steps, found {given}"
            )
        count = whole_periods(f"{name}: period", period, plant.period)
        if count > MOST_STEPS:
            raise InputError(
                f"{name}: period: {period:g} s are {count} steps of block {plant.name!r}, found more than "
                f"{MOST_STEPS}: take its own period, and no sample in between (lost_samples, or NaN)"
            )
        return count
    if given is not None:
        if not 1 <= given <= MOST_STEPS:
            raise InputError(f"{name}: substeps: expected 1 to {MOST_STEPS}, found {shown(given)}")
        return given
    f, u = numpy_functions(plant), [s.start for s in plant.inputs]
    start = [s.start for s in plant.states]
    fastest = 0.0
    for x in (start, [0.0] * len(start)):
        with np.errstate(all="ignore"):
            F = f.jacobian(0.0, x, u)
        if np.isfinite(F).all():
            fastest = max(fastest, float(np.abs(np.linalg.eigvals(F)).max()))
        elif x is start:
            raise InputError(f"{name}: the plant's Jacobian is not finite at its start values: set others")
    needed = max(1, int(np.ceil(period * fastest / LONGEST)))
    if needed > MOST_STEPS:
        raise InputError(
            f"{name}: the plant's fastest mode, {fastest:.3g} 1/s at its start values or at rest, takes "
            f"{needed} steps in a period of {period:g} s: shorten the period, or give substeps={MOST_STEPS}"
        )
    return needed
