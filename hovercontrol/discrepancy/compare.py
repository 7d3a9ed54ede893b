"""Compare a model with logs: free-running, a short time ahead, and whether what remains is noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.data import Data, gather
from hovercontrol.discrepancy.fit import Fit, fit
from hovercontrol.discrepancy.levels import LEVEL
from hovercontrol.discrepancy.noise import Noise
from hovercontrol.discrepancy.subject import Subject
from hovercontrol.discrepancy.traces import Trace, traces
from hovercontrol.discrepancy.whiteness import (
    independence,
    past_commands,
    recursive_residuals,
    whiteness,
)
from hovercontrol.logs import Log

Array = NDArray[np.float64]

#: How far ahead models are judged [s].
HORIZON = 1.0

#: Chance at which all tests together find something where there is nothing.
CHANCE = 1e-3


@dataclass(frozen=True)
class Compared:
    """One channel of one log.

    Attributes
    ----------
    log, channel, unit : str
    noise : float
        Of the measurement, from the log itself, in that unit.
    short, free : float
        Root mean square error over windows of a second, each from its own fitted start; and of one run over
        the longest stretch, from the start alone. In that unit.
    remains : float
        Size of what the rows before do not foretell, over that of noise: 1 if nothing is missing.
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
        Length of the short windows [s].
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
        level = CHANCE / max(2 * len(self.channels), 1)
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
    model: Subject, logs: Sequence[Log] | Data, *, horizon: float = HORIZON, noise: Noise | None = None
) -> Comparison:
    """Compare a model, its coefficients as they are, with logs.

    Parameters
    ----------
    model : Model or BlockModel
    logs : sequence of Log, or Data
        With the model's inputs, and some of what it computes.
    horizon : float, optional
        Length of short windows [s].
    noise : Noise, optional
        Default: that of the measurements, from the logs; with process noise, gusts count as noise.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If a log lacks an input, is too short for a window, or shows nothing of the model.

    Examples
    --------
    >>> from hovercontrol.vehicles import c17_simulation
    >>> rng, t = np.random.default_rng(0), np.arange(0.0, 10.0, 0.05)
    >>> commands = {"thrust": 2 + np.sin(t), "rudder": 0.2 * np.cos(t)}
    >>> run = c17_simulation().plant().compile(friction="smooth").simulate(t, list(commands.values()))
    >>> seen = {k: y + 1e-3 * rng.normal(size=t.size) for k, y in zip(run.output_labels, run.outputs)}
    >>> compare(c17_simulation(), [Log("demo", t, {**seen, **commands})]).agrees
    True
    """
    data = logs if isinstance(logs, Data) else gather(model, logs)
    return compared(fit(model, data, horizon, noise, frozen=True))


def compared(near: Fit) -> Comparison:
    """Return the comparison of a model that was fitted to windows as long as the horizon.

    Parameters
    ----------
    near : Fit
        Its coefficients as they are judged.
    """
    data, horizon = near.windowed.data, near.windowed.length
    short, runs, z = traces(near, horizon), traces(near), recursive_residuals(near)
    found = []
    for i, (log, windows, run) in enumerate(zip(data.logs, short, runs, strict=True)):
        own = np.array([k == i for k, _, _ in near.windowed.ranges], dtype=bool)
        past = past_commands(near, i)
        near_rms, free_rms = _short_rms(near, own), run.rms()
        for channel in log.channels:
            c = data.channels.index(channel)
            mine = z[own][:, :, c]
            known = mine[np.isfinite(mine)]
            found.append(
                Compared(
                    log.name,
                    channel,
                    windows.units[channel],
                    float(data.noise[c] * data.scales[i, c]),
                    near_rms[c],
                    free_rms[channel],
                    float(np.sqrt(np.mean(known**2))) if known.size else np.nan,
                    1.0 + 4.0 * LEVEL / np.sqrt(max(int(near.windowed.seen[..., c].sum()), 1)),
                    whiteness(mine),
                    independence(mine, past),
                )
            )
    return Comparison(near.windowed.model.name, horizon, tuple(found), tuple(runs))


def _short_rms(near: Fit, own: NDArray[np.bool_]) -> list[float]:
    """Return the root mean square residual of each channel in some windows."""
    seen = near.windowed.seen[own]
    count = np.maximum(seen.sum(axis=(0, 1)), 1)
    left = near.left[own] * near.windowed.scale[own]
    rms: Array = np.sqrt((left**2).sum(axis=(0, 1)) / count)
    return rms.tolist()
