"""Where a warning points to: the user's line."""

from __future__ import annotations

import os
import sys


def caller_level() -> int:
    """Return the ``stacklevel`` of the first caller outside the package and python-control."""
    inside = [os.path.dirname(os.path.dirname(__file__))]
    if "control" in sys.modules:
        inside.append(os.path.dirname(str(sys.modules["control"].__file__)))
    folders = tuple(folder + os.sep for folder in inside)
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(folders):
        frame, level = frame.f_back, level + 1
    return level
