"""The two limit points of K06's turn law, and from where the craft goes to which (sections 2.2.5-2.2.6).

The law (2.39) takes the craft to ``(0, 0, r_ref)``, wanted, or to ``(0, -d r_ref, 0)``, where it drifts
sideways and does not turn. W (2.36) never grows, so that a craft that starts below its level at the unwanted
point, W_bad, gets to the wanted one, and so does one that starts within the ball of (2.48).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.analysis.law_regions import MOVING, force_craft
from hovercontrol.analysis.regions import Axis, Region, axis, mesh, refuse_large
from hovercontrol.block import Block
from hovercontrol.controllers.k06 import setpoints, turn
from hovercontrol.controllers.k06.energy import body_signals, entry_energy, kinetic_energy, unwanted_level
from hovercontrol.controllers.k06.laws import YAW_RATE_REF
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.interconnect import interconnect
from hovercontrol.signals import Signal
from hovercontrol.tables import number, positive
from hovercontrol.vehicles import HOVERDEMON_BODY, Body

Array = NDArray[np.float64]
Plane = Mapping[str, tuple[float, float]]

#: A run that ends this close to the unwanted limit point is on its way there [m/s].
CLOSE = 0.1

#: The plane that shows most: surge dies out by itself.
DRIFT_AND_TURN: Plane = {"v": (-2.5, 2.5), "r": (-8.0, 8.0)}

#: For the estimate before a sweep, of one core.
_SECONDS_PER_RUN = 3e-4

_ABOUT = {"u": "initial surge u", "v": "initial sway v", "r": "initial yaw rate r"}


def turn_loop(*, k1: float, k2: float, yaw_rate: float) -> Block:
    """Return K06's craft under the turn law, with a watch on the energy and the unwanted limit point.

    Outputs ``level``, W/W_bad of (2.36), and ``away`` [m/s], the distance from the unwanted limit point with
    yaw rates as velocities at the rudder. States ``craft.u``, ``craft.v``, ``craft.r``.

    Parameters
    ----------
    k1, k2 : float
        Gains [kg/s], positive.
    yaw_rate : float
        r_ref [rad/s].

    Raises
    ------
    InputError
        If a gain is not positive, or the yaw rate zero: then both limit points are one.
    """
    if not math.isfinite(number("yaw_rate", yaw_rate)):
        raise InputError(f"yaw_rate must be finite, found {yaw_rate!r}")
    if yaw_rate == 0:
        raise InputError("yaw_rate: expected a turn, found 0 rad/s: the two limit points are one")
    law = turn(k1=k1, k2=k2, name="law")
    u, v, r = (s.symbol for s in MOVING)
    parameters = body_signals(HOVERDEMON_BODY)
    m, J, d = (s.symbol for s in parameters)
    ref = YAW_RATE_REF.symbol
    watch = Block(
        "watch",
        inputs=(*MOVING, YAW_RATE_REF),
        outputs=(Signal("level", "1", "W/W_bad"), Signal("away", "m/s", "from the unwanted limit point")),
        parameters=parameters,
        output_expressions={
            "level": kinetic_energy(m, J, u, v, r - ref) / unwanted_level(m, J, d, ref),
            "away": sp.sqrt(u**2 + (v + d * ref) ** 2 + (d * r) ** 2),
        },
    )
    told = setpoints([law], {"yaw_rate_ref": yaw_rate})
    return interconnect([force_craft(), law, told, watch], "loop", outputs=["level", "away"])


def turn_basins(
    plane: Plane = DRIFT_AND_TURN,
    points: int = 100,
    *,
    at: Mapping[str, float] | None = None,
    yaw_rate: float = 3.0,
    k1: float = 0.5,
    k2: float = 3.5,
    duration: float = 300.0,
    executor: Executor | None = None,
    checkpoint: str | Path | None = None,
    progress: Callable[[int], None] | None = None,
) -> Region:
    """Return, over a plane of initial velocities, which limit point the turn law takes the craft to.

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
        Of each simulation [s]. The approach to the unwanted point is slow, as 1/t: an eigenvalue is 0.
    executor : concurrent.futures.Executor, optional
        Where the simulations are done; default threads of this machine.
    checkpoint : path, optional
        Folder from which the same map resumes.
    progress : callable, optional
        Called now and then with the number of runs done.

    Returns
    -------
    Region
        Maps ``unwanted`` (simulated: above W_bad and close to the unwanted point at the end), ``wanted``
        (simulated: below W_bad at the end, from where it cannot rise), ``level`` (W < W_bad at the start),
        ``entry`` (the ball of (2.48)); lines at the edges of the last two. A run may be neither: in doubt.

    Raises
    ------
    InputError
        If the plane is none, a range is none, a gain or the duration is not positive, the yaw rate is 0, or
        the map is too large.

    Examples
    --------
    >>> region = turn_basins(points=9)
    >>> region.outside("level", "wanted"), region.outside("entry", "level")
    ([], [])
    """
    x, y = _axes(plane, points)
    positive("duration", duration)
    ready = turn_loop(k1=k1, k2=k2, yaw_rate=yaw_rate).compile()
    refuse_large(ready, points**2, _SECONDS_PER_RUN)
    start = _start(plane, x, y, at or {})
    runs = ready.sweep(
        [0.0, duration],
        x0={f"craft.{name}": values for name, values in start.items()},
        rtol=1e-9,
        atol=1e-12,
        executor=executor,
        checkpoint=checkpoint,
        progress=progress,
    )
    body = HOVERDEMON_BODY
    energy = kinetic_energy(body.mass, body.inertia, **start)
    error = kinetic_energy(body.mass, body.inertia, **{**start, "r": start["r"] - yaw_rate})
    bad, entry = levels(yaw_rate)
    well = runs.status == 0
    below = runs["level"].final < 1.0
    maps = {
        "unwanted": well & (runs["away"].final < CLOSE) & ~below,
        "wanted": well & below,
        "level": error < bad,
        "entry": energy < entry,
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
        {name: values.reshape(points, points) for name, values in maps.items()},
        labels={
            "unwanted": "simulated: to (0, -d r_ref, 0), unwanted",
            "wanted": "simulated: to (0, 0, r_ref), wanted",
            "level": "W < W_bad at the start",
            "entry": "energy below (2.48) at the start",
        },
        lines={name: curve for name, curve in lines.items() if len(curve[0])},
        marks=_limit_points(x, y, {third: value}, yaw_rate, body),
    )


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
        if name not in _ABOUT:
            raise InputError(f"plane: unknown velocity {name!r}{did_you_mean(str(name), _ABOUT)}")
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
            raise InputError(f"at: expected {third.pop()}, which is not of the plane, found {name!r}")
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
