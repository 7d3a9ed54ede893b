"""Files read in a process of their own, by libraries that some damaged files crash or stall.

A library in C or C++ can end Python or never return. Its script runs in a new interpreter that imports NumPy
and that library only. ``contents(file)`` of the script returns a value for JSON and arrays by name.
"""

from __future__ import annotations

import io
import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from hovercontrol.logs.readers.tables import missing_library

PATIENCE = 30.0
"""Time [s] for reading a file, and for each 10 MB of it."""

_CHILD = """
import os, runpy, sys
out = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)  # what the library prints
import json, numpy, types
about, arrays = runpy.run_path(sys.argv[1])["contents"](sys.argv[2])
out.write(json.dumps([about, list(arrays)]).encode() + b"\\n")
for values in arrays.values():
    numpy.save(types.SimpleNamespace(write=out.write), numpy.asarray(values), allow_pickle=False)
out.close()
"""


def read_apart(
    file: Path, script: ModuleType, module: str, what: str, package: str = ""
) -> tuple[Any, dict[str, Any]]:
    """Return what ``contents(file)`` of a script returns.

    Parameters
    ----------
    script : module
        Its file imports nothing of this package: that would take longer than most files.
    module, what, package : str
        The library, what it reads, and its name if the module has another: see :func:`.tables.library`.

    Raises
    ------
    InputError
        If the library is missing.
    ValueError
        If it fails, crashes, or does not end within `PATIENCE`.
    """
    if find_spec(module) is None:
        raise missing_library(file, package or module, what, "logs-all", f"no module named {module!r}")
    command = [sys.executable, "-P", "-W", "ignore", "-c", _CHILD, str(script.__file__), str(file)]
    patience = PATIENCE * (1.0 + file.stat().st_size / 1e7)
    try:
        done = subprocess.run(command, capture_output=True, timeout=patience, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"{package or module} did not end within {patience:.0f} s") from None
    if done.returncode < 0:
        raise ValueError(f"{package or module} was ended by signal {-done.returncode}")
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        raise ValueError(lines[-1] if lines else f"{package or module} ended with status {done.returncode}")
    stream = io.BytesIO(done.stdout)
    about, names = json.loads(stream.readline())
    return about, {name: np.load(stream, allow_pickle=False) for name in names}
