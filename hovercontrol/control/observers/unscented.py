"""The unscented Kalman filter of any Block, as a Block.

The filter replaces linearisation by sigma points: 2 n points with mean x and covariance P, and x itself,

    x +- sqrt(n + kappa) L_i,  L L' = P,  weights 1/(2 (n + kappa)), and kappa/(n + kappa) for x itself,

which are propagated through the nonlinear equations (Julier and Uhlmann, Proc. IEEE 92 (2004)). With
kappa = 0 they are the cubature points of Arasaratnam and Haykin, IEEE TAC 54 (2009). No weight is negative,
so covariances stay positive. The process noise of a step is computed as in :mod:`.propagation`, along the
path of the point x.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import fixed
from hovercontrol.blocks.signals import time
from hovercontrol.control.observers.filter_equations import (
    corrected,
    estimate_of,
    expected,
    filter_states,
    innovations,
    sampled_block,
    shares,
)
from hovercontrol.control.observers.ins.kalman import Equations, Estimate, wrapped
from hovercontrol.control.observers.observability import warn_if_undetectable
from hovercontrol.control.observers.observed import (
    Observed,
    measured_expressions,
    observed,
    plant_of,
    tick_of,
)
from hovercontrol.control.observers.propagation import (
    Dynamics,
    collected,
    middle_columns,
    noise_weights,
    runge_kutta,
    steps_between,
    written_at,
)
from hovercontrol.craft.models.interface import AnyModel

#: Minimum pivot of a Cholesky factor, as a share of the variance, so that rounding cannot make its square
#: root imaginary.
PIVOT = sp.Float(1e-14)


@checked
def unscented_kalman(
    plant: AnyModel,
    measured: Sequence[str] | None = None,
    *,
    process_noise: Mapping[str, float],
    measurement_noise: Mapping[str, float],
    period: float | None = None,
    start_std: Mapping[str, float] | None = None,
    lost_samples: bool | Sequence[str] = False,
    kappa: float = 0.0,
    substeps: int | None = None,
    name: str = "estimator",
) -> Block:
    """Return the unscented Kalman filter of a plant.

    It has two to three times as many equations as
    :func:`~hovercontrol.control.observers.extended.extended_kalman`. Use it where the error of the estimate
    exceeds the range in which the equations are nearly linear: a speed uncertain by more than the width of
    dry friction, or a heading uncertain by some tenths of a radian.

    Parameters
    ----------
    plant : Model, BlockModel or Block
        Continuous or sampled. Its start values are the first estimate.
    measured : sequence of str, optional
        Outputs, or states, of the plant (default: the keys of `measurement_noise`, in their order).
        Innovations in rad are wrapped to -pi ... pi.
    process_noise, measurement_noise, start_std : mapping of str to float
        As for :func:`~hovercontrol.control.observers.extended.extended_kalman` with a period [unit/s^(1/2),
        unit, unit]; every entry of `start_std` must be positive.
    period : float, optional
        Sampling period [s]; of a sampled plant a multiple of its period (default: its period).
    lost_samples : bool or sequence of str, optional
        Add an input ``fresh``, or ``fresh_NAME`` for these measured outputs: 0 means that there is no sample.
    kappa : float, optional
        Spread of the points, not negative (dimensionless).
    substeps : int, optional
        Runge-Kutta steps per period, with new points for each (default: as for the extended filter).
    name : str, optional

    Returns
    -------
    Block
        Sampled; signals as of :func:`~hovercontrol.control.observers.extended.extended_kalman`.

    Raises
    ------
    InputError
        As :func:`~hovercontrol.control.observers.extended.extended_kalman`; or if kappa is negative, or an
        initial standard deviation is 0.

    Warns
    -----
    UserWarning
        If the measurements do not determine the state at the plant's start values.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> estimator = unscented_kalman(
    ...     craft, process_noise={"u": 0.1, "v": 0.1, "r": 0.1},
    ...     measurement_noise={"x": 0.01, "y": 0.01, "psi": 0.02}, period=0.01,
    ... )
    >>> [s.name for s in estimator.outputs[:4]]
    ['x_hat', 'y_hat', 'psi_hat', 'u_hat']
    """
    block = plant_of(plant, name, "unscented Kalman filter")
    tick = tick_of(block, period, f"{name}: period")
    model = observed(
        block,
        measured,
        process_noise,
        measurement_noise,
        start_std,
        name,
        continuous=False,
        lost_samples=lost_samples,
    )
    spread = not_negative(f"{name}: kappa", kappa)
    for state, std in zip(block.states, model.start_std, strict=True):
        if not std:
            raise InputError(f"{name}: start_std: expected a positive number for {state.name!r}, found 0")
    warn_if_undetectable(block, [s.name for s in model.measured], name)
    n = steps_between(block, tick, name, substeps)
    step = fixed("period", tick, "of the samples")
    states, write = filter_states(model), Equations()
    prior = estimate_of(states, len(block.states))
    now = _measured(model, write, prior, spread)
    then, dynamics, h = now, Dynamics(model.plant), write.define("substep", step.symbol / n)
    for k in range(n):
        then = _predicted(dynamics, write, f"step_{k}", then, model.intensities, time + k * h, h, spread)
    return sampled_block(model, states, write, now, then, step)


def cholesky(write: Equations, name: str, P: sp.Matrix) -> sp.Matrix:
    """Write the lower Cholesky factor L of a covariance, P = L L'."""
    # L_jj = sqrt(P_jj - sum_k<j L_jk^2),  L_ij = (P_ij - sum_k<j L_ik L_jk) / L_jj.
    n = P.rows
    L = sp.zeros(n, n)
    for j in range(n):
        pivot = P[j, j] - sum(L[j, k] ** 2 for k in range(j))
        least = sp.Max(pivot, PIVOT * P[j, j]) if j else pivot
        L[j, j] = write.define(f"{name}[{j},{j}]", sp.sqrt(least))
        for i in range(j + 1, n):
            rest = P[i, j] - sum(L[i, k] * L[j, k] for k in range(j))
            L[i, j] = write.define(f"{name}[{i},{j}]", rest / L[j, j])
    return L


def _points(
    write: Equations, name: str, x: sp.Matrix, P: sp.Matrix, kappa: float
) -> tuple[list[sp.Matrix], list[Any]]:
    """Return the sigma points and their weights; x itself comes first, with weight 0 if kappa is 0."""
    n = P.rows
    L = cholesky(write, f"{name}_L", P)
    root = sp.sqrt(sp.nsimplify(n + kappa))
    points, weights = [x], [sp.nsimplify(kappa) / sp.nsimplify(n + kappa)]
    for j in range(n):
        for sign, side in ((1, "ahead"), (-1, "behind")):
            points.append(write.matrix(f"{name}_{side}_{j}", x + sign * root * L[:, j]))
            weights.append(sp.S.One / (2 * sp.nsimplify(n + kappa)))
    return points, weights


def _mean(write: Equations, name: str, points: Sequence[sp.Matrix], weights: Sequence[Any]) -> sp.Matrix:
    n = points[0].rows
    return write.matrix(
        name, sp.Matrix([sum(w * p[i] for w, p in zip(weights, points, strict=True) if w) for i in range(n)])
    )


def _deviations(write: Equations, name: str, points: Sequence[sp.Matrix], mean: sp.Matrix) -> list[sp.Matrix]:
    return [write.matrix(f"{name}_{k}", p - mean) for k, p in enumerate(points)]


def _product(a: Sequence[sp.Matrix], b: Sequence[sp.Matrix], weights: Sequence[Any], i: int, j: int) -> Any:
    """Return an entry of the cross-covariance of two sets of deviations: ``sum_k w_k a_k[i] b_k[j]``."""
    return sum(w * p[i] * q[j] for w, p, q in zip(weights, a, b, strict=True) if w)


def _predicted(
    dynamics: Dynamics,
    write: Equations,
    name: str,
    estimate: Estimate,
    Q: Mapping[int, sp.Expr],
    when: sp.Expr,
    h: sp.Expr,
    kappa: float,
) -> Estimate:
    """Write the estimate one step later; arguments as for :func:`.propagation.predict`."""
    # Points x_k of P + w_0 Q move by a step:  x+ = sum w_k x_k+,
    # P+ = sum w_k (x_k+ - x+) (x_k+ - x+)' + w_1 Phi_2 Q Phi_2' + w_2 Q.
    n, shares_of_noise = estimate.P.rows, noise_weights(dynamics.block, h)
    first, inside, _ = shares_of_noise
    begin = sp.Matrix(estimate.P)
    for i, q in Q.items():
        begin[i, i] += first * q
    begin = write.symmetric(f"{name}_begin", n, {(i, j): begin[i, j] for i in range(n) for j in range(i, n)})
    points, weights = _points(write, name, estimate.x, begin, kappa)
    centre = runge_kutta(dynamics, write, name, points[0], when, h, jacobian=bool(inside))
    moved = [centre.x] + [
        runge_kutta(dynamics, write, f"{name}_point_{k}", p, when, h, jacobian=False).x
        for k, p in enumerate(points[1:])
    ]
    x = _mean(write, f"{name}_mean", moved, weights)
    off = _deviations(write, f"{name}_off", moved, x)
    P = sp.Matrix(n, n, lambda i, j: _product(off, off, weights, i, j) if j >= i else 0)
    middle = middle_columns(write, name, centre.F, h, list(Q)) if inside else {}
    whole = collected(P, middle, Q, shares_of_noise)
    upper = {(i, j): whole[i, j] for i in range(n) for j in range(i, n)}
    return Estimate(x, write.symmetric(f"{name}_P", n, upper))


def _measured(model: Observed, write: Equations, prior: Estimate, kappa: float) -> Estimate:
    """Write the measurement update; if the outputs are linear in the states, use the Kalman filter's."""
    # dy_k = h(x_k) - h(x) - mean,  S = sum w_k dy_k dy_k' + R,  C = sum w_k dx_k dy_k',  e = y - h(x) - mean,
    # where mean = sum w_k (h(x_k) - h(x)) and dx_k = x_k - x.
    plant = measured_expressions(model.plant, model.measured)
    states = {s.symbol for s in plant.states}
    slopes = plant.jacobian("outputs", "states")
    if not slopes.free_symbols & states:
        return corrected(model, write, prior)
    n, m = prior.P.rows, len(model.measured)
    h, _ = expected(model, write, prior.x)
    points, weights = _points(write, "sigma", prior.x, prior.P, kappa)
    outputs = [sp.zeros(m, 1)]
    values = list(plant.output_expressions.values())
    for k, point in enumerate(points[1:]):
        swap = written_at(plant, write, f"sigma_{k}", list(point), time, values)
        # Outputs relative to those at the mean, wrapped: an angle may jump by a whole turn between points.
        off = [e.xreplace(swap) - e0 for e, e0 in zip(values, h, strict=True)]
        turned = [wrapped(e) if s.unit == "rad" else e for e, s in zip(off, model.measured, strict=True)]
        outputs.append(write.matrix(f"sigma_{k}_output", sp.Matrix(turned)))
    mean = _mean(write, "sigma_mean", outputs, weights)
    # Without a sample the deviations and the innovation of an output are zero, so it corrects nothing.
    used = sp.diag(*shares(model))
    dy = [used * d for d in _deviations(write, "sigma_dy", outputs, mean)]
    dx = _deviations(write, "sigma_dx", points, prior.x)
    R = [s.symbol**2 for s in model.noise]
    S = sp.Matrix(m, m, lambda i, j: _product(dy, dy, weights, i, j) + (R[i] if i == j else 0))
    cross = write.matrix("cross", sp.Matrix(m, n, lambda i, j: _product(dy, dx, weights, i, j)))
    # K = C S^-1 with S = L L': x + G' L^-1 e, P - G' G, where G = L^-1 C'.
    L = cholesky(write, "S_L", S)
    e = used * (sp.Matrix(innovations(model, write, h)) - mean)
    G, z = _solved(write, "G", L, cross), _solved(write, "z", L, e)
    x = write.matrix("measured_x", prior.x + G.T * z)
    upper = {
        (i, j): prior.P[i, j] - sum(G[k, i] * G[k, j] for k in range(m))
        for i in range(n)
        for j in range(i, n)
    }
    return Estimate(x, write.symmetric("measured_P", n, upper))


def _solved(write: Equations, name: str, L: sp.Matrix, right: sp.Matrix) -> sp.Matrix:
    """Write the solution of ``L X = right``, by forward substitution."""
    X = sp.zeros(*right.shape)
    for i in range(right.rows):
        for j in range(right.cols):
            rest = right[i, j] - sum(L[i, k] * X[k, j] for k in range(i))
            X[i, j] = write.define(f"{name}[{i},{j}]", rest / L[i, i])
    return X
