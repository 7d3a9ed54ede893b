"""A compiled Block computes what NumPy computes, sweeps are single simulations, and bad input is refused."""

import os
import pickle
import shutil
import subprocess
import sys
import threading
import warnings

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
import sympy as sp

from hovercontrol import Block, InputError, Signal, interconnect, time, tracking_controller, vehicle
from hovercontrol.blocks.backends import engines
from hovercontrol.blocks.backends.compiled import CompiledBlock, compile_block
from hovercontrol.blocks.backends.sweep import FIGURES
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts
from tests.blocks.backends import designed

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
SCENARIO = load_scenario("table1")
PARTS = loop_parts(SCENARIO)
WITHOUT_ESTIMATOR = interconnect(
    [
        PARTS["plant"],
        tracking_controller(SCENARIO.belief, control_point=0.2, k1=2.0, k2=2.0),
        PARTS["reference"],
    ],
    "loop",
)
BLOCKS = {**PARTS, "loop": interconnect(list(PARTS.values()), "loop")}
V, A = Signal("v", "m/s"), Signal("a", "m/s^2")
CART = Block("cart", [V], [A], [V, A], derivatives={"v": A.symbol})
K = Signal("k", "1/s", start=2.0, lower=0.0)
DECAY = Block("decay", [V.replace(start=1.0)], [], [V], [K], {"v": -K.symbol * V.symbol})
BLOW_UP = Block(
    "blow_up",
    [V.replace(start=1.0)],
    [],
    [V],
    [Signal("c", "1/m")],
    {"v": Signal("c", "1/m").symbol * V.symbol**2},
)
GRID = np.linspace(0.0, 5.0, 101)
TIGHT = {"rtol": 1e-9, "atol": 1e-11}
DRAG = "plant.yaw_linear_drag"


def test_a_single_step_takes_whole_numbers_for_times():
    """advance(0, 1) once gave the machine code the bits of integers for seconds, and went nowhere."""
    assert DECAY.compile().advance(0, 1, [1.0]) == pytest.approx([np.exp(-2.0)], rel=1e-5)


@pytest.fixture
def no_compiler(monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    engines.engine_of.cache_clear()
    engines._warn_once.cache_clear()
    yield
    engines.engine_of.cache_clear()


def swept(runs=12, **options):
    loop = compile_block(WITHOUT_ESTIMATOR)
    drag = np.linspace(0.6, 1.4, runs) * WITHOUT_ESTIMATOR.default_parameters[DRAG]
    x = np.linspace(-0.5, 0.5, runs)
    return loop.sweep(GRID, params={DRAG: drag, "controller.k1": 3.0}, x0={"plant.x": x}, **options)


# ---- one point, one simulation ---------------------------------------------------------------------------


@pytest.mark.slow("estimator", "loop", "monitor", "minimum_time")
@needs_cc
@pytest.mark.parametrize("name", [*BLOCKS, *designed.MAKERS])
def test_at_a_point_it_is_numpy(name, rng):
    block = BLOCKS[name] if name in BLOCKS else designed.designed(name)
    ready, functions = compile_block(block), block.to_numpy()
    for _ in range(10):
        t, x, u = rng.uniform(0, 3), rng.normal(size=len(block.states)), rng.normal(size=len(block.inputs))
        x = x if name in BLOCKS else designed.near_start(block, rng)
        params = {k: v * rng.uniform(0.9, 1.1) for k, v in block.default_parameters.items()}
        for rows in ("derivatives", "outputs"):
            expected = getattr(functions, rows)(t, x, u, params)
            np.testing.assert_allclose(getattr(ready, rows)(t, x, u, params), expected, 1e-12, 1e-12)


@needs_cc
def test_many_threads_may_ask_for_derivatives_at_once(rng):
    ready, points = compile_block(BLOCKS["plant"]), rng.normal(size=(4, 6))
    point = ready.point_function("derivatives")
    expected = [point(0.0, x, [1.0, 0.1]) for x in points]
    wrong = []

    def ask(k):
        for _ in range(2000):
            if not np.array_equal(point(0.0, points[k], [1.0, 0.1]), expected[k]):
                wrong.append(k)

    threads = [threading.Thread(target=ask, args=(k,)) for k in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert not wrong


@needs_cc
@pytest.mark.parametrize("method", ["dormand-prince", "dop853"])
@pytest.mark.parametrize("name", ["plant", "loop"])
def test_a_simulation_is_that_of_numpy(name, method):
    block = BLOCKS[name]
    u = {"thrust": np.where(GRID < 2, 1.0, 0.3), "rudder": 0.1} if block.inputs else None
    exact = simulate(block, GRID, u, method="DOP853", **TIGHT)
    response = compile_block(block, friction="smooth").simulate(GRID, u, method=method, **TIGHT)
    np.testing.assert_allclose(response.states, exact.states, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(response.outputs, exact.outputs, rtol=1e-6, atol=2e-6)
    np.testing.assert_array_equal(response.inputs, exact.inputs)
    for labels in ("output_labels", "state_labels", "input_labels", "sysname", "issiso"):
        assert getattr(response, labels) == getattr(exact, labels)
    assert list(response.to_pandas().columns) == list(exact.to_pandas().columns)


@needs_cc
def test_a_craft_that_coasts_stops_and_stays():
    plant = vehicle("c17_simulation").plant().with_values({"u": 0.5})
    speed = {
        kind: compile_block(plant, friction=kind).simulate(GRID).states[3] for kind in ("events", "smooth")
    }
    assert speed["events"][-1] == 0.0
    assert 0.0 < speed["smooth"][-1] < 1e-3  # it creeps


@needs_cc
@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 0.01}])
def test_a_step_on_a_coarse_grid_stays_a_step(options):
    v = compile_block(CART).simulate([0, 1, 2, 3], {"a": [0, 0, 1, 1]}, **options).states[0]
    assert v == pytest.approx([0, 0, 0, 1], abs=1e-9)


@needs_cc
def test_runge_kutta_gains_four_digits_for_ten_times_the_steps():
    ready = compile_block(DECAY)
    gap = [ready.simulate([0, 1], method="rk4", step=h).outputs[0, -1] - np.exp(-2) for h in (0.1, 0.01)]
    assert 3.8 < np.log10(gap[0] / gap[1]) < 4.2


@needs_cc
def test_a_pulse_by_the_clock_is_not_stepped_over():
    push, on, off = A.replace(start=1.0), Signal("on", "s", start=700.0), Signal("off", "s", start=701.0)
    shape = sp.Piecewise((0, time < on.symbol), (1, time < off.symbol), (0, True))
    pulse = Block("pulse", [V], [], [V], [push, on, off], {"v": push.symbol * shape})
    ready = compile_block(pulse)
    assert ready.simulate([0, 1000]).states[0, -1] == pytest.approx(1.0, abs=1e-4)
    swept = ready.sweep([0, 1000], params={"pulse.on": [700.0, 700.8]})
    assert swept["v"].final == pytest.approx([1.0, 0.2], abs=1e-4)


@needs_cc
def test_a_block_without_states_is_its_outputs():
    response = compile_block(BLOCKS["reference"]).simulate(GRID)
    np.testing.assert_allclose(response.outputs, simulate(BLOCKS["reference"], GRID).outputs, 1e-12, 1e-12)


@needs_cc
def test_a_simulation_that_fails_names_the_time_it_reached():
    ready = compile_block(BLOW_UP)
    with pytest.raises(InputError, match=r"block 'blow_up': the simulation stops at t = (1|0\.999\d*) s: "):
        ready.simulate([0, 2], params={"blow_up.c": 1.0})


@needs_cc
def test_it_is_pickled_as_its_block():
    again = pickle.loads(pickle.dumps(CompiledBlock(DECAY, "smooth")))
    assert (again.block, again.friction, again.native) == (DECAY, "smooth", True)


# ---- sweeps ----------------------------------------------------------------------------------------------


@needs_cc
@pytest.mark.parametrize("start", [-np.inf, 1.0, 1.02, 5.0])
def test_a_sweep_is_single_simulations(start):
    result = swept(start=start, band={"error_x": 0.1})
    assert len(result) == 12
    assert not result.status.any()
    ready = compile_block(WITHOUT_ESTIMATOR)
    for k in (0, 5, 11):
        params = {DRAG: result.parameters[DRAG][k], "controller.k1": 3.0}
        r = ready.simulate(GRID, x0={"plant.x": result.x0["plant.x"][k]}, params=params)
        rows = start <= GRID
        t, y = GRID[rows], r.outputs[:, rows]
        np.testing.assert_array_equal(result.states_final[k], r.states[:, -1])
        np.testing.assert_array_equal(result.final[k], y[:, -1])
        np.testing.assert_array_equal(result.maximum[k], y.max(axis=1))
        np.testing.assert_array_equal(result.minimum[k], y.min(axis=1))
        mean = np.trapezoid(y**2, t) / (t[-1] - t[0]) if len(t) > 1 else y[:, 0] ** 2
        np.testing.assert_allclose(result.rms[k], np.sqrt(mean), rtol=1e-12)
        column = r.output_labels.index("error_x")
        away = np.flatnonzero(np.abs(y[column] - y[column, -1]) > 0.1)
        assert result["error_x"].settling[k] == (t[away[-1] + 1] if away.size else t[0])


@needs_cc
def test_results_do_not_depend_on_the_number_of_threads():
    one, two, many = swept(600, threads=1), swept(600, threads=2), swept(600, threads=7)
    for other in (two, many):
        for name in (*FIGURES, "states_final"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


@needs_cc
def test_a_run_that_fails_is_reported_and_the_others_finish():
    c = np.array([0.0, 1.0, 0.1])
    result = compile_block(BLOW_UP).sweep([0, 1, 2], params={"blow_up.c": c})
    (failure,) = result.failures
    assert (failure.run, failure.values) == (1, {"blow_up.c": 1.0})
    assert str(failure).startswith("run 1: ")
    assert np.isnan(result["v"].rms[1])
    assert result["v"].final[[0, 2]] == pytest.approx([1.0, 1.25], rel=1e-5)


@needs_cc
def test_initial_states_come_by_name_as_rows_or_as_one_row():
    ready = compile_block(DECAY)
    by_name = ready.sweep([0, 1], x0={"v": [1.0, 2.0]})
    by_row = ready.sweep([0, 1], x0=[[1.0], [2.0]])
    np.testing.assert_array_equal(by_name.final, by_row.final)
    assert len(ready.sweep([0, 1], x0=[3.0], params={"decay.k": [1.0, 2.0]})) == 2
    assert len(ready.sweep([0, 1])) == 1


@needs_cc
def test_inputs_of_a_sweep_are_steps_as_well():
    result = compile_block(CART).sweep([0, 1, 2, 3], inputs={"a": [0, 0, 1, 1]}, x0={"v": [0.0, 1.0]})
    assert result["v"].final == pytest.approx([1.0, 2.0])


@needs_cc
def test_progress_counts_the_runs_to_the_last():
    seen = []
    swept(40, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 40


@needs_cc
def test_a_sweep_that_is_stopped_stops():
    def stop(done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        swept(600, progress=stop)


@needs_cc
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_sweep_is_tabled_and_saved(tmp_path, suffix):
    result = compile_block(DECAY).sweep([0, 1], params={"decay.k": [1.0, 2.0]}, x0={"v": 2.0})
    table = result.to_table()
    assert table.column_names[:4] == ["run", "decay.k", "v.start", "status"]
    assert table["v.final"].to_pylist() == result["v"].final.tolist()
    path = result.save(tmp_path / f"sweep.{suffix}")
    read = pyarrow.csv.read_csv if suffix == "csv" else pyarrow.parquet.read_table
    assert read(path).column_names == table.column_names
    with pytest.raises(InputError, match=r"\.csv or \.parquet"):
        result.save(tmp_path / "sweep.xlsx")
    with pytest.raises(InputError, match="unknown output 'w'"):
        result["w"]


# ---- bad input -------------------------------------------------------------------------------------------


@needs_cc
@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"params": {"decay.kk": [1.0]}}, r"unknown parameter 'decay.kk'; did you mean 'decay.k'\?"),
        ({"params": {"decay.k": [1.0, -1.0]}}, r"decay.k = -1 1/s is out of its bounds \[0, inf\] \(run 1\)"),
        ({"params": {"decay.k": [1.0, np.nan]}}, r"decay.k: expected a number, found nan \(run 1\)"),
        ({"params": {"decay.k": "fast"}}, r"params\['decay.k'\]: expected numbers, found 'fast'"),
        (
            {"params": {"decay.k": [1.0, 2.0]}, "x0": {"v": [1.0, 2.0, 3.0]}},
            r"'decay.k' has shape \(2,\), 'v' has \(3,\)",
        ),
        ({"x0": {"w": 1.0}}, "unknown state 'w'"),
        ({"x0": [[1.0, 2.0]]}, r"x0 must have 1 columns.*found shape \(1, 2\)"),
        ({"band": {"w": 1.0}}, "band: unknown output 'w'"),
        ({"band": -1.0}, "band of 'v' must not be negative"),
        ({"start": 2.0}, "start = 2 s is after the last time, 1 s"),
        ({"threads": 0}, "threads must be 1 or more"),
        ({"method": "rk"}, "method: expected .*; did you mean 'rk4'"),
        ({"method": "rk4"}, "'rk4' needs a step"),
        ({"method": "rk4", "step": -1.0}, "step must be positive"),
        ({"rtol": 0.0}, "rtol must be positive"),
    ],
)
def test_a_sweep_that_cannot_be_is_refused(options, line):
    with pytest.raises(InputError, match=line):
        compile_block(DECAY).sweep([0.0, 1.0], **options)


@needs_cc
def test_a_simulation_that_cannot_be_is_refused():
    ready = compile_block(CART)
    with pytest.raises(InputError, match=r"hold must be 'zero'.*hovercontrol\.simulate"):
        ready.simulate([0, 1], hold="linear")
    with pytest.raises(InputError, match="must be two or more"):
        ready.simulate([1, 0])
    with pytest.raises(InputError, match="expected 1 states and 1 inputs"):
        ready.derivatives(0.0, [1.0, 2.0], [0.0])
    with pytest.raises(InputError, match="friction must be"):
        compile_block(CART, friction="none")


# ---- other processes, no compiler ------------------------------------------------------------------------


@pytest.mark.slow
@needs_cc
def test_two_processes_compile_at_once_into_an_empty_cache(tmp_path):
    code = (
        "from hovercontrol import vehicle\n"
        "from hovercontrol.blocks.backends.compiled import compile_block\n"
        "ready = compile_block(vehicle('c17_simulation').plant())\n"
        "print(ready.native, ready.simulate([0, 1], [1.0, 0.1]).states[:, -1].tobytes().hex())\n"
    )
    environment = os.environ | {"HOVERCONTROL_CACHE": str(tmp_path)}
    call = {"env": environment, "stdout": subprocess.PIPE, "text": True}
    running = [subprocess.Popen([sys.executable, "-c", code], **call) for _ in range(2)]
    (one, _), (two, _) = (p.communicate() for p in running)
    assert one == two
    assert one.startswith("True ")
    kinds = sorted(path.suffix for path in (tmp_path / "compiled").rglob("*") if path.is_file())
    assert kinds == [".c", ".o", ".so"]  # the runtime that all share; nothing twice, nothing temporary


def test_without_a_compiler_numpy_does_the_work_and_one_warning_says_so(no_compiler):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ready = compile_block(DECAY)
        compile_block(CART)
    (warning,) = caught
    assert "'/nowhere/cc', does not run: compiled Blocks run on NumPy" in str(warning.message)
    assert not ready.native
    assert ready.derivatives(0.0, [2.0]).tolist() == [-4.0]
    assert ready.simulate([0, 1]).outputs[0, -1] == pytest.approx(np.exp(-2), rel=1e-5)
    assert ready.simulate([0, 1], method="rk4", step=0.01).outputs[0, -1] == pytest.approx(np.exp(-2))
    exact = ready.simulate([0, 1], method="dop853", rtol=1e-11, atol=1e-13).outputs[0, -1]
    assert exact == pytest.approx(np.exp(-2), rel=1e-11)


@needs_cc
def test_without_a_compiler_a_sweep_gives_the_same_figures(no_compiler, monkeypatch):
    options = {
        "params": {"decay.k": np.array([0.5, 1.0, 2.0])},
        "x0": {"v": [1.0, 1.0, 2.0]},
        "start": 1.0,
        "method": "rk4",
        "step": 0.05,
    }
    with pytest.warns(UserWarning, match="NumPy"):
        slow = compile_block(DECAY).sweep(GRID, **options)
    monkeypatch.delenv("CC")
    engines.engine_of.cache_clear()
    fast = compile_block(DECAY).sweep(GRID, **options)
    for name in FIGURES:
        np.testing.assert_allclose(getattr(slow, name), getattr(fast, name), rtol=1e-9, atol=1e-12)


def test_without_a_compiler_a_failed_run_is_reported_too(no_compiler):
    with pytest.warns(UserWarning, match="NumPy"):
        ready = compile_block(BLOW_UP)
    result = ready.sweep([0, 1, 2], params={"blow_up.c": [0.1, np.inf]})
    assert [f.run for f in result.failures] == [1]
