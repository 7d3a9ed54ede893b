"""The first fit of a model: from its given coefficients, and once more under little process noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.discrepancy.criteria import CRITERIA
from hovercontrol.discrepancy.search.trial import TRIALS
from hovercontrol.estimation.data import Data
from hovercontrol.estimation.fit import CONVERGENCE, Fit, estimate, first_noise, refit
from hovercontrol.estimation.prior import prior_of
from hovercontrol.estimation.problem import Problem
from hovercontrol.estimation.subject import Subject


def base_fit(
    model: Subject,
    data: Data,
    names: Sequence[str] | None = None,
    trace: Callable[[str], None] | None = None,
) -> Fit:
    """Return the likelier of two fits of a model as it was given, less samples that stand out.

    A likelihood with process noise has optima in which noise stands in for the equations. So where noise
    remains, the fit begins again at the given coefficients under a tenth of it.

    Parameters
    ----------
    model : Model or BlockModel
    data : Data
    names : sequence of str, optional
        Unknowns; default: all.
    trace : callable, optional
        Called with a line on each pass.

    Raises
    ------
    FloatingPointError
        If the model runs away from the logs.
    """
    problem = Problem(model, data, names)
    prior = prior_of(problem, model)
    first = estimate(problem, prior, first_noise(problem), gate=True, trace=trace)
    if not len(first.p) or not np.any(CRITERIA.left(first)):
        return first
    quiet = replace(first.noise, process=TRIALS.quiet * first.noise.process)
    try:
        again = refit(
            first, first.problem, prior, noise=quiet, p=problem.start.copy(), levels=False, trace=trace
        )
        again = refit(again, again.problem, prior, noise=first.noise, trace=trace)
    except FloatingPointError:
        return first
    return again if again.cost < first.cost - CONVERGENCE.settled else first
