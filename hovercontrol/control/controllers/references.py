"""Reference trajectories as Blocks: position, velocity and acceleration, exact to the last derivative.

Each has no inputs and no states; its outputs are ``x_ref, y_ref`` [m], ``vx_ref, vy_ref`` [m/s] and
``ax_ref, ay_ref`` [m/s^2] as functions of time.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.base.tables import finite, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time

#: Least time between two points [s], and over that of the whole path: coefficients grow with its fifth power.
CLOSEST = 1e-9

#: What every reference puts out, and what the tracking controller takes in.
OUTPUTS = (
    Signal("x_ref", "m", "reference position"),
    Signal("y_ref", "m", "reference position"),
    Signal("vx_ref", "m/s", "reference velocity"),
    Signal("vy_ref", "m/s", "reference velocity"),
    Signal("ax_ref", "m/s^2", "reference acceleration"),
    Signal("ay_ref", "m/s^2", "reference acceleration"),
)


def from_position(
    x: sp.Expr, y: sp.Expr, parameters: Sequence[Signal] = (), name: str = "reference"
) -> Block:
    """Return the reference that follows a position given as expressions of time.

    Parameters
    ----------
    x, y : sympy.Expr
        Position [m] as functions of :data:`hovercontrol.blocks.signals.time` and the parameters.
    parameters : sequence of Signal, optional
        The symbols used.

    Raises
    ------
    UnitError
        If x or y is not a length.
    """
    curves = [x, y]
    for _ in range(2):
        curves += [sp.diff(c, time) for c in curves[-2:]]
    values = {s.name: c for s, c in zip(OUTPUTS, curves, strict=True)}
    return Block(name, outputs=OUTPUTS, parameters=tuple(parameters), output_expressions=values)


@checked
def ellipse(
    semi_x: float, semi_y: float, rate: float = 1.0, phase: float = 0.0, name: str = "reference"
) -> Block:
    """Return ``[semi_x cos(phase + rate t), semi_y sin(phase + rate t)]``.

    Parameters
    ----------
    semi_x, semi_y : float
        Semi-axes [m]. C17's simulation: 1.5, 2.5 with rate -1 and phase pi/2; its experiment: 1.15, 2.0.
    rate : float, optional
        Angular rate [rad/s], negative for clockwise.
    phase : float, optional
        Angle at t = 0 [rad].
    name : str, optional

    Raises
    ------
    InputError
        If a value is no number, a semi-axis is not positive or the rate is zero.

    Examples
    --------
    >>> [s.name for s in ellipse(1.5, 2.5, rate=-1.0).outputs]
    ['x_ref', 'y_ref', 'vx_ref', 'vy_ref', 'ax_ref', 'ay_ref']
    """
    _positive(semi_x=semi_x, semi_y=semi_y)
    _nonzero(rate=rate)
    finite("reference: phase", phase)
    a, b, w, p = (
        Signal("semi_x", "m", "semi-axis along x", start=semi_x, lower=0.0),
        Signal("semi_y", "m", "semi-axis along y", start=semi_y, lower=0.0),
        Signal("rate", "rad/s", "angular rate", start=rate),
        Signal("phase", "rad", "angle at t = 0", start=phase),
    )
    angle = p.symbol + w.symbol * time
    return from_position(a.symbol * sp.cos(angle), b.symbol * sp.sin(angle), (a, b, w, p), name)


@checked
def circle(radius: float, rate: float = 1.0, phase: float = 0.0, name: str = "reference") -> Block:
    """Return a circle about the origin.

    Parameters
    ----------
    radius : float
        [m]
    rate : float, optional
        Angular rate [rad/s], negative for clockwise.
    phase : float, optional
        Angle at t = 0 [rad].
    name : str, optional

    Raises
    ------
    InputError
        If a value is no number, the radius is not positive or the rate is zero.

    Examples
    --------
    >>> print(circle(2.0, rate=0.25).equations())
    x_ref = radius*cos(phase + rate*t)
    y_ref = radius*sin(phase + rate*t)
    vx_ref = -radius*rate*sin(phase + rate*t)
    vy_ref = radius*rate*cos(phase + rate*t)
    ax_ref = -radius*rate**2*cos(phase + rate*t)
    ay_ref = -radius*rate**2*sin(phase + rate*t)
    """
    _positive(radius=radius)
    _nonzero(rate=rate)
    finite("reference: phase", phase)
    r, w, p = (
        Signal("radius", "m", "radius", start=radius, lower=0.0),
        Signal("rate", "rad/s", "angular rate", start=rate),
        Signal("phase", "rad", "angle at t = 0", start=phase),
    )
    angle = p.symbol + w.symbol * time
    return from_position(r.symbol * sp.cos(angle), r.symbol * sp.sin(angle), (r, w, p), name)


@checked
def line(
    velocity: tuple[float, float], start: tuple[float, float] = (0.0, 0.0), name: str = "reference"
) -> Block:
    """Return a straight line at constant velocity.

    Parameters
    ----------
    velocity : tuple of 2 float
        Along x and y [m/s].
    start : tuple of 2 float, optional
        Where it is at t = 0 [m].
    name : str, optional

    Raises
    ------
    InputError
        If velocity or start are not two numbers, or the velocity is zero.

    Examples
    --------
    >>> path = line((0.5, 0.0), start=(0.0, 1.0))
    >>> path.to_numpy().outputs(2.0, [], [])[:2].tolist()
    [1.0, 1.0]
    """
    speed_x, speed_y = _pair("velocity", velocity)
    start_x, start_y = _pair("start", start)
    _nonzero(speed=math.hypot(speed_x, speed_y))
    signals = (
        Signal("start_x", "m", "start", start=start_x),
        Signal("start_y", "m", "start", start=start_y),
        Signal("velocity_x", "m/s", "velocity", start=speed_x),
        Signal("velocity_y", "m/s", "velocity", start=speed_y),
    )
    x0, y0, vx, vy = (s.symbol for s in signals)
    return from_position(x0 + vx * time, y0 + vy * time, signals, name)


@checked
def figure_eight(length: float, width: float, rate: float = 1.0, name: str = "reference") -> Block:
    """Return a lying eight (Gerono's lemniscate): ``[length/2 sin(w t), width/2 sin(2 w t)]``.

    Parameters
    ----------
    length, width : float
        Its extent along x and y [m].
    rate : float, optional
        Angular rate w of the long axis [rad/s].
    name : str, optional

    Raises
    ------
    InputError
        If a value is no number, an extent is not positive or the rate is zero.

    Examples
    --------
    >>> eight = figure_eight(4.0, 2.0)
    >>> eight.to_numpy().outputs(0.0, [], [])[:2].tolist()  # it begins in the middle
    [0.0, 0.0]
    """
    _positive(length=length, width=width)
    _nonzero(rate=rate)
    a, b, w = (
        Signal("length", "m", "extent along x", start=length, lower=0.0),
        Signal("width", "m", "extent along y", start=width, lower=0.0),
        Signal("rate", "rad/s", "angular rate of the long axis", start=rate),
    )
    angle = w.symbol * time
    return from_position(a.symbol / 2 * sp.sin(angle), b.symbol / 2 * sp.sin(2 * angle), (a, b, w), name)


@checked
def waypoints(points: ArrayLike, times: ArrayLike, name: str = "reference") -> Block:
    """Return a smooth path through points: a quintic spline, at rest at both ends and beyond them.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Points [m], n >= 2.
    times : array_like, shape (n,)
        When each is passed [s], increasing.
    name : str, optional

    Raises
    ------
    InputError
        If a value is no number, shapes differ, there are fewer than two points, or times do not increase or
        almost coincide.

    Examples
    --------
    >>> path = waypoints([[0.0, 0.0], [2.0, 1.0]], [0.0, 4.0])
    >>> path.to_numpy().outputs(4.0, [], [])[:2].round(9).tolist()
    [2.0, 1.0]
    """
    knots, path = _array("times", times), _array("points", points)
    if path.ndim != 2 or path.shape[1:] != (2,) or len(path) < 2 or knots.shape != (len(path),):
        raise InputError(
            f"waypoints: expected n >= 2 points (n, 2) and n times, found {path.shape} and {knots.shape}"
        )
    if not (np.isfinite(path).all() and np.isfinite(knots).all() and (np.diff(knots) > 0).all()):
        raise InputError("waypoints: points and times must be finite, times increasing")
    least = CLOSEST * max(knots[-1] - knots[0], 1.0)
    if np.diff(knots).min() < least:
        raise InputError(f"waypoints: times must differ by {least:.3g} s or more, found {shown(knots)}")
    from scipy.interpolate import PPoly, make_interp_spline  # 0.3 s that only this reference needs

    rest = [(1, 0.0), (2, 0.0)]
    splines = [
        PPoly.from_spline(make_interp_spline(knots, path[:, axis], k=5, bc_type=(rest, rest)))
        for axis in (0, 1)
    ]
    ends = [(path[0, axis], path[-1, axis]) for axis in (0, 1)]
    return from_pieces([(p.x, p.c) for p in splines], ends, name)


def from_pieces(
    curves: Sequence[tuple[np.ndarray, np.ndarray]], ends: Sequence[tuple[float, float]], name: str
) -> Block:
    """Return the reference along x and y given as polynomials over time.

    Parameters
    ----------
    curves : sequence of (knots, coefficients)
        Of x and y [m], as for :func:`piecewise`.
    ends : sequence of (float, float)
        Of x and y before and after them [m].
    """
    metre = Signal("metre", "m", "length unit of the coefficients", start=1.0)
    second = Signal("second", "s", "time unit of the coefficients", start=1.0, lower=1e-9)
    x, y = (
        piecewise(*curve, outside, second.symbol) * metre.symbol
        for curve, outside in zip(curves, ends, strict=True)
    )
    return from_position(x, y, (metre, second), name)


def piecewise(
    knots: np.ndarray, coefficients: np.ndarray, ends: tuple[float, float], second: sp.Symbol
) -> sp.Expr:
    """Return a curve of polynomials over time, constant before and after them, as an expression.

    Parameters
    ----------
    knots : ndarray, shape (n + 1,)
        Begins of the pieces and the last end [s]; a piece of no length is left out.
    coefficients : ndarray, shape (degree + 1, n)
        Of each piece in the time since its begin, the highest power first.
    ends : tuple of 2 float
        Values before and after.
    second : sympy.Symbol
        A second, which makes time dimensionless.
    """
    now = time / second
    pieces: list[tuple[sp.Expr, object]] = [(sp.Float(ends[0]), now < knots[0])]
    for begin, end, row in zip(knots, knots[1:], coefficients.T, strict=False):
        if end > begin:
            local = now - float(begin)
            value = sp.Float(row[0])
            for coefficient in row[1:]:
                value = value * local + sp.Float(coefficient)
            pieces.append((value, now < float(end)))
    return sp.Piecewise(*pieces, (sp.Float(ends[1]), True))


def _pair(name: str, value: Any) -> tuple[float, float]:
    """Return a value that must be two finite numbers."""
    if not isinstance(value, list | tuple | np.ndarray) or len(value) != 2:
        raise InputError(f"reference: {name} must be two numbers, found {reprlib.repr(value)}")
    return finite(f"reference: {name}[0]", value[0]), finite(f"reference: {name}[1]", value[1])


def _array(name: str, value: Any) -> np.ndarray:
    """Return a value that must be an array of numbers."""
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iufO":
            raise TypeError
        return array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"waypoints: {name} must be numbers, found {reprlib.repr(value)}") from None


def _positive(**values: Any) -> None:
    for name, value in values.items():
        positive(f"reference: {name}", value)


def _nonzero(**values: Any) -> None:
    for name, value in values.items():
        if finite(f"reference: {name}", value) == 0:
            raise InputError(f"reference: {name} must not be zero")


#: Every reference by the name that scenario files use.
REFERENCES = {f.__name__: f for f in (ellipse, circle, line, figure_eight, waypoints)}
