"""Packets that get lost between controller and craft: how many a sampled loop bears in the mean square.

Each packet is lost with one probability, whatever the others do. The loop's second moment then follows a
linear recursion, and the loop is stable in the mean square if and only if that shrinks.

K06 section 5.3.3 names the scalar case [K06 eq 5.2] under the law [K06 eq 5.3], with packets that are sent
once more if they arrive corrupted, probability q: both are with q^2, so that ``a^2 q^2 > 1`` is what cannot
be stabilised, ``|a| q > 1`` as K06 prints. Without a second try it is ``a^2 q > 1``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from hovercontrol.base.arguments import as_row, at_least
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import number
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.linear_systems import over_period
from hovercontrol.control.analysis.cut_loop import CutLoop, Point

Lost = Literal["hold", "zero"]

#: Step of the loss probability in which a critical one is looked for.
STEP = 0.01


@checked
@dataclass(frozen=True, eq=False)
class PacketLoop:
    """A sampled loop over a lossy link: ``x(k+1) = arrives x(k)``, or ``lost x(k)`` if the packet is lost.

    Parameters
    ----------
    arrives, lost : ndarray, shape (n_steps, n, n)
        One step if nothing changes with time; else those of one period. In the units of the states.

    Raises
    ------
    InputError
        If the matrices are not square and alike.

    Examples
    --------
    K06 (5.2)-(5.3): ``x(k+1) = a x(k) + u(k)``, ``u = -a x``, a = 2:

    >>> loop = PacketLoop(np.zeros((1, 1, 1)), np.full((1, 1, 1), 2.0))
    >>> round(loop.critical, 6)  # 1/a^2
    0.25
    >>> round(loop.critical_corruption(), 6)  # 1/a: each packet is sent once more
    0.5
    """

    arrives: Array
    lost: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        shapes = [np.shape(m) for m in (self.arrives, self.lost)]
        if shapes[0] != shapes[1] or len(shapes[0]) != 3 or shapes[0][1] != shapes[0][2] or not shapes[0][0]:
            raise InputError(
                f"packet loop: expected two arrays (n_steps, n, n), found {shapes[0]}, {shapes[1]}"
            )

    def second_moment(self, loss: float) -> Array:
        """Return what takes ``E[x x']``, as a column, through all steps; shape (n^2, n^2).

        Parameters
        ----------
        loss : float
            Probability that a packet is lost, 0 to 1.

        Raises
        ------
        InputError
            If the probability is not between 0 and 1.
        """
        if not 0 <= number("loss", loss) <= 1:
            raise InputError(f"loss: expected a probability, 0 to 1, found {loss!r}")
        whole = np.eye(self.arrives.shape[1] ** 2)
        for good, bad in zip(self.arrives, self.lost, strict=True):
            whole = ((1 - loss) * np.kron(good, good) + loss * np.kron(bad, bad)) @ whole
        return whole

    def growth(self, loss: float) -> float:
        """Return the factor by which the mean square grows in a step, in the long run: below 1 is stable.

        Parameters
        ----------
        loss : float
            Probability that a packet is lost, 0 to 1.
        """
        radius = np.abs(np.linalg.eigvals(self.second_moment(loss))).max()
        return float(radius ** (1 / len(self.arrives)))

    @property
    def critical(self) -> float:
        """The smallest loss probability that is not borne in the mean square; inf if all are."""
        if self.growth(0.0) >= 1:
            return 0.0
        below = 0.0
        for above in np.arange(STEP, 1 + STEP / 2, STEP).clip(max=1.0).tolist():
            if self.growth(above) >= 1:
                return float(brentq(lambda p: self.growth(p) - 1, below, above, xtol=1e-10))
            below = above
        return math.inf

    def critical_corruption(self, tries: int = 2) -> float:
        """Return the smallest probability q of one try's corruption that is not borne; inf if all are.

        Parameters
        ----------
        tries : int, optional
            So often a packet is sent within a step, at most: 2 for K06's one retransmission, 1 for none. The
            command is lost if all are corrupted, q^tries.

        Raises
        ------
        InputError
            If there is no try.
        """
        if not isinstance(tries, int) or tries < 1:
            raise InputError(f"tries: expected 1 or more, found {tries!r}")
        return self.critical ** (1 / tries)

    def simulate(self, loss: float, x0: ArrayLike, steps: int, runs: int, seed: int = 0) -> Array:
        """Return the states of many runs with packets lost at random, shape (steps + 1, runs, n).

        Parameters
        ----------
        loss : float
            Probability that a packet is lost, 0 to 1.
        x0 : array_like, shape (n,)
            States at the start.
        steps, runs : int
            How many packets there are in a run, and how many runs.
        seed : int, optional

        Raises
        ------
        InputError
            If there are not as many starts as states, or a count or the seed is negative.
        """
        self.second_moment(loss)
        for name, value in (("steps", steps), ("runs", runs), ("seed", seed)):
            at_least(f"PacketLoop.simulate: {name}", value)
        x0 = as_row("PacketLoop.simulate: x0", x0, self.arrives.shape[1])
        lost = np.random.default_rng(seed).uniform(size=(steps, runs)) < loss
        x = np.empty((steps + 1, runs, self.arrives.shape[1]))
        x[0] = x0
        for k in range(steps):
            step = k % len(self.arrives)
            x[k + 1] = np.where(lost[k][:, None], x[k] @ self.lost[step].T, x[k] @ self.arrives[step].T)
        return x


@checked
def packet_loop(
    blocks: Sequence[Block],
    at: str | Sequence[str],
    period: float,
    x: Point | None = None,
    *,
    lost: Lost = "hold",
    time: float = 0.0,
    params: Mapping[str, float] | None = None,
) -> PacketLoop:
    """Return a loop, linearised about a point, whose commands come as packets.

    Parameters
    ----------
    blocks : sequence of Block
        That join to a closed loop without inputs; all continuous, or sampled with one period.
    at : str or sequence of str
        The commands that a packet holds. What they depend on is sampled when it is sent.
    period : float
        From packet to packet [s]; of sampled Blocks a multiple of theirs.
    x, time, params
        As for :meth:`~hovercontrol.control.analysis.cut_loop.CutLoop.linearize`.
    lost : {"hold", "zero"}, optional
        What the craft does without a packet: go on with the last commands, or take those of the point itself
        (zero deviation).

    Raises
    ------
    InputError
        As there, if the period is not positive, or a command feeds through to itself at once.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, a, k = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2"), hc.Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> law = Block("law", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})
    >>> loop = packet_loop([cart, law], "a", period=0.1)
    >>> round(loop.growth(0.0), 3), round(loop.growth(0.5), 3)  # no packet lost, half of them
    (0.64, 0.712)
    """
    line = CutLoop(blocks, at).linearize(x, time, params)
    return PacketLoop(*(m[None] for m in _step(line, period, lost)))


@checked
def packet_loop_along(
    blocks: Sequence[Block],
    at: str | Sequence[str],
    motion: control.TimeResponseData,
    *,
    lost: Lost = "hold",
    params: Mapping[str, float] | None = None,
) -> PacketLoop:
    """Return a loop along one period of a motion: the product of its steps is judged (lifted), not each.

    Parameters
    ----------
    blocks, at, lost, params
        As for :func:`packet_loop`.
    motion : control.TimeResponseData
        One period of the closed loop, a row for each packet, the first row once more at the end. The
        linearisation is held from packet to packet.

    Raises
    ------
    InputError
        As there, and if the times are not equally spaced.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v, a, k = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2"), hc.Signal("k", "1/s", start=2.0)
    >>> cart = Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    >>> law = Block("law", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})
    >>> motion = hc.simulate(hc.interconnect([cart, law]), [0.0, 0.1, 0.2])
    >>> round(packet_loop_along([cart, law], "a", motion).growth(0.5), 3)  # over two packets
    0.712
    """
    times = np.asarray(motion.time, dtype=float)
    gaps = np.diff(times)
    if len(gaps) < 1 or not np.allclose(gaps, gaps[0], rtol=1e-6):
        raise InputError("motion: expected equally spaced times, one for each packet")
    lines = list(CutLoop(blocks, at).along(motion, params))[:-1]
    steps = [_step(line, float(gaps[0]), lost) for line in lines]
    arrives, without = (np.array(matrices) for matrices in zip(*steps, strict=True))
    return PacketLoop(arrives, without)


def _step(line: control.StateSpace, period: float, lost: str) -> tuple[Array, Array]:
    """Return the step of states and held commands if the packet arrives, and if it is lost."""
    check_known(lost, ("hold", "zero"), f"lost: unknown {lost!r}")
    if np.any(line.D):
        raise InputError("packet loop: a command depends on a command at the same instant")
    A, B = over_period("packet loop: period", line.A, line.B, float(line.dt or 0.0), period)
    K = line.C
    n, m = B.shape
    arrives = np.block([[A + B @ K, np.zeros((n, m))], [K, np.zeros((m, m))]])
    hold = np.block([[A, B], [np.zeros((m, n)), np.eye(m)]])
    zero = np.block([[A, np.zeros((n, m))], [np.zeros((m, n + m))]])
    return arrives, hold if lost == "hold" else zero
