"""Clocks and units, checked by what the columns of one log say of each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from hovercontrol.discrepancy.windowed import Subject, structure
from hovercontrol.errors import InputError
from hovercontrol.logs import POSE, VELOCITY, Log

Array = NDArray[np.float64]

#: Seconds over which motion is compared; how far commands are shifted, and in which steps [s].
OVER, REACH, STEP = 0.4, 0.4, 0.02

#: Length of the sections that are compared [s], how many at most and at least.
SECTION, MOST, FEWEST = 4.0, 12, 5

#: Least way [m] that must be gone in one comparison.
LEAST = 0.02

#: Pose and velocities may disagree by this part, and by so many standard errors.
SCALE, SURE = 0.03, 5.0

#: Clocks may drift apart by so much [s]; more is told if chance makes it this rarely.
DRIFT, CHANCE = 0.03, 1e-4


def refuse_units(log: Log) -> None:
    """Refuse positions or yaw rates in other units than the other columns.

    Raises
    ------
    InputError
        If the position moves 100 or 1000 times as far as the velocities say (or as little), or heading and
        yaw rate differ by the factor between radian and degree.

    Examples
    --------
    >>> t = np.arange(0, 4, 0.02)
    >>> columns = {"x": 1e3 * t, "y": 0 * t, "psi": 0 * t, "u": 1 + 0 * t, "v": 0 * t, "r": 0 * t}
    >>> refuse_units(Log("a", t, columns))
    Traceback (most recent call last):
        ...
    hovercontrol.errors.InputError: a: the position moves 1000 times as far as the velocities: is it in mm?
    """
    scale = _scale(log)
    if scale is not None:
        for factor, hint in ((1e3, "is it in mm?"), (1e2, "is it in cm?"), (1e-3, "in km?"), (1e-2, "")):
            if 0.8 * factor < scale[0] < 1.25 * factor:
                hint = hint or "are the velocities in cm/s?"
                raise InputError(
                    f"{log.name}: the position moves {factor:g} times as far as the velocities: {hint}"
                )
    if log.has("psi", "r"):
        turned, said = _sums(log, "psi", "r")
        if turned > 57.0 and 40.0 < turned / max(said, 1e-9) < 80.0:
            raise InputError(
                f"{log.name}: column 'psi': expected a heading in rad; it turns 57 times as far as the yaw "
                "rate says: is it in degrees? Multiply by pi/180"
            )
        if said > 57.0 and 40.0 < said / max(turned, 1e-9) < 80.0:
            raise InputError(
                f"{log.name}: column 'r': expected a yaw rate in rad/s; it says 57 times what the heading "
                "turns: is it in deg/s?"
            )


def clock_warnings(model: Subject, log: Log) -> list[str]:
    """Return warnings of clocks that do not run alike, one line each.

    Parameters
    ----------
    model : Model or BlockModel
    log : Log
        With pose and velocities, or velocities and commands; else nothing can be said.
    """
    said = []
    scale = _scale(log)
    if scale is not None:
        factor, std = scale
        if abs(factor - 1.0) > SCALE + SURE * std:
            said.append(
                f"{log.name}: the position moves {factor:.3g} times as fast as the velocities say: another "
                "clock, or another scale?"
            )
    drift = command_drift(model, log)
    if drift is not None and abs(drift[0]) > DRIFT and drift[1] < CHANCE:
        said.append(
            f"{log.name}: commands and motion drift apart by {1e3 * drift[0]:.0f} ms from its beginning "
            "to its end: were two clocks joined?"
        )
    return said


def _sums(log: Log, angle: str, rate: str) -> tuple[float, float]:
    """Return how far an angle turns, and how far its rate says, over steps that noise hardly enters."""
    known = np.isfinite(log[angle]) & np.isfinite(log[rate])
    time, values, rates = log.time[known], np.unwrap(log[angle][known]), log[rate][known]
    if time.size < 3:
        return 0.0, 0.0
    every = max(1, round(OVER / float(np.median(np.diff(time)))))
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(time))])
    return float(np.abs(np.diff(values[::every])).sum()), float(np.abs(np.diff(whole[::every])).sum())


def _scale(log: Log) -> tuple[float, float] | None:
    """Return how much farther the position moves than the velocities say, and its standard error."""
    if not log.has(*POSE, *VELOCITY):
        return None
    columns = log.stack(*POSE, *VELOCITY)
    known = np.isfinite(columns).all(axis=1)
    if known.sum() < 50:
        return None
    time, (x, y, psi, u, v, _) = log.time[known], columns[known].T
    rates = np.stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
    steps = np.diff(time)
    whole = np.concatenate(
        [np.zeros((2, 1)), np.cumsum(0.5 * (rates[:, 1:] + rates[:, :-1]) * steps, axis=1)], axis=1
    )
    every = max(1, round(OVER / float(np.median(steps))))
    said = np.diff(whole[:, ::every], axis=1).ravel()
    moved = np.diff(np.stack([x, y])[:, ::every], axis=1).ravel()
    if float(np.abs(said).max()) < LEAST:
        return None
    arm = np.diff(np.stack([np.cos(psi), np.sin(psi)])[:, ::every], axis=1).ravel()
    columns = np.stack(
        [said, arm], axis=1
    )  # velocities of a point beside that of the pose are no wrong scale
    inverse = np.linalg.pinv(columns.T @ columns)
    factor = float((inverse @ columns.T @ moved)[0])
    scores = columns * (moved - columns @ (inverse @ columns.T @ moved))[:, None]
    return factor, float(np.sqrt((inverse @ (scores.T @ scores) @ inverse)[0, 0]))


def command_drift(model: Subject, log: Log) -> tuple[float, float] | None:
    """Return how much later the motion follows its commands at a log's end than at its beginning.

    The growth of velocities over short stretches as the model has it, its commands shifted by each of some
    times, against that measured. Sections of the log each have a best shift, at the least sum of squares. A
    line through those tells the drift, their scatter about it the error: where the model lacks a lag, the
    best shift differs from section to section without a trend.

    Parameters
    ----------
    model : Model or BlockModel
    log : Log

    Returns
    -------
    (float, float) or None
        Seconds, and the chance of as much if there is none; None where the log does not tell.
    """
    shifts = np.arange(-REACH, REACH + STEP / 2, STEP)
    found = _squares(model, log, shifts)
    if found is None:
        return None
    time, squares = found
    count = int(np.clip((time[-1] - time[0]) / SECTION, 1, MOST))
    section = np.minimum(count * np.arange(time.size) // time.size, count - 1)
    best = []
    for k in range(count):
        own = section == k
        least = _least(shifts, squares[:, own].sum(axis=1))
        if least is not None:
            best.append((float(time[own].mean()), least))
    if len(best) < FEWEST:
        return None
    at, late = np.array(best).T
    slope, middle = np.polyfit(at - at.mean(), late, 1)
    rest = late - middle - slope * (at - at.mean())
    scatter = np.sqrt((rest**2).sum() / (len(best) - 2) / ((at - at.mean()) ** 2).sum())
    chance = 2.0 * student.sf(abs(slope) / max(float(scatter), 1e-12), len(best) - 2)
    return float(slope) * float(time[-1] - time[0]), float(chance)


def _squares(model: Subject, log: Log, shifts: Array) -> tuple[Array, Array] | None:
    """Return the middles of stretches, and squares of what the model misses in each, by shift."""
    block = structure(model)
    states, inputs = [s.name for s in block.states], [s.name for s in block.inputs]
    if not inputs or not set(VELOCITY) <= set(states) or not log.has(*VELOCITY):
        return None
    known = np.isfinite(log.stack(*VELOCITY, *inputs)).all(axis=1)
    time = log.time[known]
    every = max(2, round(OVER / float(np.median(np.diff(log.time)))))
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
    usual = np.diff(time[cuts]) < 2.0 * OVER
    return 0.5 * (time[cuts[1:]] + time[cuts[:-1]])[usual], squares[:, usual]


def _least(shifts: Array, squares: Array) -> float | None:
    """Return where sums of squares are least; None at the ends."""
    k = int(squares.argmin())
    if not 1 < k < shifts.size - 2:
        return None
    bend, slope, _ = np.polyfit(shifts[k - 2 : k + 3] - shifts[k], squares[k - 2 : k + 3], 2)
    return float(shifts[k] - 0.5 * slope / bend) if bend > 0 else None
