"""Compare a model with logs: short predictions, free simulation, and whether the residual is noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.evidence.holdout import held_fit
from hovercontrol.discrepancy.evidence.traces import Trace, simulated_traces
from hovercontrol.discrepancy.evidence.whiteness import independence, innovations, past_commands, whiteness
from hovercontrol.estimation.data import gather
from hovercontrol.estimation.fit import Fit
from hovercontrol.estimation.levels import LEVEL
from hovercontrol.estimation.noise import Noise
from hovercontrol.estimation.subject import Subject
from hovercontrol.logs import Log

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ComparisonCriteria:
    """When a model and a log disagree.

    No published source: set by hand, exercised by tests/discrepancy/test_compare.py.

    Attributes
    ----------
    horizon : float
        Prediction horizon [s].
    chance : float
        Probability of a false alarm of all tests together.
    beyond : float
        Standard errors of the noise level that the innovations may exceed it by.
    """

    horizon: float = 1.0
    chance: float = 1e-3
    beyond: float = 4.0


#: The values in use.
COMPARISON = ComparisonCriteria()


@dataclass(frozen=True)
class Compared:
    """One channel of one log.

    Attributes
    ----------
    log, channel, unit : str
    noise : float
        Of the measurement, from the log itself, in that unit.
    short, free : float
        Root mean square error of simulations of a second, each from its own smoothed start; and of one over
        the whole log, from its start alone. In that unit.
    remains : float
        Size of the innovation over that of noise: 1 if nothing is missing.
    largest : float
        Of what noise may be taken for, its level being known no better.
    white, independent : float
        Chance of what remains being as correlated in time, and with past commands, were it noise.
    """

    log: str
    channel: str
    unit: str
    noise: float
    short: float
    free: float
    remains: float
    largest: float
    white: float
    independent: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model beside logs.

    Attributes
    ----------
    model : str
    horizon : float
        Length of the short simulations [s].
    channels : tuple of Compared
    runs : tuple of Trace
        Running free, one for each log.
    """

    model: str
    horizon: float
    channels: tuple[Compared, ...]
    runs: tuple[Trace, ...]

    def beyond(self, one: Compared) -> tuple[str, ...]:
        """Return what is wrong with what remains of a channel, in words; empty if it is noise."""
        level = COMPARISON.chance / max(2 * len(self.channels), 1)
        larger = (f"{one.remains:.3g} times the noise",) if one.remains > one.largest else ()
        in_time = ("correlated in time",) if one.white < level else ()
        return (*larger, *in_time, *(("following the commands",) if one.independent < level else ()))

    @property
    def disagreements(self) -> tuple[str, ...]:
        """What is there beyond noise, in words; empty if the model agrees with all logs."""
        found = ((c, self.beyond(c)) for c in self.channels)
        return tuple(f"{c.log}: what remains of {c.channel} is {', '.join(why)}" for c, why in found if why)

    @property
    def agrees(self) -> bool:
        """Whether there is no disagreement beyond noise."""
        return not self.disagreements

    def text(self) -> str:
        """Return the comparison as plain text."""
        lines = [
            f"{c.log}: {c.channel}: {c.short:.3g} {c.unit} over {self.horizon:g} s "
            f"({c.short / c.noise:.3g} times the noise), {c.free:.3g} {c.unit} running free"
            for c in self.channels
        ]
        return "\n".join([*lines, *(self.disagreements or ["no disagreement beyond noise"])])


def compare(
    model: Subject, logs: Sequence[Log], *, horizon: float = COMPARISON.horizon, noise: Noise | None = None
) -> Comparison:
    """Compare a model, its coefficients as they are, with logs.

    Parameters
    ----------
    model : Model or BlockModel
    logs : sequence of Log
        With the model's inputs, and some of what it computes.
    horizon : float, optional
        Length of short simulations [s].
    noise : Noise, optional
        Default: that of the measurements, from the logs; with process noise, gusts count as noise.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If a log lacks an input, is too short, or shows nothing of the model.

    Examples
    --------
    >>> from hovercontrol.models.vehicles import c17_simulation
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 10.0, 0.05)
    >>> commands = {"thrust": 2 + np.sin(t), "rudder": 0.2 * np.cos(t)}
    >>> run = c17_simulation().plant().compile(friction="smooth").simulate(t, list(commands.values()))
    >>> seen = {k: y + 1e-3 * rng.normal(size=t.size) for k, y in zip(run.output_labels, run.outputs)}
    >>> compare(c17_simulation(), [Log("demo", t, {**seen, **commands})]).agrees
    True
    """
    fit = held_fit(model, gather(model, logs))
    return compared(fit, horizon, noise)


def compared(fit: Fit, horizon: float = COMPARISON.horizon, noise: Noise | None = None) -> Comparison:
    """Return the comparison of a fitted model.

    Parameters
    ----------
    fit : Fit
        Its coefficients as they are judged; its path is where the craft was. Samples that it left out are not
        compared.
    horizon : float, optional
        Length of short simulations [s].
    noise : Noise, optional
        Default: that of the measurements.
    """
    problem = fit.problem
    fit = replace(fit, noise=noise or replace(fit.noise, process=np.zeros_like(fit.noise.process)))
    short, free = simulated_traces(fit, horizon), simulated_traces(fit)
    z = innovations(fit)
    found = []
    for i, (log, ahead, run) in enumerate(zip(problem.logs, short, free, strict=True)):
        own = problem.rows.log == i
        past, ahead_rms, free_rms = past_commands(fit, i), ahead.rms(), run.rms()
        for channel in log.channels:
            c = problem.rows.channels.index(channel)
            mine = z[:, own, c]
            known = mine[np.isfinite(mine)]
            found.append(
                Compared(
                    log.name,
                    channel,
                    run.units[channel],
                    float(fit.noise.measured[c] * fit.noise.scale[i, c]),
                    ahead_rms[channel],
                    free_rms[channel],
                    float(np.sqrt(np.mean(known**2))) if known.size else np.nan,
                    1.0 + COMPARISON.beyond * LEVEL / np.sqrt(max(int(problem.seen[:, own, c].sum()), 1)),
                    whiteness(mine),
                    independence(mine, past),
                )
            )
    return Comparison(problem.model.name, horizon, tuple(found), free)
