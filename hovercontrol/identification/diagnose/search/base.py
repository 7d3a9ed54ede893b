"""The first fit of a model, and its restart at the given coefficients."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.search.fit import TRIALS
from hovercontrol.identification.engine.data import Data
from hovercontrol.identification.engine.fit import CONVERGENCE, Fit, estimate, first_noise, refit
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.subject import Subject


def base_fit(
    model: Subject,
    data: Data,
    names: Sequence[str] | None = None,
    trace: Callable[[str], None] | None = None,
) -> Fit:
    """Return the fit of the given model to logs, without outlying samples.

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
        If the simulation diverges from the logs.
    """
    problem = Problem(model, data, names)
    if problem.unguessed:  # the size of hidden states follows from the model as it is given
        noise = first_noise(problem)
        noise = replace(noise, process=0.0 * noise.process)
        seen = estimate(problem, prior_of(problem, model), noise, frozen=True, levels=False)
        states = [problem.block.states[i].name for i in problem.free]
        hidden = [name for name, own in zip(states, problem.hidden, strict=True) if own]
        names_ = [s.name for s in problem.block.states]
        guess = {name: seen.path[..., names_.index(name)] for name in hidden}
        problem = Problem(model, data.seen_through(guess), names)
    return estimate(problem, prior_of(problem, model), first_noise(problem), gate=True, trace=trace)


def likelier_start(first: Fit, trace: Callable[[str], None] | None = None) -> Fit:
    """Return a fit, or a likelier one that starts at the given coefficients with little process noise.

    A likelihood with process noise has local optima in which noise replaces the equations. So if process
    noise is left, the fit is restarted with a tenth of it.

    Parameters
    ----------
    first : Fit
        Fit of the given model.
    trace : callable, optional
        Called with a line on each pass.
    """
    if not len(first.p) or not np.any(CRITERIA.left(first)):
        return first
    problem, quiet = first.problem, replace(first.noise, process=TRIALS.quiet * first.noise.process)
    try:
        again = refit(
            first, problem, first.prior, noise=quiet, p=problem.start.copy(), levels=False, trace=trace
        )
        again = refit(again, again.problem, first.prior, noise=first.noise, trace=trace)
    except FloatingPointError:
        return first
    return again if again.cost < first.cost - CONVERGENCE.settled else first
