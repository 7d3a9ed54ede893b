"""K06's calibrations as fits (section 4.3): thrust, rudder angle, reverse thrust, inertia."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.craft.hardware.calibration.result import Axis, Fit, fit_polynomial, measured


@checked
def fit_thrust(
    speed: ArrayLike, force: ArrayLike, *, title: str = "thrust of the fan", unit: str = "RPM"
) -> Fit:
    """Fit the quadratic of thrust over fan speed (4.3.2.1): ``F = a x^2 + b x + c``, x = speed/1000.

    Parameters
    ----------
    speed : array_like, shape (n,)
        [RPM], or the command of a motor, with its `unit`.
    force : array_like, shape (n,)
        [N]
    title : str, optional
    unit : str, optional
        Of `speed`, for texts and pictures.

    Returns
    -------
    Fit
        ``a, b, c`` [N].

    Raises
    ------
    InputError
        If shapes differ, a number is missing, or there are fewer than four measurements at three speeds.

    Examples
    --------
    >>> n = [4000, 6000, 8000, 10000]
    >>> fit = fit_thrust(n, [0.24, 0.53, 0.92, 1.46])
    >>> round(float(fit.values[0]), 4)
    0.0156
    """
    axes = Axis("speed" if unit == "RPM" else "command", unit), Axis("thrust", "N")
    return fit_polynomial(title, speed, force, axes, dict.fromkeys("abc", "N"), scale=1000.0)


@checked
def fit_rudder(force_angle: ArrayLike, rudder: ArrayLike) -> Fit:
    """Fit the regression [K06 eq 4.3]: ``rudder = slope phi + offset``.

    Parameters
    ----------
    force_angle : array_like, shape (n,)
        phi [degree], K06's hovercraft angle, to which a tethered craft turns.
    rudder : array_like, shape (n,)
        Rudder angle [degree].

    Returns
    -------
    Fit
        ``slope`` [1], ``offset`` [degree]; K06 found -1.40 and 0.566.

    Raises
    ------
    InputError
        If shapes differ, a number is missing, or there are fewer than three measurements at two angles.

    Examples
    --------
    >>> phi = np.array([-20.0, -10.0, 0.0, 10.0, 20.0])
    >>> fit = fit_rudder(phi, -1.4 * phi + 0.5)
    >>> fit.values.round(6).tolist(), fit.units
    ([-1.4, 0.5], ('1', 'deg'))
    """
    axes = Axis("hovercraft angle", "deg"), Axis("rudder angle", "deg")
    return fit_polynomial("rudder angle", force_angle, rudder, axes, {"slope": "1", "offset": "deg"})


@checked
def fit_reverse_ratio(speed: ArrayLike, ratio: ArrayLike) -> Fit:
    """Fit the cubic of the thrust ratio, reverse to forward, over speed [K06 eq 4.4], x = speed/1000.

    Parameters
    ----------
    speed : array_like, shape (n,)
        Magnitude of the speed [RPM].
    ratio : array_like, shape (n,)
        Ratio of reverse to forward thrust at rudder 0.

    Returns
    -------
    Fit
        ``c3, c2, c1, c0`` of ``y = c3 x^3 + c2 x^2 + c1 x + c0``.

    Raises
    ------
    InputError
        If shapes differ, a number is missing, or there are fewer than five measurements at four speeds.

    Examples
    --------
    >>> speed = np.array([5e3, 6e3, 7e3, 8e3, 9e3])
    >>> fit_reverse_ratio(speed, 0.1 + speed / 20e3).names
    ('c3', 'c2', 'c1', 'c0')
    """
    axes = Axis("speed", "RPM"), Axis("ratio of reverse to forward thrust", "1")
    names = dict.fromkeys(("c3", "c2", "c1", "c0"), "1")
    return fit_polynomial("reverse thrust", speed, ratio, axes, names, scale=1000.0)


@checked
def fit_inertia(
    time: ArrayLike,
    yaw_rate: ArrayLike,
    *,
    side_force: float,
    arm: float,
    between: tuple[float, float] | None = None,
) -> Fit:
    """Find the moment of inertia in one release test [K06 eq 4.5]: ``J = -d F_Y / r'``.

    The craft is released under a constant force; its yaw rate grows linearly until friction matters.

    Parameters
    ----------
    time, yaw_rate : array_like, shape (n,)
        [s], [rad/s]
    side_force : float
        F_Y [N], at the rudder.
    arm : float
        d [m], the rudder behind the centre of mass.
    between : tuple of two float, optional
        The times [s] of the straight part (default: all).

    Returns
    -------
    Fit
        ``inertia`` [kg*m^2], with the error propagated from the slope, and ``yaw_rate_0`` [rad/s].

    Raises
    ------
    InputError
        If shapes differ, a number is missing, fewer than three measurements lie between the times, force or
        arm are zero, or the craft turned against its torque.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 11)
    >>> fit_inertia(t, -2.0 * t, side_force=0.5, arm=0.2).values.round(6).tolist()
    [0.05, 0.0]
    """
    title = "inertia"
    t, r = measured(title, time, yaw_rate)
    if not (np.isfinite(side_force) and side_force and np.isfinite(arm) and arm > 0):
        raise InputError(f"{title}: expected a force and an arm, found {side_force!r} N and {arm!r} m")
    if between is not None:
        inside = (t >= between[0]) & (t <= between[1])
        t, r = t[inside], r[inside]
    units = {"yaw_acceleration": "rad/s^2", "yaw_rate_0": "rad/s"}
    line = fit_polynomial(title, t, r, (Axis("time", "s"), Axis("yaw rate", "rad/s")), units)
    slope, start = line.values
    torque = -arm * side_force
    if torque * slope <= 0:
        raise InputError(
            f"{title}: expected a yaw acceleration of the sign of -d F_Y = {torque:.3g} N*m, found "
            f"{slope:.3g} rad/s^2"
        )
    turn = np.diag([-torque / slope**2, 1.0])
    return Fit(
        title,
        line.x_axis,
        line.y_axis,
        line.x,
        line.y,
        line.fitted,
        ("inertia", "yaw_rate_0"),
        ("kg*m^2", "rad/s"),
        np.array([torque / slope, start]),
        turn @ line.covariance @ turn,
    )


@checked
def mean_inertia(trials: ArrayLike) -> Fit:
    """Average the inertias of several release tests; the standard error comes from their spread.

    Parameters
    ----------
    trials : array_like, shape (n,)
        Two or more [kg*m^2].

    Returns
    -------
    Fit
        ``inertia`` [kg*m^2].

    Raises
    ------
    InputError
        If there are fewer than two or a number is missing.

    Examples
    --------
    >>> print(mean_inertia([0.0952, 0.0967]))  # K06 table 4.2
    inertia, mean of trials
      inertia = 0.09595 +- 0.00075 kg*m^2
      residuals 0.00106 kg*m^2, 2 measurements
    """
    numbers = np.arange(1, np.size(trials) + 1)
    axes = Axis("trial", "1"), Axis("inertia", "kg*m^2")
    return fit_polynomial("inertia, mean of trials", numbers, trials, axes, {"inertia": "kg*m^2"})
