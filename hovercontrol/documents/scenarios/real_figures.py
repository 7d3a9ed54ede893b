"""Figure of a real and an ideal loop, as K06's figures 6.7-6.12."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.documents.scenarios.time_axes import in_time, time_figure

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.result import Run


def comparison(run: Run, simulated: Run | None = None) -> Figure:
    """Return surge, sway, yaw rate, and of a heading trial the heading: reference, real and ideal loop.

    Parameters
    ----------
    run : Run
        Run of a scenario with an autopilot.
    simulated : Run, optional
        The same trial run with the model that the controller knows, drawn in place of the ideal loop, as in
        K06's figures 6.21 to 6.26.
    """
    rows = {"u": "surge u [m/s]", "v": "sway v [m/s]", "r": "yaw rate r [rad/s]"}
    told = {"u": "surge_ref", "r": "yaw_rate_ref", "psi": "heading_ref"}
    if "heading_ref" in run.columns:
        rows["psi"] = "heading psi [deg]"
        told.pop("r")  # what guidance tells the law changes all the time
    what = "the real and the ideal loop"
    if simulated is not None:
        what = "real: with what the model lacks; simulated: the model"
    figure, axes = time_figure(run, what, len(rows), 1.0 + 1.9 * len(rows))
    for k, (name, unit) in enumerate(rows.items()):
        factor = math.degrees(1.0) if unit.endswith("[deg]") else 1.0
        shown = within_a_turn if name == "psi" else np.asarray
        curves = {
            "real, by its INS": shown(run.columns[name]) * factor,
            "real": shown(run.columns[f"true_{name}"]) * factor,
        }
        if simulated is None:
            curves["ideal"] = shown(run.columns[f"ideal_{name}"]) * factor
        else:
            curves["simulated"] = shown(simulated.columns[f"true_{name}"]) * factor
        styles = ["0.75", "C0", "C3--"]
        if told.get(name) in run.columns:
            curves["reference"] = run.columns[told[name]] * factor
            styles.append("k:")
        in_time(run, axes[k], curves, unit, tuple(styles))
        if name == "psi":  # an estimate just below zero is drawn at a whole turn: the axis leaves it out
            drawn = np.concatenate([v for key, v in curves.items() if key != "real, by its INS"])
            low, high = float(np.nanmin(drawn)), float(np.nanmax(drawn))
            axes[k].set_ylim(low - 0.1 * (high - low), high + 0.1 * (high - low))
            if high - low > 180.0:
                axes[k].set_yticks(range(0, 361, 90))
    return figure


def within_a_turn(heading: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a heading within 0 ... 2 pi, as K06 draws it, without lines where it jumps."""
    wrapped = np.mod(heading, 2 * math.pi)
    jumps = np.flatnonzero(np.abs(np.diff(wrapped)) > math.pi)
    wrapped[jumps + 1] = np.nan
    return wrapped
