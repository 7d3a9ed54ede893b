"""``hc.animate``: a run as an animation of the craft from above."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.app.animation.craft import Craft, craft_of
from hovercontrol.app.animation.frames import Frames, check_ffmpeg, gif_period, write_gif, write_mp4
from hovercontrol.app.animation.motion import Motion, motion_of
from hovercontrol.app.animation.player import framed, page
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.figure_style import figure_style
from hovercontrol.base.files import write_atomically
from hovercontrol.base.tables import positive
from hovercontrol.craft.models.model import Model
from hovercontrol.documents.scenarios.machine import MachineRun
from hovercontrol.documents.scenarios.result import Run
from hovercontrol.logs.log import Log

FORMATS = (".html", ".mp4", ".gif")

#: Most frames of an animation: 20 minutes at 25 frames per second.
MOST = 30_000


@checked
def animate(
    run: control.TimeResponseData | Log | Run | MachineRun,
    path: str | Path | None = None,
    *,
    speed: float = 1.0,
    fps: float = 25.0,
    model: Model | None = None,
    trail: bool = True,
    forces: bool = True,
    obstacles: ArrayLike = (),
    waypoints: ArrayLike = (),
    progress: Callable[[float], None] | None = None,
) -> Animation:
    """Return the motion of a craft as an animation, and write it to a file if a path is given.

    The craft is drawn as an outline with its bow, the path behind it, the point to follow if the run holds
    ``x_ref`` and ``y_ref`` (or ``goal_x_ref``, ``goal_y_ref``), forces as arrows, and time and body
    velocities as text. An arrow ends where its force acts: at the stern along the rudder angle for ``thrust``
    and ``rudder``, at each fan for a model with fans. The upper quartile of the run's forces is as
    long as the hull, and the longest arrow twice that.

    Parameters
    ----------
    run : control.TimeResponseData, Log, Run or MachineRun
        With ``x``, ``y`` [m] and ``psi`` [rad] as outputs, columns or states (``plant.x``): from
        :func:`hovercontrol.simulate`, ``compile().simulate``, a scenario, or a log.
    path : path, optional
        A file ``.html`` (one page that needs nothing else, with slider and speeds), ``.mp4`` (needs ffmpeg or
        the extra ``video``) or ``.gif``; written atomically. A notebook shows the result without.
    speed : float, optional
        Seconds of the run per second of the animation.
    fps : float, optional
        Frames per second; the HTML page uses the screen's rate, a GIF the nearest possible rate.
    model : Model, optional
        Model of the craft, for its fans and the size of the hull. Default: the scenario's, or else a craft
        with a rudder of 0.45 m x 0.25 m. A hull too small to see is enlarged.
    trail, forces : bool, optional
        Whether the past path and the arrows are drawn.
    obstacles : array_like, shape (n, 3), optional
        x, y and radius of circles to draw [m]. A run of a predictive controller brings its own, its
        waypoints, and what it plans at each sample.
    waypoints : array_like, shape (n, 2), optional
        Points to mark [m].
    progress : callable, optional
        Called with the fraction written, 0 to 1.

    Returns
    -------
    Animation
        With ``save(path)``.

    Raises
    ------
    InputError
        If the run holds no pose, the file has another suffix, ffmpeg is missing, or there would be more than
        30 000 frames.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> import numpy as np
    >>> craft, t = hc.vehicle("c17_simulation"), np.linspace(0.0, 4.0, 81)
    >>> run = hc.simulate(craft.plant(), t, {"thrust": np.full(81, 3.0), "rudder": 0.1 * np.sin(t)})
    >>> hc.animate(run, speed=2.0).frames
    51
    """
    speed, fps = positive("animate: speed", speed), positive("animate: fps", fps)
    made = Animation(motion_of(run, obstacles, waypoints), model, speed, fps, trail, forces)
    if made.frames > MOST:
        raise InputError(
            f"animate: {made.frames} frames are too many, at most {MOST}: "
            f"raise speed to {math.ceil(speed * made.frames / MOST)} or more"
        )
    if path is not None:
        made.save(path, progress)
    return made


def check_format(path: Path) -> str:
    """Return the suffix of a file for an animation; raise if it is not supported."""
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(
            f"{path}: expected a file {', '.join(FORMATS)}, found {kind or 'no suffix'}"
            f"{did_you_mean(kind, FORMATS) if kind else ''}"
        )
    if kind == ".mp4":
        check_ffmpeg(path)
    return kind


@checked
@dataclass(frozen=True, eq=False)
class Animation:
    """A motion with its display options, as returned by :func:`animate`. A notebook shows it as a player.

    Attributes
    ----------
    motion : Motion
        Motion of the run.
    model : Model or None
    speed : float
        Seconds of the run per second of the animation [1].
    fps : float
        Frames per second [1/s].
    trail, forces : bool
        Whether the past path and the arrows are drawn.

    Examples
    --------
    >>> log = Log("line", [0.0, 2.0], {"x": [0.0, 1.0], "y": [0.0, 0.0], "psi": [0.0, 0.0]})
    >>> animate(log, fps=10.0).frames
    21
    """

    motion: Motion
    model: Model | None = None
    speed: float = 1.0
    fps: float = 25.0
    trail: bool = True
    forces: bool = True

    def __repr__(self) -> str:
        first, last = self.motion.time[[0, -1]]
        return (
            f"Animation of {self.motion.name}: {self.frames} frames from {first:g} to {last:g} s, "
            f"{self.fps:g} a second at speed {self.speed:g}; save(FILE.html, .mp4 or .gif) writes it"
        )

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self._times(1 / self.fps))

    def save(self, path: str | Path, progress: Callable[[float], None] | None = None) -> Path:
        """Write the animation to a file ``.html``, ``.mp4`` or ``.gif``, atomically.

        Parameters
        ----------
        path : path
        progress : callable, optional
            Called with the fraction written, 0 to 1.

        Raises
        ------
        InputError
            If the suffix is another, ffmpeg is missing or fails, or the file cannot be written.
        """
        file = Path(path)
        kind = check_format(file)
        if kind == ".html":
            text = self._page()
            return write_atomically(file, lambda part: part.write_text(text, encoding="utf-8"))
        period = gif_period(self.fps) if kind == ".gif" else 1 / self.fps
        write = write_gif if kind == ".gif" else write_mp4
        with figure_style():
            frames = Frames(self.motion, *self._drawn(period), trail=self.trail)
            report = progress or (lambda part: None)
            return write_atomically(file, lambda part: write(frames, part, period, report))

    def _repr_html_(self) -> str:
        return framed(self._page())

    def _page(self) -> str:
        step = min(self.speed, 1.0) / self.fps  # a page may be played more slowly than at first
        step = max(step, (self.motion.time[-1] - self.motion.time[0]) / MOST)
        motion, craft = self._drawn(step / self.speed)
        return page(motion, craft, step, self.speed, trail=self.trail)

    def _drawn(self, period: float) -> tuple[Motion, Craft]:
        motion = self.motion.at(self._times(period))
        return motion, craft_of(motion, self.model, forces=self.forces)

    def _times(self, period: float) -> NDArray[np.float64]:
        """Return the run's times, one for each frame; the last frame is not before the run's end."""
        begin, end, step = self.motion.time[0], self.motion.time[-1], period * self.speed
        times: NDArray[np.float64] = begin + step * np.arange(math.ceil((end - begin) / step - 1e-9) + 1)
        return times
