"""Where Matplotlib keeps its cache of fonts: for commands, a private folder if the user's is not writable."""

from __future__ import annotations

import atexit
import logging
import os
import shutil
import sys
import tempfile
from pathlib import Path


def set_matplotlib_folder() -> None:
    """Give Matplotlib a temporary folder if its own is not writable; otherwise it would print warnings.

    To be called before Matplotlib is imported. The folder ends with this process.
    """
    if not all(_writable(folder) for folder in _folders()):
        folder = tempfile.mkdtemp(prefix="hovercontrol-matplotlib-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        os.environ["MPLCONFIGDIR"] = folder
        logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)  # it finds all fonts each time


def _folders() -> list[str]:
    """Return Matplotlib's folders of settings and caches."""
    own = os.environ.get("MPLCONFIGDIR")
    if own:
        return [own]
    if not sys.platform.startswith(("linux", "freebsd")):
        return ["~/.matplotlib"]
    bases = {"XDG_CONFIG_HOME": "~/.config", "XDG_CACHE_HOME": "~/.cache"}
    return [os.path.join(os.environ.get(name) or base, "matplotlib") for name, base in bases.items()]


def _writable(folder: str) -> bool:
    """Return whether a folder is writable or can be created."""
    place = Path(os.path.expanduser(folder)).absolute()
    there = next(p for p in (place, *place.parents) if os.path.lexists(p))
    return there.is_dir() and os.access(there, os.W_OK | os.X_OK)
