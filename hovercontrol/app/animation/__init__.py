"""The motion of a craft as a map and as an animation: from a simulated run, a scenario or a measured log."""

from hovercontrol.app.animation.animate import Animation, animate
from hovercontrol.app.animation.path import plot_path

__all__ = ["animate", "Animation", "plot_path"]
