"""Sweeps on executors are those of one machine to the bit; a part that fails or is lost costs no other."""

import math
import os
import shutil
import socket
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pyarrow.parquet
import pytest

from hovercontrol import Block, InputError, Signal
from hovercontrol.blocks.backends.executors import cluster, sweep_on
from hovercontrol.blocks.backends.sweep import FIGURES
from hovercontrol.control.analysis.loops import tracking_loop
from hovercontrol.craft.models.vehicles import c17_simulation

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
GRID = np.linspace(0.0, 5.0, 51)
RUNS = 100
V, Z, K = Signal("v", "m/s", start=1.0), Signal("z"), Signal("k", "1/s", start=2.0, lower=0.0)
DECAY = Block("decay", [V], [], [V], [K], {"v": -K.symbol * V.symbol}).compile()
RATES = {"decay.k": np.linspace(0.0, 3.0, RUNS)}


@pytest.fixture(scope="module")
def loop():
    model = c17_simulation()
    return tracking_loop(model, control_point=0.2, k1=2.0, k2=2.0).compile()


@pytest.fixture(scope="module")
def dask():
    distributed = pytest.importorskip("distributed")
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "host": "127.0.0.1",
        "dashboard_address": "127.0.0.1:0",
    }
    with distributed.LocalCluster(processes=True, silence_logs=50, **options) as local:
        yield local


def assert_same(one, other):
    assert (one.outputs, one.states, one.units) == (other.outputs, other.states, other.units)
    for name in (*FIGURES, "states_final", "status"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name


def given(runs=200):
    x = np.linspace(-0.5, 0.5, runs)
    return {"params": {"plant.yaw_linear_drag": np.linspace(0.3, 0.6, runs)}, "x0": {"plant.x": x}}


class Immediate(Executor):
    """Does everything at once, here; `spoil` may raise in place of a part with these rates."""

    def __init__(self, spoil=None):
        self.spoil, self.calls = spoil, 0

    def submit(self, work, *arguments):
        future, self.calls = Future(), self.calls + 1
        try:
            if self.spoil:
                self.spoil(self.calls, arguments[2]["decay.k"])
            future.set_result(work(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


# ---- the same results ------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{"rtol": 1e-7}, {"method": "rk4", "step": 0.01}])
@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_threads_and_processes_give_the_bits_of_one_machine(loop, pool, options):
    expected = loop.sweep(GRID, **given(), **options)
    with pool(2) as executor:
        assert_same(sweep_on(executor, loop, GRID, **given(), **options), expected)


@pytest.mark.slow
def test_a_dask_cluster_gives_the_bits_of_one_machine_and_redoes_what_a_killed_worker_had(loop, dask):
    grid, seen = np.linspace(0.0, 20.0, 201), []
    expected = loop.sweep(grid, **given(1000))

    def kill(done):
        seen.append(done)
        if len(seen) == 1:
            os.kill(next(iter(dask.workers.values())).pid, 9)

    with cluster(dask.scheduler_address) as executor:
        found = sweep_on(executor, loop, grid, **given(1000), progress=kill)
    assert_same(found, expected)
    assert seen == sorted(seen)
    assert seen[-1] == 1000


def test_parts_in_which_a_state_rests_give_the_bits_of_the_others():
    block = Block("two", [V, Z], [], [V, Z], [K], {"v": -K.symbol * V.symbol, "z": -K.symbol * Z.symbol})
    two, moved = block.compile(), np.r_[np.zeros(RUNS - 1), 0.5]  # z rests in all parts but the last
    options = {"params": {"two.k": np.linspace(0.5, 3.0, RUNS)}, "x0": {"z": moved}}
    assert_same(sweep_on(Immediate(), two, GRID, **options), two.sweep(GRID, **options))


def test_a_sweep_takes_an_executor_and_a_checkpoint(loop, tmp_path):
    expected, executor = loop.sweep(GRID, **given()), Immediate()
    assert_same(loop.sweep(GRID, executor=executor, **given()), expected)
    assert executor.calls == 13  # of 16 runs each
    assert_same(loop.sweep(GRID, checkpoint=tmp_path, threads=2, **given()), expected)
    assert len(list(tmp_path.glob("*.parquet"))) == 13


# ---- failures --------------------------------------------------------------------------------------------


def test_a_run_that_fails_in_its_worker_is_reported_with_its_values_and_the_others_finish():
    def spoil(call, rates):
        if RATES["decay.k"][40] in rates:
            raise MemoryError("none left")

    expected, seen = DECAY.sweep(GRID, params=RATES), []
    found = sweep_on(Immediate(spoil), DECAY, GRID, params=RATES, progress=seen.append)
    (failure,) = found.failures
    assert str(failure) == "run 40: MemoryError: none left (decay.k = 1.21212)"
    others = np.delete(np.arange(RUNS), 40)
    np.testing.assert_array_equal(found.final[others], expected.final[others])
    assert np.isnan(found.final[40]).all()
    assert found.to_table()["status"].to_pylist().count("its worker failed") == 1
    assert seen[-1] == RUNS


def test_a_solver_that_fails_is_no_failure_of_the_worker():
    c = Signal("c", "1/m")
    blow_up = Block("blow_up", [V], [], [V], [c], {"v": c.symbol * V.symbol**2}).compile()
    options = {"params": {"blow_up.c": [0.1, 5.0]}}
    found = sweep_on(Immediate(), blow_up, [0, 1, 2], **options)
    assert found.failures == blow_up.sweep([0, 1, 2], **options).failures
    assert len(found.failures) == 1


def test_where_every_part_fails_the_reason_is_told_and_no_part_is_tried_again():
    def spoil(call, rates):
        raise OSError("no compiler here")

    executor = Immediate(spoil)
    with pytest.raises(
        RuntimeError, match="all parts of the sweep failed, the first so: OSError: no compiler"
    ):
        sweep_on(executor, DECAY, GRID, params=RATES)
    assert executor.calls == 7  # of 16 runs each


def _die(*_):
    os._exit(1)


class Poisoned(ProcessPoolExecutor):
    """The third task kills its process."""

    calls = 0

    def submit(self, work, *arguments):
        self.calls += 1
        if self.calls == 3:
            super().submit(work, *arguments).result()
        return super().submit(_die if self.calls == 4 else work, *arguments)


def test_a_process_pool_whose_process_dies_breaks_and_the_checkpoint_goes_on(tmp_path):
    expected = DECAY.sweep(GRID, params=RATES)
    with Poisoned(1) as pool, pytest.raises(RuntimeError, match=r"broke after \d+ of 100 runs: .*keeps"):
        sweep_on(pool, DECAY, GRID, params=RATES, checkpoint=tmp_path)
    done = len(list(tmp_path.glob("*.parquet")))
    assert 0 < done < 7
    executor = Immediate()
    assert_same(sweep_on(executor, DECAY, GRID, params=RATES, checkpoint=tmp_path), expected)
    assert executor.calls == 7 - done


# ---- checkpoints -----------------------------------------------------------------------------------------


def test_an_interrupted_sweep_resumes(tmp_path):
    def interrupt(done):
        if done > 40:
            raise KeyboardInterrupt

    options = {"params": RATES, "checkpoint": tmp_path / "kept"}
    with pytest.raises(KeyboardInterrupt):
        sweep_on(Immediate(), DECAY, GRID, progress=interrupt, **options)
    done = sum(pyarrow.parquet.read_metadata(p).num_rows for p in (tmp_path / "kept").iterdir())
    assert 40 < done < RUNS
    executor, seen = Immediate(), []
    found = sweep_on(executor, DECAY, GRID, progress=seen.append, **options)
    assert executor.calls == math.ceil((RUNS - done) / 16)
    assert (seen[0], seen[-1]) == (done, RUNS)
    expected = DECAY.sweep(GRID, params=RATES)
    assert_same(found, expected)
    assert pyarrow.parquet.read_table(tmp_path / "kept").equals(expected.to_table())
    again = Immediate()
    assert_same(sweep_on(again, DECAY, GRID, **options), expected)
    assert again.calls == 0


@pytest.mark.parametrize(
    "other",
    [{"params": {"decay.k": np.linspace(0.0, 3.1, RUNS)}}, {"x0": {"v": 2.0}}, {"rtol": 1e-7}, {"band": 0.1}],
)
def test_a_checkpoint_of_another_sweep_is_refused(tmp_path, other):
    sweep_on(Immediate(), DECAY, GRID, params=RATES, checkpoint=tmp_path)
    with pytest.raises(InputError, match=r"runs-0.*parquet: belongs to another sweep"):
        sweep_on(Immediate(), DECAY, GRID, **{"params": RATES, "checkpoint": tmp_path, **other})


def test_a_checkpoint_that_is_none_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file, not a folder"):
        sweep_on(Immediate(), DECAY, GRID, params=RATES, checkpoint=tmp_path / "file")
    (tmp_path / "x.parquet").write_text("nothing")
    with pytest.raises(InputError, match=r"x\.parquet: not readable as Parquet"):
        sweep_on(Immediate(), DECAY, GRID, params=RATES, checkpoint=tmp_path)


@pytest.mark.parametrize("flips", [15, pytest.param(150, marks=pytest.mark.slow)])
def test_a_damaged_checkpoint_is_said_and_its_runs_are_computed_again(tmp_path, rng, flips):
    """One bit is flipped at random places of the files: results are never others."""
    whole = DECAY.sweep(GRID, params=RATES)
    sweep_on(Immediate(), DECAY, GRID, params=RATES, checkpoint=tmp_path)
    for _ in range(flips):
        path = rng.choice(sorted(tmp_path.glob("*.parquet")))
        content = bytearray(path.read_bytes())
        bit = int(rng.integers(8 * len(content)))
        content[bit // 8] ^= 1 << bit % 8
        path.write_bytes(content)
        executor = Immediate()
        with pytest.warns(UserWarning, match=r"runs-\d+-\d+-\w+\.parquet: damaged; its runs are computed"):
            found = sweep_on(executor, DECAY, GRID, params=RATES, checkpoint=tmp_path)
        assert_same(found, whole)
        assert executor.calls == 1 and path.read_bytes() != content
    path.write_bytes(b"")
    with pytest.warns(UserWarning, match="damaged"):
        assert_same(sweep_on(Immediate(), DECAY, GRID, params=RATES, checkpoint=tmp_path), whole)


# ---- bad input -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"params": {"decay.kk": [1.0]}}, "did you mean 'decay.k'"),
        ({"params": {"decay.k": [1.0, -1.0]}}, r"out of its bounds .*\(run 1\)"),
        ({"method": "rk"}, "did you mean 'rk4'"),
        ({"start": 9.0}, "after the last time"),
    ],
)
def test_a_sweep_that_cannot_be_is_refused(options, line):
    with pytest.raises(InputError, match=line):
        sweep_on(Immediate(), DECAY, GRID, **options)


@pytest.mark.slow
def test_a_cluster_that_does_not_answer_is_refused_in_time():
    pytest.importorskip("distributed")
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with (
            pytest.raises(InputError, match=r"cluster 'tcp://.*does not answer within 0\.5 s"),
            cluster(address, timeout=0.5),
        ):
            pass
    with pytest.raises(InputError, match="cluster 'nowhere://1'"), cluster("nowhere://1", timeout=0.5):
        pass
    with pytest.raises(InputError, match="timeout must be positive"), cluster(address, timeout=0):
        pass


@pytest.mark.slow
def test_a_cluster_without_workers_is_refused_in_time():
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 0, "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with (
        distributed.LocalCluster(**options) as local,
        pytest.raises(InputError, match=r"no worker within 0\.3 s"),
        cluster(local.scheduler_address, timeout=0.3),
    ):
        pass
