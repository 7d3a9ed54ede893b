"""Clocks of FMI 3 with a constant or fixed interval: the importer ticks them (models/clocked.c)."""

import warnings
import zipfile

import control as ct
import fmpy
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave

from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load
from hovercontrol.fmi.importer.unpacked import open_source
from hovercontrol.fmi.replay.replayer import Replayer, array_of, text_of

#: The controller of models/clocked.c as python-control writes it: y = 2 e + s, s+ = s + 0.05 e.
NATIVE = {"A": [[1.0]], "B": [[0.05]], "C": [[1.0]], "D": [[2.0]]}


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        yield


def run(system, t, e, w=1.0, u=0.0):
    rows = np.array([np.broadcast_to(row, t.shape) for row in (e, w, u)])
    return ct.input_output_response(system, t, rows)


def changed(path, target, *pairs):
    """Write an FMU once more, with another description."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                for before, after in pairs:
                    assert before.encode() in content
                    content = content.replace(before.encode(), after.encode())
            new.writestr(name, content)
    return target


def test_the_description_is_a_valid_one(written):
    fmpy.read_model_description(str(written("clocked")), validate=True)


@pytest.mark.parametrize("isolated", [False, True])
def test_a_sampled_controller_answers_at_its_ticks(written, isolated):
    """Its step is the shorter interval; the same as python-control's own system, without a delay."""
    with load(written("clocked"), isolated=isolated) as system:
        assert system.dt == 0.1 and list(system.input_index) == ["e", "w", "u"]
        t = 0.1 * np.arange(30)
        e = np.sin(1.3 * t)
        found = run(system, t, e)
    same = ct.forced_response(ct.ss(*NATIVE.values(), 0.1), t, e)
    assert np.abs(found.outputs[0] - same.outputs).max() < 1e-14


def test_between_ticks_outputs_are_held_and_inputs_are_not_seen(written):
    """A step of 20 ms: five steps between two ticks, and inputs that are wrong in four of them."""
    t = 0.02 * np.arange(101)
    e = np.where(np.arange(101) % 5 == 0, np.cos(t), 1e3)
    with load(written("clocked"), step=0.02) as system:
        found = run(system, t, e)
    same = ct.forced_response(ct.ss(*NATIVE.values(), 0.1), t[::5], np.cos(t[::5]))
    assert np.abs(found.outputs[0] - np.repeat(same.outputs, 5)[:101]).max() < 1e-12


def test_ticks_within_a_step_and_the_motion_between_them(written):
    """Ticks at 0.05 s and every 0.25 s count; z' = u - z in Euler's steps of 1 ms is exact by hand."""
    t = 0.4 * np.arange(8)
    with load(written("clocked"), step=0.4) as system:
        found = run(system, t, 0.0, w=3.0, u=1.0)
    ticks = [np.sum(0.05 + 0.25 * np.arange(20) < now + 1e-9) for now in t]
    assert found.outputs[1].tolist() == [3.0 * n for n in ticks]
    assert np.abs(found.outputs[2] - (1.0 - 0.999 ** np.arange(0, 3200, 400))).max() < 1e-12


def test_a_loop_with_a_native_plant_is_that_of_native_systems(written):
    """python-control asks for outputs several times at an instant, with other inputs."""
    plant = ct.ss([[0.9]], [[0.1]], [[1.0]], [[0.0]], 0.1, inputs="y", outputs="x", name="plant")
    error = ct.summing_junction(["r", "-x"], "e", name="error")
    native = ct.ss(*NATIVE.values(), 0.1, inputs="e", outputs="y", name="controller")
    t = 0.1 * np.arange(60)
    with load(written("clocked"), name="controller") as system:
        loops = [
            ct.interconnect([c, plant, error], inputs="r", outputs=["x", "y"], check_unused=False)
            for c in (system, native)
        ]
        found, same = (ct.input_output_response(loop, t, np.sign(np.sin(t))) for loop in loops)
    assert np.abs(found.outputs - same.outputs).max() < 1e-12 and np.abs(same.outputs[0]).max() > 0.5


def test_a_point_can_be_taken_up_again_with_other_inputs(written):
    """y = 2 e + s at a tick, for each e; the sum goes on with the e of the step."""
    with load(written("clocked")) as system:
        x = system.dynamics(0.0, [0.0], [1.0, 1.0, 0.0])  # s = 0.05
        y = [system.output(0.1, x, [e, 1.0, 0.0])[0] for e in (3.0, -1.0, 3.0)]
        assert y == pytest.approx([6.05, -1.95, 6.05], abs=1e-14)
        later = [system.dynamics(0.1, x, [e, 1.0, 0.0]) for e in (4.0, 8.0)]
        found = [system.output(0.2, z, [0.0, 1.0, 0.0])[0] for z in (*later, later[0])]
        assert found == pytest.approx([0.25, 0.45, 0.25], abs=1e-14)
        assert system.output(0.1, x, [0.0, 1.0, 0.0])[0] == pytest.approx(0.05, abs=1e-14)


@pytest.mark.parametrize("start", [0.0, 7.3])
def test_ticks_count_from_the_start_of_a_run(written, start):
    t = start + 0.1 * np.arange(10)
    with load(written("clocked")) as system:
        found = run(system, t, 1.0)
    assert np.abs(found.outputs[0] - (2.0 + 0.05 * np.arange(10))).max() < 1e-12


@pytest.mark.parametrize(
    "pair",
    [
        ('canGetAndSetFMUState="true"', 'canGetAndSetFMUState="false"'),
        ('hasEventMode="true"', 'hasEventMode="false"'),
        ('intervalVariability="constant" intervalDecimal="0.1"', 'intervalVariability="changing"'),
    ],
)
def test_clocks_that_are_not_ticked_are_left_out_with_a_warning(written, tmp_path, pair):
    path = changed(written("clocked"), tmp_path / "other.fmu", pair)
    with pytest.warns(UserWarning, match="input 'e' \\(clocked by 'fast', which is not ticked here\\)"):
        system = load(path, step=0.1)
    with system:
        assert "e" not in system.input_index and "z" in system.output_index


def test_saved_states_are_freed(written, monkeypatch):
    """With inputs that differ at each call, steps of several ticks, and a second run."""
    calls = []
    for name in ("getFMUState", "freeFMUState"):
        own = getattr(FMU3Slave, name)
        monkeypatch.setattr(FMU3Slave, name, lambda *a, own=own, name=name: calls.append(name) or own(*a))
    with load(written("clocked"), step=0.3) as system:
        for _ in range(2):
            run(system, 0.3 * np.arange(40), np.arange(40.0))
    assert calls.count("getFMUState") == calls.count("freeFMUState") > 80


def test_a_refusal_at_a_tick_is_one_line(written, tmp_path):
    """The description takes an input of the slow clock for one of the fast clock; the FMU refuses it."""
    path = changed(
        written("clocked"), tmp_path / "other.fmu", ('variability="discrete" clocks="21" start="1"',
                                                     'variability="discrete" clocks="20" start="1"'),
    )  # fmt: skip
    with load(path) as system, pytest.raises(InputError, match="cannot be set now"):
        run(system, 0.1 * np.arange(3), 0.0)


def exchanged(written, t, rows, **options):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*has time events")
        system = load(written("clocked"), kind="ModelExchange")
    with system:
        return system.simulate(t, rows, **options)


def test_model_exchange_ticks_at_time_events(written):
    """At a tick samples show the values before it; u jumps nowhere, so that z = 1 - exp(-t) by hand."""
    t = 0.05 * np.arange(41)
    found = exchanged(written, t, {"e": np.cos(t), "w": 3.0, "u": 1.0}, rtol=1e-9, atol=1e-12)
    ticks = 0.1 * np.arange(21)
    same = ct.forced_response(ct.ss(*NATIVE.values(), 0.1), ticks, np.cos(ticks))
    before = [0, *((np.arange(1, 41) - 1) // 2)]  # the last tick that a sample shows
    assert np.abs(found.outputs[0] - same.outputs[before]).max() < 1e-12
    counts = [np.sum(0.05 + 0.25 * np.arange(20) < now - 1e-9) for now in t]
    assert found.outputs[1].tolist() == [3.0 * n for n in counts]
    assert np.abs(found.outputs[2] - (1.0 - np.exp(-t))).max() < 1e-8


def test_model_exchange_begins_with_the_given_states(written):
    """The tick at the start is done once, with them."""
    t = 0.05 * np.arange(5)
    found = exchanged(written, t, {"e": 1.0, "u": 2.0}, x0=[2.0])
    assert found.outputs[0] == pytest.approx([2.0, 2.0, 2.0, 2.05, 2.05], abs=1e-14)
    assert found.states[0] == pytest.approx(2.0, abs=1e-9)


def test_model_exchange_is_told_to_have_time_events(written):
    with pytest.warns(UserWarning, match=r"time events, the first at t = 0\.05 s"):
        load(written("clocked"), kind="ModelExchange").close()


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_run_over_the_rows_of_a_log_ticks_too(written, kind):
    """What a fit computes, at rows 50 ms apart: at a tick with the inputs of that row."""
    t = 0.05 * np.arange(41)
    rows = np.column_stack([np.cos(t), 3.0 + 0.0 * t, 1.0 + 0.0 * t])
    source = open_source(written("clocked"), kind, True)
    replayer = Replayer(source.unpacked.folder, source.interface, "clocked")
    replayer.log("log", text_of(t))
    found = array_of(replayer.run("log", text_of(rows), [None, None], None, 5)).reshape(41, -1)
    replayer.close()
    source.unpacked.release()
    ticks = 0.1 * np.arange(21)
    same = ct.forced_response(ct.ss(*NATIVE.values(), 0.1), ticks, np.cos(ticks)).outputs
    assert np.abs(found[:, 0] - np.repeat(same, 2)[:41]).max() < 1e-12
    assert found[:, 1].tolist() == [3.0 * np.sum(0.05 + 0.25 * np.arange(20) < now + 1e-9) for now in t]
    assert np.abs(found[:, 2] - (1.0 - np.exp(-t))).max() < (1e-7 if kind == "ModelExchange" else 1e-3)
