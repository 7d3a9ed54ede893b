"""A log of 10^7 rows (CSV, 450 MB, made on the spot): ``identify`` and ``check`` from file to result."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hovercontrol.documents.samples import sample_path
from hovercontrol.logs import Log, read_log

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
        fitted, checked = (run(command, path) for command in ("identify", "check"))
    for name, (status, spent, peak) in (("identify", fitted), ("check", checked)):
        yield f"{name}, exit status", str(status), "0", status == 0
        yield f"{name}, time", f"{spent:.0f} s", "", None
        yield f"{name}, peak memory", f"{peak:.2f} GiB", "< 2 GiB", peak < 2.0
    yield "check over identify, time", f"{checked[1] / fitted[1]:.2f}", "<= 1", checked[1] <= fitted[1]
    same = checked[2] <= 1.05 * fitted[2]  # it imports more, 20 MB
    yield "check over identify, memory", f"{checked[2] / fitted[2]:.2f}", "<= 1.05", same


def run(name: str, log: Path) -> tuple[int, float, float]:
    """Return exit status, time [s] and peak memory [GiB] of a command on a log."""
    command = [sys.executable, "-m", "hovercontrol.app.cli", name, str(log), "--vehicle", "c17_experiment"]
    command += ["--out", str(log.parent / name)]
    quiet = [(os.POSIX_SPAWN_OPEN, n, os.devnull, os.O_WRONLY, 0) for n in (1, 2)]
    begin = time.perf_counter()
    pid = os.posix_spawn(sys.executable, command, dict(os.environ), file_actions=quiet)
    _, status, used = os.wait4(pid, 0)
    return os.waitstatus_to_exitcode(status), time.perf_counter() - begin, used.ru_maxrss / 2**20
