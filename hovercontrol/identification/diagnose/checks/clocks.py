"""Checks of the clocks within one log, against each other and against the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.identification.diagnose.checks.units import scale
from hovercontrol.identification.engine.subject import Subject, structure
from hovercontrol.logs import VELOCITY, Log


@dataclass(frozen=True)
class ClockCriteria:
    """Settings that decide when the clocks of one log disagree.

    No published source: set by hand, exercised by tests/identification/diagnose/test_checks.py.

    Attributes
    ----------
    over : float
        Time over which motion is compared [s].
    reach : float
        Largest shift of the commands that is tried [s].
    step : float
        Step of those shifts [s].
    section : float
        Length of the sections that are compared [s].
    most : int
        Maximum number of sections.
    fewest : int
        Minimum number of sections to estimate a drift.
    scale : float
        Relative difference between pose and velocities above which a warning is given.
    sure : float
        Standard errors that this difference must exceed as well.
    drift : float
        Drift between commands and motion over a log above which a warning is given [s].
    chance : float
        Largest p-value of such a drift.
    left : float
        Largest fraction of the misfit that may remain once commands are shifted back along the drift; other
        causes leave all of it.
    refused_drift : float
        Drift above which the log is refused [s].
    refused_chance : float
        Largest p-value of a drift for which the log is refused.
    refused_left : float
        Largest fraction of the misfit that may remain in a log that is refused.
    """

    over: float = 0.4
    reach: float = 0.4
    step: float = 0.02
    section: float = 4.0
    most: int = 12
    fewest: int = 5
    scale: float = 0.03
    sure: float = 5.0
    drift: float = 0.03
    chance: float = 1e-4
    left: float = 0.9
    refused_drift: float = 0.1
    refused_chance: float = 1e-5
    refused_left: float = 0.75


#: The values in use.
CLOCKS = ClockCriteria()


def check_clocks(model: Subject, log: Log) -> list[str]:
    """Return warnings about clocks with different rates, one line each.

    Parameters
    ----------
    log : Log
        Log with pose and velocities, or velocities and commands; without these it is not checked.

    Raises
    ------
    InputError
        If the clocks of commands and motion drift apart significantly and by much: no effect explains that.
    """
    said = []
    found = scale(log)
    if found is not None:
        factor, std = found
        if abs(factor - 1.0) > CLOCKS.scale + CLOCKS.sure * std:
            said.append(
                f"{log.name}: the position moves {factor:.3g} times as fast as the velocities say: another "
                "clock, or another scale?"
            )
    drift, chance, left = command_drift(model, log) or (0.0, 1.0, 1.0)
    if abs(drift) <= CLOCKS.drift or chance >= CLOCKS.chance or left >= CLOCKS.left:
        return said
    pace = 1.0 + drift / float(log.time[-1] - log.time[0])
    text = (
        f"{log.name}: commands and motion drift apart by {1e3 * drift:.0f} ms from its beginning to its end"
    )
    if abs(drift) > CLOCKS.refused_drift and chance < CLOCKS.refused_chance and left < CLOCKS.refused_left:
        raise InputError(
            f"{text}: their clocks run at different rates; record both with one clock, or multiply the "
            f"times of the commands by {pace:.4f} before the two are joined"
        )
    return [*said, f"{text}: were columns of two clocks joined?"]


def command_drift(model: Subject, log: Log) -> tuple[float, float, float] | None:
    """Return the increase in delay between commands and motion from the beginning of a log to its end.

    The change of the velocities over short stretches is computed by the model, with commands shifted by each
    of several times, and compared with the measured change. Each section of the log has a best shift, at the
    minimum sum of squares. The slope of a line through these shifts gives the drift, and their scatter about
    the line its error. If the model lacks a lag, the best shift varies between sections without a trend. With
    n sections at times t_i, and residuals e_i of their best shifts from a line of slope b::

        drift = b (duration of the log),    std(b)^2 = sum e_i^2 / (n - 2) / sum (t_i - mean t)^2

    Returns
    -------
    (float, float, float) or None
        Drift [s]; its two-sided p-value; and the misfit with commands shifted along the line over that with
        the best constant shift. None if the log carries too little information.
    """
    shifts = np.arange(-CLOCKS.reach, CLOCKS.reach + CLOCKS.step / 2, CLOCKS.step)
    found = _squares(model, log, shifts)
    if found is None:
        return None
    time, squares = found
    count = int(np.clip((time[-1] - time[0]) / CLOCKS.section, 1, CLOCKS.most))
    section = np.minimum(count * np.arange(time.size) // time.size, count - 1)
    best = []
    for k in range(count):
        own = section == k
        least = _least(shifts, squares[:, own].sum(axis=1))
        if least is not None:
            best.append((float(time[own].mean()), least))
    if len(best) < CLOCKS.fewest:
        return None
    at, late = np.array(best).T
    slope, middle = np.polyfit(at - at.mean(), late, 1)
    rest = late - middle - slope * (at - at.mean())
    scatter = np.sqrt((rest**2).sum() / (len(best) - 2) / ((at - at.mean()) ** 2).sum())
    chance = 2.0 * student.sf(abs(slope) / max(float(scatter), 1e-12), len(best) - 2)
    line = middle + slope * (time - at.mean())
    nearest = np.clip(np.rint((line - shifts[0]) / CLOCKS.step).astype(int), 0, shifts.size - 1)
    along = float(squares[nearest, np.arange(time.size)].sum())
    left = along / max(float(squares.sum(axis=1).min()), 1e-12)
    return float(slope) * float(time[-1] - time[0]), float(chance), left


def _squares(model: Subject, log: Log, shifts: Array) -> tuple[Array, Array] | None:
    """Return the middles of stretches, and the squared error of the model's velocity change by shift.

    Errors are relative to their median at shift zero, and clipped at 6.
    """
    block = structure(model)
    states, inputs = [s.name for s in block.states], [s.name for s in block.inputs]
    if not inputs or not set(VELOCITY) <= set(states) or not log.has(*VELOCITY):
        return None
    known = np.isfinite(log.stack(*VELOCITY, *inputs)).all(axis=1)
    time = log.time[known]
    every = max(2, round(CLOCKS.over / float(np.median(np.diff(log.time)))))
    cuts = np.arange(0, time.size, every)
    if cuts.size < 10:
        return None
    x = np.array([log[s][known] if log.has(s) else np.zeros(time.size) for s in states])
    x = np.where(np.isfinite(x), x, 0.0)
    commands, seen = (log.stack(*names)[known].T for names in (inputs, VELOCITY))
    grown = np.diff(seen[:, cuts], axis=1)
    values = model.coefficients()
    numbers = {k: values.get(k.rpartition(".")[2], v) for k, v in block.default_parameters.items()}
    rows = [states.index(c) for c in VELOCITY]
    lost = np.empty((shifts.size, *grown.shape))
    for k, shift in enumerate(shifts.tolist()):
        at = np.clip(np.searchsorted(time, time - shift + 1e-9, side="right") - 1, 0, time.size - 1)
        slope = block.to_numpy().derivatives(time - time[0], x, commands[:, at], numbers)[rows, :-1]
        whole = np.cumsum(slope * np.diff(time), axis=1)
        lost[k] = np.diff(np.concatenate([np.zeros((len(rows), 1)), whole], axis=1)[:, cuts]) - grown
    size = np.median(np.abs(lost[shifts.size // 2]), axis=1)
    squares = (np.minimum(np.abs(lost) / np.maximum(size, 1e-9)[:, None], 6.0) ** 2).sum(axis=1)
    usual = np.diff(time[cuts]) < 2.0 * CLOCKS.over
    return 0.5 * (time[cuts[1:]] + time[cuts[:-1]])[usual], squares[:, usual]


def _least(shifts: Array, squares: Array) -> float | None:
    """Return the shift with the minimum sum of squares, by a parabola fitted to five; None near the ends."""
    k = int(squares.argmin())
    if not 1 < k < shifts.size - 2:
        return None
    bend, slope, _ = np.polyfit(shifts[k - 2 : k + 3] - shifts[k], squares[k - 2 : k + 3], 2)
    return float(shifts[k] - 0.5 * slope / bend) if bend > 0 else None
