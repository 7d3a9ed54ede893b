"""An animation drawn by Matplotlib, frame by frame, as MP4 (ffmpeg) or GIF (Pillow)."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rcParams
from matplotlib.animation import FFMpegWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from PIL import Image

from hovercontrol.app.animation.craft import MARGIN, Craft, to_earth
from hovercontrol.app.animation.motion import ROUNDING, Motion, Scenery
from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.base.figure_style import BLUE, GREEN, SKY, VERMILION, YELLOW

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Size of a frame [in] and its resolution [1/in]; H.264 needs even numbers of pixels.
SIZE, DPI = (7.0, 6.0), 100

#: A GIF counts its time in hundredths of a second; browsers show frames shorter than two of them slowly.
TICK, SHORTEST = 0.01, 2


class Frames:
    """The figure of a motion, updated for each frame.

    Parameters
    ----------
    whole : Motion
        The recorded motion.
    motion : Motion
        At the times of the frames.
    craft : Craft
        With forces at those times.
    trail : bool
        Whether the past path is drawn.
    """

    def __init__(self, whole: Motion, motion: Motion, craft: Craft, *, trail: bool) -> None:
        self.figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        self.many = len(motion.time)
        self._whole, self._motion, self._craft = whole, motion, craft
        axes = self.figure.subplots()
        x, y = extent(whole)
        edge = MARGIN * craft.length
        axes.update_datalim([(x.min() - edge, y.min() - edge), (x.max() + edge, y.max() + edge)])
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(xlabel="x [m]", ylabel="y [m]")
        axes.grid(alpha=0.3)
        if motion.reference and not motion.goal:
            axes.plot(whole.reference["x"], whole.reference["y"], "--", color="0.5", lw=1.0)
        draw_scenery(axes, motion.scenery)
        (self._plan,) = axes.plot([], [], ".-", color=VERMILION, lw=0.8, ms=3, zorder=4)
        (self._point,) = axes.plot([], [], ".", color=YELLOW, ms=9, zorder=5)
        (self._trail,) = axes.plot([], [], color=BLUE, lw=1.2, visible=trail)
        (self._target,) = axes.plot(
            [], [], "+" if motion.goal else "o", color=GREEN, ms=9, mfc="none", zorder=5
        )
        at = float(motion.x[0]), float(motion.y[0]), float(motion.psi[0])
        self._hull = Polygon(to_earth(craft.outline, *at), closed=True, fc=SKY, ec="0.1", lw=1.2, zorder=3)
        axes.add_patch(self._hull)
        none = np.zeros(len(craft.arrows))
        self._arrows = axes.quiver(
            none, none, none, none, angles="xy", scale_units="xy", scale=1.0, pivot="tip",
            color=VERMILION, width=0.006, zorder=4,
        )  # fmt: skip
        self._title = axes.set_title("", loc="left", family="monospace", fontsize="medium")
        axes.set_title(motion.name, loc="right", fontsize="medium")
        self.show(0)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # the axes stay where they are, and frames take half the time

    def show(self, k: int) -> None:
        """Draw frame k."""
        motion, craft = self._motion, self._craft
        pose = float(motion.x[k]), float(motion.y[k]), float(motion.psi[k])
        behind = self._whole.time <= motion.time[k]
        self._trail.set_data(
            np.append(self._whole.x[behind], pose[0]), np.append(self._whole.y[behind], pose[1])
        )
        self._hull.set_xy(to_earth(craft.outline, *pose))
        if len(motion.scenery.plans):
            self._plan.set_data(*plan_at(self._whole, motion.time[k]).T)
        if motion.tracked:
            self._point.set_data([motion.tracked["x"][k]], [motion.tracked["y"][k]])
        if motion.reference:
            self._target.set_data([motion.reference["x"][k]], [motion.reference["y"][k]])
        if craft.arrows:
            forces = np.array([a.force[:, k] for a in craft.arrows])
            ends = to_earth(np.array([a.place for a in craft.arrows]), *pose)
            self._arrows.set_offsets(ends)
            self._arrows.set_UVC(*(craft.length * to_earth(forces, 0.0, 0.0, pose[2])).T)
        self._title.set_text(caption(motion, k))


def extent(motion: Motion) -> tuple[Array, Array]:
    """Return x and y of all that the map of a motion shows."""
    seen = motion.scenery.extent()
    x, y = (
        np.concatenate([getattr(motion, k), motion.reference.get(k, []), seen[i]]) for i, k in enumerate("xy")
    )
    return x, y


def plan_at(whole: Motion, time: float) -> Array:
    """Return the plan of a predictive controller at an instant, shape (points, 2): one a sample."""
    plans = whole.scenery.plans
    sample = (whole.time[-1] - whole.time[0]) / len(plans)
    return plans[min(int((time - whole.time[0]) / sample + ROUNDING), len(plans) - 1)]


def draw_scenery(axes: Axes, scenery: Scenery) -> None:
    """Draw obstacles as discs and waypoints as crosses."""
    for k, (x, y, radius) in enumerate(scenery.obstacles):
        axes.add_patch(Circle((x, y), radius, color="0.75", label=None if k else "obstacle", zorder=1))
    if len(scenery.waypoints):
        axes.plot(*scenery.waypoints.T, "k+", ms=10, mew=1.5, label="waypoints", zorder=2)


def caption(motion: Motion, k: int) -> str:
    """Return time and body velocities at an instant."""
    units = {"u": "m/s", "v": "m/s", "r": "rad/s"}
    speeds = "  ".join(f"{name} {row[k]:+.2f} {units[name]}" for name, row in motion.velocities.items())
    return f"t {motion.time[k]:6.2f} s  {speeds}".rstrip()


def gif_period(fps: float) -> float:
    """Return the frame period [s] of a GIF nearest to a frame rate [1/s]."""
    return TICK * max(SHORTEST, round(1 / (fps * TICK)))


def check_ffmpeg(path: Path) -> None:
    """Raise if there is no ffmpeg: neither the program nor that of the package imageio-ffmpeg."""
    if not FFMpegWriter.isAvailable():
        try:
            from imageio_ffmpeg import get_ffmpeg_exe
        except ImportError:
            raise InputError(
                f"{path}: an MP4 needs ffmpeg, which was not found: pip install '.[video]', "
                "or write .html or .gif"
            ) from None
        rcParams["animation.ffmpeg_path"] = get_ffmpeg_exe()


def write_gif(frames: Frames, path: Path, period: float, report: Callable[[float], None]) -> None:
    """Write all frames as a GIF, `period` seconds apart, that loops."""
    images = _images(frames, report)
    milliseconds = round(1000 * period)
    next(images).save(path, save_all=True, append_images=images, duration=milliseconds, loop=0)


def _images(frames: Frames, report: Callable[[float], None]) -> Iterator[Image.Image]:
    canvas = FigureCanvasAgg(frames.figure)
    for k in range(frames.many):
        frames.show(k)
        canvas.draw()
        yield (
            Image.fromarray(np.asarray(canvas.buffer_rgba()))
            .convert("RGB")
            .quantize(64, Image.Quantize.FASTOCTREE)
        )
        report((k + 1) / frames.many)


def write_mp4(frames: Frames, path: Path, period: float, report: Callable[[float], None]) -> None:
    """Write all frames as an MP4, `period` seconds apart, by ffmpeg."""
    writer = FFMpegWriter(fps=1 / period)  # type: ignore[arg-type]  # of any rate, its annotation says int
    try:
        with writer.saving(frames.figure, str(path), DPI):
            for k in range(frames.many):
                frames.show(k)
                writer.grab_frame()
                report((k + 1) / frames.many)
    except (subprocess.CalledProcessError, BrokenPipeError) as error:
        raise InputError(f"{path.name}: ffmpeg ended with an error: {error}") from None
