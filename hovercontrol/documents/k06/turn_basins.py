"""The two limit points of K06's turn law and their basins of attraction (sections 2.2.5-2.2.6).

The law (2.39) takes the craft to the wanted point ``(0, 0, r_ref)``, or to the unwanted one
``(0, -d r_ref, 0)``, where it drifts sideways without turning. W (2.36) never grows. A craft that starts
below W_bad, the level of W at the unwanted point, therefore reaches the wanted one; so does a craft that
starts within the ball of (2.48).

It may take long: a slow manifold, ``r' = kappa r^2`` with kappa of :func:`slow_rate`, runs through the
unwanted point. A craft that reaches the manifold at r < 0 ends at the unwanted point; at r > 0 it leaves
after about ``1/(kappa r)``, which may be years. Hence three classes: turns within the stated time, unwanted,
and stuck (neither).

Erratum: section 2.2.6 calls the unwanted point a local minimiser of W. It is not: the gradient of W there is
``(m u, m v, J (r - r_ref)) = (0, -m d r_ref, -J r_ref)``, for K06's craft at 3 rad/s (0, -2.50, -0.288).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.backends.sweep import SweepResult
from hovercontrol.control.analysis.regions import Axis, Region, axis, mesh, refuse_large
from hovercontrol.control.controllers.k06.energy import entry_energy, kinetic_energy, unwanted_level
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body
from hovercontrol.documents.k06.law_loop import TURNING, turn_loop

Plane = Mapping[str, tuple[float, float]]

#: A run that ends within this distance of the unwanted limit point is on its slow manifold [m/s].
CLOSE = 0.1

#: Tolerances of the runs: relative, and absolute in m/s and rad/s.
RTOL, ATOL = 1e-9, 1e-12

#: Smallest yaw rate on the slow manifold whose sign is resolved [rad/s]. With tolerances a hundred times as
#: tight 99 of 100 final yaw rates change by less than 5e-12 rad/s, and no sign does (a test checks it).
TOLD = 1e-11

#: The default plane: surge decays by itself.
DRIFT_AND_TURN: Plane = {"v": (-2.5, 2.5), "r": (-8.0, 8.0)}

#: Computing time of a run on one core, for the estimate before a sweep [s].
_SECONDS_PER_RUN = 3e-4

_ABOUT = {"u": "initial surge u", "v": "initial sway v", "r": "initial yaw rate r"}


def slow_rate(*, k1: float, yaw_rate: float, body: Body = HOVERDEMON_BODY) -> float:
    """Return kappa [1/rad] of the slow manifold ``r' = kappa r^2`` through the unwanted limit point.

    There ``u = m v r/k1`` with ``v = -d r_ref``, and the side force keeps ``v' = d r'``:
    ``kappa = d^2 m^2 r_ref/(k1 (J + d^2 m))``.

    Examples
    --------
    >>> round(slow_rate(k1=0.5, yaw_rate=3.0), 1)
    11.5
    """
    m, J, d = body.mass, body.inertia, body.arm
    return d**2 * m**2 * yaw_rate / (positive("k1", k1) * (J + d**2 * m))


@checked
def turn_basins(
    plane: Plane = DRIFT_AND_TURN,
    points: int = 100,
    *,
    at: Mapping[str, float] | None = None,
    yaw_rate: float = 3.0,
    k1: float = 0.5,
    k2: float = 3.5,
    duration: float = 300.0,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return the limit point that the turn law reaches, and the time, over a plane of initial velocities.

    Parameters
    ----------
    plane : mapping, optional
        Two of ``u``, ``v`` [m/s] and ``r`` [rad/s], with their ranges: first the x axis.
    points : int, optional
        Along each axis.
    at : mapping, optional
        Initial value of the third; default 0.
    yaw_rate : float, optional
        r_ref [rad/s], not 0; default of K06's table 6.4.
    k1, k2 : float, optional
        [kg/s], likewise.
    duration : float, optional
        Of each simulation [s]; a craft that turns later counts as stuck.
    progress
        As for :meth:`~hovercontrol.blocks.backends.compiled.CompiledBlock.sweep`.

    Returns
    -------
    Region
        Three classes, one for each start: ``unwanted`` (near the unwanted point at the end, with a yaw rate
        of at least :data:`TOLD` against r_ref), ``turns`` (W at most :data:`TURNING` of W_bad at the end),
        ``stuck`` (neither: it leaves later, or the tolerances do not resolve it); ``level`` (W < W_bad at
        the start), ``entry`` (the ball of (2.48)); the quantities ``time`` [s] until it turns, and
        ``leaves`` [s], the estimated time at which a stuck craft leaves; lines at the edges of level and
        entry.

    Raises
    ------
    InputError
        If the plane or a range is not valid, a gain or the duration is not positive, the yaw rate is 0, or
        the map is too large.

    Examples
    --------
    >>> region = turn_basins(points=9)
    >>> bool((region["level"] & region["unwanted"]).any()), region.outside("entry", "level")
    (False, [])
    """
    x, y = _axes(plane, points)
    positive("duration", duration)
    ready = turn_loop(k1=k1, k2=k2, yaw_rate=yaw_rate).compile()
    refuse_large(ready, points**2, _SECONDS_PER_RUN)
    start = _start(plane, x, y, at or {})
    runs = ready.sweep(
        [0.0, duration],
        x0={f"craft.{name}": values for name, values in start.items()},
        rtol=RTOL,
        atol=ATOL,
        progress=progress,
    )
    body = HOVERDEMON_BODY
    bad, entry = levels(yaw_rate)
    kappa = slow_rate(k1=k1, yaw_rate=abs(yaw_rate))
    classes, times = _classes(runs, yaw_rate, duration, kappa)
    inside = {
        "level": kinetic_energy(body.mass, body.inertia, **{**start, "r": start["r"] - yaw_rate}) < bad,
        "entry": kinetic_energy(body.mass, body.inertia, **start) < entry,
    }
    third = next(iter(set(_ABOUT) - set(plane)))
    value = float(start[third][0])
    lines = {
        "W = W_bad": _ellipse(x, y, body, bad, value, third, yaw_rate),
        "entry ball (2.48)": _ellipse(x, y, body, entry, value, third, 0.0),
    }
    unit = "rad/s" if third == "r" else "m/s"
    return Region(
        f"K06 turn law, r_ref = {yaw_rate:g} rad/s, from {third} = {value:g} {unit}",
        x,
        y,
        {n: values.reshape(points, points) for n, values in (classes | inside | times).items()},
        units={"time": "s", "leaves": "s"},
        labels={
            "unwanted": "simulated: to (0, -d r_ref, 0), unwanted",
            "turns": f"simulated: turns at r_ref within {duration:g} s",
            "stuck": f"simulated: after {duration:g} s still near the unwanted point",
            "time": "time until it turns",
            "leaves": "time when it leaves, about",
            "level": "W < W_bad at the start",
            "entry": "energy below (2.48) at the start",
        },
        lines={name: curve for name, curve in lines.items() if len(curve[0])},
        marks=_limit_points(x, y, {third: value}, yaw_rate, body),
    )


def _classes(
    runs: SweepResult, yaw_rate: float, duration: float, kappa: float
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Return the class of each run, the time until it turns, and the time at which a stuck one leaves [s].

    On the slow manifold ``r' = kappa r^2``, so that r grows without bound ``1/(kappa r)`` later.
    """
    well = runs.status == 0
    turns = well & (runs["level"].final <= TURNING)
    near = well & (runs["away"].final < CLOSE)
    rate = runs.states_final[:, runs.states.index("craft.r")] * np.sign(yaw_rate)
    unwanted = near & (rate <= -TOLD)
    stuck = well & ~turns & ~unwanted
    leaves = duration + 1 / (kappa * np.maximum(rate, TOLD))
    return {"unwanted": unwanted, "turns": turns, "stuck": stuck}, {
        "time": np.where(turns, runs["waited"].final, np.nan),
        "leaves": np.where(stuck & (rate >= TOLD), leaves, np.nan),
    }


def levels(yaw_rate: float, body: Body = HOVERDEMON_BODY) -> tuple[float, float]:
    """Return W_bad of section 2.2.6 and the entry energy (2.48), both [J].

    Examples
    --------
    >>> [round(level, 4) for level in levels(3.0)]
    [1.6301, 0.2201]
    """
    numbers = (body.mass, body.inertia, body.arm, yaw_rate)
    return float(unwanted_level(*numbers)), float(entry_energy(*numbers))


def _axes(plane: Plane, points: int) -> tuple[Axis, Axis]:
    if not isinstance(plane, Mapping):
        raise InputError(f"plane: expected ranges by name, found {plane!r}")
    for name in plane:
        check_known(name, _ABOUT, f"plane: unknown velocity {name!r}")
    if len(plane) != 2:
        raise InputError(f"plane: expected two of u, v, r, found {len(plane)}")
    x, y = (
        axis(name, "rad/s" if name == "r" else "m/s", span, points, _ABOUT[name])
        for name, span in plane.items()
    )
    return x, y


def _start(plane: Plane, x: Axis, y: Axis, at: Mapping[str, float]) -> dict[str, Array]:
    """Return the initial u, v, r of all runs."""
    third = set(_ABOUT) - set(plane)
    if not isinstance(at, Mapping):
        raise InputError(f"at: expected one velocity by name, such as {{'u': 0.0}}, found {at!r}")
    for name in at:
        if name not in third:
            raise InputError(f"at: expected {third.pop()}, the velocity outside the plane, found {name!r}")
    xs, ys = mesh(x, y)
    given = {x.name: xs, y.name: ys}
    fixed = {name: np.full(len(xs), number(f"at: {name}", at.get(name, 0.0))) for name in third}
    return {name: (given | fixed)[name] for name in _ABOUT}


def _ellipse(
    x: Axis, y: Axis, body: Body, energy: float, value: float, third: str, turning: float
) -> tuple[Array, Array]:
    """Return the curve where the plane cuts the ellipsoid of an energy about ``(0, 0, turning)``."""
    weight = {"u": body.mass, "v": body.mass, "r": body.inertia}
    centre = {"u": 0.0, "v": 0.0, "r": turning}
    left = 2 * energy - weight[third] * (value - centre[third]) ** 2
    if left <= 0:
        return np.empty(0), np.empty(0)
    angle = np.linspace(0.0, 2 * np.pi, 361)
    xs, ys = (
        centre[a.name] + np.sqrt(left / weight[a.name]) * f(angle) for a, f in ((x, np.cos), (y, np.sin))
    )
    return xs, ys


def _limit_points(
    x: Axis, y: Axis, at: Mapping[str, float], yaw_rate: float, body: Body
) -> dict[str, tuple[float, float]]:
    """Return those of the two limit points that lie in the plane and on the map."""
    points = {
        "wanted limit point": {"u": 0.0, "v": 0.0, "r": yaw_rate},
        "unwanted limit point": {"u": 0.0, "v": -body.arm * yaw_rate, "r": 0.0},
    }
    return {
        name: (point[x.name], point[y.name])
        for name, point in points.items()
        if all(math.isclose(point[third], value) for third, value in at.items())
        and all(a.values[0] <= point[a.name] <= a.values[-1] for a in (x, y))
    }
