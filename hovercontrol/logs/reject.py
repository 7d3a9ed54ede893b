"""Telling motion from a lost marker body: the longest chain of pieces that one craft could follow.

The pose is cut into pieces at every step that the neighbouring steps do not explain. A piece may
follow another if constant speed carries one end to the other's start within what pushes and
impacts allow. Dynamic programming picks the chain with the most samples; a heading that was turned
over for a while is left out although it is as smooth as the truth, because no step leads to it and
back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from hovercontrol.logs.log import Floats, Mask

PUSH = np.array([5.0, 5.0, 50.0])
"""Largest sustained acceleration of x, y [m/s^2] and psi [rad/s^2]; models reach a fifth."""

IMPACT = np.array([0.3, 0.3, 3.0])
"""Largest change of speed between two samples, by landing or hitting a wall [m/s, rad/s]."""

FARTHEST = np.array([0.5, 0.5, 2.0])
"""Largest departure from constant speed over a loss of sight [m, rad]; a flip is pi."""

FORGET = 2.0
"""After this long [s] without sight the craft may be anywhere."""

SPEED_SPAN = 0.08
"""Time [s] over which the speed at the end of a piece is taken, or four steps."""

LONGEST = 1.0
"""Pieces are cut at this length [s], so that part of a wrong one can be left out."""

LOOK_BACK = 100
"""Earlier pieces tried as predecessors."""

ROUGHNESS = 3.0
"""Samples that a link at the edge of the allowed costs."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Runs of smooth samples, rows ``first`` to ``last``, and the speeds (m, 3) at both ends."""

    first: np.ndarray[tuple[int], np.dtype[np.intp]]
    last: np.ndarray[tuple[int], np.dtype[np.intp]]
    speed_in: Floats
    speed_out: Floats
    single: Mask


def wrap(angle: Floats) -> Floats:
    """Return angles moved by whole turns into [-pi, pi).

    Examples
    --------
    >>> wrap(np.array([0.5, 2 * np.pi + 0.5]))
    array([0.5, 0.5])
    """
    turned: Floats = (angle + np.pi) % (2 * np.pi) - np.pi
    return turned


def follow(time: Floats, pose: Floats) -> tuple[Mask, Floats]:
    """Pick the samples that one craft could have passed, and count the turns of its heading.

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
    speed = median_filter(steps / dt, size=(5, 1), mode="nearest")
    surprise = np.abs(steps - speed * dt)
    noise = 8.0 * 1.4826 * np.median(surprise, axis=0) + 1e-6
    smooth = np.all(surprise <= noise + IMPACT * dt / 2, axis=1)
    pieces = _cut(time, steps / dt, smooth)
    chain = _best_chain(time, pose, pieces, noise)

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
            expected = straight[e, 2] + (mean * blind if blind < FORGET else 0.0)
            start = expected + float(wrap(np.asarray(start - expected)))
        straight[a : b + 1, 2] = start + psi[a : b + 1] - psi[a]
        accepted[a : b + 1] = True
        before = k
    return accepted, straight


def _cut(time: Floats, rates: Floats, smooth: Mask) -> Pieces:
    """Cut into pieces at steps that are not smooth and at whole multiples of ``LONGEST``."""
    block = np.floor((time - time[0]) / LONGEST)
    cut = ~smooth | (np.diff(block) > 0)
    first = np.concatenate([[0], np.flatnonzero(cut) + 1])
    last = np.concatenate([first[1:] - 1, [time.size - 1]])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(rates, axis=0)])
    usual = int(np.rint(SPEED_SPAN / np.median(np.diff(time))))
    reach = np.minimum(last - first, max(4, usual))
    count = np.maximum(reach, 1)[:, None]
    speed_in = (total[first + reach] - total[first]) / count
    speed_out = (total[last] - total[last - reach]) / count
    return Pieces(first, last, speed_in, speed_out, reach == 0)


def _best_chain(time: Floats, pose: Floats, pieces: Pieces, noise: Floats) -> list[int]:
    """Return the chain of pieces with the most samples, less what its rough links cost."""
    start, end = time[pieces.first], time[pieces.last]
    at_start, at_end = pose[pieces.first], pose[pieces.last]
    score = (pieces.last - pieces.first + 1).astype(float)
    previous = np.full(score.size, -1)
    leader = np.zeros(score.size, dtype=np.intp)  # the best piece up to each
    forgotten = np.searchsorted(end, start - FORGET, side="right") - 1
    for k in range(score.size):
        best, gain = -1, 0.0
        if forgotten[k] >= 0:
            best = int(leader[forgotten[k]])
            gain = score[best]
        near = slice(max(0, k - LOOK_BACK), k)
        if k:
            blind = (start[k] - end[near])[:, None]
            into = np.where(pieces.single[k], pieces.speed_out[near], pieces.speed_in[k])
            out = np.where(pieces.single[near, None], into, pieces.speed_out[near])
            missed = at_start[k] - at_end[near] - (into + out) / 2 * blind
            missed[:, 2] = wrap(missed[:, 2])
            pushed = np.minimum(IMPACT * blind + PUSH * blind**2 / 4, FARTHEST)
            allowed = pushed + noise * (1.0 + blind / SPEED_SPAN)
            rough = np.max(np.abs(missed) / allowed, axis=1)
            reached = np.where(rough <= 1.0, score[near] - ROUGHNESS * rough**2, -np.inf)
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
