"""Libraries that some damaged files crash or stall, run in a process of their own.

A library in C or C++ can end Python or never return. Its script runs in a new interpreter that imports NumPy
and that library only. A function of the script returns a value for JSON, and arrays by name.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import weakref
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from hovercontrol.logs.readers.tables import missing_library

PATIENCE = 30.0
"""Time [s] for reading a file, and for each 10 MB of it."""

_CHILD = """
import os, sys
out = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)  # what the library prints
import json, numpy, runpy, types
functions = runpy.run_path(sys.argv[1])
for line in sys.stdin:
    name, *given = json.loads(line)
    try:
        about, arrays = functions[name](*given)
        answer = [about, list(arrays)]
    except Exception as error:
        answer, arrays = [f"{type(error).__name__}: {error}"], {}
    out.write(json.dumps(answer).encode() + b"\\n")
    for values in arrays.values():
        numpy.save(types.SimpleNamespace(write=out.write), numpy.asarray(values), allow_pickle=False)
    out.flush()
"""


class Apart:
    """A script in a process of its own, for one file.

    Parameters
    ----------
    file : Path
    script : module
        Its file imports nothing of this package: that would take longer than most files.
    module, what, extra, package : str
        The library, what it reads, the extra with it, and its name: see :func:`.tables.library`.

    Raises
    ------
    InputError
        If the library is missing.
    """

    def __init__(
        self,
        file: Path,
        script: ModuleType,
        module: str,
        what: str,
        extra: str = "logs-all",
        package: str = "",
    ) -> None:
        self._name = package or module
        if find_spec(module) is None:
            raise missing_library(file, self._name, what, extra, f"no module named {module!r}")
        self._patience = PATIENCE * (1.0 + file.stat().st_size / 1e7)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-W", "ignore", "-c", _CHILD, str(script.__file__)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        weakref.finalize(self, _end, self._process)

    def call(self, function: str, *given: Any) -> tuple[Any, dict[str, Any]]:
        """Return what a function of the script returns for arguments that JSON has.

        Raises
        ------
        ValueError
            If it fails, crashes, or does not end within `PATIENCE`.
        """
        to, back = self._process.stdin, self._process.stdout
        assert to and back
        watch = threading.Timer(self._patience, self._process.kill)
        watch.start()
        try:
            to.write(json.dumps([function, *given]).encode() + b"\n")
            to.flush()
            answer = json.loads(back.readline())
            if len(answer) == 2:
                about, names = answer
                pipe = SimpleNamespace(read=back.read)
                return about, {n: np.lib.format.read_array(pipe, allow_pickle=False) for n in names}
        except (OSError, ValueError):
            raise ValueError(self._ended(late=not watch.is_alive())) from None
        finally:
            watch.cancel()
        raise ValueError(answer[0])

    def _ended(self, *, late: bool) -> str:
        _end(self._process)
        code = self._process.returncode
        if late:
            return f"{self._name} did not end within {self._patience:.0f} s"
        return f"{self._name} was ended by signal {-code}" if code < 0 else f"{self._name} ended with {code}"


def _end(process: subprocess.Popen[bytes]) -> None:
    for stream in (process.stdin, process.stdout):
        if stream:
            stream.close()
    try:
        process.wait(1.0)  # its input has ended
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
