"""Fisher scoring of unknowns and noise levels together, on the likelihood of the innovations.

A pass (:mod:`.passes`) keeps the gains of the filter fixed while it solves for the unknowns. But the
covariance of the innovations depends on the unknowns, too: a less stable model predicts less surely. Without
that part the optimum lies where the model explains least, the more so if feedback holds an unstable machine.
Here each unknown and each noise level is changed a little and the filter run again. The differences hold
everything that depends on it: innovations, gains and covariances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.kalman import Filtered, run_filter
from hovercontrol.identification.engine.noise import Noise, augment, least_measured, noisy, time_range
from hovercontrol.identification.engine.passes import inverse, products
from hovercontrol.identification.engine.problem import Linear, Problem

#: Change of an unknown for a one-sided difference, in standard errors; the largest one relative to its size;
#: change of the logarithm of a noise level.
PART, LARGEST, OF_LEVELS = 1e-3, 1e-2, 1e-3


#: Largest information of the likelihood in any direction of the unknowns, relative to that with the states of
#: the path and the gains of the filter known. It is 2 if the model is linear in its states. With G the
#: spectrum of the signal, f = G + R that of its measurements, dG = H G + G H* the derivative by an unknown,
#: and the path's spectrum G f^-1 G, per row (Whittle, Ark. Mat. 2 (1953))::
#:
#:     S = 1/2 int tr(f^-1 dG f^-1 dG) = K + Re int tr(M M) <= 2 K,    M = f^-1/2 H G f^-1/2,
#:     K = int tr(f^-1 H (G f^-1 G) H*) = int tr(M M*)
#:
#: What the inputs cause adds the same to both. Dry friction of which logs hardly tell gives 4 to 200: the
#: model is not linear within the uncertainty of its states, and the information is not there.
EXCESS = 2.0


@dataclass(frozen=True, eq=False)
class Levels:
    """The noise levels that are estimated; their coordinates are logarithms.

    Attributes
    ----------
    measured : ndarray of int
        Channels whose noise is estimated: all that are above their lower limit.
    process, seconds : ndarray of int
        Driven states whose spectral density at low frequency ``process**2 * seconds``, and whose correlation
        time, are estimated.
    """

    measured: NDArray[np.intp]
    process: NDArray[np.intp]
    seconds: NDArray[np.intp]

    @classmethod
    def of(cls, problem: Problem, noise: Noise, times: bool = True) -> Levels:
        """Return those of a noise."""
        measured = np.flatnonzero(noise.measured > (1.0 + 1e-9) * least_measured(problem))
        seconds = noisy(problem, noise) if times else np.empty(0, dtype=np.intp)
        return cls(measured, np.flatnonzero(noise.process > 0.0), seconds)

    def __len__(self) -> int:
        return len(self.measured) + len(self.process) + len(self.seconds)

    def moved(self, problem: Problem, noise: Noise, step: Array) -> Noise:
        """Return the noise after a step of the coordinates: log measured, log process, log seconds."""
        # With d_p, d_t the steps:  seconds <- seconds exp(d_t),  process <- process exp(d_p - d_t / 2)
        of_measured, of_process, of_seconds = np.split(
            step, np.cumsum([len(self.measured), len(self.process)])
        )
        measured, process, seconds = noise.measured.copy(), noise.process.copy(), noise.seconds.copy()
        measured[self.measured] *= np.exp(of_measured)
        seconds[self.seconds] = np.clip(seconds[self.seconds] * np.exp(of_seconds), *time_range(problem))
        process[self.process] *= np.exp(of_process)
        process *= np.sqrt(noise.seconds / seconds)
        return replace(
            noise, measured=np.maximum(measured, least_measured(problem)), process=process, seconds=seconds
        )


#: No noise level is estimated.
NO_LEVELS = Levels(*(np.empty(0, dtype=np.intp) for _ in range(3)))


def scores(
    problem: Problem, noise: Noise, p: Array, path: Array, levels: Levels, known: Array
) -> tuple[Array, Array]:
    """Return the normal equations of unknowns and noise levels by stretch, ``S step = g``.

    Parameters
    ----------
    known : ndarray, shape (P,)
        Approximate information on each unknown alone, in scaled coordinates. It sets the differences.

    Returns
    -------
    S : ndarray, shape (W, P + M, P + M)
        Information (Fisher) of P unknowns and M noise levels.
    g : ndarray, shape (W, P + M)
        Half the gradient of minus the cost.
    """
    # With whitened innovations w and their log variances l, of scalar channels one after the other:
    #   cost = sum w^2 + l,   g_i = -sum (w dw/di + dl/di / 2)
    #   S_ij = sum E[(de/di)(de/dj)] / var + (dl/di)(dl/dj) / 2,  e = w exp(l/2) the innovations
    #        = sum E[(dw/di)(dw/dj)] + (dl/di)(dl/dj) / 4
    here = problem.linearise(path, p, unknowns=False)

    def run(linear: Linear, other: Noise) -> Filtered:
        return run_filter(augment(problem, linear, other, unknowns=False), rows=True)

    base, z = run(here, noise), problem.inside(p)
    changed: list[tuple[Filtered, float]] = []
    for j in range(len(p)):
        size = 1.0 if problem.log_scale[j] else problem.size[j]
        part = min(PART / np.sqrt(known[j]), LARGEST * size) if known[j] > 0.0 else LARGEST * size
        other = z.copy()
        other[j] += part
        if abs(problem.inside(problem.outside(other))[j] - other[j]) > 0.5 * part:  # beyond a bound
            other[j], part = z[j] - part, -part
        changed.append((run(problem.linearise(path, problem.outside(other), unknowns=False), noise), part))
    for k in range(len(levels)):
        step = np.zeros(len(levels))
        step[k] = OF_LEVELS
        changed.append((run(here, levels.moved(problem, noise, step)), OF_LEVELS))
    w = [base.white[..., 0], *((f.white[..., 0] - base.white[..., 0]) / part for f, part in changed)]
    l = [(f.log_det - base.log_det) / part for f, part in changed]  # noqa: E741
    both = products(np.stack(w, axis=-1))
    of_variance = products(np.stack(l, axis=-1))
    S = both[:, 1:, 1:] + 0.25 * of_variance
    g = -both[:, 1:, 0] - 0.5 * np.stack([one.sum(axis=(0, 2)) for one in l], axis=-1)
    return S, g


def of_unknowns(S: Array, g: Array, count: int) -> tuple[Array, Array]:
    """Return the normal equations of the first `count` numbers, with the others re-estimated on all blocks.

    With u the unknowns and l the levels, ``T = [1, -S_ul S_ll^-1]`` of the sums over blocks: ``T S T'`` and
    ``T g`` (the efficient score: van der Vaart, Asymptotic Statistics (1998), 25.4).
    """
    total = S.sum(axis=0)
    back = total[:count, count:] @ inverse(total[count:, count:])
    T = np.concatenate([np.eye(count), -back], axis=1)
    return T @ S @ T.T, g @ T.T


def excess(S: Array, known: Array, precision: Array) -> float:
    """Return the largest ratio of two information matrices in any direction, each with that of the prior.

    The largest eigenvalue of ``(K + Lambda)^-1 (S + Lambda)``.
    """
    total = known + np.diag(precision)
    size = 1.0 / np.sqrt(np.maximum(np.diag(total), 1e-300))
    values, vectors = np.linalg.eigh(total * np.outer(size, size))
    root = vectors / np.sqrt(np.maximum(values, 1e-12))
    scaled = (S + np.diag(precision)) * np.outer(size, size)
    return float(np.linalg.eigvalsh(root.T @ scaled @ root)[-1])
