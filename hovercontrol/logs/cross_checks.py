"""Columns of a log that contradict each other by the laws of motion, and the convention that reconciles them.

With z = x + i y, heading psi and body velocity w = u + i v, kinematics says z' = w exp(i psi) and psi' = r.
A compass heading, a velocity in the axes of the world or a yaw rate about the axis that points down leave
their own relation instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.logs.log import Floats, Log

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class CrossCriteria:
    """Thresholds for a contradiction.

    Set by hand, tested in tests/logs/test_cross_checks.py.

    Attributes
    ----------
    over : float
        Time over which rates are computed [s].
    fewest : int
        Minimum number of rates.
    agrees : float
        Share of the motion that a relation must explain to hold: the coefficient of determination of
        velocities, or the mean resultant length of angles.
    fails : float
        Largest share that the relation of the log's own convention explains if it does not hold.
    moving : float
        Speed above which there is a course, as a fraction of the 90 % quantile.
    off : float
        Smallest angle between course and heading [rad] that is no drift.
    """

    over: float = 0.4
    fewest: int = 12
    agrees: float = 0.9
    fails: float = 0.5
    moving: float = 0.3
    off: float = 1.0


#: The values in use.
CROSS = CrossCriteria()

#: Ratios of speeds that are units: a velocity column that is read as m/s.
_SPEEDS = {"km/h": 3.6, "knot": 3.6 / 1.852, "mph": 2.236936, "ft/s": 3.28084, "cm/s": 100.0, "mm/s": 1000.0}

#: Largest logarithm of the ratio of two factors that are the same unit.
_SAME = 0.05


def convention_faults(log: Log) -> list[str]:
    """Return one line for each contradiction between position, heading, velocities and yaw rate.

    Returns
    -------
    list of str
        Empty if the columns agree, or do not move enough to tell.

    Examples
    --------
    >>> t = np.arange(0.0, 20.0, 0.02)
    >>> psi = 0.3 * t
    >>> log = Log("a", t, {"x": np.sin(psi) / 0.3, "y": (1 - np.cos(psi)) / 0.3, "psi": np.pi / 2 - psi})
    >>> print(convention_faults(log)[0].partition(": ")[2].partition(";")[0])
    column 'psi' is a compass heading (from y, clockwise), psi must turn from x to y
    """
    said: list[str] = []
    for part in log.each_trial():
        said += [line for line in (_rate_fault(part), _motion_fault(part)) if line]
    return list(dict.fromkeys(f"{log.name}: {line}" for line in said))


def _windows(log: Log, *names: str) -> tuple[Floats, Floats, Floats]:
    """Return rates [1/s], means, and the steps of time [s] over windows, shape (m, number of names)."""
    values = log.stack(*names)
    known = np.isfinite(values).all(axis=1)
    time, values = log.time[known], values[known]
    if time.size < 3:
        return np.zeros((0, len(names))), np.zeros((0, len(names))), np.zeros(0)
    every = max(1, round(CROSS.over / float(np.median(np.diff(time)))))
    for k in (k for k, name in enumerate(names) if name == "psi"):
        values[:, k] = np.unwrap(values[:, k])
    steps = time[every::every] - time[:-every:every]
    ends = values[every::every] - values[:-every:every]
    # mean over each window by the trapezium rule
    area = np.vstack(
        [np.zeros(len(names)), np.cumsum(np.diff(time)[:, None] * (values[1:] + values[:-1]) / 2, 0)]
    )
    means = (area[every::every] - area[:-every:every]) / steps[:, None]
    short = steps < 2 * CROSS.over + 2 * float(np.median(np.diff(time)))  # without the gaps
    return (ends / steps[:, None])[short], means[short], steps[short]


def _rate_fault(log: Log) -> str:
    """Return a contradiction of heading and yaw rate, psi' = r, or an empty text."""
    if not log.has("psi", "r"):
        return ""
    rates, means, steps = _windows(log, "psi", "r")
    turned, r = rates[:, 0], means[:, 1]
    if steps.size < CROSS.fewest or not np.any(r):
        return ""
    own, other = _explained(turned, r), _explained(turned, -r)
    if own > CROSS.fails or other < CROSS.agrees:
        return ""
    return (
        "column 'r' is minus the rate of psi: one of them is positive clockwise (NED), the other "
        "counter-clockwise; --columns r=NAME:-rad/s turns the sign of r, --frame ned that of both"
    )


def _motion_fault(log: Log) -> str:
    """Return a contradiction of position, heading and velocities, or an empty text."""
    if not log.has("x", "y", "psi"):
        return ""
    body = log.has("u", "v")
    rates, means, steps = _windows(log, "x", "y", "psi", *(("u", "v") if body else ()))
    if steps.size < CROSS.fewest:
        return ""
    moved, psi = rates[:, 0] + 1j * rates[:, 1], means[:, 2]
    return _velocity_fault(moved, psi, means[:, 3] + 1j * means[:, 4]) if body else _course_fault(moved, psi)


def _velocity_fault(moved: Complex, psi: Floats, w: Complex) -> str:
    # z' = w e^{i psi}, and what other conventions give for it
    turn = np.exp(1j * psi)
    others = {
        "u and v are velocities along x and y, not along the body; leave them out of --columns": w,
        "v is positive to the right: --columns v=NAME:-m/s turns its sign": w.conj() * turn,
        _COMPASS: w * 1j * turn.conj(),
        _COMPASS + ", and v is positive to the right: --columns v=NAME:-m/s": w.conj() * 1j * turn.conj(),
        "psi turns from y to x, against the position: --columns psi=NAME:-rad turns its sign": w
        * turn.conj(),
        "psi is 90 deg too large": -1j * w * turn,
        "psi is 90 deg too small": 1j * w * turn,
        "psi is 180 deg off, or u and v point aft": -w * turn,
    }
    power = float(np.vdot(w, w).real) * float(np.vdot(moved, moved).real)
    along = float(np.vdot(w * turn, moved).real)
    if along > 0.0 and along**2 > CROSS.agrees * power:  # the directions agree; the sizes may not
        scale = float(np.vdot(w, w).real) / along
        unit, ratio = min(_SPEEDS.items(), key=lambda pair: abs(np.log(scale / pair[1])))
        if abs(np.log(scale / ratio)) > _SAME:
            return ""
        return f"u and v are {scale:.3g} times the speed of the position: are they in {unit}? u=NAME:{unit}"
    name, share = _best(moved, others)
    return name if share > CROSS.agrees and _explained(moved, w * turn) < CROSS.fails else ""


_COMPASS = (
    "column 'psi' is a compass heading (from y, clockwise), psi must turn from x to y; --frame ned if x is "
    "north and y is east, which also has to be so for the position"
)


def _course_fault(moved: Complex, psi: Floats) -> str:
    """Return a contradiction of course and heading, if the bow keeps its angle to the course."""
    speed = np.abs(moved)
    fast = speed > CROSS.moving * np.quantile(speed, 0.9)
    course, turn = moved[fast] / speed[fast], np.exp(1j * psi[fast])
    if course.size < CROSS.fewest:
        return ""
    drift, mirrored = np.mean(course * turn.conj()), np.mean(course * turn)
    if abs(drift) > CROSS.agrees:
        angle = float(np.angle(drift))
        if abs(angle) < CROSS.off or abs(mirrored) > CROSS.fails:  # it goes straight: no turn tells
            return ""
        return (
            f"the craft moves {np.degrees(abs(angle)):.0f} deg to the {'left' if angle > 0 else 'right'} "
            "of its heading all the time: is psi measured from another axis of the craft or of the floor?"
        )
    if abs(mirrored) > CROSS.agrees and abs(drift) < CROSS.fails:
        angle = float(np.degrees(np.angle(mirrored)))
        if abs(angle - 90.0) < 45.0:
            return _COMPASS
        return (
            "psi turns against the course: a heading that is positive clockwise? --columns psi=NAME:-rad "
            "turns its sign, --frame ned converts a log with x north and y east"
        )
    return ""


def _explained(seen: NDArray[np.inexact], said: NDArray[np.inexact]) -> float:
    """Return the coefficient of determination 1 - sum |seen - said|^2 / sum |seen|^2."""
    power = float(np.vdot(seen, seen).real)
    return 1.0 - float(np.vdot(seen - said, seen - said).real) / power if power > 0.0 else 0.0


def _best(moved: Complex, others: Mapping[str, Complex]) -> tuple[str, float]:
    name = max(others, key=lambda key: _explained(moved, others[key]))
    return name, _explained(moved, others[name])
