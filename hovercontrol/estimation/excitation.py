"""Which coefficients a log excites, and in which directions it says nothing.

A direction is a combination of coefficients that may change together while what the model says of the
measurements stays as it was. Coefficients are compared by their size: their value before (1 if that was 0),
of a Block's parameter its nominal value; or a quarter of their estimate where that is larger (chance alone
does not carry an estimate four standard errors away).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.core.block import Block
from hovercontrol.core.derivatives import partial_derivatives
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.kalman import run_filter
from hovercontrol.estimation.noise import augment
from hovercontrol.estimation.passes import inverse, products
from hovercontrol.estimation.step_control import controlled, deviations

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ExcitationCriteria:
    """When a log excites a coefficient.

    No published source: set by hand, exercised by tests/identify/test_fit.py.

    Attributes
    ----------
    named : float
        Smallest component of a direction that is named, relative to the largest.
    resting : float
        Standard errors within which a state is at rest.
    no_information : float
        Standard error, relative to the size of the coefficient, above which it is infinite.
    growth : float
        Growth of a state from row to row above which sub-steps are too long for friction at rest: an
        explicit step h along a slope s grows from h s = 2.8 on (Hairer and Wanner, Solving ODEs II, IV.2), an
        unstable craft by a few per cent.
    """

    named: float = 0.1
    resting: float = 3.0
    no_information: float = 1e5
    growth: float = 2.0


#: The values in use.
EXCITATION = ExcitationCriteria()


def information(fit: Fit) -> Array:
    """Return what the logs alone say of the coefficients, in their own units, shape (P, P).

    States that are at rest but for noise are taken to be at rest: on a velocity that is fitted to noise drag
    seems to act, and the log would seem to excite it. Where the shortest sub-steps are too long for friction
    at rest, the path is the fitted one.
    """
    n = len(fit.problem.free)
    path, slope = fit.path.copy(), fit.problem.slope(fit.p)
    std = np.sqrt(np.maximum(np.diagonal(fit.covariance_of_path, axis1=2, axis2=3)[..., :n], 0.0))
    free = path[..., list(fit.problem.free)]
    path[..., list(fit.problem.free)] = np.where(np.abs(free) < EXCITATION.resting * std, 0.0, free)
    problem = controlled(fit.problem, path, fit.p, deviations(fit.problem, fit.covariance_of_path))
    linear = problem.linearise(path, fit.p)
    if np.abs(np.diagonal(linear.A, axis1=2, axis2=3)).max() < EXCITATION.growth:
        S = products(run_filter(augment(problem, linear, fit.noise)).white)[:, 1:, 1:].sum(axis=0)
    else:
        S = fit.S.sum(axis=0)
    return np.asarray(S / np.outer(slope, slope))


def covariance(S: Array, size: Array, widen: Array) -> Array:
    """Return the covariance of the coefficients, shape (P, P); very large, not infinite, where none is known.

    Parameters
    ----------
    S : ndarray, shape (P, P)
        Information matrix.
    size : ndarray, shape (P,)
        For scaling.
    widen : ndarray, shape (P,)
        Factors of the standard errors.
    """
    values, vectors = np.linalg.eigh(S * np.outer(size, size))
    values = np.maximum(values, max(1e-14 * values[-1], EXCITATION.no_information**-3))
    C = (vectors / values) @ vectors.T * np.outer(size, size)
    return np.asarray(C * np.outer(widen, widen))


def widening(fit: Fit) -> Array:
    """Return how many times wider than their noise says blocks of the logs scatter coefficients, shape (P,).

    See :attr:`Fit.covariance <hovercontrol.estimation.fit.Fit.covariance>`.
    """
    plain = inverse(fit.S.sum(axis=0) + np.diag(fit.prior.precision))
    slope = fit.problem.slope(fit.p)
    wide = np.diag(fit.covariance) / np.maximum(np.diag(plain) * slope**2, 1e-300)
    return np.sqrt(np.maximum(wide, 1.0))


def unexcited_directions(C: Array, size: Array) -> Array:
    """Return directions with a standard error above their size: unit vectors in sizes, (P, m).

    There are none unless some coefficient's own standard error is above its size.
    """
    scaled = C / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    return vectors[:, values > (1.0 if np.diag(scaled).max() > 1.0 else np.inf)]


def named_directions(directions: Array, size: Array, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Return each direction as steps of named coefficients, the largest (in sizes) being 1."""
    named = []
    for v in directions.T:
        lead = int(np.abs(v).argmax())
        steps = v * size / (v[lead] * size[lead])
        large = np.abs(v) >= EXCITATION.named * abs(v[lead])
        named.append({n: float(s) for n, s, use in zip(names, steps, large, strict=True) if use})
    return tuple(named)


def reason(
    name: str,
    std: float,
    size: float,
    alone: float,
    directions: Sequence[Mapping[str, float]],
    unit: str,
    idle: Sequence[str],
) -> str:
    """Return why a coefficient is not excited, empty if it is.

    Parameters
    ----------
    name, unit : str
    std, size : float
        Standard error and size, in that unit.
    alone : float
        Standard error if all others were known.
    directions : sequence of mapping
        As from :func:`named_directions`.
    idle : sequence of str
        Inputs in the coefficient's factor that do not move.
    """
    if std <= size:
        return ""
    if alone > size:
        why = f" ({', '.join(idle)} stays 0)" if idle else ""
        return f"nothing measured depends on it enough{why}"
    for direction in directions:
        others = (
            {k: s / direction[name] for k, s in direction.items() if k != name} if name in direction else {}
        )
        if others:
            part = 0.1 * size
            steps = [f"{k} {abs(part * s):.2g} {'higher' if s > 0 else 'lower'}" for k, s in others.items()]
            return (
                f"hardly distinguishable from {', '.join(others)}: with it {part:.2g} higher and "
                f"{', '.join(steps)} the logs would look much the same"
            )
    return f"its standard error is above its size of {size:.3g} {unit}"


def inputs_beside(block: Block, name: str) -> list[str]:
    """Return the inputs in a coefficient's factor, by name.

    Parameters
    ----------
    block : Block
    name : str
        Full name of the parameter.
    """
    factors = partial_derivatives(block, "derivatives", [name]).values()
    symbols: set[sp.Symbol] = set().union(*(block.expand(e).free_symbols for e in factors))
    return [s.name for s in block.inputs if s.symbol in symbols]


def idle_inputs(block: Block, name: str, moving: Sequence[bool]) -> list[str]:
    """Return the inputs in a coefficient's factor that are zero throughout.

    Parameters
    ----------
    block : Block
    name : str
        Full name of the parameter.
    moving : sequence of bool
        For each input, whether it is ever other than zero.
    """
    idle = {s.name for s, moves in zip(block.inputs, moving, strict=True) if not moves}
    return [n for n in inputs_beside(block, name) if n in idle]
