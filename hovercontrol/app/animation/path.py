"""``hc.plot_path``: the path of a craft as a map, with its heading."""

from __future__ import annotations

from typing import TYPE_CHECKING

import control
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import ArrayLike

from hovercontrol.app.animation.craft import craft_of, to_earth
from hovercontrol.app.animation.frames import draw_scenery
from hovercontrol.app.animation.motion import Motion, motion_of
from hovercontrol.base.boundary import checked
from hovercontrol.base.figure_style import BLACK, BLUE, GREEN, SKY, VERMILION, YELLOW, figure_style
from hovercontrol.base.pyplot import open_in_pyplot, shown_once
from hovercontrol.craft.models.model import Model
from hovercontrol.documents.scenarios.machine import MachineRun
from hovercontrol.documents.scenarios.result import Run
from hovercontrol.logs.log import Log

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: How often the craft is drawn on its path, at equal times.
TIMES = 9


@checked
def plot_path(
    run: control.TimeResponseData | Log | Run | MachineRun,
    *,
    model: Model | None = None,
    obstacles: ArrayLike = (),
    waypoints: ArrayLike = (),
    axes: Axes | None = None,
) -> Figure:
    """Draw the path of a craft as a map: the craft with its heading at nine times, and its reference.

    A run with the tracking error ``error_x``, ``error_y`` also shows the point of the craft that follows.

    Parameters
    ----------
    run : control.TimeResponseData, Log, Run or MachineRun
        With ``x``, ``y`` [m] and ``psi`` [rad], as for :func:`hovercontrol.animate`. Of a machine of one's
        own without ``psi`` the heading is its only state in rad; without any it is drawn round.
    model : Model, optional
        Model of the craft, for its size.
    obstacles, waypoints : array_like, optional
        As for :func:`hovercontrol.animate`.
    axes : matplotlib.axes.Axes, optional
        To draw into; default: those of a new figure.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the run holds no pose.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> log = hc.Log("line", [0.0, 1.0, 2.0], {"x": [0, 1, 2], "y": [0, 1, 2], "psi": [0.8, 0.8, 0.8]})
    >>> hc.plot_path(log).axes[0].get_xlabel()
    'x [m]'
    """
    motion = motion_of(run, obstacles, waypoints)
    with figure_style():
        own = axes is None
        if axes is None:
            axes = Figure(figsize=(6.6, 6.0), layout="constrained").subplots()
        _draw(axes, motion, model)
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    return open_in_pyplot(figure) if own else shown_once(figure)


def _draw(axes: Axes, motion: Motion, model: Model | None) -> None:
    craft = craft_of(motion, model, forces=False)
    if motion.goal:
        axes.plot(motion.reference["x"][-1], motion.reference["y"][-1], "+", color=GREEN, ms=11, label="goal")
    elif motion.reference:
        axes.plot(
            motion.reference["x"],
            motion.reference["y"],
            "--",
            color=BLACK,
            lw=1.0,
            label="reference",
            zorder=4,
        )
    draw_scenery(axes, motion.scenery)
    if motion.tracked:
        axes.plot(motion.tracked["x"], motion.tracked["y"], color=YELLOW, lw=1.6, label="tracked point")
    axes.plot(motion.x, motion.y, color=BLUE, lw=1.2, label="centre of mass")
    seen = motion.at(np.linspace(motion.time[0], motion.time[-1], TIMES))
    if motion.tracked:
        axes.plot(seen.tracked["x"], seen.tracked["y"], ".", color=YELLOW, ms=7, zorder=5)
    for pose in zip(seen.x.tolist(), seen.y.tolist(), seen.psi.tolist(), strict=True):
        corners = to_earth(craft.outline, *pose)
        axes.add_patch(Polygon(corners, closed=True, fc=SKY, ec=BLACK, alpha=0.5, lw=0.8, zorder=3))
    axes.plot(motion.x[0], motion.y[0], "x", color=VERMILION, ms=8, label="start", zorder=4)
    axes.set(xlabel="x [m]", ylabel="y [m]", title=motion.name)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, frameon=False)
