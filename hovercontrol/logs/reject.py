"""Rejection of samples that are not motion: the best chain of pieces that one craft could follow.

The pose is cut into pieces at every step that the neighbouring steps do not explain. A link from one piece to
another has a cost: the deviation of the second piece's start from a motion at constant speed, relative to the
deviation that forces, impacts and noise explain (estimated from the log itself, :class:`Limits`). Only a link
between two consecutive samples may deviate by more than that. Dynamic programming finds the chain with the
highest score, its number of samples minus the cost of its links. A heading that is flipped for a while is
rejected although it is as smooth as the truth, because the steps there and back cost more than its samples.
A small permanent shift is kept, because rejecting the rest of the log would cost more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from hovercontrol.base.short_repr import short_repr
from hovercontrol.logs.log import Floats, Mask


@dataclass(frozen=True)
class RejectionCriteria:
    """Thresholds for samples of a pose that are not motion of the craft.

    No published source: set by hand on recorded logs, tested in tests/logs/test_smooth.py and
    tests/logs/test_real.py.

    Attributes
    ----------
    usual : float
        Largest deviation of a step from its neighbours, in median deviations: twelve standard deviations.
    spare : int
        Number of steps in the median that gives the speed; two wrong samples in a row affect three steps.
    uneven : float
        Factor by which the scatter of steps in fast motion may exceed that of the log.
    neighbours : int
        Number of samples from which the local scatter of steps is estimated.
    pushed : float
        Largest sustained acceleration, relative to the 90 % quantile of the log.
    stops : float
        Time in which a landing craft loses the log's highest speed [s].
    bump : float
        Largest change of speed between two samples, in a collision, relative to the log's highest speed.
    farthest_turn : float
        Largest deviation of the heading from a constant rate over a loss of sight [rad]; a flip is pi.
    farthest_time : float
        Largest deviation of the position from constant speed over a loss of sight, as time at the log's
        highest speed [s].
    forget : float
        Loss of sight after which the craft may be anywhere [s].
    speed_span : float
        Time over which the speed at the end of a piece is averaged [s], at least four steps.
    longest : float
        Maximum length of a piece [s], so that part of a wrong one can be rejected.
    look_back : int
        Number of earlier pieces tried as predecessors.
    at_once : float
        Maximum length, in steps, of a link that may exceed the explained deviation: a shift between two
        samples.
    roughness : float
        Cost, in samples, of a link at the largest explained deviation; the cost is quadratic in the
        deviation.
    """

    usual: float = 12.0 * 1.4826
    spare: int = 7
    uneven: float = 4.0
    neighbours: int = 51
    pushed: float = 4.0
    stops: float = 0.2
    bump: float = 1.0 / 3.0
    farthest_turn: float = 2.0
    farthest_time: float = 1.0
    forget: float = 2.0
    speed_span: float = 0.08
    longest: float = 1.0
    look_back: int = 100
    at_once: float = 1.5
    roughness: float = 3.0


#: The values in use.
REJECTION = RejectionCriteria()


@dataclass(frozen=True, eq=False)
class Limits:
    """Largest deviations that a log explains, for x, y, psi.

    All follow from quantiles, so that a few per cent of wrong samples hardly change them.

    Attributes
    ----------
    noise : ndarray (3,)
        Largest deviation of a step from its neighbours in undisturbed motion [m, rad].
    local : ndarray (n - 1, 3)
        The same for each step, from the scatter around it.
    push : ndarray (3,)
        Sustained acceleration [m/s^2, rad/s^2].
    impact : ndarray (3,)
        Change of speed between two samples [m/s, rad/s].
    farthest : ndarray (3,)
        Deviation from constant speed over a loss of sight [m, rad].
    """

    noise: Floats
    local: Floats
    push: Floats
    impact: Floats
    farthest: Floats

    __repr__ = short_repr

    @classmethod
    def of(cls, time: Floats, speed: Floats, surprise: Floats) -> Limits:
        """Return the limits of a log.

        Parameters
        ----------
        time : ndarray (n,)
        speed : ndarray (n - 1, 3)
            Speed at each step, by a median without single outliers.
        surprise : ndarray (n - 1, 3)
            Absolute difference of each step from speed times its duration.
        """
        step = float(np.median(np.diff(time)))
        reach = min(_reach(step), len(speed) - 1)
        change = np.abs(speed[reach:] - speed[:-reach]) / (reach * step)
        usual, fastest = np.quantile(change, 0.9, axis=0), np.quantile(np.abs(speed), 0.99, axis=0)
        for row in (usual, fastest):
            row[:2] = row[:2].max()  # x and y alike, because the craft turns
        noise = REJECTION.usual * np.median(surprise, axis=0) + 1e-6
        around = REJECTION.usual * median_filter(surprise, size=(REJECTION.neighbours, 1), mode="nearest")
        return cls(
            noise,
            np.clip(around, noise, REJECTION.uneven * noise),
            np.maximum(REJECTION.pushed * usual, fastest / REJECTION.stops),
            REJECTION.bump * fastest,
            np.append(REJECTION.farthest_time * fastest[:2], REJECTION.farthest_turn),
        )


@dataclass(frozen=True, eq=False)
class Pieces:
    """Runs of smooth samples, rows ``first`` to ``last``, with the speeds (m, 3) at both ends."""

    first: np.ndarray[tuple[int], np.dtype[np.intp]]
    last: np.ndarray[tuple[int], np.dtype[np.intp]]
    speed_in: Floats
    speed_out: Floats
    single: Mask

    __repr__ = short_repr


def wrap(angle: Floats) -> Floats:
    """Return angles wrapped to [-pi, pi).

    Examples
    --------
    >>> wrap(np.array([0.5, 2 * np.pi + 0.5]))
    array([0.5, 0.5])
    """
    turned: Floats = (angle + np.pi) % (2 * np.pi) - np.pi
    return turned


def follow(time: Floats, pose: Floats) -> tuple[Mask, Floats]:
    """Select the samples that one craft could have followed, and unwrap its heading.

    Parameters
    ----------
    time : ndarray (n,)
        Steady times [s].
    pose : ndarray (n, 3)
        x, y [m], psi [rad, wrapped or not].

    Returns
    -------
    accepted : ndarray (n,) of bool
    pose : ndarray (n, 3)
        With psi continuous over the accepted samples.
    """
    steps = np.diff(pose, axis=0)
    steps[:, 2] = wrap(steps[:, 2])
    dt = np.diff(time)[:, None]
    speed = median_filter(steps / dt, size=(REJECTION.spare, 1), mode="nearest")
    surprise = np.abs(steps - speed * dt)
    limits = Limits.of(time, speed, surprise)
    explained = limits.local + limits.impact * dt / 2
    explained[:, 2] = np.minimum(explained[:, 2], REJECTION.farthest_turn / 2)
    smooth = np.all(surprise <= explained, axis=1)
    pieces = _cut(time, steps / dt, smooth)
    chain = _best_chain(time, pose, pieces, limits)

    accepted = np.zeros(time.size, dtype=bool)
    straight = pose.copy()
    psi = np.concatenate([[0.0], np.cumsum(steps[:, 2])])
    before = None
    for k in chain:
        a, b = pieces.first[k], pieces.last[k]
        start = pose[a, 2]
        if before is not None:
            e = pieces.last[before]
            mean = (pieces.speed_out[before, 2] + pieces.speed_in[k, 2]) / 2
            blind = time[a] - time[e]
            expected = straight[e, 2] + (mean * blind if blind < REJECTION.forget else 0.0)
            start = expected + float(wrap(np.asarray(start - expected)))
        straight[a : b + 1, 2] = start + psi[a : b + 1] - psi[a]
        accepted[a : b + 1] = True
        before = k
    return accepted, straight


def _cut(time: Floats, rates: Floats, smooth: Mask) -> Pieces:
    """Cut into pieces at steps that are not smooth and at multiples of ``REJECTION.longest``."""
    block = np.floor((time - time[0]) / REJECTION.longest)
    cut = ~smooth | (np.diff(block) > 0)
    first = np.concatenate([[0], np.flatnonzero(cut) + 1])
    last = np.concatenate([first[1:] - 1, [time.size - 1]])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(rates, axis=0)])
    reach = np.minimum(last - first, _reach(float(np.median(np.diff(time)))))
    count = np.maximum(reach, 1)[:, None]
    speed_in = (total[first + reach] - total[first]) / count
    speed_out = (total[last] - total[last - reach]) / count
    return Pieces(first, last, speed_in, speed_out, reach == 0)


def _reach(step: float) -> int:
    """Return the number of steps over which the speed at the end of a piece is averaged."""
    return max(4, int(np.rint(REJECTION.speed_span / step)))


def _best_chain(time: Floats, pose: Floats, pieces: Pieces, limits: Limits) -> list[int]:
    """Return the chain of pieces with the highest score: its samples minus the cost of its links."""
    # A link over the time T from piece j to k deviates by  d = p_k - p_j - (v_j + v_k)/2 T.  Allowed is
    # a = min(impact T + push T^2/4, farthest) + noise (1 + T/speed_span);  rho = max |d|/a over x, y, psi.
    # Dynamic programming:  score_k = samples_k + max over j of (score_j - roughness rho^2).
    noise = np.vstack([limits.noise, limits.local])[pieces.first]  # of the step into each piece
    step = float(np.median(np.diff(time)))
    start, end = time[pieces.first], time[pieces.last]
    at_start, at_end = pose[pieces.first], pose[pieces.last]
    score = (pieces.last - pieces.first + 1).astype(float)
    previous = np.full(score.size, -1)
    leader = np.zeros(score.size, dtype=np.intp)  # the best piece up to each
    forgotten = np.searchsorted(end, start - REJECTION.forget, side="right") - 1
    for k in range(score.size):
        best, gain = -1, 0.0
        if forgotten[k] >= 0:
            best = int(leader[forgotten[k]])
            gain = score[best]
        near = slice(max(0, k - REJECTION.look_back), k)
        if k:
            blind = (start[k] - end[near])[:, None]
            into = np.where(pieces.single[k], pieces.speed_out[near], pieces.speed_in[k])
            out = np.where(pieces.single[near, None], into, pieces.speed_out[near])
            missed = at_start[k] - at_end[near] - (into + out) / 2 * blind
            missed[:, 2] = wrap(missed[:, 2])
            pushed = np.minimum(limits.impact * blind + limits.push * blind**2 / 4, limits.farthest)
            allowed = pushed + noise[k] * (1.0 + blind / REJECTION.speed_span)
            allowed[:, 2] = np.minimum(allowed[:, 2], REJECTION.farthest_turn)
            rough = np.max(np.abs(missed) / allowed, axis=1)
            possible = (rough <= 1.0) | (blind[:, 0] <= REJECTION.at_once * step)
            reached = np.where(possible, score[near] - REJECTION.roughness * rough**2, -np.inf)
            j = int(reached.argmax())
            if reached[j] > gain:
                best, gain = near.start + j, reached[j]
        score[k] += gain
        previous[k] = best
        leader[k] = k if k == 0 or score[k] > score[leader[k - 1]] else leader[k - 1]
    chain = [int(leader[-1])]
    while previous[chain[-1]] >= 0:
        chain.append(int(previous[chain[-1]]))
    return chain[::-1]
