"""K06's real loop, a turn of 22 s with sensors, filters, links, actuators: compiled and by python-control."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator

import control
import numpy as np

from hovercontrol.control.autopilot import autopilot, seeds
from hovercontrol.control.controllers.k06 import turn

Row = tuple[str, str, str, bool | None]

#: Length of K06's turn trial [s] and its base tick.
LENGTH, TICK = 22.0, 0.001
RUNS = 1000


def rows() -> Iterator[Row]:
    begin = time.perf_counter()
    loop = autopilot(
        turn(k1=0.5, k2=3.5),
        references={"yaw_rate_ref": 3.0},
        start={"r": 0.1},
        navigation="magnetometer",
    )
    yield "derive the loop", f"{time.perf_counter() - begin:.1f} s", "", None
    begin = time.perf_counter()
    compiled = loop.compile()
    every = np.arange(round(LENGTH / TICK) + 1) * TICK
    coarse = every[::20]
    compiled.simulate(coarse[:2])
    yield "print and compile it", f"{time.perf_counter() - begin:.1f} s", "", None
    for method, options in (("dormand-prince", {}), ("rk4", {"method": "rk4", "step": 0.02})):
        spent = _fastest(lambda o=options: compiled.simulate(coarse, **o), 7)  # type: ignore[misc]
        yield f"22 s compiled, {method}", f"{1e3 * spent:.1f} ms", "at most 50 ms", spent <= 0.05
    system = loop.to_control(step=TICK)
    start = [s.start for s in loop.states]
    spent = _fastest(lambda: control.input_output_response(system, every, 0.0, start), 3)
    yield "22 s by python-control at 1 ms", f"{spent:.2f} s", "at most 1.5 s", spent <= 1.5
    begin = time.perf_counter()
    many = seeds(loop, RUNS)
    spread = compiled.sweep(coarse, params=many, method="rk4", step=0.02, start=8.0)["r"].rms.std()
    spent = time.perf_counter() - begin
    what = f"{RUNS} runs of other random numbers, {os.cpu_count()} cores"
    yield what, f"{spent:.1f} s", "at most 60 s on 2 cores", spent <= 60
    yield "  their yaw rate (rms) differs by", f"{spread:.4f} rad/s", "", None


def _fastest(run: Callable[[], object], times: int) -> float:
    spent = []
    for _ in range(times):
        begin = time.perf_counter()
        run()
        spent.append(time.perf_counter() - begin)
    return min(spent)
