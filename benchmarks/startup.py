"""Start-up: seconds on the clock, and of processor time, which counts on a busy machine; median of seven.

Also what an install without extras takes on disk, and a CSV file read with pyarrow and without it.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path

import numpy as np
import pyarrow.csv
from packaging.requirements import Requirement

from hovercontrol.logs import read_log

Row = tuple[str, str, str, bool | None]
#: What is started, and the seconds that it may take.
STARTED = {
    "import hovercontrol": (["-c", "import hovercontrol"], 0.05),
    "import hovercontrol, and a craft's plant": (
        ["-c", "import hovercontrol as hc; hc.vehicle('c17_simulation').plant()"],
        None,
    ),
    "hovercontrol --help": (["-m", "hovercontrol", "--help"], 0.25),
    "hovercontrol simulate --help": (["-m", "hovercontrol", "simulate", "--help"], None),
}


def spent(words: list[str]) -> tuple[float, float]:
    """Return seconds on the clock and of processor time of a Python process, medians of seven."""
    taken = []
    for _ in range(7):
        clock, before = time.perf_counter(), os.times()
        subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
        after = os.times()
        used = after.children_user + after.children_system - before.children_user - before.children_system
        taken.append((time.perf_counter() - clock, used))
    clocks, used_times = zip(*taken, strict=True)
    return statistics.median(clocks), statistics.median(used_times)


def rows() -> Iterator[Row]:
    for what, (words, most) in STARTED.items():
        clock, used = spent(words)
        wanted = f"<= {most:g} s of processor" if most else ""
        yield what, f"{clock:.2f} s, {used:.2f} s of processor", wanted, used <= most if most else None
    sizes = installed()
    largest = ", ".join(f"{name} {size:.0f}" for name, size in list(sizes.items())[:4])
    yield f"installed without extras: {len(sizes)} packages", f"{sum(sizes.values()):.0f} MB", largest, None
    for what, seconds in reading().items():
        yield f"200,000 rows of seven columns of CSV by {what}", f"{seconds:.2f} s of processor", "", None


def installed() -> dict[str, float]:
    """Return the size of each package of an install without extras [MB], the largest first."""
    sizes, left = dict[str, float](), ["hovercontrol"]
    while left:
        name = left.pop()
        if name in sizes:
            continue
        found = metadata.distribution(name)
        files = [Path(str(file.locate())) for file in found.files or ()]
        sizes[name] = sum(file.stat().st_size for file in files if file.exists()) / 1e6
        needed = [Requirement(line) for line in found.requires or ()]
        left += [r.name.lower() for r in needed if not r.marker or r.marker.evaluate({"extra": ""})]
    return dict(sorted(sizes.items(), key=lambda one: -one[1]))


def reading() -> dict[str, float]:
    """Return processor time of reading a CSV file [s], once all is imported."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "log.csv"
        table = np.random.default_rng(0).normal(size=(200_000, 7))
        table[:, 0] = 0.01 * np.arange(len(table))
        np.savetxt(file, table, "%.6f", ",", header="time,x,y,psi,u,v,r", comments="")
        works: dict[str, Callable[[], object]] = {
            "read_log": lambda: read_log(file, inputs=[]),
            "pyarrow": lambda: pyarrow.csv.read_csv(file),
            "numpy.loadtxt": lambda: np.loadtxt(file, delimiter=",", skiprows=1),
        }
        return {what: min(_spent(work) for _ in range(3)) for what, work in works.items()}


def _spent(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin
