"""Figures of measurement and simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.core.boundary import checked
from hovercontrol.io.pyplot import open_in_pyplot
from hovercontrol.logs import POSE, VELOCITY

if TYPE_CHECKING:
    from hovercontrol.identify.predict import FreeRun

MEASURED, SIMULATED, SHADE = "0.7", "tab:blue", "tab:red"


@checked
def plot_free_run(run: FreeRun, *, held_out: bool = False) -> Figure:
    """Plot the free-running simulation over the measurement, one axis for each channel.

    The pose is on the left and the velocities are on the right. The measurement is a broad grey line, so
    that both curves are visible where they agree. Spans that the smoother rejected are shaded, and the error
    is printed above each axis.

    Parameters
    ----------
    run : FreeRun
    held_out : bool, optional
        Whether the title says that the log was held out of the fit.

    Returns
    -------
    matplotlib.figure.Figure
        Not attached to a screen; ``figure.savefig("run.png")`` writes it.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> import numpy as np
    >>> from hovercontrol.identify import free_run
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=1.0)
    >>> decay = hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> t = np.linspace(0, 2, 21)
    >>> figure = plot_free_run(free_run(decay, hc.logs.Log("demo", t, {"v": np.exp(-t)})))
    >>> len(figure.axes)
    1
    """
    return open_in_pyplot(free_run_figure(run, held_out=held_out))


def free_run_figure(run: FreeRun, *, held_out: bool = False) -> Figure:
    """Return the figure of :func:`plot_free_run` without registering it in pyplot."""
    known = [c for pair in zip(POSE, VELOCITY, strict=True) for c in pair]
    planar = set(known) <= set(run.channels)
    left_over = [c for c in run.channels if c not in known]
    channels = [*known, *left_over] if planar else list(run.channels)
    columns = 2 if planar else 1
    rows = -(-len(channels) // columns)
    figure = Figure(figsize=(5.5 * columns, 1.0 + 1.8 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, sharex=True, squeeze=False).ravel())
    for axis, channel in zip(axes, channels, strict=False):
        _draw(axis, run, channel)
    for axis in axes[len(channels) :]:
        axis.remove()
    for axis in axes[max(0, len(channels) - columns) : len(channels)]:
        axis.set_xlabel("time [s]")
        axis.tick_params(labelbottom=True)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    again = f", started {len(run.starts)} times" if len(run.starts) > 1 else ""
    title = f"{run.model} running free on the inputs of {run.log}{' (held out)' if held_out else ''}{again}"
    figure.suptitle(title)
    return figure


def _draw(axis: Axes, run: FreeRun, channel: str) -> None:
    i = run.channels.index(channel)
    sampled = np.isfinite(run.measured[i])  # false in rows that contain only a command
    axis.plot(run.time[sampled], run.measured[i, sampled], color=MEASURED, lw=4.0, label="measured")
    axis.plot(run.time, run.simulated[i], color=SIMULATED, lw=0.9, label="simulated")
    for k, span in enumerate(run.rejected):
        axis.axvspan(
            span.start,
            span.stop,
            color=SHADE,
            alpha=0.2,
            lw=0.5,
            label="no motion, left out" if k == 0 else None,
        )
    axis.set_ylabel(f"{channel} [{run.units[channel]}]")
    axis.set_title(f"rms error {run.rms[channel]:.3g} {run.units[channel]}", fontsize="small", loc="right")
    axis.margins(x=0)
    axis.grid(alpha=0.3)
