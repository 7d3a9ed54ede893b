"""K06's calibration (section 4.3): the published part, and stand-ins for the unpublished tables.

Published are the regression (4.3), the ratio (4.4), and the size of the tables: 14 rudder angles 5 degrees
apart by 161 forces 0.025 N apart, speeds of 3000 to 12 000 RPM, force quadratic in the speed and falling
with the rudder angle, between 1.5 and 2 N at 12 000 RPM (the axis of figure 4.5). The entries are not
published. **The tables here are stand-ins, generated from these facts**; read measured tables with
:func:`~hovercontrol.craft.hardware.actuators.read_fan_table`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from hovercontrol.base.arguments import as_row, broadcastable
from hovercontrol.base.boundary import checked
from hovercontrol.craft.hardware.actuators.signals import DEGREE
from hovercontrol.craft.hardware.actuators.tables import FanTable, Floats, ServoTable

#: (4.3): rudder angle = SLOPE phi + OFFSET. K06's hovercraft angle phi has F_X = |F| cos(phi),
#: F_Y = -|F| sin(phi) [K06 eq 4.1, 4.2]: it is the opposite of the force's angle from the bow.
RUDDER_SLOPE, RUDDER_OFFSET = -1.40, 0.566 * DEGREE

#: (4.4): coefficients of x^3 ... 1, x = RPM/1000, and where it holds.
REVERSE_RATIO, RATIO_RANGE = (9.734e-4, -3.277e-2, 3.833e-1, -1.099), (6.0, 12.0)

#: Forward thrust [N] at 10 000 RPM and rudder 0: 1.94 N at 12 000 RPM. The last tick of figure 4.5 is 1.5 N,
#: so that its mesh ends below 2 N; the force table's columns reach to 2 N, so that it ends near that.
THRUST_AT_10000 = 1.35

#: The tables' axes: rudder angles [degree] as figure 4.3 spans them, forces [N]; speeds used [RPM].
RUDDER_ROWS = np.arange(-35.0, 31.0, 5.0)
FORCE_COLUMNS = np.linspace(-2.0, 2.0, 161)
LOWEST_SPEED, HIGHEST_SPEED = 3000.0, 12000.0

#: Column step of the force table [RPM]; a line between two columns is then within 0.3 mN of the parabola.
SPEED_STEP = 250.0

#: What a formula takes: numbers, or symbols where it becomes part of a Block.
Quantity: TypeAlias = float | Floats | sp.Expr


@checked
def rudder_of_force_angle(
    angle: Quantity, slope: Quantity = RUDDER_SLOPE, offset: Quantity = RUDDER_OFFSET
) -> Any:
    """Return the rudder angle [rad] that turns the force to an angle from the bow [rad], by (4.3).

    Parameters
    ----------
    angle : float, array or sympy.Expr
        Of the force from the bow [rad].
    slope, offset : float or sympy.Expr, optional
        Of the regression (4.3) [1, rad].

    Examples
    --------
    >>> phi = 14.6  # K06 table 4.2, trial 1: rudder at -20 degrees
    >>> round(rudder_of_force_angle(-phi * DEGREE) / DEGREE, 1)
    -19.9
    """
    angle, slope, offset = map(_quantity, (angle, slope, offset))
    return offset - slope * angle


@checked
def force_angle_of_rudder(
    rudder: Quantity, slope: Quantity = RUDDER_SLOPE, offset: Quantity = RUDDER_OFFSET
) -> Any:
    """Return the angle of the force from the bow [rad] at a rudder angle [rad], the inverse of (4.3).

    Parameters
    ----------
    rudder : float, array or sympy.Expr
        Rudder angle [rad].
    slope, offset : float or sympy.Expr, optional
        Of the regression (4.3) [1, rad].

    Examples
    --------
    >>> round(force_angle_of_rudder(rudder_of_force_angle(0.3)), 6)
    0.3
    """
    rudder, slope, offset = map(_quantity, (rudder, slope, offset))
    return (offset - rudder) / slope


def _quantity(value: Quantity) -> Quantity:
    return np.asarray(value, dtype=float) if isinstance(value, list | tuple) else value


@checked
def forward_thrust(speed: ArrayLike, rudder: ArrayLike = 0.0) -> Floats:
    """Return the fan's forward force [N]: the stand-in for K06's quadratic fits, one for each rudder angle.

    ``1.35 N (speed/10 000 RPM)^2 cos(rudder)``: the cosine is the part of the axial momentum behind a turned
    vane. K06 says only that the force falls with the angle.

    Parameters
    ----------
    speed : array_like
        [RPM]
    rudder : array_like, optional
        [degree], of a shape that broadcasts with it.

    Returns
    -------
    ndarray, of their common shape

    Raises
    ------
    InputError
        If the shapes do not go together.

    Examples
    --------
    >>> forward_thrust([5_000.0, 10_000.0]).tolist()
    [0.3375, 1.35]
    """
    n, angle = broadcastable("forward_thrust", speed=speed, rudder=rudder)
    return np.asarray(THRUST_AT_10000 * (n / 1e4) ** 2 * np.cos(angle * DEGREE))


@checked
def reverse_ratio(speed: ArrayLike) -> Floats:
    """Return the ratio of reverse to forward force (4.4) at a speed [RPM], constant outside 6000 ... 12 000.

    Below 4000 RPM the cubic itself is negative.

    Parameters
    ----------
    speed : array_like, any shape
        [RPM]

    Returns
    -------
    ndarray, of the same shape

    Examples
    --------
    >>> reverse_ratio([1000, 6000, 12000]).round(3).tolist()
    [0.231, 0.231, 0.464]
    """
    return np.asarray(np.polyval(REVERSE_RATIO, np.clip(np.abs(speed) / 1e3, *RATIO_RANGE)))


@checked
def fan_force(speed: ArrayLike, rudder: ArrayLike = 0.0) -> Floats:
    """Return the force [N] of the fan at a speed [RPM], negative in reverse, and a rudder angle [degree].

    Parameters
    ----------
    speed, rudder : array_like, of shapes that broadcast
        [RPM], [degree]

    Returns
    -------
    ndarray, of their common shape

    Raises
    ------
    InputError
        If the shapes do not go together.

    Examples
    --------
    >>> fan_force([10_000.0, -10_000.0]).round(3).tolist()
    [1.35, -0.581]
    """
    n, angle = broadcastable("fan_force", speed=speed, rudder=rudder)
    return np.where(n < 0, -reverse_ratio(n), 1.0) * forward_thrust(n, angle)


@checked
def fan_tables(
    force: Callable[[Floats, float], ArrayLike] = fan_force,
    *,
    name: str = "K06 stand-in",
    rudder: ArrayLike = RUDDER_ROWS,
    columns: ArrayLike = FORCE_COLUMNS,
    lowest: float = LOWEST_SPEED,
    highest: float = HIGHEST_SPEED,
    step: float = SPEED_STEP,
) -> tuple[FanTable, FanTable]:
    """Return K06's lookup table (speeds over forces) and its inverse, from a model of the force.

    Speeds are limited to lowest and highest, in whole RPM; at zero force the fan stands still.

    Parameters
    ----------
    force : callable, optional
        Of speeds [RPM] and one rudder angle [degree]: forces [N], increasing with the speed. Default:
        :func:`fan_force`, the stand-in.
    name : str, optional
        Name of the tables in messages.
    rudder, columns : array_like, optional
        Axes: rudder angles [degree], forces [N].
    lowest, highest : float, optional
        Range of the speed [RPM].
    step : float, optional
        Step of the speeds in the inverse table [RPM].

    Returns
    -------
    tuple of two FanTable
        Speeds [RPM] over forces, and forces [N] over speeds.

    Raises
    ------
    InputError
        If an axis is not a row of numbers, or as of :class:`FanTable`.

    Examples
    --------
    >>> lookup, reverse = fan_tables()
    >>> lookup.shape, float(lookup.values.min()), float(lookup.values.max())
    ((14, 161), -12000.0, 12000.0)
    """
    angles, wanted = (as_row(f"{name}: {k}", a) for k, a in (("rudder", rudder), ("columns", columns)))
    half = step * np.arange(1, round(highest / step) + 1)
    speeds = np.concatenate([-half[::-1], [0.0], half])
    fine = np.linspace(-highest, highest, 4801)
    rows = []
    for angle in angles:
        found = np.interp(wanted, np.asarray(force(fine, float(angle))), fine)
        found = np.sign(wanted) * np.maximum(np.abs(found), lowest)
        rows.append(np.round(found))
    forces = [np.asarray(force(speeds, float(angle))) for angle in angles]
    return (
        FanTable(name, "force", angles, wanted, np.array(rows)),
        FanTable(f"{name}, reverse", "speed", angles, speeds, np.array(forces)),
    )


@checked
def servo_table() -> ServoTable:
    """Return rudder angle against pulse, 1 to 2 ms in steps of 0.05 ms: a stand-in for figure 4.2.

    K06 stepped the servo like this and found a "nonlinear" curve between -40 and 40 degrees. The stand-in is
    a rod between two arms: the sine of the servo's angle, which is 60 degrees at the ends.

    Examples
    --------
    >>> servo_table().pulse[[0, -1]].tolist(), servo_table().angle[[0, -1]].round(6).tolist()
    ([1.0, 2.0], [-38.0, 38.0])
    """
    pulse = np.round(np.linspace(1.0, 2.0, 21), 2)
    angle = 38.0 * np.sin(np.radians(120.0 * (pulse - 1.5))) / np.sin(np.radians(60.0))
    return ServoTable("K06 stand-in", pulse, angle)


@checked
def ideal_fan(force: float = 20.0, angle: float = 180.0) -> tuple[FanTable, FanTable]:
    """Return tables of an ideal fan: force proportional to speed, at any rudder angle.

    They switch off the fan's calibration; :func:`ideal_servo` switches off the servo's.

    Parameters
    ----------
    force : float, optional
        Largest force [N], at 12 000 RPM.
    angle : float, optional
        Largest rudder angle [degree].

    Examples
    --------
    >>> forward, reverse = ideal_fan()
    >>> forward.values.shape, reverse.values.shape
    ((2, 2), (2, 2))
    """
    rows, n, f = (-angle, angle), HIGHEST_SPEED, force
    return (
        FanTable("ideal", "force", rows, (-f, f), ((-n, n), (-n, n))),  # type: ignore[arg-type]
        FanTable("ideal, reverse", "speed", rows, (-n, n), ((-f, f), (-f, f))),  # type: ignore[arg-type]
    )


@checked
def ideal_servo(angle: float = 180.0) -> ServoTable:
    """Return the table of an ideal servo: angle proportional to pulse, up to `angle` [degree].

    Examples
    --------
    >>> float(ideal_servo(90.0).angle[-1])
    90.0
    """
    return ServoTable("ideal", (1.0, 2.0), (-angle, angle))  # type: ignore[arg-type]
