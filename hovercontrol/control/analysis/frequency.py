"""Bode and Nyquist curves of a loop that is broken at one wire."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.control.analysis.frequency_grid import frequencies_of
from hovercontrol.control.analysis.loop_modes import OutsideModes
from hovercontrol.control.analysis.open_loop import (
    At,
    Loop,
    Slope,
    broken,
    response_of,
    unstable_poles,
)
from hovercontrol.control.analysis.stability_margins import Margins

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@checked
@dataclass(frozen=True, eq=False)
class Bode:
    """Magnitude and phase of a loop gain; made by :func:`bode`.

    Parameters
    ----------
    gain : control.StateSpace
        L, for negative feedback.
    frequencies : ndarray, shape (n,)
        [rad/s]
    magnitude : ndarray, shape (n,)
        Of L, as a factor [1].
    phase : ndarray, shape (n,)
        [deg], continuous.
    margins : Margins
    wire : str
        Where the loop is broken.

    Examples
    --------
    >>> found = bode(control.tf([2.0], [1.0, 0.0]), frequencies=[2.0])
    >>> found.magnitude.round(9), found.phase.round(9)
    (array([1.]), array([-90.]))
    """

    gain: control.StateSpace
    frequencies: Array
    magnitude: Array
    phase: Array
    margins: Margins
    wire: str = ""

    def __repr__(self) -> str:
        m = self.margins
        if not m.stable:
            said = "the loop is unstable"
        else:
            said = f"gain margin {m.gain_up:.4g}, phase margin {m.phase:.4g} deg at {m.crossover:.4g} rad/s"
        return f"<Bode{f' at {self.wire}' if self.wire else ''}: {said}>"

    def plot(self, *, db: bool = True) -> Figure:
        """Return the Bode plot of L with its margins; the magnitude is in dB, or without `db` a ratio."""
        from hovercontrol.control.analysis.frequency_plots import bode_figure

        return open_in_pyplot(bode_figure(self, db=db))


@checked
def bode(
    loop: Loop,
    wire: str | None = None,
    at: At = None,
    *,
    frequencies: ArrayLike | None = None,
    time: float | None = None,
    params: Mapping[str, float] | None = None,
    friction: Slope = "smooth",
    amplitude: Mapping[str, float] | None = None,
) -> Bode:
    """Return the frequency response of a loop broken at one wire, with its margins.

    Parameters
    ----------
    loop, wire, at, time, params, friction, amplitude
        As for :func:`loop_gain`.
    frequencies : array_like, shape (n,), optional
        [rad/s], positive; default two decades beyond what the loop has of poles and zeros. Of a sampled loop
        up to Nyquist's frequency; with a delay up to 8 over it.

    Raises
    ------
    InputError
        As by :func:`loop_gain`, or if a frequency is not positive or above that.

    Examples
    --------
    >>> found = bode(control.tf([2.0], [1.0, 3.0, 2.0, 0.0]))  # 2/(s (s + 1)(s + 2))
    >>> round(found.margins.gain_up, 6)
    3.0
    """
    gain, _, margins = broken(loop, wire, at, time, params, friction, amplitude)
    omega = frequencies_of(gain, frequencies)
    response = response_of(gain, omega)
    phase = np.degrees(np.unwrap(np.angle(response)))
    # at low frequencies each integrator takes 90 deg; a negative gain begins at -180 deg
    turns = (-90.0 * _integrators(gain) - phase[0]) / 360.0
    phase += 360.0 * math.floor(turns + 0.45)
    return Bode(gain, omega, np.abs(response), phase, margins, wire or "")


@checked
@dataclass(frozen=True, eq=False)
class Nyquist:
    """The Nyquist curve of a loop gain, and what its encirclements of -1 say; made by :func:`nyquist`.

    Parameters
    ----------
    gain : control.StateSpace
        L, for negative feedback, without the modes outside the loop.
    frequencies : ndarray, shape (n,)
        [rad/s]
    encirclements : int
        N, clockwise about -1, of the whole curve.
    open_loop_unstable : int
        P, poles of L in the right half-plane (of a sampled loop outside the unit circle).
    closed_loop_unstable : int
        Z = N + P, those of the closed loop.
    outside : OutsideModes
        The modes outside the loop that do not decay.
    wire : str
        Where the loop is broken.

    Examples
    --------
    >>> found = nyquist(control.tf([2.0], [1.0, -1.0]))  # 2/(s - 1)
    >>> found.encirclements, found.open_loop_unstable, found.closed_loop_unstable
    (-1, 1, 0)
    """

    gain: control.StateSpace
    frequencies: Array
    encirclements: int
    open_loop_unstable: int
    closed_loop_unstable: int
    outside: OutsideModes = field(default_factory=OutsideModes)
    wire: str = ""

    def __repr__(self) -> str:
        at = f" at {self.wire}" if self.wire else ""
        return (
            f"<Nyquist{at}: {self.encirclements} clockwise encirclements, "
            f"unstable poles {self.open_loop_unstable} open loop, {self.closed_loop_unstable} closed loop>"
        )

    @property
    def response(self) -> NDArray[np.complex128]:
        """L at the frequencies, complex, shape (n,) [1]."""
        return response_of(self.gain, self.frequencies)

    def plot(self) -> Figure:
        """Return the Nyquist plot of L with the unit circle."""
        from hovercontrol.control.analysis.frequency_plots import nyquist_figure

        return open_in_pyplot(nyquist_figure(self))


@checked
def nyquist(
    loop: Loop,
    wire: str | None = None,
    at: At = None,
    *,
    frequencies: ArrayLike | None = None,
    time: float | None = None,
    params: Mapping[str, float] | None = None,
    friction: Slope = "smooth",
    amplitude: Mapping[str, float] | None = None,
) -> Nyquist:
    """Return the Nyquist curve of a loop broken at one wire, with its encirclements of -1.

    Parameters
    ----------
    loop, wire, at, time, params, friction, amplitude
        As for :func:`loop_gain`.
    frequencies : array_like, shape (n,), optional
        [rad/s], positive; default as for :func:`bode`.

    Raises
    ------
    InputError
        As by :func:`bode`.

    Examples
    --------
    >>> nyquist(control.tf([7.0], [1.0, 3.0, 2.0, 0.0])).closed_loop_unstable
    2
    """
    gain, outside, _ = broken(loop, wire, at, time, params, friction, amplitude)
    omega = frequencies_of(gain, frequencies)
    # Z = N + P (the argument principle), N from poles that are known exactly
    closed = control.feedback(gain, 1)
    P, Z = unstable_poles(gain), unstable_poles(closed)
    return Nyquist(gain, omega, Z - P, P, Z, outside, wire or "")


def _integrators(gain: control.StateSpace) -> int:
    """Return the number of poles less the number of zeros at frequency 0."""
    still = 1.0 if gain.isdtime(strict=True) else 0.0
    return int(sum(np.sum(np.abs(r - still) < 1e-6) * k for r, k in ((gain.poles(), 1), (gain.zeros(), -1))))
