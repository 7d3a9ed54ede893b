"""Table I with estimator, 50 s through python-control: one fused Block against separate blocks in Python."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterator

import control
import numpy as np

from hovercontrol.blocks.backends.library import Library
from hovercontrol.blocks.backends.points import points
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts, phase_grid, phase_parameters

SOLVER = {"solve_ivp_method": "RK45", "solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-9}}


def systems() -> tuple[control.NonlinearIOSystem, control.InterconnectedSystem]:
    """Return the fused and the separate form of Table I's loop; both show the tracking error.

    The separate blocks stay in Python, as blocks written for python-control are.
    """
    parts = list(loop_parts(load_scenario("table1")).values())
    fused = interconnect(parts, "loop").to_control()
    for part in parts:
        points(part)._next = math.inf
    separate = control.interconnect(
        [p.to_control() for p in parts],
        inputs=[],
        outputs=["error_x", "error_y"],
        name="separate",
        warn_duplicate=False,
        check_unused=False,
    )
    return fused, separate


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    scenario = load_scenario("table1")
    fused, separate = systems()
    start = np.array([s.start for s in fused.block.states])
    order = [fused.state_labels.index(name.replace("_", ".", 1)) for name in separate.state_labels]
    native = interconnect(list(loop_parts(scenario).values()), "native").to_control()
    points(fused.block)._next = math.inf
    Library(native.block, "smooth")  # built, or in the cache
    points(native.block)._next = 0  # and loaded at the first evaluation
    times: dict[str, list[float]] = {"native": [], "fused": [], "separate": []}
    errors = {}
    for _ in range(5):
        for name, system, x in (
            ("native", native, start),
            ("fused", fused, start),
            ("separate", separate, start[order]),
        ):
            begin, ran, pieces = time.perf_counter(), 0.0, []
            for phase in scenario.phases:
                grid = phase_grid(ran, phase.until, 0.05)
                params = phase_parameters(scenario, phase)
                response = control.input_output_response(system, grid, 0, x, params=params, **SOLVER)
                shown = [response.output_labels.index(k) for k in ("error_x", "error_y")]
                pieces.append(response.outputs[shown])
                x, ran = response.states[:, -1], phase.until
            times[name].append(time.perf_counter() - begin)
            errors[name] = np.hstack(pieces)
    median = {name: statistics.median(t) for name, t in times.items()}
    ratio = median["separate"] / median["fused"]
    compiled = median["separate"] / median["native"]
    gap = max(float(np.abs(errors[name] - errors["separate"]).max()) for name in ("fused", "native"))
    yield "separate blocks, median of 5", f"{median['separate']:.2f} s", "", None
    yield "fused Block in Python, median of 5", f"{median['fused']:.2f} s", "", None
    yield "ratio", f"{ratio:.1f} times faster", ">= 1.5 times", ratio >= 1.5
    yield "fused Block, library loaded, median of 5", f"{median['native']:.2f} s", "", None
    yield "ratio", f"{compiled:.1f} times faster", ">= 4 times", compiled >= 4
    yield "largest difference of the tracking error", f"{gap:.1e} m", "< 1e-6 m", gap < 1e-6
