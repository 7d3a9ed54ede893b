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
import hovercontrol as hc
drag = [f"{axis}_{kind}" for axis in ("surge", "sway", "yaw") for kind in ("coulomb", "linear_drag")]
craft = hc.vehicle("c17_simulation")
plant = craft.plant()
loop = hc.interconnect([
    plant, hc.tracking_controller(craft, adapt=drag), hc.kalman_bucy(plant), hc.ellipse(1.5, 2.5, rate=-1.0),
])
assert len(loop.states) == 83
loop.to_numpy().derivatives(0.0, [s.start for s in loop.states])
print(time.perf_counter() - start)
"""


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    times = []
    for _ in range(5):
        out = subprocess.run([sys.executable, "-c", CODE], check=True, capture_output=True, text=True)
        times.append(float(out.stdout))
    median = statistics.median(times)
    yield "import, wire, derive, evaluate; median of 5 processes", f"{median:.2f} s", "< 1.5 s", median < 1.5
