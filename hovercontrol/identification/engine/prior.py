"""Prior of a model's unknowns: a wide normal distribution about the values of the model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.subject import Subject


@dataclass(frozen=True)
class PriorWidths:
    """Standard deviations of the prior about the values of the model.

    No published source: set by hand, exercised by tests/identification/engine/test_fit.py.

    Attributes
    ----------
    shapes : float
        Standard deviation of the logarithm of a parameter that keeps its sign: a mass, a width of friction.
    coefficients : float
        Standard deviation of a coefficient, relative to its value. With 1, logs that determine a coefficient
        at all (standard error below its value: :mod:`.excitation`) outweigh the given value.
    alone : float
        Standard deviation of a coefficient, relative to the value at which its term alone explains the
        observed acceleration. The larger of the two standard deviations applies.
    first : float
        Standard deviations of coefficients in the passes before scoring, relative to those above, and of the
        logarithm of one that keeps its sign. These passes neglect a part of the likelihood (:mod:`.scoring`),
        so they are kept near the given values.
    """

    shapes: float = 1.5
    coefficients: float = 1.0
    alone: float = 1.0 / 3.0
    first: float = 0.3


#: The values in use.
PRIOR = PriorWidths()


@dataclass(frozen=True, eq=False)
class Prior:
    """Independent normal distributions in scaled coordinates (:class:`.Unknowns`).

    Parameters of effects that were added to the model have no prior: their precision is zero.

    Attributes
    ----------
    centre, precision : ndarray, shape (P,)
        Mean c and inverse variance Lambda in scaled coordinates z.
    starting : ndarray, shape (P,)
        Inverse variances in the passes before scoring.
    """

    centre: Array
    precision: Array
    starting: Array

    @property
    def first(self) -> Prior:
        """The prior of the passes before scoring."""
        return replace(self, precision=self.starting)

    def cost(self, z: Array) -> float:
        """Return minus twice the log prior up to a constant, ``sum Lambda (z - c)^2``."""
        return float(self.precision @ (z - self.centre) ** 2)

    def slope(self, z: Array) -> Array:
        """Return half the gradient of the cost, ``Lambda (z - c)``."""
        return np.asarray(self.precision * (z - self.centre))


def prior_of(problem: Problem, model: Subject) -> Prior:
    """Return the prior of a problem, centred at the values of the original model.

    Parameters
    ----------
    model : Model or BlockModel
        The model before effects were added.
    """
    own, free = model.coefficients(), set(model.free_coefficients())
    centre = np.array([own.get(name, v) for name, v in zip(problem.names, problem.start, strict=True)])
    centre = np.clip(centre, problem.lower, problem.upper)
    z = problem.inside(centre)
    # precision = 1/sigma^2 about the model's value c, with c_alone of `sizes_alone`:
    #   logarithm: sigma = shapes;  coefficient: sigma = max(coefficients |c|, alone c_alone)
    #   other shape: sigma = max(|c|, 1e-3)
    precision = np.zeros(len(z))
    alone = problem.sizes_alone()
    for j, name in enumerate(problem.names):
        if name in own and problem.log_scale[j]:
            precision[j] = 1.0 / PRIOR.shapes**2
        elif name in free:
            precision[j] = 1.0 / max(PRIOR.coefficients * abs(centre[j]), PRIOR.alone * alone[j]) ** 2
        elif name in own:
            precision[j] = 1.0 / max(abs(centre[j]), 1e-3) ** 2
    of_free = np.array([name in free for name in problem.names], dtype=bool)
    first = np.where(problem.log_scale, PRIOR.first**-2, precision / PRIOR.first**2)
    return Prior(z, precision, np.where(of_free, first, precision))
