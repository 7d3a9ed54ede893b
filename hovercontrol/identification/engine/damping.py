"""Damping or lengthening of steps that oscillate or converge slowly: Aitken's rule, whole or by element."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hovercontrol.base.arrays import Array

#: Smallest fraction of a step that is taken.
LEAST = 0.2


@dataclass(eq=False)
class Damping:
    """Damp each element of a step by Aitken's rule (Irons and Tuck, Int. J. Numer. Methods Eng. 1 (1969)).

    The last two proposed steps predict the fraction of the new step after which the next step would be zero.
    About a kink (dry friction, a jump of a command) undamped steps from either side undo each other for
    ever; noise levels converge slowly.

    Attributes
    ----------
    most : float
        Largest fraction that is taken: 1 only damps, more also lengthens.
    step : ndarray
        Last proposed step.
    part : ndarray
        Fraction of it that was taken.
    """

    most: float = 1.0
    step: Array = field(default_factory=lambda: np.zeros(0))
    part: Array = field(default_factory=lambda: np.zeros(0))

    def taken(self, step: Array) -> Array:
        """Return the damped step.

        Parameters
        ----------
        step : ndarray
            Proposed step. If its shape differs from that of the last one, it is taken as it is.
        """
        # Secant through the last two proposals s, s' of which a part a of s was taken: a' = a s / (s - s')
        part = np.ones_like(step)
        if self.step.shape == step.shape:
            with np.errstate(all="ignore"):
                secant = self.part * self.step / (self.step - step)
            away = np.abs(step) >= np.abs(self.step)  # steps grow: the secant has no root ahead
            onward = np.where(away, self.most, np.clip(secant, LEAST, self.most))
            part = np.where(step * self.step < 0.0, np.clip(secant, LEAST, 1.0), np.maximum(onward, 1.0))
            part = np.where(np.isfinite(part), part, 1.0)
        self.step, self.part = step, part
        return np.asarray(part * step)


@dataclass(eq=False)
class Relaxation:
    """Damp a whole step by Aitken's rule for vectors (Irons and Tuck, 1969).

    If the fraction a of the last step s was taken and s' is proposed now, the new fraction is ``a/(1 - m)``
    with ``m = s'.s / s.s``. The direction is kept, so a descent direction stays one.

    Attributes
    ----------
    step : ndarray
        Last proposed step.
    part : float
        Fraction of it that was taken.
    """

    step: Array = field(default_factory=lambda: np.zeros(0))
    part: float = 1.0

    def of(self, step: Array) -> float:
        """Return the fraction of a proposed step to take, ``LEAST`` to 1.

        Parameters
        ----------
        step : ndarray
            Proposed step, elements in comparable units. If its shape differs from that of the last one, the
            fraction is 1.
        """
        part, square = 1.0, float(self.step @ self.step)
        if self.step.shape == step.shape and square > 0.0:
            along = float(step @ self.step) / square
            part = float(np.clip(self.part / (1.0 - along), LEAST, 1.0)) if along < 1.0 else 1.0
        self.step, self.part = step, part
        return part
