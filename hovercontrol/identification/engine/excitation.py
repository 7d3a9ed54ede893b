"""Excitation: the coefficients that logs identify, and the directions in which they give no information.

A direction is a combination of coefficients that can change together without changing the predicted
measurements. Coefficients are compared by their size. The size is the value before the fit (1 if that was 0),
or the nominal value of a Block's parameter. It is a quarter of the estimate if that is larger, because an
estimate is not four standard errors from zero by chance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.derivatives import partial_derivatives
from hovercontrol.blocks.signals import Signal
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.groups import group_text, groups
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.passes import inverse
from hovercontrol.identification.engine.step_control import controlled, deviations


@dataclass(frozen=True)
class ExcitationCriteria:
    """When a log excites a coefficient.

    No published source: set by hand, exercised by tests/identification/identify/test_fit.py.

    Attributes
    ----------
    named : float
        Smallest component of a direction that is reported, relative to the largest.
    resting : float
        A state within this many standard errors of zero counts as at rest.
    no_information : float
        Standard error, relative to the size of the coefficient, above which it counts as infinite.
    anywhere : float
        Factor on the standard deviation of the first values of hidden states, which would otherwise say how
        large these states are.
    """

    named: float = 0.1
    resting: float = 3.0
    no_information: float = 1e5
    anywhere: float = 30.0


#: The values in use.
EXCITATION = ExcitationCriteria()


def information(fit: Fit) -> Array:
    """Return the information matrix of the coefficients from the logs alone, in their own units, (P, P).

    States that differ from zero by noise alone are set to zero. Otherwise drag would act on a velocity that
    is fitted to noise, and the log would seem to excite that drag. If even the shortest sub-steps are too
    long for friction at rest, the fitted path is used.
    """
    # S = J'J with whitened sensitivities J, without the prior; in own units S_ij / (dp_i/dz_i dp_j/dz_j)
    n = len(fit.problem.free)
    path, slope = fit.path.copy(), fit.problem.slope(fit.p)
    std = np.sqrt(np.maximum(fit.variance_of_path[..., :n], 0.0))
    free = path[..., list(fit.problem.free)]
    path[..., list(fit.problem.free)] = np.where(np.abs(free) < EXCITATION.resting * std, 0.0, free)
    path = fit.problem.rows.joined(path)
    problem = controlled(fit.problem, path, fit.p, deviations(fit.problem, fit.variance_of_path))
    linear = problem.linearise(path, fit.p)
    linear = replace(linear, start=np.where(problem.hidden, EXCITATION.anywhere, 1.0) * linear.start)
    if linear.resolved:
        S = run_filter(augment(problem, linear, fit.noise)).products[:, 1:, 1:].sum(axis=0)
    else:
        S = fit.S.sum(axis=0)
    return np.asarray(S / np.outer(slope, slope))


def covariance(S: Array, size: Array, widen: Array) -> Array:
    """Return the covariance of the coefficients, shape (P, P); large but finite without information.

    Parameters
    ----------
    S : ndarray, shape (P, P)
        Information matrix.
    size : ndarray, shape (P,)
        Sizes of the coefficients, for scaling.
    widen : ndarray, shape (P,)
        Factors on the standard errors.
    """
    # With D = diag(size): C = D (D S D)^-1 D by eigenvalues, with a lower limit on each, then C_ij k_i k_j
    values, vectors = np.linalg.eigh(S * np.outer(size, size))
    values = np.maximum(values, max(1e-14 * values[-1], EXCITATION.no_information**-3))
    C = (vectors / values) @ vectors.T * np.outer(size, size)
    return np.asarray(C * np.outer(widen, widen))


def widening(fit: Fit) -> Array:
    """Return the factors by which standard errors exceed those of a filter with known gains, shape (P,).

    Its gains depend on the unknowns and on noise levels that are estimated with them (:mod:`.scoring`), and
    blocks scatter (:attr:`Fit.covariance <hovercontrol.identification.engine.fit.Fit.covariance>`).
    """
    # k_i = sqrt(variance / variance with gains fixed), both with the prior
    problem = fit.problem
    bare = run_filter(augment(problem, fit.linear, fit.noise)).products[:, 1:, 1:].sum(axis=0)
    plain = np.diag(inverse(bare + np.diag(fit.prior.precision))) * problem.slope(fit.p) ** 2
    return np.sqrt(np.maximum(np.diag(fit.covariance), 0.0) / np.maximum(plain, 1e-300))


def scatter(fit: Fit, S: Array, size: Array, own: Sequence[int]) -> Array:
    """Return the covariance of the coefficients by the scatter of scores over blocks, shape (P, P).

    Directions that the logs do not determine are left out. See :attr:`Fit.covariance
    <hovercontrol.identification.engine.fit.Fit.covariance>`.

    Parameters
    ----------
    S : ndarray, shape (P, P)
        Information matrix.
    size : ndarray, shape (P,)
        Sizes of the coefficients.
    own : sequence of int
        Their indices among the unknowns.
    """
    # C M C with M of Fit.covariance, and C of the eigenvectors of D S D with eigenvalues above 1
    scores = (fit.scores / fit.problem.slope(fit.p))[:, own]
    values, vectors = np.linalg.eigh(S * np.outer(size, size))
    known = values > 1.0
    C = (vectors[:, known] / values[known]) @ vectors[:, known].T * np.outer(size, size)
    return np.asarray(C @ (scores.T @ scores) @ C)


class Excitation:
    """What logs show of the coefficients of a fit.

    Parameters
    ----------
    fit : Fit
    names : sequence of str, optional
        Coefficients that are looked at; the other unknowns count as known. Default: all.
    size : ndarray, shape (P,)
        Their sizes.

    Attributes
    ----------
    labels : list of str
        Their names without the name of the Block, unless two share it.
    covariance : ndarray, shape (P, P)
    alone : ndarray, shape (P,)
        Standard errors if all other coefficients were known; infinite without any information.
    directions : tuple of mapping
        Steps of coefficients that together change nothing measured.
    groups : tuple of Group
        Products and sums that the logs determine.
    """

    def __init__(self, fit: Fit, size: Array, names: Sequence[str] | None = None) -> None:
        problem, self._fit = fit.problem, fit
        self._names = list(problem.names if names is None else names)
        own = [problem.names.index(name) for name in self._names]
        short = [name.rpartition(".")[2] for name in self._names]
        self.labels = short if len(set(short)) == len(short) else self._names
        S, self.size = information(fit)[np.ix_(own, own)], size
        self.covariance = covariance(S, size, widening(fit)[own])
        bare = np.diag(S)
        self.alone = np.where(bare > 0.0, 1.0 / np.sqrt(np.maximum(bare, 1e-300)), np.inf)
        open_ = unexcited_directions(self.covariance, size)
        self.directions = named_directions(open_, size, self.labels)
        linear = problem.model.linear_coefficients()
        last = [label for label, name in zip(self.labels, self._names, strict=True) if name not in linear]
        plain, wide = covariance(S, size, np.ones(len(size))), scatter(fit, S, size, own)
        values = dict(zip(self.labels, fit.p[own].tolist(), strict=True))
        units = {label: self._signal(j).unit for j, label in enumerate(self.labels)}
        self.groups = groups(open_, plain, wide, size, values, units, last)

    @property
    def std(self) -> Array:
        """Standard errors, infinite for coefficients that the logs do not determine alone, shape (P,)."""
        std = np.sqrt(np.diag(self.covariance))
        members = {n for g in self.groups for n in g.members}
        grouped = np.array([label in members for label in self.labels])
        known = np.maximum(std, self.alone) < EXCITATION.no_information * self.size
        return np.where(known & ~grouped, std, np.inf)

    def reason(self, j: int) -> str:
        """Return why coefficient j is not excited; an empty string if it is."""
        problem, signal = self._fit.problem, self._signal(j)
        moving = [
            any(np.any(m.inputs[i] != 0.0) for m in problem.logs) for i in range(len(problem.block.inputs))
        ]
        idle = idle_inputs(problem.block, signal.name, moving)
        label, std = self.labels[j], float(np.sqrt(self.covariance[j, j]))
        return group_text(label, self.groups) or reason(
            label, std, self.size[j], self.alone[j], self.directions, signal.unit, idle
        )

    def _signal(self, j: int) -> Signal:
        return self._fit.problem.block.parameter(self._names[j])


def unexcited_directions(C: Array, size: Array) -> Array:
    """Return directions whose standard error exceeds their size, as unit vectors in sizes, (P, m).

    They are eigenvectors of ``D^-1 C D^-1``, ``D = diag(size)``, with eigenvalues above 1. There are none
    unless the standard error of some coefficient exceeds its size.
    """
    scaled = C / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    return vectors[:, values > (1.0 if np.diag(scaled).max() > 1.0 else np.inf)]


def named_directions(directions: Array, size: Array, names: Sequence[str]) -> tuple[dict[str, float], ...]:
    """Return each direction as steps of named coefficients; the largest one (in sizes) has the step 1."""
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
    """Return why a coefficient is not excited; an empty string if it is.

    Parameters
    ----------
    name, unit : str
        Name and unit of the coefficient.
    std, size : float
        Standard error and size, in that unit.
    alone : float
        Standard error if all other coefficients were known.
    directions : sequence of mapping
        Result of :func:`named_directions`.
    idle : sequence of str
        Inputs in the factor of the coefficient that are constant zero.
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
    """Return the names of the inputs in the factor of a coefficient.

    Parameters
    ----------
    name : str
        Full name of the parameter.
    """
    factors = partial_derivatives(block, "derivatives", [name]).values()
    symbols: set[sp.Symbol] = set().union(*(block.expand(e).free_symbols for e in factors))
    return [s.name for s in block.inputs if s.symbol in symbols]


def idle_inputs(block: Block, name: str, moving: Sequence[bool]) -> list[str]:
    """Return the names of the inputs in the factor of a coefficient that are zero throughout.

    Parameters
    ----------
    name : str
        Full name of the parameter.
    moving : sequence of bool
        For each input, whether it is nonzero at any time.
    """
    idle = {s.name for s, moves in zip(block.inputs, moving, strict=True) if not moves}
    return [n for n in inputs_beside(block, name) if n in idle]
