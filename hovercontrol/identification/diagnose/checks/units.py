"""Checks of the units of one log's columns, against each other and against the model."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import estimate, first_noise
from hovercontrol.identification.engine.kalman import run_filter
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.identification.engine.subject import Subject, structure
from hovercontrol.logs import POSE, VELOCITY, Log


@dataclass(frozen=True)
class UnitCriteria:
    """Settings that decide when a column seems to be in another unit.

    No published source: set by hand, exercised by tests/identification/diagnose/test_checks.py.

    Attributes
    ----------
    over : float
        Time over which motion is compared [s].
    least : float
        Minimum distance moved in one comparison [m].
    fits : float
        Fraction of the motion that velocities must explain with the heading read as degrees.
    fails : float
        Maximum fraction that they may explain with the heading read as radians.
    turns : float
        Minimum gain over a constant heading, relative to the fraction that it leaves unexplained.
    brisk : float
        Mean turn rate above which degrees are suspected [rad/s].
    less : float
        Factor by which the misfit of the model must fall with angles read as degrees.
    asked : int
        Number of rows used for this test: those with the largest turn.
    """

    over: float = 0.4
    least: float = 0.02
    fits: float = 0.9
    fails: float = 0.5
    turns: float = 0.2
    brisk: float = 2.0
    less: float = 4.0
    asked: int = 600


#: The values in use.
UNITS = UnitCriteria()


def refuse_units(model: Subject, log: Log) -> None:
    """Refuse positions, angles or yaw rates in other units than the other columns.

    Raises
    ------
    InputError
        If position and velocities differ by a factor of 100 or 1000, if heading and yaw rate differ by the
        factor between radians and degrees or are both in degrees, or if a craft's input in rad exceeds pi.

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import c17_simulation
    >>> t = np.arange(0, 4, 0.02)
    >>> columns = {"x": 1e3 * t, "y": 0 * t, "psi": 0 * t, "u": 1 + 0 * t, "v": 0 * t, "r": 0 * t}
    >>> columns |= {"thrust": 0 * t, "rudder": 0 * t}
    >>> refuse_units(c17_simulation(), Log("a", t, columns))  # doctest: +NORMALIZE_WHITESPACE
    Traceback (most recent call last):
        ...
    hovercontrol.base.errors.InputError: a: the position moves 1000 times as far as the velocities: is it in
    mm?
    """
    _refuse_angles(model, log)
    found = scale(log)
    if found is not None:
        for factor, hint in ((1e3, "is it in mm?"), (1e2, "is it in cm?"), (1e-3, "in km?"), (1e-2, "")):
            if 0.8 * factor < found[0] < 1.25 * factor:
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
    _refuse_degrees(model, log)


def scale(log: Log) -> tuple[float, float] | None:
    """Return the ratio of the position's motion to the integrated velocities, and its standard error.

    With the columns X and motions y of :func:`_ways`, and e the residual::

        b = (X'X)^-1 X'y,    covariance (X'X)^-1 (sum e_i^2 x_i x_i') (X'X)^-1 (sandwich);    the ratio is b_1
    """
    found = _ways(log, 1.0)
    if found is None:
        return None
    columns, moved = found
    inverse = np.linalg.pinv(columns.T @ columns)
    factor = float((inverse @ columns.T @ moved)[0])
    scores = columns * (moved - columns @ (inverse @ columns.T @ moved))[:, None]
    return factor, float(np.sqrt((inverse @ (scores.T @ scores) @ inverse)[0, 0]))


def _refuse_angles(model: Subject, log: Log) -> None:
    """Refuse inputs of a craft in rad that exceed pi; inputs with bounds of their own are checked later.

    A craft's angles are those of rudders and fans. The commanded angle of a servo may be many turns.
    """
    for signal in structure(model).inputs if model.is_craft else ():
        row = log[signal.name][np.isfinite(log[signal.name])]
        farthest = float(np.abs(row).max(initial=0.0))
        bounded = math.isfinite(signal.lower) and math.isfinite(signal.upper)
        if signal.unit == "rad" and farthest > math.pi and not bounded:
            raise InputError(
                f"{log.name}: column {signal.name!r}: expected an angle in rad, found values from "
                f"{row.min():.4g} to {row.max():.4g}: is it in degrees? Multiply by pi/180"
            )


def _refuse_degrees(model: Subject, log: Log) -> None:
    """Refuse a heading and a yaw rate in degrees, both or the one that the log has."""
    angles = [name for name in ("psi", "r") if log.has(name)]
    agree = _moved_in_degrees(log)
    if not agree and not _modelled_in_degrees(model, log, angles):
        return
    if len(angles) == 2:
        turned, said = _sums(log, "psi", "r")
        angles = angles if 0.5 < turned / max(said, 1e-9) < 2.0 else ["psi"]
    rows = {name: log[name][np.isfinite(log[name])] for name in angles}
    what = {"psi": "heading", "r": "yaw rate"}
    spans = " and ".join(f"a {what[k]} from {row.min():.4g} to {row.max():.4g}" for k, row in rows.items())
    units = {"psi": "rad", "r": "rad/s"}
    if agree:
        why = "in degrees the velocities agree with the position"
    else:
        why = "in degrees the model agrees far better with it"
    raise InputError(
        f"{log.name}: column{'s' if len(angles) > 1 else ''} {' and '.join(map(repr, angles))}: expected "
        f"{' and '.join(units[k] for k in angles)}, found {spans} that look like degrees ({why}); multiply "
        f"{'both ' if len(angles) > 1 else ''}by pi/180"
    )


def _moved_in_degrees(log: Log) -> bool:
    """Whether body velocities agree with the position only if the heading is in degrees."""
    explained = []
    for factor in (math.pi / 180, 1.0, 0.0):
        found = _ways(log, factor)
        if found is None:
            return False
        columns, moved = found
        part, *_ = np.linalg.lstsq(columns, moved, rcond=None)
        rest = moved - columns @ part
        explained.append(1.0 - float(rest @ rest) / max(float(moved @ moved), 1e-300))
    degrees, radian, straight = explained
    return (
        degrees > UNITS.fits and radian < UNITS.fails and degrees > straight + UNITS.turns * (1.0 - straight)
    )


def _modelled_in_degrees(model: Subject, log: Log, angles: list[str]) -> bool:
    """Whether a fast-turning log agrees far better with the model if its angles are in degrees."""
    moves = set(VELOCITY) <= {s.name for s in structure(model).states}
    if not (moves and angles and _whirls(log)):
        return False
    log = _busiest(log, angles[0])
    turned = {name: np.radians(log[name]) for name in angles}
    as_said, in_degrees = (_misfit(model, log.with_columns(k)) for k in ({}, turned))
    return UNITS.less * in_degrees < as_said


def _busiest(log: Log, angle: str) -> Log:
    """Return the part of a log, `asked` rows long, in which an angle changes most."""
    if len(log) <= UNITS.asked:
        return log
    whole = np.concatenate([[0.0], np.nancumsum(np.abs(np.diff(log[angle])))])
    first = int((whole[UNITS.asked :] - whole[: -UNITS.asked]).argmax())
    return log.select(slice(first, first + UNITS.asked))


def _misfit(model: Subject, log: Log) -> float:
    """Return the mean square innovation of the given model on a log, over short blocks: 1 is noise alone."""
    try:
        data = gather(model, [log])
        problem = Problem(model, data)
        begin = first_noise(problem)
        noise = replace(begin, process=np.zeros_like(begin.process))
        fit = estimate(problem, prior_of(problem, model), noise, frozen=True, levels=False)
    except (InputError, FloatingPointError):  # it diverges; other faults are reported on reading
        return math.inf
    squares = run_filter(augment(problem, fit.linear, noise, unknowns=False)).products
    return float(squares.sum()) / int(problem.seen.sum())


def _whirls(log: Log) -> bool:
    """Whether a craft seems to turn fast, as it does if angles are in degrees."""
    if log.has("r"):
        return float(np.nanmean(np.abs(log["r"]))) > UNITS.brisk
    psi = log["psi"][np.isfinite(log["psi"])]
    if psi.size < 3 or float(np.ptp(psi)) <= 1.05 * math.tau:  # a heading wrapped to +-pi is in rad
        return False
    every = max(1, round(UNITS.over / float(np.median(np.diff(log.time)))))
    way = float(np.abs(np.diff(psi[::every])).sum())
    return way > UNITS.brisk * float(log.time[-1] - log.time[0])


def _sums(log: Log, angle: str, rate: str) -> tuple[float, float]:
    """Return the total turn of an angle and of its integrated rate, over steps that suppress noise."""
    known = np.isfinite(log[angle]) & np.isfinite(log[rate])
    time, values, rates = log.time[known], np.unwrap(log[angle][known]), log[rate][known]
    if time.size < 3:
        return 0.0, 0.0
    every = max(1, round(UNITS.over / float(np.median(np.diff(time)))))
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(time))])
    return float(np.abs(np.diff(values[::every])).sum()), float(np.abs(np.diff(whole[::every])).sum())


def _ways(log: Log, factor: float) -> tuple[Array, Array] | None:
    """Return regressors, shape (n, 2), of the position's displacements, and these; heading times a factor.

    Over each step the first column is the integral of ``(u cos psi - v sin psi, u sin psi + v cos psi)`` by
    the trapezoidal rule. The second is the change of ``(cos psi, sin psi)``: it allows for a pose measured
    ahead of the point whose velocities are measured.
    """
    if not log.has(*POSE, *VELOCITY):
        return None
    rows = log.stack(*POSE, *VELOCITY)
    known = np.isfinite(rows).all(axis=1)
    if known.sum() < 50:
        return None
    time, (x, y, psi, u, v, _) = log.time[known], rows[known].T
    psi = factor * psi
    rates = np.stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
    steps = np.diff(time)
    whole = np.concatenate(
        [np.zeros((2, 1)), np.cumsum(0.5 * (rates[:, 1:] + rates[:, :-1]) * steps, axis=1)], axis=1
    )
    every = max(1, round(UNITS.over / float(np.median(steps))))
    said = np.diff(whole[:, ::every], axis=1).ravel()
    moved = np.diff(np.stack([x, y])[:, ::every], axis=1).ravel()
    if float(np.abs(said).max(initial=0.0)) < UNITS.least:
        return None
    arm = np.diff(np.stack([np.cos(psi), np.sin(psi)])[:, ::every], axis=1).ravel()
    return np.stack([said, arm], axis=1), moved
