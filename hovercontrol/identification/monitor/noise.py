"""Noise of a monitor from a log: the levels that the fit of the estimation engine finds.

The fit describes what the model leaves open as missing accelerations, Ornstein-Uhlenbeck processes of root
mean square sigma and correlation time tau. Slower than a tick the monitor knows them as white noise of the
same power at low frequencies: root spectral density ``sigma (2 tau)^(1/2)``. Of a sampled model of period T,
each step adds ``sigma (2 tau T)^(1/2)``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.measure import MOST_ROWS
from hovercontrol.identification.engine.noise import averaged
from hovercontrol.identification.identify.fit import identify, measure_shared
from hovercontrol.identification.monitor.candidates import Craft
from hovercontrol.logs.log import Log

#: Least process noise: this share of the observed acceleration, lasting so many seconds, times the tempo. A
#: model is hardly better known, and a filter without process noise takes every such error for a change.
LEAST, LASTS = 0.01, 0.5

#: Without a training log the noise is taken from the first part of the log: at most this long [s] (of a
#: machine that is not a craft :mod:`.pace`), and at most this share of it.
FIRST_SECONDS, FIRST_SHARE = 20.0, 1.0 / 3.0


@dataclass(frozen=True)
class NoiseLevels:
    """Noise for :func:`~hovercontrol.identification.monitor.monitor.monitor`.

    Attributes
    ----------
    process : dict of str to float
        Root spectral density, by state [unit of the state / s^(1/2)]; of a sampled model what each step adds
        [unit of the state].
    measurement : dict of str to float
        Standard deviation of a sample, by channel [its unit].
    unexplained : dict of str to float
        Root mean square of the missing accelerations, as a share of the observed ones, by state.
    """

    process: dict[str, float]
    measurement: dict[str, float]
    unexplained: dict[str, float]

    def text(self) -> str:
        """Return the levels as one line."""
        seen = ", ".join(f"{k} {v:.2g}" for k, v in self.measurement.items())
        driven = ", ".join(f"{k}' {v:.2g}" for k, v in self.process.items())
        return f"noise of a sample: {seen}; process noise: {driven} (SI units per s^(1/2))"

    def misfit(self) -> str:
        """Return what the model does not explain as one line; empty if it is not more than :data:`LEAST`."""
        left = [f"{100 * v:.0f} % of {k}'" for k, v in self.unexplained.items() if v > LEAST]
        if not left:
            return ""
        return (
            f"the model does not explain {', '.join(left)} in that log (rms); "
            "with a large part, names and sizes may be wrong"
        )


def noise_of(fit: Fit, channels: Sequence[str]) -> NoiseLevels:
    """Return the noise levels of a fit."""
    density = fit.noise.process * np.sqrt(2.0 * fit.noise.seconds)
    least = LEAST * fit.problem.accelerations * np.sqrt(2.0 * LASTS * fit.problem.tempo)
    sizes = (np.maximum(density, least) * np.sqrt(fit.problem.period or 1.0)).tolist()
    measured = dict(zip(fit.problem.rows.channels, fit.noise.measured.tolist(), strict=True))
    lacking = [c for c in channels if c not in measured]
    if lacking:
        raise InputError(f"monitor: the log for the noise has no samples of {', '.join(lacking)}")
    problem = fit.problem  # accelerations are seen from row to row
    rowwise = fit.noise.process if problem.period else averaged(fit.noise, problem.shortest)
    shares = (rowwise / problem.accelerations).tolist()
    return NoiseLevels(
        dict(zip(fit.noise.driven, sizes, strict=True)),
        {c: float(measured[c]) for c in channels},
        dict(zip(fit.noise.driven, shares, strict=True)),
    )


def first_part(log: Log, seconds: float) -> Log:
    """Return the part of a log from which its noise is taken, at most so long [s], without a training log."""
    begin, end = float(log.time[0]), float(log.time[-1])
    return log.between(begin, begin + min(seconds, FIRST_SHARE * (end - begin)))


def noise_from(model: Craft, log: Log, channels: Sequence[str]) -> NoiseLevels:
    """Return the noise levels that a log shows against a model as it is."""
    chosen = Log(log.name, log.time, _only(model, log, channels), frame=log.frame, trials=log.trials)
    subject = as_model(model)
    try:
        fit = base_fit(subject, gather(subject, measure_shared(model, [chosen], MOST_ROWS)), ())
    except FloatingPointError as error:
        raise InputError(f"{log.name}: the noise cannot be fitted: {error}") from error
    return noise_of(fit, channels)


def trained_model(
    model: Craft, log: Log, channels: Sequence[str], progress: Callable[[float, str], None] | None = None
) -> tuple[Craft, NoiseLevels, dict[str, float]]:
    """Return a model with the coefficients that a training log shows, its noise levels, and standard errors.

    The standard errors hold for an incomplete model, too: they cover what other estimates of a coefficient
    give. A coefficient that the log does not show keeps its value, and has none.
    """
    chosen = Log(log.name, log.time, _only(model, log, channels), frame=log.frame, trials=log.trials)
    found = identify(model, [chosen], progress=progress)
    std = {c.name: c.std for c in found.coefficients if 0.0 < c.std < math.inf}
    return found.model, noise_of(found.fit, channels), std


def _only(model: Craft, log: Log, channels: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the columns of the measured channels and of the inputs."""
    names = [*channels, *(s.name for s in model.plant().inputs)]
    lacking = [n for n in names if n not in log.columns]
    if lacking:
        raise InputError(f"monitor: log {log.name!r} has no column {lacking[0]!r}")
    return {n: log.columns[n] for n in names}
