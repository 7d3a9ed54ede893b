"""The acceleration still missing in each equation once effects are named: its size, and its course."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.identification.diagnose.criteria import CRITERIA, Criteria
from hovercontrol.identification.diagnose.evidence.missing import Missing, Quantity, rate, running_mean
from hovercontrol.identification.engine.fit import Fit, refit
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import Noise, augment, averaged, averaging_time
from hovercontrol.identification.engine.passes import inverse


@dataclass(frozen=True)
class RemainderCriteria:
    """Settings of the measurement of remainders.

    No published source: set by hand, exercised by tests/identification/diagnose/test_remainder.py.

    Attributes
    ----------
    large : float
        Gain of process noise above which no second fit is needed to confirm it.
    """

    large: float = 2000.0


#: The values in use.
REMAINDER = RemainderCriteria()


@dataclass(frozen=True)
class Remainder:
    """The acceleration that remains unexplained in one equation.

    Attributes
    ----------
    equation : str
        ``"u'"``
    rms : float
        Root mean square of the missing acceleration, averaged over `over` seconds; zero if it is not
        significant.
    unit : str
    share_explained : float
        Fraction of the mean square of the acceleration missing in the given model that the named effects
        explain.
    gain : float
        Reduction of twice the negative log likelihood by process noise in this equation.
    over, seconds : float
        Averaging time, and correlation time [s].
    """

    equation: str
    rms: float
    unit: str
    share_explained: float
    gain: float
    over: float
    seconds: float

    @property
    def there(self) -> bool:
        """Whether the remainder is significant."""
        return self.rms > 0.0


def remainders(base: Fit, final: Fit, criteria: Criteria = CRITERIA) -> tuple[Remainder, ...]:
    """Return the remainder of each equation on which forces act.

    Parameters
    ----------
    base, final : Fit
        Fits of the given and of the amended model; the same fit if nothing was added.
    """
    problem = final.problem
    over = averaging_time(final.problem)
    before, after = averaged(base.noise, over), averaged(final.noise, over)
    lacked = dict(zip(base.noise.driven, zip(before, criteria.left(base), strict=True), strict=True))
    found = []
    for j, i in enumerate(problem.driven):
        state = problem.block.states[problem.free[i]]
        gain = _gain(final, j, criteria)
        there = gain > criteria.remains and criteria.left(final)[j]
        left = float(after[j]) if there else 0.0
        rms, lacks = lacked.get(state.name, (0.0, False))
        # share explained: 1 - (rms of the amended model / rms of the given model)^2
        share = 1.0 - (left / rms) ** 2 if final is not base and lacks else 0.0
        unit = rate(state.unit)
        found.append(
            Remainder(
                f"{state.name}'", left, unit, max(share, 0.0), gain, over, float(final.noise.seconds[j])
            )
        )
    return tuple(found)


def _gain(fit: Fit, j: int, criteria: Criteria) -> float:
    """Return the reduction of the cost by process noise in one equation.

    The path and the unknowns are fitted again without this noise only where the gain is near the threshold.
    Elsewhere the gain is that of the linear problem, an upper bound.
    """
    problem = fit.problem
    if not criteria.left(fit)[j]:
        return 0.0
    process = fit.noise.process.copy()
    process[j] = 0.0
    silent = replace(fit.noise, process=process)
    gain = _cost(fit, silent) - _cost(fit, fit.noise)
    if gain < criteria.remains or gain > REMAINDER.large:  # a refit would decide alike
        return gain
    without = refit(fit, problem, fit.prior, noise=silent, levels=False)
    return float(without.cost - fit.cost)


def _cost(fit: Fit, noise: Noise) -> float:
    """Return the cost of a fit's linear problem under a noise, path and unknowns at their likeliest.

    With the whitened residual w0 and columns W of the unknowns, and the prior of precision Lambda about z0::

        cost = |w0|^2 + log det - s'(W'W + Lambda)^-1 s,    s = -W'w0 - Lambda (z - z0)
    """
    filtered = run_filter(augment(fit.problem, fit.linear, noise))
    every = filtered.products.sum(axis=0)
    slope = -every[1:, 0] - fit.prior.slope(fit.problem.inside(fit.p))
    S = every[1:, 1:] + np.diag(fit.prior.precision)
    return float(every[0, 0] + filtered.log_dets.sum() - slope @ inverse(S) @ slope)


def missing_forces(fit: Fit) -> tuple[Missing, ...]:
    """Return the smoothed missing accelerations of a fit by log and equation, averaged, with their bands.

    They are averaged over the averaging time of remainders. The band of a mean assumes an error as correlated
    in time as the acceleration itself, by exp(-t/tau): a mean over T has the standard deviation
    ``sigma (2 (s - 1 + exp(-s)))^(1/2) / s``, with ``s = T/tau``.
    """
    problem = fit.problem
    n, over = len(problem.free), averaging_time(fit.problem)
    variance = fit.variance_of_path[..., n:]
    s = over / fit.noise.seconds
    narrower = np.sqrt(np.maximum(2.0 * (s + np.expm1(-s)), 0.0)) / s
    moving = [problem.block.states[problem.free[i]] for i in problem.driven]
    found = []
    for k, log in enumerate(problem.logs):

        def rows(values: Array, k: int = k, size: int = log.time.size) -> Array:
            whole = np.full(size, np.nan)
            for w in np.flatnonzero(problem.rows.log == k):
                own = problem.rows.at[:, w] >= 0
                whole[problem.rows.at[own, w]] = values[own, w]
            return whole

        depends = tuple(
            Quantity(s.name, s.unit, rows(fit.path[..., problem.free[i]]))
            for s, i in zip(moving, problem.driven, strict=True)
        ) + tuple(
            Quantity(s.name, s.unit, log.inputs[m], is_command=True)
            for m, s in enumerate(problem.block.inputs)
        )
        for j, state in enumerate(moving):
            force = running_mean(log.time, rows(fit.missing[..., j]), over)
            band = np.sqrt(np.maximum(rows(variance[..., j]), 0.0)) * narrower[j]
            seen = float(problem.accelerations[j])
            unit = rate(state.unit)
            found.append(
                Missing(log.name, f"{state.name}'", unit, log.time, force, band, depends, seen, problem.tempo)
            )
    return tuple(found)
