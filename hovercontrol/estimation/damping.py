"""Steps of an iteration that go to and fro, or creep: Aitken's rule, for a whole step or its elements."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Smallest part of a step that is taken.
LEAST = 0.2


@dataclass(eq=False)
class Damping:
    """Takes the part of each proposed step after which, by the last two, the next one would be zero.

    About a kink (dry friction, a jump of a command) steps that are right on either side undo each other for
    ever; levels of noise creep. Irons and Tuck, Int. J. Numer. Methods Eng. 1 (1969), element by element.

    Attributes
    ----------
    most : float
        Largest part that is taken: 1 damps, more also lengthens.
    step : ndarray
        Proposed last.
    part : ndarray
        Of it that was taken.
    """

    most: float = 1.0
    step: Array = field(default_factory=lambda: np.zeros(0))
    part: Array = field(default_factory=lambda: np.zeros(0))

    def taken(self, step: Array) -> Array:
        """Return what is taken of a proposed step.

        Parameters
        ----------
        step : ndarray
            Of the shape of the last one; else that one is forgotten.
        """
        part = np.ones_like(step)
        if self.step.shape == step.shape:
            with np.errstate(all="ignore"):
                secant = self.part * self.step / (self.step - step)
            away = np.abs(step) >= np.abs(self.step)  # it grows: no end is in sight
            onward = np.where(away, self.most, np.clip(secant, LEAST, self.most))
            part = np.where(step * self.step < 0.0, np.clip(secant, LEAST, 1.0), np.maximum(onward, 1.0))
            part = np.where(np.isfinite(part), part, 1.0)
        self.step, self.part = step, part
        return np.asarray(part * step)


@dataclass(eq=False)
class Relaxation:
    """Takes the part of a whole step after which, by the last two, the next one would be zero.

    Of steps s and s' of which the part a of s was taken, with m = s' s / s s, that part is a/(1 - m):
    Aitken's rule for vectors (Irons and Tuck, 1969). The direction stays: what falls along it still does.

    Attributes
    ----------
    step : ndarray
        Proposed last.
    part : float
        Of it that was taken.
    """

    step: Array = field(default_factory=lambda: np.zeros(0))
    part: float = 1.0

    def of(self, step: Array) -> float:
        """Return the part of a proposed step that is to be taken, ``LEAST`` to 1.

        Parameters
        ----------
        step : ndarray
            Of the shape of the last one, else that one is forgotten; elements in comparable units.
        """
        part, square = 1.0, float(self.step @ self.step)
        if self.step.shape == step.shape and square > 0.0:
            along = float(step @ self.step) / square
            part = float(np.clip(self.part / (1.0 - along), LEAST, 1.0)) if along < 1.0 else 1.0
        self.step, self.part = step, part
        return part
