"""The sensitivity functions of a loop that is broken at one wire, and their peaks.

With L the loop gain and negative feedback,

    S = 1/(1 + L),    T = L/(1 + L),    S + T = 1.

S is what feedback makes of a disturbance at the wire, T of measurement noise [Astrom and Murray, Feedback
Systems, 2nd ed., chapters 10 and 12].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.control.analysis.frequency_grid import frequencies_of
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
class Sensitivity:
    """Sensitivity S and complementary sensitivity T of a loop; made by :func:`sensitivity`.

    Parameters
    ----------
    gain : control.StateSpace
        L, for negative feedback.
    frequencies : ndarray, shape (n,)
        [rad/s]
    Ms, Mt : float
        Largest size of S and of T [1]: 1/Ms is the distance of L from -1. NaN if the loop is unstable.
    Ms_frequency, Mt_frequency : float
        Where these are [rad/s]; 0 or inf where it is the limit.
    gain_margin, phase_margin : float
        What Ms guarantees: a gain up to the factor Ms/(Ms - 1), a phase of 2 asin(1/(2 Ms)) [deg].
    margins : Margins
        The margins themselves, the disk of gain and phase at once among them.
    wire : str
        Where the loop is broken.

    Examples
    --------
    >>> found = sensitivity(control.tf([1.0], [1.0, 1.0, 0.0]))  # T = 1/(s^2 + s + 1)
    >>> round(found.Mt, 4), round(found.Mt_frequency, 4)
    (1.1547, 0.7071)
    """

    gain: control.StateSpace
    frequencies: Array
    Ms: float
    Ms_frequency: float
    Mt: float
    Mt_frequency: float
    gain_margin: float
    phase_margin: float
    margins: Margins
    wire: str = ""

    def __repr__(self) -> str:
        peaks = (("Ms", self.Ms, self.Ms_frequency), ("Mt", self.Mt, self.Mt_frequency))
        said = ", ".join(f"{name} {peak:.4g} at {where:.4g} rad/s" for name, peak, where in peaks)
        return f"<Sensitivity{f' at {self.wire}' if self.wire else ''}: {said}>"

    @property
    def S(self) -> NDArray[np.complex128]:
        """1/(1 + L) at the frequencies, complex, shape (n,) [1]."""
        return 1 / (1 + response_of(self.gain, self.frequencies))

    @property
    def T(self) -> NDArray[np.complex128]:
        """L/(1 + L) at the frequencies, complex, shape (n,) [1]."""
        return 1 - self.S

    def plot(self, *, db: bool = True) -> Figure:
        """Return the sizes of S and T over frequency in dB, or without `db` as ratios, their peaks marked."""
        from hovercontrol.control.analysis.frequency_plots import sensitivity_figure

        return open_in_pyplot(sensitivity_figure(self, db=db))


@checked
def sensitivity(
    loop: Loop,
    wire: str | None = None,
    at: At = None,
    *,
    frequencies: ArrayLike | None = None,
    time: float | None = None,
    params: Mapping[str, float] | None = None,
    friction: Slope = "smooth",
    amplitude: Mapping[str, float] | None = None,
) -> Sensitivity:
    """Return S and T of a loop broken at one wire, and their peaks.

    Parameters
    ----------
    loop, wire, at, time, params, friction, amplitude
        As for :func:`loop_gain`.
    frequencies : array_like, shape (n,), optional
        [rad/s], positive; default as for :func:`bode`. The peaks are sought beside it.

    Raises
    ------
    InputError
        As by :func:`bode`.

    Examples
    --------
    >>> found = sensitivity(control.tf([2.0], [1.0, 0.0]))  # S = s/(s + 2)
    >>> found.Ms, found.gain_margin, round(found.phase_margin, 9)
    (1.0, inf, 60.0)
    """
    gain, outside, margins = broken(loop, wire, at, time, params, friction, amplitude)
    omega = frequencies_of(gain, frequencies)
    S, T = control.feedback(1, gain), control.feedback(gain, 1)
    if unstable_poles(T) or outside.grow:
        return Sensitivity(gain, omega, *(math.nan,) * 6, margins, wire or "")
    search = frequencies_of(gain, None)
    (Ms, Ms_frequency), (Mt, Mt_frequency) = _peak(S, search), _peak(T, search)
    phase = math.degrees(2 * math.asin(min(1.0, 1 / (2 * Ms))))
    factor = Ms / (Ms - 1) if Ms > 1 else math.inf
    return Sensitivity(gain, omega, Ms, Ms_frequency, Mt, Mt_frequency, factor, phase, margins, wire or "")


def _peak(system: control.StateSpace, omega: Array) -> tuple[float, float]:
    """Return the largest gain of a stable system and its frequency [rad/s], limits at both ends included."""
    sizes = np.abs(response_of(system, omega))
    k = int(np.argmax(sizes))
    sampled = system.isdtime(strict=True)
    ends = [(abs(complex(system(1.0 if sampled else 0.0))), 0.0)]
    ends += [(float(sizes[-1]), float(omega[-1])) if sampled else (abs(float(system.D[0, 0])), math.inf)]
    inside = (float(sizes[k]), float(omega[k]))
    if 0 < k < len(omega) - 1:
        found = minimize_scalar(
            lambda w: -float(np.abs(response_of(system, np.exp([w])))[0]),
            bounds=(math.log(omega[k - 1]), math.log(omega[k + 1])),
            method="bounded",
            options={"xatol": 1e-10},
        )
        inside = max(inside, (float(-found.fun), math.exp(found.x)))
    best = max(*ends, inside, key=lambda one: one[0])
    return next(one for one in (*ends, best) if one[0] >= best[0] * (1 - 1e-12))
