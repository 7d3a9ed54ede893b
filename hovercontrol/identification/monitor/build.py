"""A monitor of the logs of a machine: channels, period and noise from a log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.block import Block
from hovercontrol.identification.diagnose.checks.units import refuse_units
from hovercontrol.identification.monitor.candidates import Craft
from hovercontrol.identification.monitor.monitor import monitor
from hovercontrol.identification.monitor.noise import FIRST_SECONDS, first_part, noise_from, trained_model
from hovercontrol.identification.monitor.pace import paced
from hovercontrol.identification.monitor.sensors import rounded_to
from hovercontrol.logs.log import POSE, Log

#: Shortest period of a monitor [s]; of faster logs every n-th row is used.
SHORTEST_PERIOD = 0.01

#: Longest part of a log along which the threshold is computed [s].
MOTION = 60.0


@dataclass(frozen=True)
class Built:
    """A monitor made for a log, and where its numbers come from.

    Attributes
    ----------
    block : Block
    notes : tuple of str
        One line each.
    sizes : dict of str to float
        Largest absolute values of the measured channels and the commands in the log that the noise is from.
    step : float
        Median time between two of its rows [s].
    """

    block: Block
    notes: tuple[str, ...]
    sizes: dict[str, float]
    step: float


def build(
    model: Craft,
    log: Log,
    *,
    train: Log | None = None,
    candidates: Sequence[str] | None = None,
    measured: Sequence[str] | None = None,
    false_alarms_per_hour: float = 0.1,
    progress: Callable[[float, str], None] | None = None,
) -> Built:
    """Return a monitor for a log.

    Parameters
    ----------
    log : Log
        To be replayed, or the training log again.
    train : Log, optional
        From which coefficients and noise are fitted. Default: the model as it is, and the noise of the first
        part of the log.
    candidates : sequence of str, optional
        As for :func:`~hovercontrol.identification.monitor.monitor.monitor`.
    measured : sequence of str, optional
        Default: the pose of a craft, of another machine all outputs that the log has.
    false_alarms_per_hour : float, optional
    progress : callable, optional

    Raises
    ------
    InputError
        If a log's units contradict each other; as of the fit and of
        :func:`~hovercontrol.identification.monitor.monitor.monitor`.
    """
    report = progress or (lambda part, what: None)
    for one in (log, train):
        if one is not None:
            refuse_units(model, one)
    channels = list(measured) if measured else channels_of(model, log)
    period = model.period or period_of(log, channels)

    def long(seconds: float) -> float:
        return paced(seconds, period, is_craft=model.is_craft)

    source = train if train is not None else first_part(log, long(FIRST_SECONDS))
    report(0.0, "fitting the noise")
    if train is not None:
        model, noise, std = trained_model(model, train, channels, lambda part, what: report(0.3 * part, what))
        where = f"coefficients and noise fitted on {train.name}"
    else:
        noise, std = noise_from(model, source, channels), {}
        where = (
            f"noise taken from the first {source.time[-1] - source.time[0]:.0f} s of {log.name}, "
            "in which a change is not seen; --reference LOG takes it from a reference log"
        )
    report(0.3, "computing the threshold")
    # reading a log has left out rows that only repeat a slower sensor's sample
    coarse = [c for c in channels if rounded_to(source[c], noise.measurement[c])]
    block = monitor(
        model,
        candidates,
        false_alarms_per_hour=false_alarms_per_hour,
        period=period,
        process_noise=noise.process,
        measurement_noise=noise.measurement,
        coefficient_std=std,
        measured=channels,
        lost_samples=channels,
        repeats=coarse,
        motion=source.between(float(source.time[0]), float(source.time[0]) + long(MOTION)),
        dispersion=True,
    )
    report(1.0, "built")
    rate = f"threshold for {false_alarms_per_hour:g} false alarms an hour; a tick each {1e3 * period:.4g} ms"
    notes = tuple(line for line in (where, noise.text(), noise.misfit(), rate) if line)
    largest = {s.name: source.columns[s.name] for s in block.inputs if source.has(s.name)}
    sizes = {name: float(np.nanmax(np.abs(column))) for name, column in largest.items()}
    return Built(block, notes, {k: v for k, v in sizes.items() if v}, float(np.median(np.diff(source.time))))


def channels_of(model: Craft, log: Log) -> list[str]:
    """Return the measured channels that a monitor of a log uses."""
    plant = model.plant()
    if model.is_craft:
        found = [name for name in POSE if log.has(name)]
    else:
        known = dict.fromkeys(s.name for s in (*plant.outputs, *plant.states))
        inputs = {s.name for s in plant.inputs}
        found = [name for name in known if log.has(name) and name not in inputs]
    if not found:
        names = [s.name for s in (plant.outputs or plant.states)]
        raise InputError(f"monitor: log {log.name!r} has none of the measured channels {shown(names)}")
    return found


def period_of(log: Log, channels: Sequence[str]) -> float:
    """Return the period of a monitor of a log [s]: that of its rows, or a multiple."""
    seen = np.isfinite(log.stack(*channels)).any(axis=1)
    steps = np.diff(log.time[seen])
    if steps.size < 10:
        raise InputError(f"monitor: log {log.name!r} has too few rows: expected more than 10")
    step = float(np.median(steps))
    step = float(f"{step:.6g}")
    # whole picoseconds, so that tick times are exact
    return round(step * max(1, int(np.ceil(SHORTEST_PERIOD / step - 1e-6))), 12)
