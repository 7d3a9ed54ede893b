"""The threshold of a monitor, from the wanted rate of false alarms.

Without a change the whitened innovations e are independent N(0, 1), and each test is a known linear function
of them: ``b = sum of eta e`` with the signatures eta along a motion. So ``Z = b/J^(1/2)`` of candidate j,
window w and tick k is N(0, 1). With I = J + J0 and theta between -L and U, ``g = 2 b theta - I theta^2`` at
``theta = min(max(b/I, -L), U)`` exceeds the threshold h where b is above

    (h I)^(1/2)           if (h/I)^(1/2) <= U, else
    (h + U^2 I)/(2 U),

or below minus the same of L. With Q the upper tail of the normal distribution the probability of both is p_i,
i = (j, w, k). An alarm is followed by a reset: exceedances whose windows began before it belong to it,
and a later one raises the next alarm. With N the number of exceedances that belong to an alarm, the rate of
alarms over a time T is exactly

    rate = 1/T  sum over i of E[1{i exceeds} / N]

(Aldous, Probability Approximations via the Poisson Clumping Heuristic, 1989). The sum is a mean over draws of
i with probabilities proportional to p_i and of e given that i exceeds (Naiman and Priebe, Computing scan
statistic p values using importance sampling, JCGS 10, 2001).

The scores are those of innovations limited to +-LIMIT, ``b = sum of eta psi(e)``, and fewer of them exceed
the threshold than p_i says. With r = eta/|eta| and ``e = w + z r``, z is N(0, 1) and independent of w, and
``sum of r psi(w + z r)`` does not decrease with z. So for a given w test i exceeds if z is above the point
z* at which the sum reaches its limit, with the probability Q(z*). e is drawn with z from the normal tail
above z*, and the draw has the weight Q(z*)/p_i:

    rate = 1/T  sum of p  E[Q(z*)/p_i 1/N].

Each draw is an alarm, so that the effort does not grow as the wanted rate falls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from hovercontrol.base.arrays import Array
from hovercontrol.identification.monitor import bank

#: Draws in a set, and sets whose mean gives the threshold. The relative standard error of the rate is about
#: 8 % for one set and 3 % for the mean.
DRAWS, SETS = 500, 12

#: Share of the information that a motion brings in about a second, below which a window says little.
FLOOR = 0.05

#: Part of a signature below which an entry is left out: it brings 3e-8 to a score of about 5, and the z at
#: which it reaches the limit is so large that rounding there would matter.
NEGLIGIBLE = 1e-8


@dataclass(frozen=True)
class Signatures:
    """Signatures of all candidates and windows along a motion.

    Attributes
    ----------
    eta : ndarray, shape (K, W, J, m)
        By tick, window, candidate and measurement.
    start : ndarray, shape (K, W)
        Tick at which the content of a window began.
    information : ndarray, shape (K, W, J)
    moved : ndarray of bool, shape (K, W)
        Whether a window takes over the content of the one before after the tick.
    """

    eta: Array
    start: NDArray[np.int64]
    information: Array
    moved: NDArray[np.bool_]


def signatures_of(eta: Array, first: int) -> Signatures:
    """Return the windows' starts and information along a motion, given the signatures."""
    K, W, J, _ = eta.shape
    start, moved = np.zeros((K, W), int), np.zeros((K, W), bool)
    information = np.zeros((K, W, J))
    now, sums = np.zeros(W, int), np.zeros((W, J))
    for k in range(K):
        sums = sums + (eta[k] ** 2).sum(axis=2)
        start[k], information[k] = now, sums
        moved[k] = [(k + 1) % (first * 2**w) == 0 for w in range(W)]
        now, sums = next_content(now, k + 1, moved[k]), next_content(sums, 0.0, moved[k])
    return Signatures(eta, start, information, moved)


def next_content(content: NDArray[Any], fresh: float, moved: NDArray[np.bool_]) -> NDArray[Any]:
    """Return the windows' content for the next tick, along the first axis."""
    earlier = np.concatenate([np.full_like(content[:1], fresh), content[:-1]])
    return np.where(moved.reshape(-1, *[1] * (content.ndim - 1)), earlier, content)


def floors(found: Signatures) -> Array:
    """Return J0 of each candidate: a share of its mean information in the window of about a second."""
    w = min(2, found.eta.shape[1] - 1)
    return FLOOR * found.information[:, w].mean(axis=0)


def least_score(threshold: float, information: Array, bound: Array) -> Array:
    """Return the least b at which a test exceeds the threshold, with theta between 0 and a bound.

    Parameters
    ----------
    threshold : float
        h.
    information : ndarray, shape (..., J)
        I = J + J0.
    bound : ndarray, shape (J,)
        U, not negative.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        free = np.sqrt(threshold * information)
        held = (threshold + bound**2 * information) / (2.0 * bound)
        return np.asarray(np.where(threshold <= bound**2 * information, free, held))


def false_alarm_rate(
    found: Signatures,
    floor: Array,
    lower: Array,
    upper: Array,
    threshold: float,
    *,
    rest: int = 0,
    draws: int = DRAWS,
    seed: int = 1,
) -> float:
    """Return the rate of false alarms per tick.

    Parameters
    ----------
    floor : ndarray, shape (J,)
    lower, upper : ndarray, shape (J,)
        Bounds of theta, ``lower <= 0 <= upper``.
    threshold : float
        h.
    rest : int, optional
        Ticks after an alarm until the tests begin anew.
    draws, seed : int, optional
    """
    K, _, _, m = found.eta.shape
    longest = int(np.ptp(found.start[-1])) or K
    begin, end = min(longest, K // 3), K - min(longest, K // 3)
    rng = np.random.default_rng(seed)
    info = found.information[begin:end]
    # scores above `most[0]` and below `-most[1]` exceed the threshold
    most = [least_score(threshold, found.information + floor, bound) for bound in (upper, np.abs(lower))]
    with np.errstate(divide="ignore"):
        limit = np.stack([side[begin:end] / np.sqrt(info) for side in most])
    tails = ndtr(-limit)
    total = float(tails.sum())
    if total == 0.0:
        return 0.0
    strata = (np.arange(draws) + rng.uniform(size=draws)) / draws
    cumulative = np.cumsum(tails.ravel())
    chosen = np.searchsorted(cumulative, strata * cumulative[-1], side="right")
    chosen = np.minimum(chosen, np.flatnonzero(tails)[-1])
    side, k, w, j = np.unravel_index(chosen, tails.shape)
    noise = rng.standard_normal((draws, K, m), dtype=np.float32)
    within, weight = rng.uniform(size=draws), np.zeros(draws)
    for d in range(draws):
        tick = begin + int(k[d])
        since = found.start[tick, w[d]]
        ticks = np.arange(since, tick + 1)
        slots = (found.start[ticks] == since).argmax(axis=1)
        row = found.eta[ticks, slots, j[d]]
        row = row / np.sqrt((row**2).sum()) * (1.0 if side[d] == 0 else -1.0)
        rest_of = noise[d, ticks] - (row * noise[d, ticks]).sum() * row
        tail = ndtr(-_reaches(row, rest_of, limit[side[d], k[d], w[d], j[d]]))
        weight[d] = tail / tails[side[d], k[d], w[d], j[d]]
        if tail > 0.0:
            noise[d, ticks] = rest_of - ndtri(within[d] * tail) * row
    told = weight > 0.0
    if not told.any():
        return 0.0
    limited = np.clip(noise[told], -bank.LIMIT, bank.LIMIT)
    count = _in_one_alarm(found, limited, most, begin + k[told], rest)
    return total / (end - begin) * float(np.sum(weight[told] / np.maximum(count, 1.0))) / draws


def _reaches(row: Array, rest_of: Array, limit: float) -> float:
    """Return the least z at which ``sum of row psi(rest + z row)`` reaches a limit; infinity if none does.

    With each entry's ends, where ``rest + z row`` is -+LIMIT, the sum is linear between them: its slope rises
    by row^2 at the first and falls by it at the second.
    """
    shows = np.abs(row) > NEGLIGIBLE
    r, w = row[shows], rest_of[shows]
    if limit > bank.LIMIT * np.abs(r).sum():
        return float("inf")
    begins = -(bank.LIMIT * np.sign(r) + w) / r
    ends = np.concatenate([begins, begins + 2.0 * bank.LIMIT / np.abs(r)])
    order = np.argsort(ends)
    ends, slope = ends[order], np.cumsum(np.concatenate([r**2, -(r**2)])[order])
    sums = np.concatenate([[0.0], np.cumsum(slope[:-1] * np.diff(ends))]) - bank.LIMIT * np.abs(r).sum()
    return float(np.interp(limit, sums, ends))


def _in_one_alarm(
    found: Signatures, noise: NDArray[np.float32], most: Sequence[Array], at: NDArray[np.int64], rest: int
) -> Array:
    """Return the number of exceedances in the alarm to which those at a tick belong, for each draw of noise.

    Scores above ``most[0]`` and below ``-most[1]`` exceed the threshold. An exceedance whose window began
    later than `rest` ticks after the last alarm raises the next alarm; any other belongs to the last alarm,
    because a reset would have taken its samples away.
    """
    draws, (K, W, J, m) = len(at), found.eta.shape
    unit = 1.0 / np.sqrt(np.maximum(found.information.max(axis=(0, 1)), 1e-300))
    eta = (found.eta * unit[:, None]).reshape(K, W * J, m).swapaxes(1, 2).astype(np.float32, order="C")
    above, below = ((side * unit).reshape(K, W * J) for side in most)
    square = (np.minimum(above, below) ** 2).astype(np.float32)
    b, work = np.zeros((2, draws, W * J), np.float32)
    windows, over = b.reshape(draws, W, J), np.zeros((draws, W * J), bool)
    count, last, ended = np.zeros(draws), np.full(draws, -rest - 1), np.zeros(draws, bool)
    moving = found.moved.sum(axis=1)  # windows 0 ... moving - 1
    for tick in range(K):
        b += np.matmul(noise[:, tick], eta[tick], out=work)
        hits = np.flatnonzero(np.greater(np.multiply(b, b, out=work), square[tick], out=over))
        if hits.size:
            score, test = b.ravel()[hits], hits % (W * J)
            hits = hits[(score > above[tick, test]) | (score < -below[tick, test])]
            run, window = hits // (W * J), hits % (W * J) // J
            fresh = np.zeros(draws, bool)
            fresh[run[found.start[tick, window] > last[run] + rest]] = True
            ended |= fresh & (at < tick)
            count[fresh & ~ended] = 0.0
            last[fresh] = tick
            count += np.bincount(run, minlength=draws) * ~ended
        if moving[tick]:
            windows[:, 1 : moving[tick]] = windows[:, : moving[tick] - 1].copy()
            windows[:, 0] = 0.0
    return count


def threshold_for(
    found: Signatures, floor: Array, lower: Array, upper: Array, rate: float, *, rest: int = 0
) -> float:
    """Return the threshold with a rate of false alarms per tick.

    The rate falls about as ``exp(-h/2)``, and each step corrects h by that. Steps use the same set of draws
    until they are short; the last two use SETS/2 new ones each, and the threshold is the mean of both.
    """
    h = 2.0 * np.log(0.1 * found.eta.shape[1] * found.eta.shape[2] / rate)

    def corrected(h: float, seeds: range) -> float:
        mean = np.mean([false_alarm_rate(found, floor, lower, upper, h, rest=rest, seed=s) for s in seeds])
        return float(h + 2.0 * np.log(mean / rate)) if mean > 0.0 else h

    for _ in range(6):
        before, h = h, corrected(h, range(1, 2))
        if abs(h - before) < 0.2:
            break
    one = corrected(h, range(2, 2 + SETS // 2))
    return 0.5 * (one + corrected(one, range(2 + SETS // 2, 2 + SETS)))
