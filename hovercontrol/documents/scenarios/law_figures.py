"""Pictures of a run under one of K06's laws: set points, motion and modes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.blocks.signals import Signal
from hovercontrol.documents.scenarios.parts import loop_parts
from hovercontrol.documents.scenarios.time_axes import in_time, own_loop, time_figure

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.result import Run


def law_figures(run: Run) -> dict[str, Figure]:
    """Return the pictures by name: forces; of a hybrid controller also heading and modes."""
    drawn = {"forces": _forces(run)}
    if "heading_ref" in run.columns and run.scenario.autopilot is None:  # else the comparison shows it
        drawn["heading"] = _heading(run)
    modes = [s for block in loop_parts(run.scenario).values() for s in block.outputs if s.modes]
    if modes:
        drawn["modes"] = _modes(run, modes)
    return drawn


def _forces(run: Run) -> Figure:
    figure, (axes,) = time_figure(run, f"forces that the law asks for{own_loop(run)}")
    curves = {"F_X": run.columns["force_x"], "F_Y": run.columns["force_y"]}
    in_time(run, axes, curves, "force [N]", ("-", "--"))
    return figure


def _heading(run: Run) -> Figure:
    figure, axes = time_figure(run, "heading", 2, 4.6)
    degrees = {k: run.columns[k] * math.degrees(1.0) for k in ("psi", "heading_ref", "heading_error")}
    curves = {"heading": degrees["psi"], "wanted": degrees["heading_ref"]}
    in_time(run, axes[0], curves, "psi [deg]", ("-", "--"))
    in_time(run, axes[1], {"": degrees["heading_error"]}, "error [deg]")
    last = degrees["heading_error"][len(run.time) // 2 :]
    span = max(2.0, 1.5 * abs(last).max())  # the second half shows what remains; the turn itself is above
    axes[1].set_ylim(-span, span)
    return figure


def _modes(run: Run, modes: list[Signal]) -> Figure:
    figure, axes = time_figure(
        run, f"modes of the hybrid controller{own_loop(run)}", len(modes), 1.2 + 1.5 * len(modes)
    )
    for row, signal in zip(axes, modes, strict=True):
        _steps(run, row, signal)
    return figure


def _steps(run: Run, axes: Axes, signal: Signal) -> None:
    axes.step(run.time, run.columns[signal.name], where="post", linewidth=1.0)
    axes.set_yticks(range(len(signal.modes)), signal.modes)
    axes.set_ylim(-0.3, len(signal.modes) - 0.7)
    axes.set_ylabel(signal.name.replace("_", " "))
