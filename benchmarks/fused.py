"""Table I with estimator, 50 s through python-control: one fused Block against separate blocks."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator

import control
import numpy as np

from hovercontrol.interconnect import interconnect
from hovercontrol.scenarios import load_scenario
from hovercontrol.scenarios.runner import loop_parts, phase_grid, phase_parameters

SOLVER = {"solve_ivp_method": "RK45", "solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-9}}


def systems() -> tuple[control.NonlinearIOSystem, control.InterconnectedSystem]:
    """Return the fused and the separate form of Table I's loop; both show the tracking error."""
    parts = list(loop_parts(load_scenario("table1")).values())
    fused = interconnect(parts, "loop").to_control()
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
    times: dict[str, list[float]] = {"fused": [], "separate": []}
    errors = {}
    for _ in range(3):
        for name, system, x in (("fused", fused, start), ("separate", separate, start[order])):
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
    gap = float(np.abs(errors["fused"] - errors["separate"]).max())
    yield "fused Block, median of 3", f"{median['fused']:.2f} s", "", None
    yield "separate blocks, median of 3", f"{median['separate']:.2f} s", "", None
    yield "ratio", f"{ratio:.1f} times faster", ">= 1.5 times", ratio >= 1.5
    yield "largest difference of the tracking error", f"{gap:.1e} m", "< 1e-6 m", gap < 1e-6
