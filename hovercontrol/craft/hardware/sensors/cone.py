"""The cone-angle error of ultrasonic ranges and its correction [K06 eq 5.7, 5.8, 5.9] [K06 fig 5.6]."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import finite
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Definitions
from hovercontrol.blocks.signals import Signal

#: K06 (5.7): e(phi) = 1 + 0.0032 phi - 0.038 phi^2, true over measured range; its two coefficients.
K06_CONE = (0.0032, -0.038)

#: Steps of Newton's method, as many as K06 needs at most.
STEPS = 5


def cone_signals(cone: tuple[float, float], where: str) -> tuple[Signal, Signal]:
    """Return the two coefficients of e(phi) as parameters; at 0 there is no cone-angle error."""
    linear, quadratic = (finite(f"{where}: cone", c) for c in cone)
    return (
        Signal(
            "cone_linear",
            "1/rad",
            "coefficient of the cone angle in the ratio of ranges, (5.7)",
            start=linear,
        ),
        Signal(
            "cone_quadratic",
            "1/rad^2",
            "coefficient of the cone angle squared in the ratio of ranges, (5.7)",
            start=quadratic,
            upper=0.4,  # e(phi) cos(phi) must fall with the angle
        ),
    )


def cone_ratio(angle: sp.Expr) -> sp.Expr:
    """Return the ratio of true to measured range at a cone angle, (5.7)."""
    linear, quadratic = (s.symbol for s in cone_signals(K06_CONE, "cone"))
    return 1 + linear * angle + quadratic * angle**2


def correction_definitions(measured: sp.Expr, height: sp.Expr, suffix: str) -> dict[str, sp.Expr]:
    """Return the definitions that correct a measured range; the result is `range_corrected` + `suffix`.

    Newton's method on e(phi) cos(phi) = h / rho (5.9), unrolled. It starts from the root of the left side's
    Taylor polynomial of degree two, which is accurate at small angles, where Newton alone is slow.
    """
    define = Definitions(suffix=suffix)
    linear, quadratic = (s.symbol for s in cone_signals(K06_CONE, "cone"))
    phi = sp.Symbol("phi", real=True)
    left = cone_ratio(phi) * sp.cos(phi)
    slope = sp.diff(left, phi)
    # Noise may make a range shorter than the height: then the beacon is overhead.
    wanted = define("height_ratio", height / sp.Max(measured, height))
    bend = sp.Rational(1, 2) - quadratic
    start = (linear + sp.sqrt(linear**2 + 4 * bend * (1 - wanted))) / (2 * bend)
    angle = define("cone_angle0", start)
    for k in range(1, STEPS + 1):
        here = {phi: angle}
        # The slope vanishes overhead, and is negative elsewhere.
        fall = define(f"cone_slope{k}", slope.xreplace(here))
        step = (left.xreplace(here) - wanted) / sp.Min(fall, sp.Float(-1e-9))
        angle = define(f"cone_angle{k}", angle - step)
    define("range_corrected", cone_ratio(angle) * measured)
    return define


@checked
def cone_correction(*, cone: tuple[float, float] = K06_CONE, name: str = "cone_correction") -> Block:
    """Return the correction of one range for its cone angle, five steps of Newton's method on (5.9).

    Parameters
    ----------
    cone : (float, float), optional
        Coefficients of angle and angle squared in (5.7).
    name : str, optional

    Returns
    -------
    Block
        Inputs ``range`` (measured) and ``height`` [m]; outputs ``range_corrected`` [m] and
        ``cone_angle5`` [rad]. No states.

    Raises
    ------
    InputError
        If a coefficient is not finite.

    Examples
    --------
    >>> block = cone_correction()
    >>> block.to_numpy().outputs(0.0, [], [3.0, 2.7]).round(3).tolist()
    [2.982, 0.439]
    """
    measured = Signal("range", "m", "measured range", start=2.7, nominal=2.7)
    height = Signal("height", "m", "height of the beacon above the unit", start=2.7, lower=1e-3, nominal=2.7)
    return Block(
        name,
        inputs=(measured, height),
        outputs=(
            Signal("range_corrected", "m", "true range"),
            Signal(f"cone_angle{STEPS}", "rad", "cone angle, from the vertical"),
        ),
        parameters=cone_signals(cone, name),
        definitions=correction_definitions(measured.symbol, height.symbol, ""),
    )


@lru_cache(maxsize=1)
def _correction() -> Block:
    return cone_correction()


@checked
def corrected_range(measured: ArrayLike, height: ArrayLike) -> NDArray[np.float64]:
    """Return corrected ranges from measured ones, K06 (5.8)-(5.9); arguments broadcast.

    Parameters
    ----------
    measured : array_like
        Measured ranges [m].
    height : array_like
        Heights of the beacons above the unit [m].

    Returns
    -------
    ndarray
        [m]

    Raises
    ------
    InputError
        If a range is not a number or a height is not positive.

    Examples
    --------
    >>> corrected_range([3.1507], 2.7048).round(3).tolist()  # table 5.2 has 3.1232
    [3.123]
    """
    rho, h = np.broadcast_arrays(np.asarray(measured, dtype=float), np.asarray(height, dtype=float))
    if np.isnan(rho).any():
        raise InputError("corrected_range: expected measured ranges, found nan")
    if not (h > 0).all():
        raise InputError(f"corrected_range: heights must be positive, found {float(h.min()):g}")
    found: NDArray[np.float64] = _correction().to_numpy().outputs(0.0, (), np.stack([rho, h]))[0]
    return found
