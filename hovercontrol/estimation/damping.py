"""Steps of an iteration that go to and fro, or creep: Aitken's rule, each element by itself."""

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
