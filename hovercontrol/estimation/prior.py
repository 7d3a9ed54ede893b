"""What is held of a model's unknowns before any log: weakly, that they are about what the model says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.problem import Problem
from hovercontrol.estimation.subject import Subject

Array = NDArray[np.float64]

#: Standard deviation of the logarithm of a shape of the model (a width of friction): one that no log tells
#: stays where it is.
SHAPES = 1.5

#: Standard deviation of a coefficient about the model's value, in parts of that value; or, if that is more,
#: in parts of what would make its term alone as large as all accelerations seen.
COEFFICIENTS, ALONE = 0.3, 0.1


@dataclass(frozen=True, eq=False)
class Prior:
    """Normal in the coordinates in which unknowns are sought; none on what was added to the model.

    Attributes
    ----------
    centre, precision : ndarray, shape (P,)
    """

    centre: Array
    precision: Array

    def cost(self, z: Array) -> float:
        """Return minus twice its logarithm, but for a constant."""
        return float(self.precision @ (z - self.centre) ** 2)

    def slope(self, z: Array) -> Array:
        """Return half the slope of the cost."""
        return np.asarray(self.precision * (z - self.centre))


def prior_of(problem: Problem, model: Subject) -> Prior:
    """Return the prior of a problem about the values of the model as it was given.

    Parameters
    ----------
    problem : Problem
    model : Model or BlockModel
        Without what was added.
    """
    own, linear = model.coefficients(), set(model.linear_coefficients())
    centre = np.array([own.get(name, v) for name, v in zip(problem.names, problem.start, strict=True)])
    centre = np.clip(centre, problem.lower, problem.upper)
    z = problem.inside(centre)
    precision = np.zeros(len(z))
    alone = problem.sizes_alone()
    for j, name in enumerate(problem.names):
        if name in linear:
            precision[j] = 1.0 / max(COEFFICIENTS * abs(centre[j]), ALONE * alone[j]) ** 2
        elif name in own and problem.log_scale[j]:
            precision[j] = 1.0 / SHAPES**2
        elif name in own:
            precision[j] = 1.0 / max(abs(centre[j]), 1e-3) ** 2
    return Prior(z, precision)
