"""What is held of a model's unknowns before any log: weakly, that they are about what the model says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.windowed import Windowed

Array = NDArray[np.float64]

#: Relative standard deviation of coefficients about the model's own values.
COEFFICIENTS = 0.3

#: Standard deviation of the logarithm of a width of dry friction: one that no log tells stays where it is.
WIDTHS = 1.5


class Prior:
    """Normal in the model's own coefficients, log-normal in its widths of friction, none on what was added.

    Parameters
    ----------
    w : Windowed
    model : Model or BlockModel
        About whose values it lies.
    """

    def __init__(self, w: Windowed, model: Subject) -> None:
        own, linear = model.coefficients(), set(model.linear_coefficients())
        centre = np.array([own.get(name, value) for name, value in zip(w.names, w.start, strict=True)])
        size = COEFFICIENTS * np.maximum(np.abs(centre), 1e-3 * w.size)
        self._precision = np.where([name in linear for name in w.names], 1.0 / size**2, 0.0)
        widths = {e.parameter("width") for e in model.effects if "width" in e.numbers and hasattr(e, "axis")}
        self._widths = np.array([name in widths for name in w.names], dtype=bool)
        self._centre = np.where(self._widths, np.maximum(centre, w.lower), centre)

    def cost(self, p: Array) -> float:
        """Return minus twice its logarithm, but for a constant."""
        ratio = self._logarithm(p) / WIDTHS
        return float(self._precision @ (p - self._centre) ** 2 + ratio @ ratio)

    def slope(self, p: Array) -> Array:
        """Return half the slope of the cost, shape (P,)."""
        return np.asarray(
            self._precision * (p - self._centre) + self._relative(p) * self._logarithm(p) / WIDTHS**2
        )

    def precision(self, p: Array) -> Array:
        """Return half the curvature of the cost as Gauss and Newton have it, shape (P,)."""
        return np.asarray(self._precision + (self._relative(p) / WIDTHS) ** 2)

    def _logarithm(self, p: Array) -> Array:
        return np.log(np.where(self._widths, p / np.where(self._widths, self._centre, 1.0), 1.0))

    def _relative(self, p: Array) -> Array:
        return np.where(self._widths, 1.0 / np.where(self._widths, p, 1.0), 0.0)
