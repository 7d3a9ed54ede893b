"""Figures and HTML of identified coefficients and free runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.boundary import checked
from hovercontrol.base.figure_style import BLUE, GREEN, VERMILION
from hovercontrol.base.html import card, fold, lines, table
from hovercontrol.base.percent import percent
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.logs import POSE, VELOCITY

if TYPE_CHECKING:
    from hovercontrol.identification.identify.predict import FreeRun
    from hovercontrol.identification.identify.result import Identified
    from hovercontrol.identification.identify.study import Study

MEASURED, SIMULATED, SHADE = "0.7", "tab:blue", "tab:red"


@checked
def plot_free_run(run: FreeRun, *, held_out: bool = False) -> Figure:
    """Plot the free-running simulation over the measurement, one axis for each channel.

    The pose is on the left and the velocities are on the right. The measurement is a broad grey line, so
    that both curves are visible where they agree. Spans that the smoother rejected are shaded, and the error
    is printed above each axis, beside the fit in % as MATLAB's ``compare`` prints it.

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
    >>> from hovercontrol.identification.identify import free_run
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
    error = f"rms error {run.rms[channel]:.3g} {run.units[channel]}"
    axis.set_title(f"{error}, fit {run.fit[channel]:.3g} %", fontsize="small", loc="right")
    axis.margins(x=0)
    axis.grid(alpha=0.3)


def identified_figure(found: Identified) -> Figure:
    """Return coefficients with two standard errors to either side beside what they were, each in its size.

    Below each stand its other readings, beside a missing effect and over longer times.
    """
    many = len(found.coefficients)
    figure = Figure(figsize=(7.5, 1.3 + 0.34 * many), layout="constrained")
    axis = figure.subplots()
    labels = []
    for k, c in enumerate(found.coefficients):
        size = max(abs(v) for v in (c.value, c.start, *(r.value for r in c.readings))) or 1.0
        known = c.excited and math.isfinite(c.std)
        if known:
            std = c.noise_std or c.std
            axis.errorbar(
                c.value / size, k, xerr=2 * std / size, fmt="o", color=BLUE, ms=5, capsize=3,
                label=None if "now" in labels else "identified, two standard errors",
            )  # fmt: skip
        elif "open" not in labels:
            axis.plot([], [], "s", mfc="none", color=VERMILION, label="not excited by the logs")
        if not known:
            axis.plot(c.value / size, k, "s", mfc="none", color=VERMILION)
        axis.plot(c.start / size, k, "|", color="0.2", ms=14, label=None if k else "before")
        for r in c.readings:
            axis.errorbar(
                r.value / size, k + 0.22, xerr=2 * r.std / size, fmt="D", color=GREEN, ms=4, capsize=2,
                label=None if "other" in labels else "other readings",
            )  # fmt: skip
            labels.append("other")
        labels.append("now" if known else "open")
    axis.set_yticks(range(many), [f"{c.name} [{c.unit}]" for c in found.coefficients])
    axis.set_ylim(many - 0.5, -0.5)
    axis.set_xlabel("value over the largest of its row [1]")
    axis.grid(alpha=0.3, axis="x")
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def identified_html(found: Identified) -> str:
    """Return identified coefficients as HTML, with what remains and what was left out."""
    rows = []
    for c in found.coefficients:
        remark = "; ".join(
            [*([f"at its {c.bound} bound"] if c.bound else []), *([c.reason] if c.reason else [])]
        )
        std = f"± {c.std:.2g}" if math.isfinite(c.std) else "unknown"
        rows.append((c.name, c.value, std, c.unit, c.start, remark))
    rows += [(g.name, g.value, f"± {g.std:.2g}", g.unit, g.start, "") for g in found.groups]
    rows += [(c.name, c.value, "kept", c.unit, c.start, c.kept) for c in found.kept]
    left = [(r.equation, r.rms, r.seen, r.unit, percent(r.share)) for r in found.remaining]
    forces = [
        (f.name, f.value, f"± {f.std:.2g}", f.unit, f.start) for f in (*found.forces(), *found.bodies())
    ]
    used = f"{found.rows} of {found.rows_total} rows of {', '.join(found.logs)}"
    return card(
        "Identified",
        found.model.name,
        "; ".join(filter(None, (used, found.not_converged))),
        table(("coefficient", "value", "std. error", "unit", "before", "remark"), rows),
        table(("with the given mass", "value", "std. error", "unit", "before"), forces),
        table(("equation", "remains", "seen", "unit", "share"), left, "what no equation says"),
        lines(found.misfit),
    )


def study_html(study: Study) -> str:
    """Return an identification and its predictions as HTML."""
    rows = [
        (
            f"{j.label}{' (held out)' if j.holdout else ''}",
            c,
            rms,
            j.prediction.trivial[c],
            j.prediction.units[c],
        )
        for j in study.judged
        for c, rms in j.prediction.rms.items()
    ]
    ahead = table(("log", "channel", "error 1 s ahead", "at constant velocity", "unit"), rows)
    return identified_html(study.found) + fold("predictions", ahead, unfolded=True)
