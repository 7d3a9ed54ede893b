"""The least-squares problem of multiple shooting: residuals, sensitivities, and windows eliminated.

Unknown are the coefficients and, for each window, the initial states. Given the coefficients each
window's states are a small problem of their own; eliminating them (Schur complement) leaves one
small system in the coefficients, exact for the linearised problem (Bock, "Randwertproblemmethoden",
1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.block import Block
from hovercontrol.identify.measure import Measured
from hovercontrol.identify.shooting import Shooter, Windows, cut

Array = NDArray[np.float64]

#: Relative size of the perturbations of central differences.
NUDGE = 1e-5

#: An initial state is at rest if it is within so many standard errors of zero.
RESTING = 3.0

#: Numbers that one group of windows may hold in memory at once (100 MB of states).
GROUP = 12_000_000


@dataclass(frozen=True, eq=False)
class Point:
    """The problem linearised at one choice of coefficients and initial states.

    Attributes
    ----------
    p : ndarray, shape (P,)
        Coefficients.
    x0 : list of ndarray, shape (n_states, W)
        Initial states, by group of windows.
    residual : list of ndarray, shape (W, K, C)
        Measured minus simulated; zero where nothing was measured.
    jacobian : list of ndarray, shape (W, K, C, n + P)
        Of the simulated channels by the initial states that matter and the coefficients; zero
        likewise.
    finite : bool
        Whether nothing ran away.
    """

    p: Array
    x0: list[Array]
    residual: list[Array]
    jacobian: list[Array]
    finite: bool


@dataclass(frozen=True, eq=False)
class Reduced:
    """The weighted normal equations with initial states eliminated: ``S dp = g``.

    Attributes
    ----------
    S, g : ndarray, shapes (P, P) and (P,)
    scores : ndarray, shape (W, P)
        What each window adds to g.
    back : list of (ndarray, ndarray)
        By group: ``dx0 = a - B dp``; shapes (W, n), (W, n, P).
    state_std : list of ndarray, shape (W, n)
        Standard errors of the initial states, the coefficients being known; infinite where not
        measured.
    """

    S: Array
    g: Array
    scores: Array
    back: list[tuple[Array, Array]]
    state_std: list[Array]


class Problem:
    """Windows of logs against a Block.

    Parameters
    ----------
    block : Block
    coefficients : sequence of str
        Full names of the Block's parameters that are sought.
    logs, states, ranges
        As for :func:`~hovercontrol.identify.shooting.cut`.
    channels : sequence of str
        Measured channels.
    """

    def __init__(
        self,
        block: Block,
        coefficients: Sequence[str],
        logs: Sequence[Measured],
        states: Sequence[Array],
        channels: Sequence[str],
        ranges: Sequence[tuple[int, int, int]],
    ) -> None:
        self.block, self.names, self.channel_names = block, tuple(coefficients), tuple(channels)
        signals = [block.parameter(name) for name in coefficients]
        keys = [p.name for p in block.parameters]
        self._at = [keys.index(s.name) for s in signals]
        self.lower = np.array([s.lower for s in signals])
        self.upper = np.array([s.upper for s in signals])
        self.nominal = np.array([s.nominal for s in signals])
        self.start = np.array([s.start for s in signals])
        self._free = states_that_matter(block, channels)
        copies = 1 + 2 * (len(self._free) + len(self.names))
        per_row = copies * max(len(block.states), len(channels))
        self.groups = [cut(logs, states, channels, part) for part in _groups(ranges, per_row)]
        self.ranges = tuple(ranges)
        self._shooters: list[Shooter] = []

    def first_states(self) -> list[Array]:
        """Return the guess of all initial states, by group."""
        return [group.start for group in self.groups]

    def set_step(self, step: float) -> None:
        """Choose the longest sub-step [s]."""
        self._shooters = [Shooter(self.block, w, self.channel_names, step) for w in self.groups]

    def parameters(self, p: Array) -> list[float]:
        """Return every parameter of the Block, the coefficients as in `p`."""
        every = list(self.block.parameter_values())
        for at, value in zip(self._at, p.tolist(), strict=True):
            every[at] = value
        return every

    def linearise(self, p: Array, x0: list[Array]) -> Point:
        """Simulate all windows with central differences in the initial states and coefficients.

        Central differences rather than variational equations: they need no derivative of the
        Block's expressions, outputs included, and agree with the exact Jacobian to 1e-4 of each
        column's largest entry with dry friction of width 0.01. Measured with 14 unknowns: half
        the time of the exact equations for 40 windows (the copies ride along in the same array
        operations), three times theirs for 400.
        """
        residual, jacobian, finite = [], [], True
        for shooter, group, x in zip(self._shooters, self.groups, x0, strict=True):
            r, J = self._group(shooter, group, p, x)
            seen = np.isfinite(group.values).transpose(1, 2, 0)
            r = np.where(seen, r, 0.0)
            J = np.where(seen[..., None], J, 0.0)
            finite = finite and bool(np.isfinite(r).all() and np.isfinite(J).all())
            residual.append(r)
            jacobian.append(J)
        return Point(p, x0, residual, jacobian, finite)

    def _group(self, shooter: Shooter, group: Windows, p: Array, x0: Array) -> tuple[Array, Array]:
        n, P = len(self._free), len(p)
        lanes = np.repeat(x0[:, None, :], 1 + 2 * (n + P), axis=1)
        width = np.empty(n + P)
        for j, i in enumerate(self._free):
            step = NUDGE * self.block.states[i].nominal
            lanes[i, 1 + j] += step
            lanes[i, 1 + n + P + j] -= step
            width[j] = 2 * step
        values: list[float | Array] = list(self.parameters(p))
        for j, at in enumerate(self._at):
            step = NUDGE * max(abs(p[j]), self.nominal[j])
            column = np.full((lanes.shape[1], 1), p[j])
            up, down = min(p[j] + step, self.upper[j]), max(p[j] - step, self.lower[j])
            column[1 + n + j], column[1 + n + P + n + j] = up, down
            width[n + j] = up - down
            values[at] = column
        Y = shooter.channels(lanes, values)
        J = (Y[:, :, 1 : 1 + n + P] - Y[:, :, 1 + n + P :]) / width[:, None]
        r = group.values.transpose(1, 2, 0) - Y[:, :, 0].transpose(2, 0, 1)
        return r, np.ascontiguousarray(J.transpose(3, 0, 1, 2))

    def reduce(self, point: Point, weights: list[Array], damping: list[Array] | None = None) -> Reduced:
        """Return the normal equations in the coefficients.

        Parameters
        ----------
        point : Point
        weights : list of ndarray, shape (W, K, C)
            One over the standard deviation of each residual.
        damping : list of ndarray, shape (W,), optional
            Levenberg-Marquardt's of each window's initial states, relative to the diagonal.
        """
        n, P = len(self._free), len(self.names)
        S, g, back, scores, stds = np.zeros((P, P)), np.zeros(P), [], [], []
        none = [np.zeros(len(r)) for r in point.residual]
        for r, J, weight, damp in zip(point.residual, point.jacobian, weights, damping or none, strict=True):
            W = len(r)
            A = (J * weight[..., None]).reshape(W, -1, n + P)
            H = A.swapaxes(1, 2) @ A
            f = (A.swapaxes(1, 2) @ (r * weight).reshape(W, -1, 1))[..., 0]
            size = np.sqrt(np.diagonal(H[:, :n, :n], axis1=1, axis2=2))
            measured = size > 0
            size = np.where(measured, size, 1.0)
            Haa = H[:, :n, :n] / (size[:, :, None] * size[:, None, :])
            Haa = Haa + (1e-10 + damp)[:, None, None] * np.eye(n)
            inverse = np.linalg.inv(Haa) / (size[:, :, None] * size[:, None, :])
            variance = np.diagonal(inverse, axis1=1, axis2=2)
            stds.append(np.where(measured, np.sqrt(np.maximum(variance, 0.0)), np.inf))
            a = (inverse @ f[:, :n, None])[..., 0]
            B = inverse @ H[:, :n, n:]
            score = f[:, n:] - np.einsum("wnp,wn->wp", H[:, :n, n:], a)
            S += (H[:, n:, n:] - H[:, n:, :n] @ B).sum(axis=0)
            g += score.sum(axis=0)
            back.append((a, B))
            scores.append(score)
        return Reduced((S + S.T) / 2, g, np.concatenate(scores), back, stds)

    def move(self, x0: list[Array], back: list[tuple[Array, Array]], dp: Array) -> list[Array]:
        """Return the initial states that go with a step of the coefficients."""
        moved = []
        for x, (a, B) in zip(x0, back, strict=True):
            new = x.copy()
            new[self._free] += (a - B @ dp).T
            moved.append(new)
        return moved

    def at_rest(self, x0: list[Array], state_std: list[Array]) -> list[Array]:
        """Return the initial states, those set to zero that are zero but for noise.

        A velocity that is fitted to noise is not zero, and drag seems to act on it; what a log
        tells of drag must be judged without.
        """
        rested = []
        for x, std in zip(x0, state_std, strict=True):
            new = x.copy()
            new[self._free] = np.where(np.abs(x[self._free]) < RESTING * std.T, 0.0, x[self._free])
            rested.append(new)
        return rested


def states_that_matter(block: Block, channels: Sequence[str]) -> list[int]:
    """Return the indices of the states on which the channels depend, directly or through others."""
    symbols = {s.symbol: i for i, s in enumerate(block.states)}
    expressions = {**block.derivatives, **block.output_expressions}
    matter: set[int] = set()
    todo = [block.signal(c).symbol if c in block.derivatives else expressions[c] for c in channels]
    while todo:
        for symbol in block.expand(todo.pop()).free_symbols & symbols.keys():
            i = symbols[symbol]
            if i not in matter:
                matter.add(i)
                todo.append(block.derivatives[block.states[i].name])
    return sorted(matter)


def _groups(ranges: Sequence[tuple[int, int, int]], per_row: int) -> list[list[tuple[int, int, int]]]:
    """Sort windows by length and group them so that padding and memory stay small."""
    order = sorted(ranges, key=lambda r: r[2] - r[1], reverse=True)
    groups: list[list[tuple[int, int, int]]] = []
    for window in order:
        longest = groups[-1][0][2] - groups[-1][0][1] if groups else 0
        fits = groups and (len(groups[-1]) + 1) * longest * per_row <= GROUP
        if fits and 2 * (window[2] - window[1]) >= longest:
            groups[-1].append(window)
        else:
            groups.append([window])
    return groups
