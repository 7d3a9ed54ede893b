"""Groups: products or sums of parameters that logs determine though they determine no single member.

The motor of ``J v' = k u - c v`` shows k/J and c/J; of J, k and c alone any multiple fits as well. Relative
steps ``dp/p`` that change nothing measured span the null space N of the information matrix. A product of
powers ``prod p_i^e_i`` is determined if its exponents e are orthogonal to N, a sum if the same holds for
absolute steps (Bellman and Astrom, Math. Biosci. 7 (1970), define structural identifiability; the
combinations follow from the null space as in Eisenberg and Hayashi, Math. Biosci. 256 (2014)).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hovercontrol.base.arrays import Array, Mask
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.units import dimension, simplified

#: Largest exponent and number of members of a group that is looked for.
HIGHEST, MEMBERS = 4, 4

#: Relative size below which a component of a direction counts as zero, and largest error of an exponent.
PIVOT, ROUND = 1e-3, 0.02


@dataclass(frozen=True)
class Group:
    """A product or sum of parameters that the logs determine.

    Attributes
    ----------
    name : str
        ``"k/J"``, ``"m1 + m2"``.
    value, std : float
        Estimate and standard error.
    unit : str
    members : mapping of str to int
        The parameters, none of which the logs determine alone, with their exponents or factors.
    added : bool
        Whether it is a sum.
    """

    name: str
    value: float
    std: float
    unit: str
    members: Mapping[str, int]
    added: bool = False

    __repr__ = short_repr

    def of(self, values: Mapping[str, float]) -> float:
        """Return the value of the group for other values of its members."""
        each = [(values[n], k) for n, k in self.members.items()]
        return sum(k * p for p, k in each) if self.added else math.prod(p**k for p, k in each)


def group_text(name: str, found: Sequence[Group]) -> str:
    """Return why a parameter is not determined alone; empty if it is in no group."""
    own = [g for g in found if name in g.members]
    if not own:
        return ""
    others = ", ".join(dict.fromkeys(n for g in own for n in g.members))
    return (
        f"the logs show only {', '.join(g.name for g in own)}: measure one of {others}, and keep it (fixed)"
    )


def groups(
    directions: Array,
    C: Array,
    wide: Array,
    size: Array,
    values: Mapping[str, float],
    units: Mapping[str, str],
    last: Sequence[str] = (),
) -> tuple[Group, ...]:
    """Return the groups of parameters that logs determine; empty if there are none with integer exponents.

    A group counts as determined if its relative standard error is below 1.

    Parameters
    ----------
    directions : ndarray, shape (P, m)
        Steps of the parameters, in sizes, that change nothing measured
        (:func:`~hovercontrol.identification.engine.excitation.unexcited_directions`).
    C : ndarray, shape (P, P)
        Covariance of the parameters by the noise alone.
    wide : ndarray, shape (P, P)
        Covariance by the scatter of blocks; the larger variance of the two applies.
    size : ndarray, shape (P,)
    values, units : mapping
        Estimate and unit of each parameter, in order.
    last : sequence of str, optional
        Parameters preferred as denominators.

    Examples
    --------
    >>> C = np.array([[1e4, 2e4], [2e4, 4e4 + 1e-4]])
    >>> directions = np.array([[1.0], [2.0]]) / 5.0**0.5
    >>> (one,) = groups(directions, C, 0.0 * C, np.ones(2), {"k": 1.0, "m": 2.0}, {"k": "N/A", "m": "kg"})
    >>> one.name, one.value, round(one.std, 4), one.unit
    ('k/m', 0.5, 0.0025, 'N/A/kg')
    """
    names = list(values)
    part = (directions**2).sum(axis=1)
    alone = part > 1.0 - PIVOT  # nothing measured depends on it
    own = np.flatnonzero((part > PIVOT) & ~alone).tolist()
    own.sort(key=lambda j: names[j] in last)
    p = np.array([values[names[j]] for j in own])
    steps = directions[own][:, (directions[own] ** 2).sum(axis=0) > PIVOT] * size[own][:, None]
    if len(own) < 2 or not steps.shape[1]:
        return ()
    both = np.stack([C, wide])[:, own][:, :, own]
    labels, texts = [names[j] for j in own], [units[names[j]] for j in own]
    if np.all(p != 0.0):  # products: relative steps dp/p
        every = _integer(steps / p[:, None], both / np.outer(p, p), [n in last for n in labels])
        if every:
            return tuple(_product(labels, texts, p, e, variance) for e, variance in every)
    if len({dimension(unit) for unit in texts}) > 1:
        return ()
    every = _integer(steps, both, [False] * len(own))  # sums: absolute steps
    return tuple(_sum(labels, units[labels[0]], p, e, variance) for e, variance in every)


def _integer(steps: Array, both: Array, last: Sequence[bool]) -> list[tuple[Array, float]]:
    """Return independent integer combinations e orthogonal to some steps, with the larger of two variances.

    The simplest ones: of few members, with small exponents, those in `last` negative.
    """
    n = len(steps)
    late = np.array(last)
    tried: list[tuple[tuple[float, ...], Array]] = []
    for count in range(2, min(n, MEMBERS) + 1):
        for own in combinations(range(n), count):
            e = _orthogonal(steps[list(own)])
            if e is None:
                continue
            whole = np.zeros(n)
            whole[list(own)] = e
            key, whole = min(((_order(one, late), one) for one in (whole, -whole)), key=lambda pair: pair[0])
            tried.append((key, whole))
    found: list[tuple[Array, float]] = []
    for _, e in sorted(tried, key=lambda one: one[0]):
        variances = np.einsum("i,kij,j->k", e, both, e)
        rank = np.linalg.matrix_rank(np.array([*(f for f, _ in found), e]))
        if variances[0] < 1.0 and rank > len(found):
            found.append((e, float(variances.max())))
    return found


def _order(e: Array, last: Mask) -> tuple[float, ...]:
    """Return a key that is smallest for few members, small exponents, few denominators, those in `last`."""
    below = e < 0
    mismatched = int((below & ~last).sum() + (last & (e > 0)).sum())
    return (
        int(np.count_nonzero(e)),
        float(np.abs(e).sum()),
        int(below.sum()),
        mismatched,
        float(-e[e != 0][0]),
    )


def _orthogonal(steps: Array) -> Array | None:
    """Return small integers e with ``e' steps = 0``, none of them zero; None if there are none."""
    left, s, _ = np.linalg.svd(steps)
    open_ = left[:, int((s > PIVOT * s[0]).sum()) :]
    if open_.shape[1] != 1 or np.abs(open_).min() < PIVOT:
        return None
    row = open_[:, 0] / open_[np.abs(open_).argmin(), 0]
    for times in range(1, HIGHEST + 1):
        e = np.round(times * row)
        if np.abs(e - times * row).max() < ROUND and np.abs(e).max() <= HIGHEST:
            return np.asarray(e)
    return None


def _product(labels: Sequence[str], units: Sequence[str], p: Array, e: Array, variance: float) -> Group:
    """Return the product of powers e of parameters, with the variance of its logarithm."""

    def power(name: str, k: int) -> str:
        return name if k == 1 else f"{name}^{k}"

    members = {n: int(k) for n, k in zip(labels, e, strict=True) if k}
    above = [power(n, k) for n, k in members.items() if k > 0]
    below = [power(n, -k) for n, k in members.items() if k < 0]
    value = float(np.prod(p**e))
    unit = simplified("*".join(f"({one})^{int(k)}" for one, k in zip(units, e, strict=True) if k))
    name = "/".join(["*".join(above) or "1", *below])
    return Group(name, value, abs(value) * variance**0.5, unit, members)


def _sum(labels: Sequence[str], unit: str, p: Array, e: Array, variance: float) -> Group:
    """Return the sum of parameters with integer factors e."""
    members = {n: int(k) for n, k in zip(labels, e, strict=True) if k}
    terms = [("-" if k < 0 else "+", n if abs(k) == 1 else f"{abs(k)} {n}") for n, k in members.items()]
    name = " ".join(word for term in terms for word in term).removeprefix("+ ")
    return Group(name, float(p @ e), variance**0.5, unit, members, added=True)
