"""Carrier sense multiple access with random backoff: waiting times of a sender on a shared medium."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.signals import Signal


@checked
@dataclass(frozen=True)
class Csma:
    """The medium access of K06's beacons (section 5.5.1): wait a random number of bytes, listen, then send.

    "Each beacon ... initially delays a random number of bytes by uniformly sampling the interval [1,64]. When
    the backoff condition is satisfied, the beacon determines whether the link is in use". K06 does not say
    what follows if it is in use. Here the sender draws and waits again, at most `attempts` times, and then
    gives up. Each attempt finds the medium in use with the same probability, independently.

    Parameters
    ----------
    busy : float
        Probability that an attempt finds the medium in use, 0 to 1.
    window : int, optional
        Largest backoff [bytes].
    byte : float, optional
        Time of one byte [s]. K06 prints none; the default belongs to 19.2 kbit/s, the radio of its Mica2
        beacons.
    attempts : int, optional
        Number of attempts before the message is given up.

    Raises
    ------
    InputError
        If a number is out of range.

    Examples
    --------
    >>> quiet, crowded = Csma(busy=0.0), Csma(busy=0.5)
    >>> print(f"{1000 * quiet.mean:.2f} ms, {1000 * crowded.mean:.2f} ms, {crowded.given_up:.4f} given up")
    13.54 ms, 26.98 ms, 0.0039 given up
    """

    busy: float
    window: int = 64
    byte: float = 8 / 19_200
    attempts: int = 8

    def __post_init__(self) -> None:
        if not 0 <= number("csma: busy", self.busy) <= 1:
            raise InputError(f"csma: busy must be a probability, found {self.busy!r}")
        positive("csma: byte", self.byte)
        for key in ("window", "attempts"):
            value = getattr(self, key)
            if not (isinstance(value, int) and 1 <= value <= 1024):
                raise InputError(f"csma: {key} must be a whole number from 1 to 1024, found {value!r}")

    @property
    def mean(self) -> float:
        """Mean time until a message is sent or given up [s]: ``byte (window + 1)/2 (1 + q + q^2 + ...)``."""
        return self.byte * (self.window + 1) / 2 * sum(self.busy**k for k in range(self.attempts))

    @property
    def most(self) -> float:
        """Longest such time [s]."""
        return self.byte * self.window * self.attempts

    @property
    def given_up(self) -> float:
        """Share of messages given up, ``q^attempts``."""
        return float(self.busy**self.attempts)

    def distribution(self) -> tuple[Array, Array]:
        """Return the exact distribution of the waiting times of sent messages, from sums of uniform numbers.

        Returns
        -------
        seconds, probability : ndarray, shape (window attempts + 1,)
            All waiting times [s], and the share of messages with each; the shares sum to ``1 - given_up``.

        Examples
        --------
        >>> Csma(busy=0.5, window=2, byte=1.0, attempts=2).distribution()[1].tolist()
        [0.0, 0.25, 0.3125, 0.125, 0.0625]
        """
        one = np.r_[0.0, np.full(self.window, 1 / self.window)]
        whole: Array = np.zeros(self.window * self.attempts + 1)
        waited = np.ones(1)
        for k in range(self.attempts):
            waited = np.convolve(waited, one).astype(float)
            whole[: len(waited)] += (1 - self.busy) * self.busy**k * waited
        return np.arange(len(whole)).astype(float) * self.byte, whole

    def drawn(self, shares: Sequence[sp.Expr], busy: Signal) -> tuple[sp.Expr, sp.logic.boolalg.Boolean]:
        """Return the waiting time [s], without unit, and whether the message is given up.

        Parameters
        ----------
        shares : sequence of sympy.Expr
            Two numbers between 0 and 1 for each attempt.
        busy : Signal
            The probability, as a parameter of the link.
        """
        waits, heard = shares[: self.attempts], shares[self.attempts :]
        used: list[sp.logic.boolalg.Boolean] = [share < busy.symbol for share in heard]
        total: sp.Expr = sp.S.Zero
        for k, share in enumerate(waits):
            backoff = sp.floor(self.window * share) + 1
            total += sp.Piecewise((backoff, sp.And(*used[:k])), (0, True)) if k else backoff
        return self.byte * total, sp.And(*used)
