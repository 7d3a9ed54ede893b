"""Pose, velocities and commands of a craft over time, from a run of any kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.model import Model
from hovercontrol.documents.scenarios.machine import MachineRun
from hovercontrol.documents.scenarios.result import Run
from hovercontrol.logs.log import POSE, VELOCITY, Log

#: What holds the motion of a craft.
AnyRun: TypeAlias = control.TimeResponseData | Log | Run | MachineRun

#: A frame that falls on a row but for this [s] takes its commands.
ROUNDING = 1e-9

#: Signals that give the point to follow, moving or fixed, in order of preference.
REFERENCES = (("x_ref", "y_ref"), ("goal_x_ref", "goal_y_ref"))


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of one craft.

    Attributes
    ----------
    name : str
    time, x, y, psi : ndarray, shape (n,)
        [s, m, m, rad]; the heading is continuous, without jumps by 2 pi.
    velocities : dict of str to ndarray (n,)
        Those of ``u``, ``v`` [m/s], ``r`` [rad/s] that the run holds.
    reference : dict of str to ndarray (n,)
        ``x`` and ``y`` [m] of the point to follow, if the run holds one.
    goal : bool
        Whether that point is a fixed goal, not a path.
    commands : dict of str to ndarray (n,)
        All other signals, held between times.
    model : Model or None
        Model of a scenario.
    tracked : dict of str to ndarray (n,)
        ``x`` and ``y`` [m] of the point of the craft that a controller brings to the reference, if the run
        holds its error ``error_x``, ``error_y``.
    scenery : Scenery
    headed : bool
        Whether the run holds a heading; a machine without one is drawn round.
    """

    name: str
    time: Array
    x: Array
    y: Array
    psi: Array
    velocities: Mapping[str, Array] = field(default_factory=dict)
    reference: Mapping[str, Array] = field(default_factory=dict)
    goal: bool = False
    commands: Mapping[str, Array] = field(default_factory=dict)
    model: Model | None = None
    tracked: Mapping[str, Array] = field(default_factory=dict)
    scenery: Scenery = field(default_factory=lambda: Scenery())
    headed: bool = True

    def at(self, times: Array) -> Motion:
        """Return the motion at other times, shape (m,): poses interpolated, commands held."""

        def between(values: Array) -> Array:
            return np.interp(times, self.time, values)

        row = np.clip(np.searchsorted(self.time, times + ROUNDING, side="right") - 1, 0, None)
        return replace(
            self, time=times, x=between(self.x), y=between(self.y), psi=between(self.psi),
            velocities={name: between(values) for name, values in self.velocities.items()},
            reference={name: between(values) for name, values in self.reference.items()},
            tracked={name: between(values) for name, values in self.tracked.items()},
            commands={name: values[row] for name, values in self.commands.items()},
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Scenery:
    """What does not move: obstacles, shape (n, 3) as x, y, radius [m], and waypoints, shape (n, 2) [m].

    Plans are what a predictive controller intended at each of its samples, shape (samples, points, 2) [m].
    """

    obstacles: Array = field(default_factory=lambda: np.zeros((0, 3)))
    waypoints: Array = field(default_factory=lambda: np.zeros((0, 2)))
    plans: Array = field(default_factory=lambda: np.zeros((0, 0, 2)))

    def extent(self) -> Array:
        """Return points that a map must show, shape (2, n)."""
        x, y, r = self.obstacles.T
        return np.hstack([self.waypoints.T, [x - r, y - r], [x + r, y + r]])


def scenery_of(run: AnyRun, obstacles: ArrayLike, waypoints: ArrayLike) -> Scenery:
    """Return what a run of a predictive controller holds of its surroundings, and what is given besides.

    Raises
    ------
    InputError
        If obstacles are not (x, y, radius), or waypoints not (x, y).
    """
    try:
        circles = np.reshape(np.asarray(obstacles, dtype=float), (-1, 3))
        points = np.reshape(np.asarray(waypoints, dtype=float), (-1, 2))
    except (TypeError, ValueError):
        raise InputError("expected obstacles as (x, y, radius) and waypoints as (x, y) in m") from None
    passed = np.reshape([p.point for p in getattr(run, "waypoints", ())], (-1, 2))
    known = getattr(run, "obstacles", np.zeros((0, 3)))
    plans = getattr(run, "plans", np.zeros((0, 0, 2)))
    plans = plans if plans.shape[-1:] == (2,) else np.zeros((0, 0, 2))
    return Scenery(np.vstack([known, circles]), np.vstack([passed, points]), plans)


def motion_of(run: AnyRun, obstacles: ArrayLike = (), waypoints: ArrayLike = ()) -> Motion:
    """Return the motion of a craft from a run.

    True signals (``true_x``) of a scenario are preferred to measured ones, and states of a closed loop
    (``plant.x``) serve where its outputs lack the pose. Without ``psi`` the heading is the only state in rad;
    if no state is in rad, there is none.

    Raises
    ------
    InputError
        If ``x``, ``y`` or ``psi`` is missing, ambiguous or known at fewer than two times.
    """
    name, time, columns = _columns(run)
    place = [_find(name, columns, key) for key in POSE[:2]]
    heading = _heading(run, name, columns)
    pose = [*place, np.zeros_like(place[0]) if heading is None else heading]
    known = np.isfinite(pose).all(axis=0)
    if known.sum() < 2:
        raise InputError(f"{name}: expected x, y and psi at two times or more, found {int(known.sum())}")
    x, y, psi = (row[known] for row in pose)
    at = time[known]
    taken: dict[str, Array] = {}
    for key, row in columns.items():
        if key not in POSE and np.isfinite(row).any():
            taken[key] = _filled(time, row, at, held=key not in (*VELOCITY, *np.ravel(REFERENCES)))
    pair = next((pair for pair in REFERENCES if set(pair) <= set(taken)), None)
    reference = {} if pair is None else dict(zip("xy", (taken[k] for k in pair), strict=True))
    follows = pair == REFERENCES[0] and {"error_x", "error_y"} <= set(taken)
    return Motion(
        name, at, x, y, np.unwrap(psi),
        velocities={k: v for k in VELOCITY if (v := _found(columns, taken, k)) is not None},
        reference=reference,
        tracked={k: reference[k] + taken[f"error_{k}"] for k in "xy"} if follows else {},
        scenery=scenery_of(run, obstacles, waypoints),
        headed=heading is not None,
        goal=pair == REFERENCES[1],
        commands=taken,
        model=run.scenario.plant if isinstance(run, Run) and isinstance(run.scenario.plant, Model) else None,
    )  # fmt: skip


def _columns(run: AnyRun) -> tuple[str, Array, dict[str, Array]]:
    """Return the name, the times and all signals by name of a run; outputs go before states of that name."""
    if isinstance(run, Run):
        return run.scenario.name, run.time, dict(run.columns)
    if isinstance(run, MachineRun | Log):
        log = run if isinstance(run, Log) else run.log
        return log.name, log.time, dict(log.columns)
    name = str(run.sysname or "run")
    if run.ntraces > 1:
        raise InputError(f"{name}: expected one run, found a response of {run.ntraces} traces")
    columns: dict[str, Array] = {}
    for labels, rows in ((run.input_labels, run.u), (run.state_labels, run.x), (run.output_labels, run.y)):
        if labels and rows is not None and np.size(rows):
            columns |= dict(zip(labels, np.reshape(rows, (len(labels), -1)), strict=True))
    return name, np.asarray(run.time, dtype=float), columns


def _find(name: str, columns: Mapping[str, Array], key: str) -> Array:
    """Return the signal of a name: the true signal, the signal itself, or the only state with that name."""
    for known in (f"true_{key}", key):
        if known in columns:
            return columns[known]
    ends = [other for other in columns if other.endswith(f".{key}")]
    if len(ends) == 1:
        return columns[ends[0]]
    found = f"several: {', '.join(ends)}" if ends else f"only {', '.join(columns) or 'no signals'}"
    raise InputError(f"{name}: expected the pose of a craft, x, y and psi; of {key!r} it holds {found}")


def _heading(run: AnyRun, name: str, columns: Mapping[str, Array]) -> Array | None:
    """Return ``psi``; of a machine without it the only state in rad, None if there is none."""
    units: Mapping[str, str] = getattr(run, "units", {})
    turning = [key for key in getattr(run, "state_labels", None) or () if units.get(key) == "rad"]
    if any(key.rpartition(".")[2] in ("psi", "true_psi") for key in columns) or len(turning) > 1 or not units:
        return _find(name, columns, POSE[2])
    return columns[turning[0]] if turning else None


def _found(columns: Mapping[str, Array], taken: Mapping[str, Array], key: str) -> Array | None:
    ends = [other for other in columns if other.endswith(f".{key}")]
    names = [f"true_{key}", key, *(ends if len(ends) == 1 else [])]
    return next((taken[known] for known in names if known in taken), None)


def _filled(time: Array, row: Array, at: Array, *, held: bool) -> Array:
    """Return a signal at other times; rows with NaN are skipped."""
    known = np.isfinite(row)
    if not held:
        return np.interp(at, time[known], row[known])
    last = np.clip(np.searchsorted(time[known], at, side="right") - 1, 0, None)
    return row[known][last]
