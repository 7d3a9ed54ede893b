"""Which coefficients a log excites, and in which directions it says nothing.

A direction is a combination of coefficients that may change together while the simulation of what
was measured stays as it was. Coefficients are compared by their size: their nominal value (of a
model's coefficient: its value before, or 1 if that was 0), or a quarter of their estimate where
that is larger (chance alone does not carry an estimate four standard errors away).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.derivatives import partial_derivatives

Array = NDArray[np.float64]

#: A component of a direction is named when it is at least this part of the largest.
NAMED = 0.1

#: Standard error, in sizes, of the directions along which start values are kept.
BLIND = 4.0

#: How stiffly they are held, in (1/nominal)^2.
STIFFNESS = 1e6

#: Standard deviation, in nominal values, of the weak pull to the start values while the way is
#: sought.
LOOSE = 3.0

#: Standard errors of more than this many sizes are called infinite.
NO_INFORMATION = 1e5


def covariance(S: Array, scores: Array, size: Array) -> Array:
    """Return the covariance of the coefficients, shape (P, P).

    Two estimates of each standard error, the larger of them: the inverse of the information matrix
    `S` (weighted by the residuals' own scatter, hence inflated by the square root of chi2/dof),
    right when residuals are white; and the sandwich over windows (Huber 1967; Liang and Zeger,
    Biometrika 73 (1986) 13), right when they are correlated within windows, as those of a model
    that lacks something are.

    Parameters
    ----------
    S : ndarray, shape (P, P)
        Information matrix.
    scores : ndarray, shape (W, P)
        What each window adds to the gradient.
    size : ndarray, shape (P,)
        For scaling.
    """
    values, vectors = np.linalg.eigh(S * np.outer(size, size))
    values = np.maximum(values, max(1e-14 * values[-1], NO_INFORMATION**-3))
    C = (vectors / values) @ vectors.T * np.outer(size, size)
    W, P = scores.shape
    if W <= P + 1:
        return C
    centred = scores - scores.mean(axis=0)
    robust = C @ (centred.T @ centred) @ C * (W / (W - P))
    plain, wide = np.diag(C), np.maximum(np.diag(C), np.diag(robust))
    grow = np.sqrt(wide / plain)
    return C * np.outer(grow, grow)


def unexcited_directions(C: Array, size: Array) -> Array:
    """Return directions with a standard error above their size: unit vectors in sizes, (P, m).

    There are none unless some coefficient's own standard error is above its size.
    """
    scaled = C / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    return vectors[:, values > (1.0 if np.diag(scaled).max() > 1.0 else np.inf)]


def blind_directions(C: Array, size: Array) -> Array:
    """Return the directions of which the logs say next to nothing, as above, shape (P, m)."""
    values, vectors = np.linalg.eigh(C / np.outer(size, size))
    return vectors[:, values > BLIND**2]


def same_directions(a: Array, b: Array) -> bool:
    """Tell whether two sets of directions span nearly the same, each of shape (P, m)."""
    if a.shape != b.shape or not a.size:
        return a.shape == b.shape
    return bool(np.linalg.svd(a.T @ b, compute_uv=False).min() > 0.95)


def stiff_pull(directions: Array, nominal: Array) -> Array:
    """Return the precision, shape (P, P), that keeps start values along directions only."""
    steps, _ = np.linalg.qr(directions)
    scaled = steps / nominal[:, None]
    return STIFFNESS * scaled @ scaled.T


def weak_pull(nominal: Array) -> Array:
    """Return a precision, shape (P, P), that keeps what is not excited from drifting far."""
    return np.diag(1 / (LOOSE * nominal) ** 2)


def named_directions(directions: Array, size: Array, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Return each direction as steps of named coefficients, the largest (in sizes) being 1."""
    named = []
    for v in directions.T:
        lead = int(np.abs(v).argmax())
        steps = v * size / (v[lead] * size[lead])
        large = np.abs(v) >= NAMED * abs(v[lead])
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
                f"hardly to be told from {', '.join(others)}: with it {part:.2g} higher and "
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
