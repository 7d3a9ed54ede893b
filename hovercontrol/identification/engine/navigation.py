"""Logs from an inertial navigation: velocities drift between corrections, positions jump at corrections.

An inertial navigation integrates accelerometers between fixes. Its velocity over ground then has an unknown
offset and ramp, and is smooth to a millimetre. Its position is the integral of that velocity and adds no
information. At a fix both jump although the craft does not. Therefore positions are left out, and offset and
ramp are states of the filter that every correction draws anew (:mod:`.drift`). K06 sections 3.5 and 5.4
describe such a navigation.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from hovercontrol.base.arrays import Array, Indices
from hovercontrol.blocks.block import Block
from hovercontrol.identification.engine.measure import MOST_ROWS, Measured, measure, steps
from hovercontrol.identification.engine.spikes import stand_out
from hovercontrol.logs import POSE, VELOCITY, Log


@dataclass(frozen=True)
class NavigationCriteria:
    """When a log is taken as the output of an inertial navigation with corrections.

    No published source: set by hand on simulated logs of K06's navigation, exercised by
    tests/identification/diagnose/test_navigation.py.

    Attributes
    ----------
    jump : float
        Smallest size of a correction in robust standard deviations of position minus integrated velocity.
    resolved : float
        Smallest size of a correction in multiples of the position's resolution.
    least : int
        Smallest number of corrections.
    most : float
        Largest fraction of the rows that are corrections.
    """

    jump: float = 8.0
    resolved: float = 3.0
    least: int = 5
    most: float = 0.2


#: The values in use.
NAVIGATION = NavigationCriteria()


#: Number of rows to either side of a correction whose medians are compared.
BESIDE = 5

#: Maximum number of searches for spikes: large spikes hide small ones.
ROUNDS = 5


#: Median of the absolute value of a normal variable, in standard deviations.
NORMAL = 0.6745


@dataclass(frozen=True)
class Drift:
    """Errors of the velocities over ground between two corrections.

    Attributes
    ----------
    offset : float
        Standard deviation of the constant part [m/s].
    ramp : float
        Standard deviation of the rate of change [m/s^2].
    white : float
        Standard deviation of the white noise from row to row [m/s].
    corrections : int
        Number of corrections in the log.
    jump : float
        Root mean square correction of the position [m].
    """

    offset: float
    ramp: float
    white: float
    corrections: int
    jump: float

    def __str__(self) -> str:
        return (
            f"the position jumps {self.corrections} times, by {self.jump:.2g} m, where the velocities say "
            "nothing of it: corrections of a navigation. Positions are left out, and between corrections the "
            f"velocities may be off by an offset ({self.offset:.2g} m/s) and a ramp ({self.ramp:.2g} m/s^2)"
        )


@dataclass(frozen=True, eq=False)
class Navigated(Measured):
    """A log from an inertial navigation.

    Attributes
    ----------
    drift : Drift
    corrected : ndarray
        Times of the first rows after corrections, on the clock of the log [s].
    """

    drift: Drift
    corrected: Array


def over_ground(log: Log) -> Array:
    """Return the velocities over ground from heading and body velocities of a log, shape (2, n) [m/s].

    ``[u cos psi - v sin psi, u sin psi + v cos psi]``
    """
    c, s = np.cos(log["psi"]), np.sin(log["psi"])
    return np.stack([c * log["u"] - s * log["v"], s * log["u"] + c * log["v"]])


def without_spikes(rows: Array) -> Array:
    """Return rows, shape (m, n), with spikes replaced by linear interpolation; corrections are kept.

    Examples
    --------
    >>> row = np.sin(997.0 * np.arange(100)) + 50 * (np.arange(100) > 49) + 30 * (np.arange(100) == 20)
    >>> clean = without_spikes(row[None])[0]
    >>> np.flatnonzero(clean != row).tolist(), bool(abs(clean[20]) < 1)
    ([20], True)
    """
    rows, known, at = rows.copy(), np.isfinite(rows), np.arange(rows.shape[1])
    good = known.copy()
    for _ in range(ROUNDS):
        levels = np.array([[noise_level(row[ok])] for row, ok in zip(rows, good, strict=True)])
        z = np.where(good, rows, 0.0) / levels
        found = stand_out(z.T[None], good.T[None])[0].T
        if not found.any():
            break
        good &= ~found
    for row, ok, all_known in zip(rows, good, known, strict=True):
        row[all_known] = np.interp(at[all_known], at[ok], row[ok]) if ok.any() else row[all_known]
    return rows


def noise_level(row: Array) -> float:
    """Return the standard deviation of the white noise of a row of samples, from third differences.

    ``median |d^3 y| / (0.6745 sqrt(20))``
    """
    thirds = np.abs(np.diff(row, 3))
    return max(float(np.median(thirds)) / (NORMAL * np.sqrt(20.0)) if thirds.size else 0.0, 1e-12)


def corrections(log: Log) -> Indices:
    """Return the rows at which the position jumps, unexplained by the velocity, and stays at the new value.

    Parameters
    ----------
    log : Log
        A log without pose and body velocities has no corrections.

    Examples
    --------
    >>> t = 0.01 * np.arange(1000)
    >>> x = t + 1e-4 * np.sin(997.0 * t) + 0.05 * (t // 1 % 2)
    >>> columns = {"x": x, "y": 0 * t, "psi": 0 * t, "u": 1 + 0 * t, "v": 0 * t, "r": 0 * t}
    >>> corrections(Log("demo", t, columns)).tolist()
    [100, 200, 300, 400, 500, 600, 700, 800, 900]
    """
    if not log.has(*POSE, *VELOCITY) or len(log) < 8:
        return np.empty(0, dtype=np.intp)
    speed, step = without_spikes(over_ground(log)), np.diff(log.time)
    # Change of position minus the integral of velocity by the trapezoidal rule: dp - (v_k + v_(k+1))/2 dt
    moved = np.diff(log.stack("x", "y"), axis=0).T - 0.5 * (speed[:, 1:] + speed[:, :-1]) * step
    known = np.isfinite(moved).all(axis=0)
    if not known.any():
        return np.empty(0, dtype=np.intp)
    carried = np.concatenate([np.zeros((2, 1)), np.cumsum(np.where(known, moved, 0.0), axis=1)], axis=1)
    carried = without_spikes(carried)  # a spike is no correction: the position does not stay there
    moved = np.diff(carried)
    level = np.median(np.abs(moved[:, known]), axis=1, keepdims=True) / NORMAL
    longer = np.maximum(step / float(np.median(step)), 1.0)  # velocities may change where rows are missing
    apart = [steps(row[np.isfinite(row)]) for row in log.stack("x", "y").T]
    finest = np.array([[sizes.min() if sizes.size else 0.0] for sizes in apart])  # resolution of the position
    least = np.maximum(NAVIGATION.jump * np.maximum(level, 1e-12), NAVIGATION.resolved * finest)
    # The time of a velocity jump is known only to a row: the position may then differ by |dv| dt.
    least = least * longer + np.abs(np.diff(speed)) * step
    far = known & (np.abs(moved) > least).any(axis=0)
    found = []
    for row in np.flatnonzero(far) + 1:
        before, after = carried[:, max(row - BESIDE, 0) : row], carried[:, row : row + BESIDE]
        stayed = np.median(after, axis=1) - np.median(before, axis=1)
        if (
            np.abs(stayed) > np.maximum(0.5 * np.abs(moved[:, row - 1]), NAVIGATION.jump * level[:, 0])
        ).any():
            found.append(int(row))
    return np.array(found, dtype=np.intp)


def measure_navigated(block: Block, log: Log, most_rows: int = MOST_ROWS) -> Navigated | None:
    """Return a log in terms of a Block if the log is from an inertial navigation, else None.

    Parameters
    ----------
    most_rows : int, optional
        As for :func:`hovercontrol.identification.engine.measure.measure`.
    """
    if not {"psi", "u", "v"} <= {s.name for s in (*block.states, *block.outputs)}:
        return None
    at = corrections(log)
    if not NAVIGATION.least <= at.size <= NAVIGATION.most * len(log):
        return None
    speed = without_spikes(over_ground(log))
    moved = np.diff(log.stack("x", "y"), axis=0)[at - 1]
    # offset = rms of the velocity jumps,  ramp = offset / median time between corrections,
    # white = median |d^3 v| / (0.6745 sqrt(20))
    jumps = np.sqrt(((speed[:, at] - speed[:, at - 1]) ** 2).mean())
    thirds = np.abs(np.diff(speed, 3, axis=1))
    white = max(float(np.nanmedian(thirds)) / (NORMAL * np.sqrt(20.0)), 1e-12)
    apart = float(np.median(np.diff(log.time[at])))
    drift = Drift(float(jumps), float(jumps) / apart, white, int(at.size), float(np.sqrt((moved**2).mean())))
    columns = {name: values for name, values in log.columns.items() if name not in ("x", "y")}
    plain = measure(block, replace(log, columns=columns), most_rows)
    given = {f.name: getattr(plain, f.name) for f in fields(Measured)}
    return Navigated(**given, drift=drift, corrected=log.time[at])
