"""An imported FMU in a process of its own; what is freed, and what a copy has."""

import copy
import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import control as ct
import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load
from hovercontrol.fmi.importer import worker
from hovercontrol.fmi.importer.system import FmuSystem

from .probe import STEP, TROUBLE, T, U, exact, write_fmu

# --- a process of its own ---


@pytest.mark.slow("hang")
@pytest.mark.parametrize(
    "trouble, line",
    [
        ("crash", r"its process ended by itself \(signal SIGSEGV\)"),
        ("exit", r"its process ended by itself \(status 3\)"),
        ("hang", r"it did not answer within 1.5 s; its process was ended"),
    ],
)
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_isolated_fmu_may_crash_exit_or_hang(probe, fmi, trouble, line):
    system = probe(fmi, isolated=True, timeout=1.5)
    with pytest.raises(InputError, match=f"FMU 'probe' failed in the step from t = 0.3 s: {line}"):
        ct.input_output_response(system, T, U, params={"trouble": TROUBLE[trouble]})
    np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="Linux alone says who waits")
def test_waiting_for_a_busy_processor_is_not_held_against_an_fmu():
    """Once 120 s of wall time ended an FMU on a machine whose cores had other work."""
    core = min(os.sched_getaffinity(0))
    here = f"import os, time; os.sched_setaffinity(0, {{{core}}})\n"
    busy = [subprocess.Popen([sys.executable, "-c", here + "while True: pass"]) for _ in range(2)]

    def waits(script, limit):
        child = subprocess.Popen([sys.executable, "-c", here + script], stdout=subprocess.PIPE)
        answers, begin = worker.queue.SimpleQueue(), time.monotonic()
        threading.Thread(target=worker._forward, args=(child.stdout, answers), daemon=True).start()
        try:
            return worker._answer(answers, child.pid, limit), time.monotonic() - begin
        except worker.queue.Empty:
            return None, time.monotonic() - begin
        finally:
            child.kill()
            child.wait()

    try:
        line, took = waits("while time.process_time() < 0.3: pass\nprint('done', flush=True)", 0.6)
        assert line == b"done\n" and took > 0.6
        assert waits("time.sleep(60)", 0.5)[0] is None
    finally:
        for process in busy:
            process.kill()
            process.wait()


def test_what_an_isolated_fmu_prints_is_no_answer(probe):
    system = probe(isolated=True, params={"trouble": TROUBLE["print"], "at": 0.0})
    np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)


@pytest.mark.slow
def test_an_interrupt_leaves_no_answer_for_the_next_call(probe, monkeypatch):
    system = probe(isolated=True)
    system.output(0, [0], [1.0])

    class Interrupted(worker.queue.SimpleQueue):
        def get(self, *args, **kwargs):
            raise KeyboardInterrupt

    remote = system._follower._engine
    child = remote._child
    monkeypatch.setattr(remote, "_answers", Interrupted())
    with pytest.raises(KeyboardInterrupt):
        ct.input_output_response(system, T, U)
    assert child.poll() is not None
    np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)


def test_the_isolated_process_ends_with_its_parent(fmu, tmp_path):
    """Even if the parent is killed while the FMU hangs."""
    script = (
        f"import hovercontrol.fmi, os\ns = hovercontrol.fmi.load({str(fmu())!r}, isolated=True)\n"
        f"print(s._follower._engine._child.pid, flush=True)\n"
        f"s.output(0, [0], [0]); x = s.dynamics(0, [0], [0], params={{'trouble': 4, 'at': 0}})\n"
        "s.output(0.1, x, [0], params={'trouble': 4, 'at': 0})\n"
    )
    log = tmp_path / "hang.log"
    parent = subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        env={**os.environ, "PROBE_LOG": str(log), "TMPDIR": str(tmp_path)},
    )
    child = int(parent.stdout.readline())
    assert until(lambda: log.exists() and "hang" in log.read_text()[:400])
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    assert until(lambda: not Path(f"/proc/{child}/exe").exists())


def until(done, seconds=20.0):
    end = time.monotonic() + seconds
    while not done() and time.monotonic() < end:
        time.sleep(0.02)
    return done()


# --- letting go, copying ---


@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
def test_close_and_with_free_the_instance_and_the_folder(fmu, temporary, calls, isolated):
    with load(fmu(), isolated=isolated) as system:
        system.output(0, [0], [0])
        assert len(list(temporary.iterdir())) == 1
    assert list(temporary.iterdir()) == [] and calls()[-2:] == ["terminate", "free"]
    system.close()
    with pytest.raises(InputError, match="FMU 'probe' is closed"):
        system.output(0, [0], [0])
    with pytest.raises(InputError, match="FMU 'probe' is closed"):
        copy.deepcopy(system)


def test_garbage_collection_frees_it_too(fmu, temporary, calls):
    system = load(fmu())
    system.output(0, [0], [0])
    del system
    gc.collect()
    assert list(temporary.iterdir()) == [] and calls()[-1] == "free"


@pytest.mark.slow
@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
def test_the_interpreters_exit_frees_it_too(fmu, tmp_path, isolated):
    folder = tmp_path / "t"
    folder.mkdir()
    script = f"import hovercontrol.fmi\ns = hovercontrol.fmi.load({str(fmu())!r}, isolated={isolated})\n"
    script += "s.output(0, [0], [0])\n"
    log = tmp_path / "calls.log"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        env={**os.environ, "TMPDIR": str(folder), "PROBE_LOG": str(log)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert list(folder.iterdir()) == [] and log.read_text().splitlines()[-1] == "free"


def test_a_copy_has_an_instance_of_its_own(probe, temporary):
    system = probe(params={"x0": 2.0})
    state = system.dynamics(0, [0], [1.0])
    for double in (copy.deepcopy(system), copy.copy(system), system.copy("other")):
        assert isinstance(double, FmuSystem) and double.params == system.params
        assert double.output(0, [0], [0])[0] == 2.0
        with pytest.raises(InputError, match="names no state"):
            double.output(STEP, state, [1.0])
        double.close()
        assert len(list(temporary.iterdir())) == 1
    assert system.output(STEP, state, [1.0])[0] == pytest.approx(exact(np.ones(2), 2.0)[0, 1])


def test_a_pickled_system_reads_the_same_file_again(probe):
    system = probe(params={"x0": 2.0}, name="plant")
    with pickle.loads(pickle.dumps(system)) as double:
        assert double.name == "plant" and double.params == system.params and double.dt == STEP
        assert double.output(0, [0], [0])[0] == 2.0
    stored = pickle.dumps(system)
    with open(system.path, "ab") as file:
        file.write(b"more")
    with pytest.raises(InputError, match="has changed since the system was pickled"):
        pickle.loads(stored)


@pytest.mark.slow
def test_an_fmu_that_allows_one_instance_has_one(once_library, tmp_path, calls):
    path = write_fmu(tmp_path / "once.fmu", once_library, once=True)
    with load(path) as system:
        for _ in range(2):
            np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)
        assert calls().count("instantiate") == 1
        with pytest.raises(InputError, match="allows one instance in a process, which exists; isolated=True"):
            load(path)
        with load(path, isolated=True) as other:
            assert other.output(0, [0], [0])[0] == 1.0
    load(path).close()
