"""A cache of libraries that holds only the compiled C runtime, the same for all Blocks."""

import contextlib
import shutil
from pathlib import Path

import pytest

from hovercontrol import Block, Signal
from hovercontrol.blocks.backends.compiler import NoCompilerError
from hovercontrol.blocks.backends.library import Library


@pytest.fixture(scope="session")
def cold(tmp_path_factory):
    """Return a function that writes such a cache into a folder; without a C compiler it is empty."""
    place, v = tmp_path_factory.mktemp("cold"), Signal("v")
    with pytest.MonkeyPatch.context() as patch, contextlib.suppress(NoCompilerError):
        patch.setenv("HOVERCONTROL_CACHE", str(place))
        Library(Block("still", [v], [], [v], [], {"v": 0 * v.symbol}), "events")

    def others(folder, names):
        return [n for n in names if Path(folder, n).is_file() and not n.startswith("runtime-")]

    return lambda folder: shutil.copytree(place, folder, ignore=others, dirs_exist_ok=True)
