"""Figures of a loop in the frequency domain, drawn by python-control."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import control
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.base.figure_style import BLUE, VERMILION

if TYPE_CHECKING:
    from hovercontrol.control.analysis.frequency import Bode, Nyquist
    from hovercontrol.control.analysis.sensitivity_functions import Sensitivity
    from hovercontrol.control.analysis.stability_margins import FrozenMargins, Margins

#: The part of a Nyquist curve beyond this size is drawn on a circle of it.
LARGEST = 4.0


def bode_figure(found: Bode, *, db: bool = True) -> Figure:
    """Return magnitude and phase of L over frequency, with gain and phase margin."""
    return loop_figure(found.gain, found.margins, found.frequencies, found.wire, db=db)


def loop_figure(
    gain: control.StateSpace,
    margins: Margins,
    frequencies: NDArray[np.float64] | None = None,
    wire: str = "",
    *,
    db: bool = True,
) -> Figure:
    """Return the Bode plot of a loop gain, at python-control's frequencies where none are given."""
    figure = Figure(figsize=(7.0, 5.4), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True).reshape(2, 1)
    control.bode_plot(gain, frequencies, ax=axes, display_margins=margins.stable, color=BLUE, dB=db)
    axes[0, 0].set_title("")
    axes[0, 0].set_ylabel(f"magnitude [{'dB' if db else '1'}]")
    axes[1, 0].set_ylabel("phase [deg]")
    axes[1, 0].set_xlabel("frequency [rad/s]")
    figure.suptitle(f"Loop gain{_at(wire)}{_margins_text(margins)}", fontsize="medium")
    return figure


def nyquist_figure(found: Nyquist) -> Figure:
    """Return the Nyquist curve of L about -1, with the unit circle."""
    figure = Figure(figsize=(6.0, 5.6), layout="constrained")
    axis = figure.subplots()
    control.nyquist_plot(
        found.gain,
        ax=axis,
        color=BLUE,
        unit_circle=True,
        max_curve_magnitude=LARGEST,
        warn_encirclements=False,
        warn_nyquist=False,
    )
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("real part of L [1]")
    axis.set_ylabel("imaginary part of L [1]")
    figure.suptitle(
        f"Nyquist curve{_at(found.wire)}: {found.encirclements} clockwise encirclements of -1,\n"
        f"unstable poles {found.open_loop_unstable} open loop, {found.closed_loop_unstable} closed loop",
        fontsize="medium",
    )
    return figure


def sensitivity_figure(found: Sensitivity, *, db: bool = True) -> Figure:
    """Return the sizes of S and T over frequency, their peaks marked."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axis = figure.subplots()
    one = control.ss([], [], [], [[1.0]], dt=found.gain.dt)
    for system, name, color, peak, where in (
        (control.feedback(one, found.gain), "S", BLUE, found.Ms, found.Ms_frequency),
        (control.feedback(found.gain, one), "T", VERMILION, found.Mt, found.Mt_frequency),
    ):
        text = f"{name}, peak {peak:.3g}" if math.isfinite(peak) else name
        control.bode_plot(
            system,
            found.frequencies,
            ax=np.array([[axis]]),
            plot_phase=False,
            dB=db,
            color=color,
            label=text,
            show_legend=False,
        )
        if 0.0 < where < math.inf:
            axis.plot(where, 20 * math.log10(peak) if db else peak, "o", color=color, ms=5)
    axis.set_ylabel(f"size [{'dB' if db else '1'}]")
    axis.set_xlabel("frequency [rad/s]")
    axis.legend(frameon=False)
    unstable = "" if math.isfinite(found.Ms) else ": the loop is unstable"
    figure.suptitle(
        f"Sensitivity S and complementary sensitivity T{_at(found.wire)}{unstable}", fontsize="medium"
    )
    return figure


def _at(wire: str) -> str:
    return f" at {wire}" if wire else ""


def _margins_text(margins: Margins) -> str:
    if not margins.stable:
        return ": the loop is unstable"
    down = f" and down {margins.gain_down:.3g}" if margins.gain_down > 0 else ""
    phase = f"{margins.phase:.3g} deg"
    at = f" at {margins.crossover:.3g} rad/s" if math.isfinite(margins.crossover) else ""
    up = f"up {margins.gain_up:.3g}" if margins.gain_up < math.inf else "infinite"
    return f"\ngain margin {up}{down}, phase margin {phase}{at}"


def margins_figure(found: FrozenMargins) -> Figure:
    """Return phase, gain and delay margins along a motion."""
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    axes[0].plot(found.times, found["phase"], color=BLUE)
    axes[0].set_ylabel("phase margin [deg]")
    for name, style, colour in (("gain_up", "-", BLUE), ("gain_down", "--", VERMILION)):
        limit = np.where((found[name] > 0) & np.isfinite(found[name]), found[name], np.nan)
        none = "" if np.isfinite(limit).any() else ": any gain is borne"
        axes[1].plot(found.times, limit, style, color=colour, label=f"{name.removeprefix('gain_')}{none}")
    if np.isfinite([found["gain_up"], found["gain_down"]]).any():
        axes[1].set_yscale("log")
    axes[1].set_ylabel("gain at the edge [1]")
    axes[1].legend(frameon=False)
    axes[2].plot(found.times, found["delay"], color=BLUE, label="constant")
    axes[2].plot(found.times, found["jitter"], "--", color=VERMILION, label="varying")
    axes[2].set_ylabel("delay margin [s]")
    axes[2].legend(frameon=False)
    axes[2].set_xlabel("time [s]")
    for axis in axes:
        axis.margins(x=0)
        axis.grid(alpha=0.3)
    return figure
