"""The frequencies at which a loop gain is drawn."""

from __future__ import annotations

import math

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError

#: Points of a curve where none are given, and how far beyond the slowest and the fastest corner it goes.
POINTS, BEYOND = 600, 100.0


def frequencies_of(gain: control.StateSpace, given: ArrayLike | None) -> Array:
    """Return the frequencies given, or a grid about the poles and zeros of L and its closed loop [rad/s].

    Raises
    ------
    InputError
        If one is not positive, is above Nyquist's frequency pi/h of a sampled loop, or above the frequency up
        to which a delay is exact.
    """
    dt = float(gain.dt) if gain.isdtime(strict=True) else 0.0
    up_to = float(getattr(gain, "up_to", math.inf))
    if given is not None:
        omega = np.atleast_1d(np.asarray(given, dtype=float))
        if omega.ndim != 1 or not len(omega) or not (np.isfinite(omega) & (omega > 0)).all():
            raise InputError("frequencies: expected positive finite numbers [rad/s]")
        if dt and omega.max() > math.pi / dt * (1 + 1e-9):
            raise InputError(
                f"frequencies: expected at most Nyquist's frequency, {math.pi / dt:.6g} rad/s at a step of "
                f"{dt:g} s, found {omega.max():g}"
            )
        if omega.max() > up_to * (1 + 1e-9):
            raise InputError(
                f"frequencies: expected at most {up_to:.6g} rad/s, up to which the delay's approximation is "
                f"exact to 1e-5, found {omega.max():g}"
            )
        return np.sort(omega)
    roots = np.concatenate([gain.poles(), gain.zeros(), control.feedback(gain, 1).poles()])
    if dt:
        with np.errstate(divide="ignore"):
            roots = np.log(roots[np.abs(roots) > 1e-12].astype(complex)) / dt
    corners = np.abs(roots)
    corners = corners[np.isfinite(corners) & (corners > 1e-6) & (corners < 1e6)]
    low, high = (corners.min(), corners.max()) if len(corners) else (1.0, 1.0)
    top = min(high * BEYOND, math.pi / dt if dt else math.inf, up_to)
    own = corners[corners < top]
    return np.unique(np.concatenate([np.geomspace(min(low / BEYOND, top / 10), top, POINTS), own]))
