"""A Runge-Kutta sweep in the processor's vectors gives what its runs give one by one, to rounding."""

import platform
import shutil
import subprocess

import numpy as np
import pytest
import sympy as sp

from hovercontrol import Block, Signal, interconnect, time, tracking_controller, waypoints
from hovercontrol.blocks.backends.c_lanes import lanes_source
from hovercontrol.blocks.backends.compiled import compile_block
from hovercontrol.blocks.backends.runtime import runtime_folder
from hovercontrol.blocks.backends.sweep import FIGURES
from hovercontrol.blocks.sgn import sgn
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
SCENARIO = load_scenario("table1")
PARTS = loop_parts(SCENARIO)
RUNS = 19  # two packs of eight lanes and three of the next
GRID = np.linspace(0.0, 6.0, 61)
STEP = 2e-3


def loop():
    controller = tracking_controller(SCENARIO.belief, control_point=0.2, k1=2.0, k2=2.0)
    return interconnect([PARTS["plant"], controller, PARTS["reference"]], "loop")


def rubbing():
    """Two masses with springs and dry friction, driven: they stick, break away, slip and stick again."""
    x, v, y, w = (Signal(n, unit) for n, unit in (("x", "m"), ("v", "m/s"), ("y", "m"), ("w", "m/s")))
    push = Signal("push", "m/s^2")
    mu = Signal("mu", "m/s^2", start=0.5, lower=0.0)
    width = Signal("width", "m/s", start=1e-3, lower=0.0)
    unit = Signal("unit", "1/s", start=1.0).symbol
    spring = unit**2 * (x.symbol - y.symbol)
    accelerations = {
        "v": push.symbol * sp.sin(2 * unit * time) - spring - mu.symbol * sgn(v.symbol, width.symbol),
        "w": spring - unit**2 * y.symbol - mu.symbol * sgn(w.symbol, width.symbol),
    }
    return Block(
        "rubbing",
        [x, v, y, w],
        [push],
        [x, v, y, w],
        [mu, width, Signal("unit", "1/s", start=1.0)],
        {"x": v.symbol, "y": w.symbol, **accelerations},
    )


def functions():
    """All functions that the lanes compute by vectors, and conditions, over one another."""
    x, a, rate = Signal("x", start=0.3), Signal("a", start=1.0), Signal("rate", "1/s", start=1.0)
    s, k, r = x.symbol, a.symbol, rate.symbol
    terms = [
        sp.sin(3 * s), sp.cos(s), sp.tan(s / 9), sp.asin(sp.tanh(s)), sp.acos(sp.tanh(s)), sp.atan(s),
        sp.exp(-(s**2)), sp.log(1 + s**2), sp.sinh(s / 5), sp.cosh(s / 5), sp.atan2(s, k), sp.sqrt(1 + s**2),
        (1 + s**2) ** sp.Float(0.3), sp.Max(s, k, 0.1), sp.Min(s, k), sp.Abs(s), sp.sign(s - k),
        sp.floor(3 * s), sp.Mod(s, k), sp.Heaviside(s - k),
        sp.Piecewise((sp.sin(s), s > k), (sp.sqrt(1 + s**2), s > 0), (s, True)),
    ]  # fmt: skip
    push = sum((sp.cos(j + r * time) * term for j, term in enumerate(terms)), sp.S.Zero) / 10
    block = Block("functions", [x], [], [x], [a, rate], {"x": r * (push - s / 2)})
    return block, {"functions.a": np.linspace(0.4, 2.0, RUNS)}


def one_by_one(ready, runs, inputs=None, step=STEP, grid=GRID):
    """Return final states and outputs of single simulations."""
    for params, x0 in runs:
        r = ready.simulate(grid, inputs, x0, params, method="rk4", step=step)
        yield r.states[:, -1], np.atleast_2d(r.outputs)


def check(block, params, x0=None, inputs=None, rtol=1e-9, **options):
    ready = compile_block(block, friction="events")
    result = ready.sweep(GRID, params=params, x0=x0, inputs=inputs, method="rk4", step=STEP, **options)
    assert not result.status.any()
    names = [s.name for s in block.states]
    runs = [
        ({k: v[i] for k, v in params.items()}, {n: v[i] for n, v in (x0 or {}).items()}) for i in range(RUNS)
    ]
    for k, (last, outputs) in enumerate(one_by_one(ready, runs, inputs)):
        np.testing.assert_allclose(result.states_final[k], last, rtol=rtol, atol=rtol, err_msg=str(names))
        np.testing.assert_allclose(result.maximum[k], outputs.max(axis=1), rtol=rtol, atol=rtol)
        np.testing.assert_allclose(result.minimum[k], outputs.min(axis=1), rtol=rtol, atol=rtol)
    return result


def test_here_the_lanes_are_at_work():
    glibc, version = platform.libc_ver()
    if platform.machine() != "x86_64" or glibc != "glibc" or tuple(map(int, version.split("."))) < (2, 35):
        pytest.skip("vectors are used with gcc and glibc 2.35 or later on x86_64")
    assert compile_block(loop(), friction="events")._engine_from(np.zeros(6), lanes=True).lanes == 8


VECTORS = ["-fopenmp-simd", "-DHC_SIMD", "-mavx2", "-fno-trapping-math"]


@pytest.mark.slow("smooth")
@pytest.mark.parametrize(
    "flags", [[], VECTORS, [*VECTORS, "-DHC_FMA"], [*VECTORS, "-DHC_FMA", "-DHC_AVX512"]]
)
@pytest.mark.parametrize("friction", ["events", "smooth"])
def test_strict_warnings_find_nothing(tmp_path, flags, friction):
    if "-mavx2" in flags and platform.machine() != "x86_64":
        pytest.skip("vectors are used on x86_64")
    sources = [runtime_folder() / "hc_lanes.c"]
    for block in (loop(), rubbing(), functions()[0]):
        sources.append(tmp_path / f"{block.name}.c")
        sources[-1].write_text(lanes_source(block, friction=friction))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Werror", "-pedantic", "-O3"]
    command = [shutil.which("cc"), *strict, *flags, f"-I{sources[0].parent}", "-c", *sources]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_closed_loop():
    drag = np.linspace(0.5, 1.5, RUNS) * loop().default_parameters["plant.yaw_linear_drag"]
    check(loop(), {"plant.yaw_linear_drag": drag}, {"plant.x": np.linspace(-1, 1, RUNS)})


def test_masses_that_stick_and_slip():
    mu = np.concatenate([[0.0], np.linspace(0.05, 1.2, RUNS - 1)])
    result = check(rubbing(), {"rubbing.mu": mu}, {"w": np.linspace(-1, 1, RUNS)}, {"push": 1.0}, rtol=1e-8)
    at_rest = result.states_final[:, 1] == 0.0
    assert at_rest.any()
    assert not at_rest.all()


def test_masses_at_rest_that_nothing_moves():
    mu, x = np.full(RUNS, 2.0), np.linspace(-1, 1, RUNS)
    result = check(rubbing(), {"rubbing.mu": mu}, {"x": x}, {"push": 0.5})
    assert not result.states_final[:, [1, 3]].any()


def test_inputs_that_jump():
    push = np.where(GRID < 2, 1.0, np.where(GRID < 4.05, -2.0, 0.0))
    check(rubbing(), {"rubbing.mu": np.linspace(0.1, 0.9, RUNS)}, None, {"push": push}, rtol=1e-8)


def test_functions_and_conditions():
    check(*functions(), x0={"x": np.linspace(-2, 2, RUNS)})


def test_switches_by_the_clock():
    corner = waypoints([[0, 0], [1, 2], [3, 1]], [0.0, 1.00037, 2.5])
    x = Signal("x", "m")
    lag = Block("lag", [x], [Signal("x_ref", "m")], [x], [Signal("k", "1/s", start=2.0)], {
        "x": Signal("k").symbol * (Signal("x_ref").symbol - x.symbol)
    })  # fmt: skip
    both = interconnect([corner, lag], "both")
    check(both, {"lag.k": np.linspace(0.5, 4.0, RUNS)})


def test_a_run_that_fails_leaves_the_lanes_beside_it_alone():
    v, c = Signal("v", start=1.0), Signal("c", "1/s")
    block = Block("blow_up", [v], [], [v], [c], {"v": c.symbol * v.symbol**2})
    c = np.linspace(-1.0, 0.1, RUNS)
    bad = c.copy()
    bad[[3, 11]] = 1.0, 0.5
    ready = compile_block(block)
    options = {"method": "rk4", "step": STEP}
    alone = ready.sweep(GRID, params={"blow_up.c": c}, **options)
    result = ready.sweep(GRID, params={"blow_up.c": bad}, **options)
    assert [f.run for f in result.failures] == [3, 11]
    good = result.status == 0
    np.testing.assert_array_equal(result.final[good], alone.final[good])
    for run in (3, 11):
        assert np.isfinite(result.states_final[run]).all()


def test_a_run_gives_the_same_bits_in_every_lane_and_every_thread():
    drag = np.full(40, 0.7)
    drag[::7] = np.linspace(0.4, 1.0, 6)
    options = {"method": "rk4", "step": STEP}
    ready = compile_block(loop(), friction="events")
    one, many = (
        ready.sweep(GRID, params={"plant.yaw_linear_drag": drag}, threads=k, **options) for k in (1, 5)
    )
    for name in (*FIGURES, "states_final"):
        every = getattr(one, name)
        assert every.tobytes() == getattr(many, name).tobytes()
        assert (every[drag == 0.7] == every[1]).all()


def test_a_grid_as_fine_as_the_steps_changes_nothing():
    ready = compile_block(loop(), friction="events")
    drag = {"plant.yaw_linear_drag": np.linspace(0.4, 1.0, RUNS)}
    options = {"params": drag, "method": "rk4", "step": STEP}
    coarse, fine = (ready.sweep(np.linspace(0, 2, n), **options) for n in (11, 1001))
    np.testing.assert_allclose(coarse.states_final, fine.states_final, rtol=1e-10, atol=1e-10)
