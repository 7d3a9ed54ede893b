"""What is held of a model's unknowns before any log: weakly, that they are about what the model says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.estimation.problem import Problem
from hovercontrol.estimation.subject import Subject

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PriorWidths:
    """Standard deviations of the prior about the values of the model.

    No published source: set by hand, exercised by tests/estimation/test_fit.py.

    Attributes
    ----------
    shapes : float
        Of the logarithm of a shape parameter, such as the width of friction.
    coefficients : float
        Of a coefficient, relative to its value.
    alone : float
        Or, if larger, relative to the coefficient whose term alone has the measured acceleration.
    """

    shapes: float = 1.5
    coefficients: float = 0.3
    alone: float = 0.1


#: The values in use.
PRIOR = PriorWidths()


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
            precision[j] = 1.0 / max(PRIOR.coefficients * abs(centre[j]), PRIOR.alone * alone[j]) ** 2
        elif name in own and problem.log_scale[j]:
            precision[j] = 1.0 / PRIOR.shapes**2
        elif name in own:
            precision[j] = 1.0 / max(abs(centre[j]), 1e-3) ** 2
    return Prior(z, precision)
