"""Solve for a trim: bounded least squares, then the solution nearest to the initial values.

With F(z) the residuals of :class:`.Conditions`, z the unknowns in nominal sizes and z_0 their initial
values::

    min |F(z)|^2 for z within its bounds;    then min |z - z_0|^2 with F(z) = 0
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.linalg
from scipy.optimize import least_squares, minimize
from scipy.stats import qmc

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.backends.trim_conditions import Conditions

#: Maximum residual of a trim, as a fraction of the nominal size of each condition.
TOLERANCE = 1e-8
#: Number of further initial points: a Halton sequence, the same in each search.
STARTS = 8
#: A solution with all unknowns within NEAR nominal sizes of the start is accepted at once. Otherwise the
#: nearest solution from the first COMPARED further starts is chosen, because angles and signs can have
#: several solutions.
NEAR, COMPARED = 4.0, 6
#: Maximum distance of the further initial points from the first, in nominal sizes.
SPREAD = 3.0
#: A pivot or singular value of the Jacobian below this fraction of the largest counts as 0.
RANK = 1e-9


def solve(conditions: Conditions) -> tuple[Array, bool]:
    """Return the unknowns in nominal sizes, and whether they meet the conditions; else the best attempt."""
    start = conditions.start
    best, least = start, np.inf
    solutions: list[Array] = []
    for tried, begin in enumerate(_starts(conditions)):
        z = _from(conditions, begin)
        if z is None:
            continue
        size = float(np.max(np.abs(conditions.missing(z)), initial=0.0))
        if size < least:
            best, least = z, size
        if size <= TOLERANCE:
            solutions.append(z)
            if np.max(np.abs(z - start), initial=0.0) <= NEAR:
                break
        if solutions and tried >= COMPARED:
            break
    if not solutions:
        return best, False
    closest = min(solutions, key=lambda z: float(np.linalg.norm(z - start)))
    return _tidy(conditions, nearest(conditions, closest)), True


def nearest(conditions: Conditions, z: Array) -> Array:
    """Return the solution nearest to the start: min |z - z_0|^2 with F(z) = 0, starting from a solution z.

    If the conditions determine all unknowns, or have no derivative at z, z is returned.
    """
    # pivoted QR of J' gives the rank of J and its independent rows, the constraints of the minimisation
    J, start = conditions.jacobian(z), conditions.start
    if not np.isfinite(J).all():
        return z
    _, R, order = scipy.linalg.qr(J.T, mode="economic", pivoting=True)
    rank = int(np.sum(np.abs(np.diag(R)) > RANK * max(1.0, np.abs(R).max(initial=0.0))))
    if rank == len(z):
        return z
    rows = order[:rank]
    found = minimize(
        lambda z: (float((z - start) @ (z - start)), 2 * (z - start)),
        z,
        jac=True,
        method="SLSQP",
        bounds=list(zip(*conditions.bounds, strict=True)),
        constraints={
            "type": "eq",
            "fun": lambda z: conditions.missing(z)[rows],
            "jac": lambda z: conditions.jacobian(z)[rows],
        },
        options={"ftol": 1e-14, "maxiter": 200},
    )
    nearer = _from(conditions, found.x) if np.isfinite(found.x).all() else None
    if nearer is None or np.max(np.abs(conditions.missing(nearer)), initial=0.0) > TOLERANCE:
        return z
    return nearer if np.linalg.norm(nearer - start) < np.linalg.norm(z - start) else z


def undetermined(conditions: Conditions, z: Array) -> list[int]:
    """Return the unknowns that can change together while the conditions still hold: J dz = 0, dz_k != 0.

    Unknowns on which no condition depends are not included.
    """
    J = conditions.jacobian(z)
    asked = np.flatnonzero(np.abs(J).max(axis=0, initial=0.0) > 0)
    if not asked.size or not np.isfinite(J).all():
        return []
    null = scipy.linalg.null_space(J[:, asked], rcond=RANK)
    return asked[np.abs(null).max(axis=1, initial=0.0) > 1e-6].tolist()


def bound_at(conditions: Conditions, k: int, value: float) -> str:
    """Return "lower" or "upper" if an unknown is at that bound, else ""; `value` is in nominal sizes."""
    lower, upper = (b[k] for b in conditions.bounds)
    if abs(value - lower) < 1e-6:
        return "lower"
    return "upper" if abs(value - upper) < 1e-6 else ""


def failure(conditions: Conditions, z: Array) -> str:
    """Return the message for the best attempt: its largest deviations first, and the bounds reached."""
    found, missing = conditions.found(z), np.abs(conditions.missing(z))
    worst = [int(k) for k in np.argsort(-missing) if not missing[k] <= 1e-6][:4]
    lines = [conditions.each[k].line(float(found[k])) for k in worst]
    bounds = []
    for k, signal in enumerate(conditions.unknowns):
        side = bound_at(conditions, k, float(z[k]))
        if side:
            unit = "" if signal.unit == "1" else f" {signal.unit}"
            bounds.append(f"{signal.name} is at its {side} bound {getattr(signal, side):g}{unit}")
    names = ", ".join(s.name for s in conditions.unknowns[:8]) or "nothing"
    if len(worst) == 1 and not bounds and conditions.each[worst[0]].state:
        bounds.append(f"rates={{{conditions.each[worst[0]].state!r}: None}} leaves that free")
    return "; ".join([f"no trim found, nearest with {names} free: {'; '.join(lines)}", *bounds])


def _from(conditions: Conditions, start: Array) -> Array | None:
    """Return the least-squares solution from a start, or the start where the conditions have no derivative.

    None if the Block has no finite values there.
    """
    lower, upper = conditions.bounds
    start = np.clip(start, lower, upper)
    if not len(start) or not np.isfinite(conditions.jacobian(start)).all():
        return start
    try:
        found = least_squares(
            conditions.missing,
            start,
            conditions.jacobian,
            bounds=(lower, upper),
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=100,
        )
    except ValueError:  # not finite at the start
        return None
    z = np.asarray(found.x)
    onto = np.clip(z, lower, upper)
    for bound in (lower, upper):  # the search stays inside; close solutions are set to the bound
        onto = np.where(np.abs(onto - bound) < 1e-7, bound, onto)
    size = [float(np.max(np.abs(conditions.missing(p)), initial=0.0)) for p in (z, onto)]
    return onto if size[1] <= max(size[0], TOLERANCE) else z


def _tidy(conditions: Conditions, z: Array) -> Array:
    """Set unknowns within rounding of 0 or of their start to that value, if the conditions still hold."""
    tidy = np.where(np.abs(z) < TOLERANCE, 0.0, z)
    tidy = np.where(np.abs(z - conditions.start) < TOLERANCE, conditions.start, tidy)
    size = [float(np.max(np.abs(conditions.missing(p)), initial=0.0)) for p in (z, tidy)]
    return tidy if size[1] <= max(size[0], TOLERANCE / 10) else z


def _starts(conditions: Conditions) -> Iterator[Array]:
    yield conditions.start
    n = len(conditions.unknowns)
    if not n or not conditions.each:
        return
    lower, upper = conditions.bounds
    low = np.maximum(lower, conditions.start - SPREAD)
    high = np.minimum(upper, conditions.start + SPREAD)
    for share in qmc.Halton(n, scramble=False).random(STARTS + 1)[1:]:
        yield low + share * (high - low)
