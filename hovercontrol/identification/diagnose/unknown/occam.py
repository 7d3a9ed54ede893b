"""The evidence for a form of few numbers: what it pays for its freedom.

The evidence is the likelihood, averaged over the numbers of the form::

    evidence = max(likelihood) mean(likelihood/max(likelihood))

The second factor is smaller for a form that can be more functions that the logs tell apart. BIC takes
n^(-k/2) for it, with n rows and k numbers: a prior as wide as one row's information, and numbers that
the logs always show. Here it is computed from the table, which says what the logs show: with its values
y and the columns A of a form's terms, whitened by the table's covariance, the misfit is |y - A c|^2.

- Coefficients c have Zellner's prior, N(0, g (A'A)^-1), of the size of the function itself: g = |P y|^2/k,
  with P the projection on A (empirical Bayes: Liang et al., J. Am. Stat. Assoc. 103 (2008)). The mean is
  ``exp(-k/2) (1 + g)^(-k/2)``.
- Numbers inside (a half-saturation, an exponent) have Jeffreys' prior: even over distinguishable functions,
  by the area that they sweep on the unit sphere of whitened functions (Balasubramanian, Neural Comput. 9
  (1997)). A saturating form that is a line over the logs at all large b counts once. The mean is a sum
  over a grid, finer near the largest likelihood.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.craft.models.forms import EXPONENTS, Term
from hovercontrol.craft.models.functions import FormFunction

#: A number in the unit of the argument is sought from this part of its largest value to its inverse.
FARTHEST = 0.01

#: Places on the grid of a number: over its range, and within six standard errors of its likeliest value.
PLACES, NEAR = 40, 61


@dataclass(frozen=True, eq=False)
class Whitened:
    """A table in its own metric.

    Attributes
    ----------
    grid : ndarray, shape (n,)
        Nodes.
    W : ndarray, shape (n, n)
        Whitens values at the nodes.
    y : ndarray, shape (n,)
        The whitened values.
    along : ndarray
        The argument in the rows of the logs.
    """

    grid: Array
    W: Array
    y: Array
    along: Array

    def columns(self, form: FormFunction, numbers: Iterable[Any]) -> Array:
        """Return the whitened terms of a form, shape (..., n, terms), of numbers of any shape (...)."""
        return np.asarray(self.W @ form.columns(self.grid)(numbers))

    def unused(self, form: FormFunction, rest: float) -> float:
        """Return the log of the mean likelihood of a form relative to the largest, by its coefficients.

        Parameters
        ----------
        rest : float
            Its smallest squared distance from the table.
        """
        return linear(len(form.terms), float(self.y @ self.y) - rest) + self._inner(form, rest)

    def of_table(self) -> float:
        """Return the same of the table itself, whose values are its coefficients."""
        return linear(self.grid.size, float(self.y @ self.y))

    def _inner(self, form: FormFunction, rest: float) -> float:
        """Return the log of the mean over the numbers inside a form, coefficients at their likeliest."""
        own = np.array(form.numbers[len(form.terms) :])
        if not own.size:
            return 0.0
        step = 1e-5 * np.maximum(np.abs(own), 1e-6 * np.abs(self.along).max())
        q, c = self._direction(form, own)
        J = [
            (self._direction(form, own + d)[0] - self._direction(form, own - d)[0]) / (2.0 * h)
            for h, d in zip(step, np.diag(step), strict=True)
        ]
        # misfit c^2 |dq|^2 along the sphere: the covariance of the numbers is (c^2 J'J)^-1
        wide = np.sqrt(np.diag(np.linalg.pinv(float(c) ** 2 * (np.array(J) @ np.array(J).T))))
        axes = [self._axis(n, t, b, s) for (n, t), b, s in zip(form.own, own, wide, strict=True)]
        q, c = self._direction(form, np.meshgrid(*axes, indexing="ij"))
        slopes = np.stack([np.gradient(q, a, axis=i) for i, a in enumerate(axes)], axis=-1)
        gram = np.swapaxes(slopes, -1, -2) @ slopes
        area = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
        for i, a in enumerate(axes):
            area *= np.gradient(a).reshape([-1 if j == i else 1 for j in range(len(axes))])
        misfit = np.maximum(self._beyond(form) - c**2 - rest, 0.0)
        total = float(area.sum())
        mean = float((area * np.exp(-0.5 * misfit)).sum()) / total if total > 0.0 else 1.0
        return math.log(max(mean, 1e-300))

    def _direction(self, form: FormFunction, numbers: Iterable[Any]) -> tuple[Array, Array]:
        """Return the unit vector of the term with numbers, orthogonal to the others, and y along it."""
        A = self.columns(form, numbers)
        k = next(i for i, t in enumerate(form.terms) if t.numbers)
        a, F = A[..., k], self._others(A, k)
        off = a - (a @ F) @ F.T
        length = np.linalg.norm(off, axis=-1, keepdims=True)
        there = length > 1e-9 * np.linalg.norm(a, axis=-1, keepdims=True)
        q = np.where(there, off / np.where(there, length, 1.0), 0.0)
        return q, q @ self.y

    @staticmethod
    def _others(A: Array, k: int) -> Array:
        """Return orthonormal columns of the terms without numbers, which are alike for all numbers."""
        F = np.delete(A.reshape(-1, *A.shape[-2:])[0], k, axis=1)
        return np.asarray(np.linalg.qr(F / np.linalg.norm(F, axis=0))[0])

    def _beyond(self, form: FormFunction) -> float:
        """Return the squared length of y orthogonal to the terms without numbers."""
        k = next(i for i, t in enumerate(form.terms) if t.numbers)
        F = self._others(self.columns(form, form.numbers[len(form.terms) :]), k)
        return float(self.y @ self.y - np.sum((F.T @ self.y) ** 2))

    def _axis(self, number: str, term: Term, best: float, wide: float) -> Array:
        """Return the places of a number."""
        low, high = float(self.along.min()), float(self.along.max())
        largest = max(abs(low), abs(high))
        if number == "n":
            every = np.geomspace(*EXPONENTS, PLACES)
        elif term.signed:
            every = np.linspace(2.0 * low - high, 2.0 * high - low, PLACES)
        else:
            every = np.geomspace(FARTHEST * largest, largest / FARTHEST, PLACES)
        near = best + wide * np.linspace(-6.0, 6.0, NEAR)
        inside = (near > every[0]) & (near < every[-1])
        return np.unique(np.r_[every, near[inside]])


def linear(count: int, explained: float) -> float:
    """Return the log of the mean likelihood of k coefficients relative to the largest: -k/2 (1 + log(1 + g)).

    Examples
    --------
    >>> round(linear(1, math.e**9 - 1.0), 9)
    -5.0
    """
    return -0.5 * count * (1.0 + math.log1p(max(explained, 0.0) / count))
