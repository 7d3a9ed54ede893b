"""A log of 10^7 rows (CSV, 450 MB, made on the spot): ``hovercontrol identify`` from file to result."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hovercontrol.logs import Log, read_log
from hovercontrol.samples import sample_path

ROWS = 10_000_000


def make(path: Path) -> None:
    """Write the sample log end to end until there are enough rows."""
    sample = read_log(sample_path())
    times = ROWS // len(sample) + 1
    columns = {name: np.tile(values, times)[:ROWS] for name, values in sample.columns.items()}
    Log("large", 0.02 * np.arange(ROWS), columns).save(path)


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.csv"
        child = os.fork()  # so that what making the file takes does not count
        if child == 0:
            make(path)
            os._exit(0)
        os.waitpid(child, 0)
        begin = time.perf_counter()
        command = [sys.executable, "-m", "hovercontrol.cli", "identify", str(path), "--out", f"{folder}/out"]
        quiet = [(os.POSIX_SPAWN_OPEN, n, os.devnull, os.O_WRONLY, 0) for n in (1, 2)]
        pid = os.posix_spawn(sys.executable, command, dict(os.environ), file_actions=quiet)
        _, status, used = os.wait4(pid, 0)
        spent, peak = time.perf_counter() - begin, used.ru_maxrss / 2**20
    yield "identify, exit status", str(os.waitstatus_to_exitcode(status)), "0", status == 0
    yield "identify, time", f"{spent:.0f} s", "", None
    yield "identify, peak memory", f"{peak:.2f} GiB", "< 2 GiB", peak < 2.0
