"""Frames of a log: north-east-down axes are converted to x, y, psi with z up."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import ArgumentError
from hovercontrol.logs.log import Log

if TYPE_CHECKING:
    pass

Complex = NDArray[np.complex128]

#: Possible frames of a log. ENU (x east, y north, psi from x to y) equals the package's own.
FRAMES = ("z-up", "enu", "ned")


@checked
def in_z_up(log: Log, frame: str) -> Log:
    """Return a log converted from a frame to x, y, psi with z up.

    Parameters
    ----------
    frame : str
        One of :data:`FRAMES`. For NED x and y are exchanged, psi becomes pi/2 - psi, and v and r change
        sign. :func:`check_frame` does not check the returned log again.

    Raises
    ------
    InputError
        If the frame is unknown.

    Examples
    --------
    >>> east = Log("east", [0.0, 1.0], {"x": [0, 0], "y": [0, 2], "psi": [np.pi / 2] * 2, "r": [0.1, 0.1]})
    >>> found = in_z_up(east, "ned")
    >>> found["x"].tolist(), found["y"].tolist(), found["psi"].tolist(), found["r"].tolist()
    ([0.0, 2.0], [0.0, 0.0], [0.0, 0.0], [-0.1, -0.1])
    """
    if frame not in FRAMES:
        raise ArgumentError(f"frame: expected one of {', '.join(FRAMES)}, found {frame!r}")
    if frame == "ned":
        turned = {"x": "y", "y": "x"}
        changed = {name: log[turned[name]] for name in turned if log.has("x", "y")}
        changed |= {name: -log[name] for name in ("v", "r") if log.has(name)}
        changed |= {"psi": np.pi / 2 - log["psi"]} if log.has("psi") else {}
        log = log.with_columns(changed)
    return replace(log, frame=frame)
