"""Axes of a log: conversion from other frames, and checks against the commands.

The package uses right-handed axes with z up: psi turns from x to y, v is positive to the left, and r is
positive to the left. Some trackers use north-east-down (NED): x north, y east, psi clockwise from north, v
and r positive to the right. A log may also be mirrored (one of x, y and psi with the wrong sign).

The motion in a mirrored log is consistent in itself. Only the forces show the error: a craft accelerates in
the direction in which its fans push it, and turns in the direction of their torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Complex
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.logs.log import POSE, Floats, Log

if TYPE_CHECKING:
    from hovercontrol.craft.models.base import EffectModel


#: Windows [s] over which motion is averaged, and delays [s] from command to motion that are tried.
WINDOWS, LAGS = (0.2, 0.6), np.arange(0.0, 0.65, 0.05)

#: Maximum number of rows of a log that are used.
MOST_ROWS = 60_000


@dataclass(frozen=True)
class FrameCriteria:
    """Thresholds for wrong axes or a wrong sign of a log's columns.

    No published source: set by hand, tested in tests/logs/test_frames.py.

    Attributes
    ----------
    least : float
        Smallest correlation that is significant.
    errors : float
        Number of standard errors that it must exceed.
    clearly : float
        Minimum ratio of the larger to the smaller of the two correlations, as logged and mirrored.
    least_torque : float
        Smallest significant correlation of a torque.
    other_sign : float
        Largest correlation of the opposite sign at another delay, as a fraction of that correlation.
    independent : float
        Time after which samples of the motion count as independent [s].
    fewest : int
        Minimum number of independent samples.
    """

    least: float = 0.25
    errors: float = 4.0
    clearly: float = 2.5
    least_torque: float = 0.5
    other_sign: float = 0.6
    independent: float = 0.5
    fewest: int = 10


#: The values in use.
FRAME = FrameCriteria()


@checked
def check_frame(model: EffectModel, log: Log) -> None:
    """Raise if a craft's log is mirrored, in north-east-down axes, or has its heading reversed.

    Parameters
    ----------
    model : Model or BlockModel
        Its effects give the direction of the forces of the commands; their magnitudes do not matter. A log
        of anything but a craft has no such frame and passes.
    log : Log
        With the model's inputs. A log with a stated frame is not checked.

    Raises
    ------
    InputError
        If forces and motion agree clearly in other axes, but not in those of the log.
    """
    from hovercontrol.craft.models.base import EffectModel

    if not isinstance(model, EffectModel):
        raise InputError(f"check_frame: model: expected a Model, found {shown(model)}")
    if not model.is_craft:
        return
    inputs = {s.name for s in model.plant(late=True).inputs}
    if log.frame or not log.has(*inputs) or len(log) < FRAME.fewest:
        return
    if (log.time[-1] - log.time[0]) / FRAME.independent < FRAME.fewest:
        return
    parts = log.spread(MOST_ROWS)
    if len(parts) > 1:
        log = log.select(np.isin(log.time, np.concatenate([part.time for part in parts])))
    push, torque = _push(model, log)
    grids = [(_times(parts, window), window) for window in WINDOWS]
    found = [_alignment(log, push, *grid) for grid in grids] if log.has(*POSE) else []
    for sound, mirrored in found:
        _refuse_mirrored(log, sound, mirrored)
    for times, window in grids if log.has("r") or log.has("psi") else ():
        _check_torque(log, torque, times, window)
    for sound, mirrored in found:
        _refuse_turned(log, sound, mirrored)


def _times(parts: Sequence[Log], window: float) -> Floats:
    """Return times every half window within the parts of a log, with NaN between two parts."""
    inside = [
        np.arange(part.time[0] + window + LAGS[-1], part.time[-1] - window, window / 2) for part in parts
    ]
    return np.concatenate([np.append(times, np.nan) for times in inside])[:-1]


def _alignment(log: Log, push: Complex, times: Floats, window: float) -> tuple[complex, complex]:
    """Return the correlation of acceleration and commanded force `push`, in the log's and mirrored axes."""
    # With z = x + i y:  z'' is correlated with F e^{i psi} of the commands (mirrored: its conjugate, or
    # F e^{-i psi}), given z', a constant and the term (i r' - r^2) e^{i psi} of a marker off the centre.
    z = _mean(log, log["x"], times, window) + 1j * _mean(log, log["y"], times, window)
    angle = _mean(log, log["psi"], times, window)
    heading = np.exp(1j * angle)
    velocity, acceleration = _differences(z, window)
    rate, change = _differences(angle, window)
    arm = (1j * change - rate**2) * heading  # acceleration of a marker off the centre of gravity
    sound = mirrored = 0j
    for lag in LAGS:
        force = _held(log, push.real, times - lag, window) + 1j * _held(log, push.imag, times - lag, window)
        sound = max(sound, _along(force * heading, acceleration, velocity, arm), key=abs)
        for other in (force * heading.conj(), (force * heading).conj()):
            mirrored = max(mirrored, _along(other, acceleration, velocity, arm.conj()), key=abs)
    return sound, mirrored


def _enough(log: Log, least: float) -> float:
    """Return the smallest significant correlation, ``max(least, errors / sqrt(independent samples))``."""
    seconds = float(np.minimum(np.diff(log.time), WINDOWS[-1]).sum())
    return max(least, FRAME.errors / float(np.sqrt(seconds / FRAME.independent)))


def _refuse_mirrored(log: Log, sound: complex, mirrored: complex) -> None:
    if abs(mirrored) > max(_enough(log, FRAME.least), FRAME.clearly * abs(sound)):
        raise InputError(
            f"{log.name}: the log is mirrored: its acceleration agrees with its commands only if x, y or "
            f"psi changes sign (correlation {abs(mirrored):.2f}, as it is {abs(sound):.2f}); expected psi to "
            "turn from x to y: --frame ned converts a compass heading with x north, y east; "
            "--columns psi=NAME:-rad turns a sign; --frame z-up skips this check"
        )


def _refuse_turned(log: Log, sound: complex, mirrored: complex) -> None:
    angle = float(np.degrees(np.angle(sound)))
    if abs(sound) > max(_enough(log, FRAME.least), FRAME.clearly * abs(mirrored)) and abs(angle) > 90.0:
        raise InputError(
            f"{log.name}: column 'psi': expected the heading of the bow, but the craft accelerates "
            f"{abs(angle):.0f} degrees from where its commands push: is psi rotated, or the sign of a "
            f"command wrong? "
            "--frame z-up skips this check"
        )


def _check_torque(log: Log, torque: Floats, times: Floats, window: float) -> None:
    if log.has("r"):
        rate = _mean(log, log["r"], times, window)
    else:
        rate = _differences(_mean(log, log["psi"], times, window), window)[0].real
    change = _differences(rate, window)[0].real
    # drag, and the Munk moment (proportional to u v), which may exceed the torque of the commands
    others = (rate, np.sign(rate), *_drifting(log, times, window))
    found = [float(_along(_held(log, torque, times - lag, window), change, *others).real) for lag in LAGS]
    if -min(found) > _enough(log, FRAME.least_torque) and max(found) < -FRAME.other_sign * min(found):
        raise InputError(
            f"{log.name}: the craft turns against the torque of its commands (correlation "
            f"{min(found):.2f}): is the log in north-east-down axes? --frame ned converts it; or is the "
            f"sign of the rudder (--columns rudder=NAME:-rad turns it), or of the fans' places, wrong? "
            f"--frame z-up skips this check"
        )


def _drifting(log: Log, times: Floats, window: float) -> tuple[Floats, ...]:
    """Return the product of surge and sway velocity, if the log contains or implies both."""
    if log.has("u", "v"):
        return (_mean(log, log["u"] * log["v"], times, window),)
    if not log.has(*POSE):
        return ()
    z = _mean(log, log["x"], times, window) + 1j * _mean(log, log["y"], times, window)
    along = _differences(z, window)[0] * np.exp(-1j * _mean(log, log["psi"], times, window))
    return (along.real * along.imag,)


def _push(model: EffectModel, log: Log) -> tuple[Complex, Floats]:
    """Return the acceleration by the commands in the body frame, u' + i v', and r', for a craft at rest."""
    from hovercontrol.blocks.functions import numpy_functions

    others = (e.name for e in model.effects if e.kind() != "force")
    plant = model.without_effects(*others).plant()
    states = [s.name for s in plant.states]
    commands = np.array([np.nan_to_num(log[s.name]) for s in plant.inputs]).reshape(-1, len(log))
    rest = np.zeros((len(states), len(log)))
    rows = numpy_functions(plant)
    with np.errstate(all="ignore"):
        found = rows.derivatives(log.time, rest, commands) - rows.derivatives(log.time, rest, 0.0 * commands)
    u, v, r = (np.nan_to_num(found[states.index(name)]) for name in ("u", "v", "r"))
    return u + 1j * v, r


def _mean(log: Log, values: Floats, times: Floats, window: float) -> Floats:
    """Return a measured signal's mean over half a window about each time; NaN where nothing was measured."""
    known = np.isfinite(values)
    t, y = log.time[known], values[known]
    if t.size < 2:
        return np.full(times.size, np.nan)
    area = np.concatenate([[0.0], np.cumsum(np.diff(t) * (y[1:] + y[:-1]) / 2)])
    mean = (np.interp(times + window / 4, t, area) - np.interp(times - window / 4, t, area)) / (window / 2)
    gaps = np.flatnonzero(np.diff(t) > window)
    for k in gaps:
        mean[(times > t[k] - window) & (times < t[k + 1] + window)] = np.nan
    return mean


def _held(log: Log, values: Floats, times: Floats, window: float) -> Floats:
    """Return a command's mean over half a window about each time; it is held from row to row."""
    area = np.concatenate([[0.0], np.cumsum(np.diff(log.time) * values[:-1])])
    early, late = (np.interp(times + side * window / 4, log.time, area) for side in (-1, 1))
    return (late - early) / (window / 2)


def _differences(values: NDArray[np.inexact], window: float) -> tuple[Complex, Complex]:
    """Return first and second derivatives, by central differences of values every half window."""
    first, second = (np.full(values.size, np.nan + 0j) for _ in range(2))
    first[1:-1] = (values[2:] - values[:-2]) / window
    second[1:-1] = (values[2:] - 2 * values[1:-1] + values[:-2]) / (window / 2) ** 2
    return first, second


def _along(cause: NDArray[np.inexact], effect: NDArray[np.inexact], *others: NDArray[np.inexact]) -> complex:
    """Return the complex partial correlation of cause and effect, given the others and a constant."""
    # c = a^H b / (|a| |b|) with the least-squares residuals a of the cause and b of the effect.
    known = np.isfinite(cause) & np.isfinite(effect) & np.all(np.isfinite(others), axis=0)
    if known.sum() < FRAME.fewest:
        return 0j
    design = np.column_stack([*(o[known] for o in others), np.ones(known.sum())])
    both = np.column_stack([cause[known], effect[known]])
    scale = np.abs(both).max(axis=0)
    if not scale.all():
        return 0j
    both = both / scale
    left = both - design @ np.linalg.lstsq(design, both, rcond=None)[0]
    sizes = np.linalg.norm(left, axis=0)
    if sizes.min() < 1e-9 * np.sqrt(known.sum()):
        return 0j
    return complex(np.vdot(left[:, 0], left[:, 1]) / sizes.prod())
