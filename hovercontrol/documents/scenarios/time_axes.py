"""Parts of the figures of a run: titles, marked phases, curves over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.result import Run


#: So many letters of a title fit in an inch.
TITLE_LETTERS_PER_INCH = 11


def time_figure(run: Run, what: str, rows: int = 1, height: float = 3.4) -> tuple[Figure, list[Axes]]:
    """Return a figure with its title and rows of axes over one time, phases marked."""
    figure = Figure(figsize=(8.0, height), layout="constrained")
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0].tolist()
    title(run, figure, what)
    for k, row in enumerate(axes):
        _mark_phases(run, row, named=k == 0)
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def own_loop(run: Run) -> str:
    """Return the suffix of a title for the real one of two loops."""
    return "" if run.scenario.autopilot is None else ", real loop"


def title(run: Run, figure: Figure, what: str) -> None:
    """Write the scenario's title and what is shown, on two lines if one is too short."""
    line = f"{run.scenario.title} - {what}"
    broken = f"{run.scenario.title}\n{what}"
    width = figure.get_figwidth() * TITLE_LETTERS_PER_INCH
    figure.suptitle(line if len(line) <= width else broken, fontsize=11)


def _mark_phases(run: Run, axes: Axes, named: bool) -> None:
    """Mark changes of phase by vertical bars, as in C17, with names along the top."""
    begin = 0.0
    for phase in run.scenario.phases:
        if begin > 0:
            axes.axvline(begin, color="0.35", linewidth=0.9, linestyle="--")
        if named and len(run.scenario.phases) > 1:
            axes.text(
                (begin + phase.until) / 2,
                1.01,
                phase.name,
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize=8,
                color="0.35",
            )
        begin = phase.until
    axes.set_xlim(run.time[0], run.time[-1])
    axes.grid(alpha=0.3)


def in_time(
    run: Run, axes: Axes, curves: Mapping[str, Array], unit: str, styles: tuple[str, ...] = ()
) -> None:
    """Draw curves over time, each under its label."""
    for k, (label, values) in enumerate(curves.items()):
        axes.plot(run.time, values, styles[k] if styles else "-", linewidth=1.1, label=label)
    axes.set_ylabel(unit)
    if any(curves):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
