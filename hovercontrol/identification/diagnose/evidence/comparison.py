"""Comparison of a model with logs: short predictions, free simulation, and tests of the innovations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.identification.diagnose.evidence.holdout import held_fit
from hovercontrol.identification.diagnose.evidence.traces import Trace, simulated_traces
from hovercontrol.identification.diagnose.evidence.whiteness import (
    independence,
    innovations,
    past_commands,
    whiteness,
)
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.levels import LEVEL
from hovercontrol.identification.engine.noise import Noise
from hovercontrol.identification.engine.subject import Subject
from hovercontrol.logs import Log


@dataclass(frozen=True)
class ComparisonCriteria:
    """Settings that decide when a model and a log disagree.

    No published source: set by hand, exercised by tests/identification/diagnose/test_compare.py.

    Attributes
    ----------
    horizon : float
        Prediction horizon [s].
    chance : float
        Probability of a false alarm of all tests together.
    beyond : float
        Number of standard errors of the noise level by which the innovations may exceed it.
    """

    horizon: float = 1.0
    chance: float = 1e-3
    beyond: float = 4.0


#: The values in use.
COMPARISON = ComparisonCriteria()


@dataclass(frozen=True)
class Compared:
    """Comparison of one channel of one log.

    Attributes
    ----------
    log, channel, unit : str
    noise : float
        Measurement noise, estimated from the log itself, in `unit`.
    short, free : float
        Root mean square error of short simulations, each from its own smoothed start; and of one simulation
        of the whole log from its start. In `unit`.
    remains : float
        Root mean square of the innovations over the noise level: 1 if nothing is missing.
    largest : float
        Largest value of `remains` that noise explains, given the error of the noise level.
    white, independent : float
        p-values of the correlation of innovations in time, and with past commands.
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
    """Comparison of a model with logs.

    Attributes
    ----------
    model : str
    horizon : float
        Length of the short simulations [s].
    channels : tuple of Compared
    runs : tuple of Trace
        Free simulations, one for each log.
    """

    model: str
    horizon: float
    channels: tuple[Compared, ...]
    runs: tuple[Trace, ...]

    def beyond(self, one: Compared) -> tuple[str, ...]:
        """Return as text how the innovations of a channel differ from noise; empty if they do not."""
        level = COMPARISON.chance / max(2 * len(self.channels), 1)
        larger = (f"{one.remains:.3g} times the noise",) if one.remains > one.largest else ()
        in_time = ("correlated in time",) if one.white < level else ()
        return (*larger, *in_time, *(("following the commands",) if one.independent < level else ()))

    @property
    def disagreements(self) -> tuple[str, ...]:
        """The differences beyond noise as text; empty if the model agrees with all logs."""
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
    """Compare a model, with fixed coefficients, with logs.

    Parameters
    ----------
    logs : sequence of Log
        Logs with the model's inputs and some of its outputs or states.
    horizon : float, optional
        Length of short simulations [s].
    noise : Noise, optional
        Default: measurement noise, estimated from the logs. With process noise, gusts count as noise.

    Raises
    ------
    InputError
        If a log lacks an input, is too short, or has no channel of the model.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
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
        Fit with the coefficients to compare; its path is taken as the true path. Samples left out of the fit
        are not compared.
    horizon : float, optional
        Length of short simulations [s].
    noise : Noise, optional
        Default: measurement noise alone.
    """
    problem = fit.problem
    fit = replace(fit, noise=noise or replace(fit.noise, process=np.zeros_like(fit.noise.process)))
    short, free = simulated_traces(fit, horizon), simulated_traces(fit)
    z = innovations(fit)
    # `largest` is 1 + k LEVEL / n^(1/2): LEVEL / n^(1/2) is the relative standard error of the noise level
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
