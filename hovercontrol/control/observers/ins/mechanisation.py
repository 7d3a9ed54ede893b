"""Unaided inertial navigation: integration of the IMU [K06 eq 3.42]."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.observers.ins.imu import IMU, IMU_PERIOD, to_navigation
from hovercontrol.control.observers.ins.kalman import Equations

PSI_HAT = Signal("psi_hat", "rad", "heading, estimated; not wrapped")
STARTED = Signal("started", "1", "0 at the first tick, then 1", upper=1.0, lower=0.0)
HELD_IMU = tuple(
    s.replace(name=f"last_{s.name}", description=f"{s.description}, at the last tick") for s in IMU
)


@checked
def ins_mechanisation(
    *,
    aided: bool = False,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    velocity: Sequence[float] = (0.0, 0.0),
    period: float = IMU_PERIOD,
    name: str = "mechanisation",
) -> Block:
    """Return a Block that integrates the IMU's samples by the trapezoidal rule (3.42).

    Specific force and yaw rate are taken as linear between samples. The outputs at the first tick are the
    initial values.

    Parameters
    ----------
    aided : bool, optional
        Resolve the specific force with ``psi_hat`` of a heading filter, as K06's aided navigation does,
        instead of the integrated heading.
    pose : sequence of 3 float, optional
        Initial x, y [m] and psi [rad].
    velocity : sequence of 2 float, optional
        Initial velocity along x and y [m/s].
    period : float, optional
        Period of the IMU [s].
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``acceleration_x``, ``acceleration_y``, ``yaw_rate`` (and ``psi_hat``); outputs
        ``psi_ins``, ``v_x_ins``, ``v_y_ins``, ``x_ins``, ``y_ins``.

    Raises
    ------
    InputError
        If the period is not positive, or pose or velocity are not three and two finite numbers.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> ins = Ticking(ins_mechanisation(period=0.5))
    >>> for k in range(3):
    ...     found = ins.tick(0.5 * k, {"acceleration_x": 2.0, "acceleration_y": 0.0, "yaw_rate": 0.0})
    >>> round(found["v_x_ins"], 9), round(found["x_ins"], 9)  # a t, a t^2 / 2
    (2.0, 1.0)
    """
    x, y, psi = finite(f"{name}: pose", pose, 3)
    v_x, v_y = finite(f"{name}: velocity", velocity, 2)
    outputs = (
        Signal("psi_ins", "rad", "heading, integrated from the gyro; not wrapped", start=psi),
        Signal("v_x_ins", "m/s", "velocity along x, integrated", start=v_x),
        Signal("v_y_ins", "m/s", "velocity along y, integrated", start=v_y),
        Signal("x_ins", "m", "position, integrated twice", start=x),
        Signal("y_ins", "m", "position, integrated twice", start=y),
    )
    states = tuple(
        s.replace(name=f"last_{s.name}", description=f"{s.description}; at the last tick") for s in outputs
    )
    force = tuple(
        Signal(f"last_force_{axis}", "m/s^2", f"specific force along {axis}, at the last tick")
        for axis in "xy"
    )
    dt, elapsed, equations = clock(name, period)
    last = sp.Matrix([s.symbol for s in states])
    rate, held_rate = IMU[2].symbol, HELD_IMU[2].symbol
    psi_ins = equations.define("psi_ins", integrated_heading(last[0], held_rate, rate, elapsed))
    heading = PSI_HAT.symbol if aided else psi_ins
    body = sp.Matrix([IMU[0].symbol, IMU[1].symbol])
    f = equations.matrix("force", to_navigation(heading, body))
    f0 = sp.Matrix([s.symbol for s in force])
    moved = integrated_motion(last[1:3, 0], last[3:5, 0], f0, f, elapsed)
    now = [psi_ins, *(equations.define(s.name, e) for s, e in zip(outputs[1:], moved, strict=True))]
    return Block(
        name,
        states=(*states, HELD_IMU[2], *force, STARTED),
        inputs=(*IMU, PSI_HAT) if aided else IMU,
        outputs=tuple(s.replace(start=0.0) for s in outputs),
        parameters=(dt,),
        derivatives={
            **{s.name: e for s, e in zip(states, now, strict=True)},
            HELD_IMU[2].name: rate,
            force[0].name: f[0],
            force[1].name: f[1],
            STARTED.name: 1,
        },
        definitions=equations.definitions,
        period=period,
    )


def integrated_heading(psi: sp.Expr, rate0: sp.Expr, rate1: sp.Expr, dt: sp.Expr) -> sp.Expr:
    """Return the heading after dt [K06 eq 3.39], first line of (3.42): ``psi + dt/2 (r0 + r1)``."""
    return psi + dt / 2 * (rate1 + rate0)


def integrated_motion(v: sp.Matrix, r: sp.Matrix, f0: sp.Matrix, f1: sp.Matrix, dt: sp.Expr) -> sp.Matrix:
    """Return velocity and position after dt [K06 eq 3.40, 3.41], with f in navigation axes.

    ``v1 = v + dt/2 (f0 + f1)``, ``r1 = r + v dt + dt^2/6 (2 f0 + f1)``: exact for f linear in time.
    """
    return sp.Matrix.vstack(v + dt / 2 * (f1 + f0), r + v * dt + dt**2 / 6 * (f1 + 2 * f0))


def clock(name: str, period: float) -> tuple[Signal, sp.Expr, Equations]:
    """Return the parameter dt, the time since the last tick (0 at the first), and empty equations."""
    dt = Signal("dt", "s", "time from tick to tick", start=positive(f"{name}: period", period), lower=0.0)
    equations = Equations()
    return dt, equations.define("elapsed", dt.symbol * STARTED.symbol), equations


def finite(where: str, values: Sequence[float], count: int) -> list[float]:
    """Return the values as a list of `count` finite numbers; raise InputError otherwise."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise InputError(f"{where}: expected {count} finite numbers, found {values!r}")
    return [float(v) for v in found]
