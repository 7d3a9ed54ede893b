"""Deriving the whole closed loop with estimator (83 states) from cold, SymPy's import aside."""

from __future__ import annotations

import statistics
import subprocess
import sys
from collections.abc import Iterator

CODE = """
import time
import sympy
start = time.perf_counter()
from hovercontrol.interconnect import interconnect
from hovercontrol.scenarios.definition import load_scenario
from hovercontrol.scenarios.runner import loop_parts
loop = interconnect(list(loop_parts(load_scenario("table1")).values()), "loop")
imported = time.perf_counter()
loop.to_numpy().scalar_pair("derivatives")
print(time.perf_counter() - start)
"""


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    times = []
    for _ in range(5):
        out = subprocess.run([sys.executable, "-c", CODE], check=True, capture_output=True, text=True)
        times.append(float(out.stdout))
    median = statistics.median(times)
    yield "wire, derive and print as NumPy, median of 5 processes", f"{median:.2f} s", "< 1.5 s", median < 1.5
