"""Start-up: seconds on the clock, and of processor time, which counts on a busy machine; median of seven."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator

Row = tuple[str, str, str, bool | None]
#: What is started, and the seconds that it may take.
STARTED = {
    "import hovercontrol": (["-c", "import hovercontrol"], 0.5),
    "import hovercontrol, and a craft's plant": (
        ["-c", "import hovercontrol as hc; hc.vehicle('c17_simulation').plant()"],
        None,
    ),
    "hovercontrol --help": (["-m", "hovercontrol", "--help"], 0.4),
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
