"""Compiled Blocks: Table I against python-control's separate blocks, and sweeps of 1,000 closed loops.

Times on one thread are processor time, so that they mean something on a machine that does other things too.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.fused import SOLVER, systems
from hovercontrol.blocks.backends.compiled import CompiledBlock, SweepResult, compile_block
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.documents.scenarios import Scenario, load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts, phase_grid, phase_parameters

RUNS = 1000


def table_one(simulate: Callable, scenario: Scenario, x: np.ndarray) -> list:
    """Run the phases of Table I by ``simulate(grid, x, params)``; return the responses."""
    responses, ran = [], 0.0
    for phase in scenario.phases:
        grid = phase_grid(ran, phase.until, 0.05)
        responses.append(simulate(grid, x, phase_parameters(scenario, phase)))
        x, ran = responses[-1].states[:, -1], phase.until
    return responses


def spent(work: Callable[[], object], times: int, clock: Callable[[], float] = time.process_time) -> float:
    """Return the median time of some calls [s]."""
    seconds = []
    for _ in range(times):
        begin = clock()
        work()
        seconds.append(clock() - begin)
    return statistics.median(seconds)


def least(works: list[Callable[[], object]], times: int) -> list[float]:
    """Return the least time of some calls of each [s]; the works take turns on a busy machine."""
    seconds = [[spent(work, 1) for work in works] for _ in range(times)]
    return [min(column) for column in zip(*seconds, strict=True)]


def errors(responses: list) -> np.ndarray:
    pieces = []
    for r in responses:
        pieces.append(r.outputs[[r.output_labels.index(name) for name in ("error_x", "error_y")]])
    return np.hstack(pieces)


def loop_without_estimator(scenario: Scenario) -> Block:
    parts = loop_parts(scenario)
    controller = tracking_controller(scenario.belief, control_point=0.2, k1=2.0, k2=2.0)
    return interconnect([parts["plant"], controller, parts["reference"]], "loop")


def sweep(compiled: CompiledBlock, **options: object) -> SweepResult:
    drag = np.linspace(0.5, 1.5, RUNS) * compiled.block.default_parameters["plant.yaw_linear_drag"]
    time_grid = np.linspace(0.0, 50.0, 501)
    return compiled.sweep(time_grid, params={"plant.yaw_linear_drag": drag}, **options)


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    import control

    scenario = load_scenario("table1")
    fused, separate = systems()
    start = np.array([s.start for s in fused.block.states])
    order = [fused.state_labels.index(name.replace("_", ".", 1)) for name in separate.state_labels]

    def by_blocks(grid: np.ndarray, x: np.ndarray, params: dict) -> object:
        return control.input_output_response(separate, grid, 0, x, params=params, **SOLVER)

    begin = time.perf_counter()
    compiled = compile_block(fused.block)
    ready = time.perf_counter() - begin
    smooth = compile_block(fused.block, friction="smooth")
    assert compiled.native

    def by_c(grid: np.ndarray, x: np.ndarray, params: dict) -> object:
        return compiled.simulate(grid, x0=x, params=params)

    slow = spent(lambda: table_one(by_blocks, scenario, start[order]), 3)
    fast = spent(lambda: table_one(by_c, scenario, start), 51)
    expected = errors(table_one(by_blocks, scenario, start[order]))
    found = errors(table_one(lambda g, x, p: smooth.simulate(g, x0=x, params=p), scenario, start))
    gap = float(np.abs(expected - found).max())
    yield "Block of 83 states to a loaded library, cache as it was", f"{ready:.2f} s", "", None
    yield "Table I with estimator, 50 s, compiled; median of 51", f"{1e3 * fast:.2f} ms", "", None
    yield "separate python-control blocks; median of 3", f"{slow:.2f} s", "", None
    yield "ratio", f"{slow / fast:.0f} times faster", ">= 400 times", slow / fast >= 400
    yield "largest difference of the tracking error", f"{gap:.1e} m", "< 1e-6 m", gap < 1e-6

    two = ["error_x", "error_y"]
    works = [
        lambda o=o: table_one(
            lambda g, x, p: compiled.simulate(g, x0=x, params=p, outputs=o), scenario, start
        )
        for o in (None, two, [])
    ]
    every, few, none = (1e3 * seconds for seconds in least(works, 51))
    yield (
        f"with {len(fused.block.outputs)} outputs, with 2, with none; least of 51",
        f"{every:.2f}, {few:.2f}, {none:.2f} ms",
        "",
        None,
    )

    for rtol in (1e-6, 1e-8, 1e-10, 1e-12):
        works = [
            lambda m=m, r=rtol: table_one(
                lambda g, x, p: compiled.simulate(g, x0=x, params=p, method=m, rtol=r, atol=1e-3 * r),
                scenario,
                start,
            )
            for m in ("dormand-prince", "dop853")
        ]
        five, eight = least(works, 15)
        yield (
            f"Table I at rtol {rtol:g}: dormand-prince, dop853, their ratio; least of 15",
            f"{1e3 * five:.2f}, {1e3 * eight:.2f} ms, {five / eight:.2f}",
            "",
            None,
        )

    function = smooth.point_function("derivatives")
    nothing = np.zeros(0)
    calls = spent(lambda: [function(0.1, start, nothing) for _ in range(10_000)], 5) / 10_000
    yield "one right-hand side from Python", f"{1e9 * calls:.0f} ns", "", None

    craft = compile_block(loop_without_estimator(scenario))
    one = spent(lambda: sweep(craft, threads=1), 3)
    both = [spent(lambda k=k: sweep(craft, threads=k), 3, time.perf_counter) for k in (1, 2)]
    craft.sweep([0.0, 0.1], method="rk4", step=1e-3)  # its library is built
    fixed = spent(lambda: sweep(craft, threads=1, method="rk4", step=1e-3), 1)
    yield f"{RUNS} closed loops of 50 s, rtol 1e-6, 1 thread", f"{one:.3f} s", "<= 0.5 s", one <= 0.5
    yield (
        "the same, 2 threads",
        f"{both[0] / both[1]:.2f} times faster",
        ">= 1.7 times",
        both[0] / both[1] >= 1.7,
    )
    yield "the same, Runge-Kutta at 1 ms, 1 thread", f"{fixed:.2f} s", "<= 5 s", fixed <= 5
    rate = 1e9 * fixed / (RUNS * 50_000 * 4)
    yield "one right-hand side in its lane, solver and all", f"{rate:.0f} ns", "", None
