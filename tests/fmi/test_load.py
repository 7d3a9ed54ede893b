"""An imported FMU is a python-control system like any other: pure, exact, named, and safe to let go of."""

import copy
import gc
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import control as ct
import fmpy
import numpy as np
import pytest

import hovercontrol as hc
import hovercontrol.fmi
from hovercontrol.errors import InputError
from hovercontrol.fmi.importer import worker
from hovercontrol.fmi.importer.follow import HELD
from hovercontrol.fmi.importer.imported import FmuSystem

from .probe import TROUBLE, binary, description, write_fmu

load = hovercontrol.fmi.load
STEP = 0.1
T = np.arange(0, 2.05, STEP)
U = np.sin(3 * T) + 0.2
#: x' = -2 x + u, inputs held over a step; z = x + 0.5 u
EXACT = ct.c2d(ct.ss([[-2.0]], [[1.0]], [[1.0], [1.0]], [[0.0], [0.5]]), STEP)


def exact(U=U, x0=1.0):
    return ct.forced_response(EXACT, np.arange(len(U)) * STEP, U, x0).outputs


# --- the numbers ---


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
@pytest.mark.parametrize("states", [True, False], ids=["saves", "cannot save"])
def test_a_response_is_the_exact_solution_and_the_second_run_the_first(probe, fmi, isolated, states):
    system = probe(fmi, states=states, isolated=isolated)
    assert (system.dt, system.nstates) == (STEP, 1)
    first = ct.input_output_response(system, T, U)
    np.testing.assert_allclose(first.outputs, exact(), rtol=0, atol=1e-14)
    second = ct.input_output_response(system, T, U)
    assert (second.outputs == first.outputs).all() and (second.states == first.states).all()
    np.testing.assert_array_equal(first.states[0], np.arange(len(T)))


def test_the_numbers_are_those_of_fmpy(probe):
    system = probe(2)
    response = ct.input_output_response(system, T, U)
    signals = np.array(list(zip(T, U, strict=True)), dtype=[("time", float), ("u", float)])
    # FMPy interpolates inputs to the start of a step and holds them, too.
    result = fmpy.simulate_fmu(
        str(system.path), stop_time=T[-1], step_size=STEP, output_interval=STEP, input=signals, output=["x"]
    )
    np.testing.assert_allclose(response.outputs[0], result["x"], rtol=0, atol=1e-14)


@pytest.mark.parametrize("states", [True, False], ids=["saves", "cannot save"])
def test_functions_of_the_state_are_pure_in_any_order(probe, rng, states):
    """Walk at random through branches of the history, forwards and back; compare each with the recurrence."""
    system = probe(states=states)
    a, b = float(EXACT.A[0, 0]), float(EXACT.B[0, 0])
    truth = {(0.0, 0.0): 1.0}  # state and time of it: x
    for _ in range(300):
        state, t = list(truth)[rng.integers(len(truth))]
        x, u = truth[state, t], float(rng.integers(-3, 4))
        if rng.random() < 0.5:
            np.testing.assert_allclose(system.output(t, [state], [u]), [x, x + 0.5 * u], rtol=0, atol=1e-12)
            continue
        following = float(system.dynamics(t, [state], [u])[0])
        assert round(following) == round(state) + 1
        truth[following, round(t + STEP, 9)] = a * x + b * u
        while len(truth) > HELD // 2:
            del truth[list(truth)[1]]


def test_an_output_that_feeds_through_follows_the_inputs_at_each_step(probe):
    system = probe()
    assert system.feedthrough == {"x": (), "z": ("u",)}
    state = system.dynamics(0, [0], [1.0])
    x = float(system.output(STEP, state, [1.0])[0])
    assert x == pytest.approx(exact(np.ones(2))[0, 1], abs=1e-14)
    for u in (1.0, -4.0, 0.0, -4.0):
        np.testing.assert_allclose(system.output(STEP, state, [u]), [x, x + 0.5 * u], atol=1e-14)


def test_a_run_starts_with_its_own_first_inputs(probe):
    system = probe(params={"follow": 1})  # x = u at the start
    for u in (3.0, -2.0, 3.0):
        assert system.output(0, [0], [u])[0] == u


def test_a_run_may_start_at_any_time_and_go_on_where_one_ended(probe):
    system = probe()
    whole = ct.input_output_response(system, T + 5, U)
    np.testing.assert_allclose(whole.outputs, exact(), rtol=0, atol=1e-14)
    begun = ct.input_output_response(system, T[:11], U[:11])
    rest = ct.input_output_response(system, T[10:], U[10:], begun.states[:, -1])
    np.testing.assert_allclose(rest.outputs, exact()[:, 10:], rtol=0, atol=1e-14)


def test_no_step_is_made_beyond_the_last_instant(probe, calls):
    system = probe()
    ct.input_output_response(system, T[:4], U[:4])
    done = calls()
    assert [c for c in done if c.startswith("step")] == ["step 0", "step 0.1", "step 0.2"]
    assert done.count("instantiate") == 1


def test_saved_states_are_given_back(probe, calls):
    system = probe()
    ct.input_output_response(system, np.arange(100) * STEP, np.zeros(100))
    running = calls()
    assert running.count("save") - running.count("drop") <= HELD + 1
    system.close()
    done = running + calls()
    assert done.count("save") == done.count("drop") == 99
    assert done[-2:] == ["terminate", "free"]


def test_an_output_without_feedthrough_is_read_before_inputs_are_set(probe):
    """FMI forbids to read between setting and stepping; an FMU that insists on it works where it can."""
    system = probe(names=["u", "x", "strict"], params={"strict": 1})
    np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact()[0], atol=1e-14)
    with pytest.raises(InputError, match="nothing may be read between set and step"):
        ct.input_output_response(probe(params={"strict": 1}), T, U)


def test_an_fmu_that_computes_outputs_in_its_steps_only_gives_them_one_step_late(probe):
    """FMI allows it, and nobody outside can tell; see FmuSystem."""
    late = ct.input_output_response(probe(params={"stale": 1}), T, U).outputs
    prompt = exact()
    np.testing.assert_allclose(late[0], prompt[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(late[1, 1:], prompt[0, 1:] + 0.5 * U[:-1], rtol=0, atol=1e-14)
    assert late[1, 0] == prompt[1, 0]  # at the start, initialisation computes them


# --- interconnection ---


def controller(name="controller", dt=STEP):
    """Return a PI controller, u = 3 e + w, w += 0.4 e."""
    return ct.nlsys(
        lambda t, x, u, params: x + 0.4 * (u[0] - u[1]),
        lambda t, x, u, params: x + params["controller.gain"] * (u[0] - u[1]),
        inputs=["r", "x"],
        outputs=["u"],
        states=1,
        dt=dt,
        name=name,
        params={"controller.gain": 3.0},
    )


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("states", [True, False], ids=["saves", "cannot save"])
def test_a_loop_wired_by_name_is_that_of_the_exact_plant(probe, fmi, states):
    plant = ct.ss(EXACT, inputs=["u"], outputs=["x", "z"], name="plant")
    wanted = ct.interconnect([plant, controller()], inputs=["r"], outputs=["x", "z", "u"])
    reference = ct.input_output_response(wanted, T, 1.0, [1.0, 0.0])
    loop = ct.interconnect([controller(), probe(fmi, states=states)], inputs=["r"], outputs=["x", "z", "u"])
    for _ in range(2):
        response = ct.input_output_response(loop, T, 1.0)
        np.testing.assert_allclose(response.outputs, reference.outputs, rtol=0, atol=1e-13)
    assert loop.state_labels == ["controller_x[0]", "probe_step"]


def test_a_feedthrough_chain_of_two_fmus_is_iterated_to_its_solution(probe):
    """z of the first feeds u of the second, whose z follows in the same instant."""
    first, second = probe(name="first"), probe(name="second")
    chain = ct.interconnect(
        [second, first],
        connections=[["second.u", "first.z"]],
        inplist=["first.u"],
        outlist=["second.z"],
        inputs=["u"],
        outputs=["z"],
    )
    middle = exact()[1]
    response = ct.input_output_response(chain, T, U)
    np.testing.assert_allclose(response.outputs, exact(middle)[1], rtol=0, atol=1e-13)


def test_parameters_of_others_pass_and_misspelt_own_ones_do_not(probe):
    loop = ct.interconnect([controller(), probe()], inputs=["r"], outputs=["x"])
    base = ct.input_output_response(loop, T, 1.0).outputs
    weaker = ct.input_output_response(loop, T, 1.0, params={"controller.gain": 0.0}).outputs
    faster = ct.input_output_response(loop, T, 1.0, params={"probe.k": 5.0}).outputs
    assert abs(weaker - base).max() > 0.1 and abs(faster - base).max() > 0.1
    assert (ct.input_output_response(loop, T, 1.0).outputs == base).all()
    with pytest.raises(InputError, match=r"unknown parameter 'probe.gaim'; did you mean 'probe.gain'\?"):
        ct.input_output_response(loop, T, 1.0, params={"probe.gaim": 1.0})


def test_the_same_file_runs_twice_at_once(probe, fmu):
    path = fmu()
    with load(path, name="a", params={"x0": 1.0}) as a, load(path, name="b", params={"x0": 7.0}) as b:
        both = ct.interconnect(
            [a, b], connections=False, inplist=["a.u", "b.u"], outlist=["a.x", "b.x"], inputs=2, outputs=2
        )
        response = ct.input_output_response(both, T, np.array([U, 0 * U]))
        np.testing.assert_allclose(response.outputs[0], exact()[0], atol=1e-14)
        np.testing.assert_allclose(response.outputs[1], 7 * np.exp(-2 * T), atol=1e-14)


def test_python_control_copies_a_system_listed_twice(probe):
    system = probe()
    twice = ct.interconnect(
        [system, system],
        connections=[[(1, 0), (0, 0)]],
        inplist=[(0, 0)],
        outlist=[(1, 0)],
        inputs=["u"],
        outputs=["x"],
        warn_duplicate=False,
    )
    response = ct.input_output_response(twice, T, U)
    np.testing.assert_allclose(response.outputs, exact(exact()[0])[0], rtol=0, atol=1e-13)


# --- names, units, types ---


def test_units_and_descriptions_are_kept(probe):
    system = probe(2)
    assert system.units["u"] == "N" and system.units["x"] == "m/s" and system.units["probe.k"] == "1/s"
    assert system.units["z"] == "m/s"  # from its declared type
    assert system.units["probe.gain"] == ""
    assert system.descriptions["x"] == "the x" and system.descriptions["probe.k"] == "the k"


def test_dotted_names_stay_and_are_wired_as_python_control_allows(probe):
    names = {"u": "body.force", "x": "body.v"}
    system = probe(rename=names)
    assert system.input_labels == ["body.force"] and system.output_labels == ["body.v", "z"]
    gain = ct.nlsys(None, lambda t, x, u, p: -u, inputs=["e"], outputs=["f"], dt=STEP, name="gain")
    loop = ct.interconnect(
        [system, gain],
        connections=[[("probe", "body.force"), ("gain", "f")], [("gain", "e"), ("probe", "body.v")]],
        outlist=[("probe", "body.v")],
        inplist=[("probe", "body.force")],
    )
    a, b = float(EXACT.A[0, 0]), float(EXACT.B[0, 0])
    dotted = ct.input_output_response(loop, T, 0.0).outputs
    np.testing.assert_allclose(dotted, (a - b) ** np.arange(len(T)), atol=1e-13)
    system.update_names(inputs=["f"], outputs=["e", "z"])
    renamed = ct.interconnect([system, gain], outputs=["e"])
    assert (ct.input_output_response(renamed, T, 0.0).outputs == dotted).all()
    assert copy.deepcopy(system).input_labels == ["f"]


def test_integers_booleans_and_enumerations_are_numbers(probe):
    system = probe(names=["u", "mode", "on", "gear", "x", "steps", "echo", "off", "sum"])
    assert system.input_labels == ["u", "mode", "on", "gear"]
    assert list(system.output(0, [0], [0, 7, 1, 2])) == [1, 0, 14, 0, 2]
    state = system.dynamics(0, [0], [5, 7, 0, 2])
    out = system.output(STEP, state, [5, -3, 0, 1])
    np.testing.assert_allclose(out, [np.exp(-2 * STEP), 1, -6, 1, 1])


@pytest.mark.parametrize("fmi, most", [(2, 2147483647), (3, 2147483647)])
def test_numbers_that_a_type_cannot_take_are_refused(probe, fmi, most):
    system = probe(fmi, names=["mode", "on", "echo"])
    system.output(0, [0], [most // 2, 1])
    for u, line in (
        (
            [0.5, 1],
            "input 'mode' at t = 0 s: expected a whole number from -2147483648 to 2147483647, found 0.5",
        ),
        ([2.0**31, 1], "found 2.14748365e[+]09"),
        ([0, 0.7], "input 'on' at t = 0 s: expected 0 or 1, found 0.7"),
        ([0, np.nan], "input 'on' is nan at t = 0 s"),
    ):
        with pytest.raises(InputError, match=line):
            system.output(0, [0], u)


def test_arrays_of_fmi_3_are_spread_and_counted_from_one(probe):
    system = probe(3, names=["v", "byte", "gear", "w", "single", "sum", "m"])
    assert system.input_labels == ["v[1]", "v[2]", "v[3]", "byte", "gear"]
    assert system.output_labels == ["w[1]", "w[2]", "w[3]", "single", "sum"]
    assert list(system.params) == [f"probe.m[{i},{j}]" for i in (1, 2) for j in (1, 2)]
    assert list(system.params.values()) == [1, 2, 3, 4]
    u = [1.0, 10.0, 100.0, 200, 2]
    assert list(system.output(0, [0], u)) == [1, 20, 300, 1, 202]
    # one element set: the others keep their start values
    assert list(system.output(0, [0], u, params={"probe.m[1,2]": 7.0})) == [1, 70, 300, 1, 202]
    with pytest.raises(InputError, match="input 'byte' at t = 0 s: expected a whole number from 0 to 255"):
        system.output(0, [0], [0, 0, 0, 256, 1])


def test_signals_that_are_no_numbers_are_left_out_with_a_warning(probe):
    text = '<String name="label" valueReference="38" causality="input" variability="discrete">'
    text += '<Start value="a"/></String>'
    with pytest.warns(UserWarning, match=r"left out, .*: input 'label' \(of type String, no number\)"):
        system = probe(3, extra=text)
    assert system.input_labels == ["u"]


# --- parameters ---


def test_parameters_are_set_at_load_by_name_or_key_and_at_each_call(probe):
    assert probe(params={"x0": 3.0}).params["probe.x0"] == 3.0
    system = probe(params={"probe.x0": 3.0, "k": 2})
    assert system.output(0, [0], [0])[0] == 3.0
    assert system.output(0, [0], [0], params={"probe.x0": 4.0})[0] == 4.0
    assert system.output(0, [0], [0], params={"x0": 5.0})[0] == 5.0
    assert system.output(0, [0], [0])[0] == 3.0
    run = ct.input_output_response(system, T, 0.0, params={"probe.k": 0.5})
    np.testing.assert_allclose(run.outputs[0], 3 * np.exp(-0.5 * T), atol=1e-13)


@pytest.mark.parametrize("given", [{"x00": 1.0}, {"probe.x00": 1.0}])
def test_an_unknown_parameter_is_refused_with_the_nearest(probe, given):
    with pytest.raises(InputError, match=r"unknown parameter .*did you mean 'probe.x0'"):
        probe(params=given)
    with pytest.raises(InputError, match=r"unknown parameter .*did you mean 'probe.x0'"):
        ct.input_output_response(probe(), T, U, params=given)


def test_keys_carry_the_systems_name_once_and_never_fall_together(probe):
    inside = {"k": "plant.k", "gain": "plant.sub.gain", "x0": "x0"}
    system = probe(name="plant", names=list(inside), rename=inside)
    assert list(system.params) == ["plant.k", "plant.sub.gain", "plant.x0"]
    system = probe(name="plant", names=["k", "x", "x0"], rename={"k": "plant.x0"})
    assert system.params == {"plant.plant.x0": 2.0, "plant.x0": 1.0}
    assert system.output(0, [0], [], params={"plant.x0": 4.0})[0] == 4.0


def test_values_put_into_params_by_hand_are_used_and_checked(probe):
    system = probe()
    system.params["probe.x0"] = 6.0
    assert system.output(0, [0], [0])[0] == 6.0
    for key, value, line in (
        ("probe.x9", 1.0, "unknown parameter"),
        ("probe.trouble", 0.5, "a whole number"),
    ):
        system.params[key] = value
        with pytest.raises(InputError, match=line):
            system.output(0, [0], [0])
        del system.params[key]


def test_a_parameter_must_be_a_number_of_its_type(probe):
    for given, line in (
        ({"trouble": 0.5}, "'probe.trouble': expected a whole number"),
        ({"strict": 2}, "'probe.strict': expected 0 or 1"),
        ({"k": np.inf}, "'probe.k': expected a finite number"),
        ({"k": "fast"}, r"params\['k'\]: expected a number or true or false, found 'fast'"),
    ):
        with pytest.raises(InputError, match=line):
            probe(params=given)


def test_a_parameter_that_is_true_or_false_may_be_given_so(probe):
    assert probe(params={"strict": True}).params["probe.strict"] == 1


def test_parameters_do_not_change_within_a_run(probe):
    system = probe()
    state = system.dynamics(0, [0], [1.0])
    with pytest.raises(InputError, match="state 1 was reached with other parameters"):
        system.output(STEP, state, [1.0], params={"k": 9.0})


# --- what cannot be ---


def test_states_that_the_fmu_was_never_in_are_refused(probe):
    system = probe()
    loop = ct.interconnect([controller(), system], inputs=["r"], outputs=["x"])
    for call in (
        lambda: system.output(0, [1.0], [0]),
        lambda: ct.input_output_response(system, T, U, [0.5]),
        lambda: loop.linearize([0, 0], [0]),
        lambda: ct.find_operating_point(system, [0.0], [0.0]),
    ):
        with pytest.raises(InputError, match="names no state of the FMU"):
            call()
    with pytest.raises(InputError, match="cannot be linearised"):
        system.linearize([0], [0])
    with pytest.raises(InputError, match="cannot be linearised"):
        ct.linearize(system, [0], [0])


def test_a_state_belongs_to_its_time(probe):
    system = probe()
    state = system.dynamics(0, [0], [1.0])
    with pytest.raises(InputError, match=r"state 1 is that of t = 0.1 s, asked for at t = 3 s"):
        system.output(3.0, state, [1.0])


@pytest.mark.parametrize(
    "fmi, trouble, line",
    [
        (2, "error", "fmi2DoStep returned fmi2Error; it says: the tank is empty, level -1.5"),
        (3, "error", "fmi3DoStep returned fmi3Error; it says: the tank is empty, level -1.5"),
        (2, "discard", "fmi2DoStep returned fmi2Discard; it says: no solution for u = 2"),
        (3, "discard", "fmi3DoStep returned fmi3Discard; it says: no solution for u = 2"),
        (2, "early", "it returned early from the step, at t = 0.35 s"),
        (3, "early", "it returned early from the step, at t = 0.35 s"),
    ],
)
@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
def test_a_failed_step_is_one_line_with_the_time_and_the_fmus_words(probe, fmi, trouble, line, isolated):
    system = probe(fmi, isolated=isolated)
    for _ in range(2):
        with pytest.raises(InputError) as caught:
            ct.input_output_response(system, T, 2.0, params={"trouble": TROUBLE[trouble]})
        assert str(caught.value).startswith(f"FMU 'probe' failed in the step from t = 0.3 s: {line}")
        assert "\n" not in str(caught.value)
    np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)


def test_a_failed_start_and_a_fatal_error_are_lines_too(probe):
    system = probe()
    with pytest.raises(InputError, match=r"at the start of a run, t = 0 s: .*cannot begin with trouble 10"):
        ct.input_output_response(system, T, U, params={"trouble": TROUBLE["not_ready"]})
    with pytest.raises(InputError, match="fmi2Fatal; it says: memory is gone 0"):
        ct.input_output_response(system, T, U, params={"trouble": TROUBLE["fatal"]})
    with pytest.raises(InputError, match="reported a fatal error before"):
        ct.input_output_response(system, T, U)


def test_messages_of_two_fmus_and_of_fmpy_itself_do_not_mix(probe, capfd):
    one, two = probe(name="one"), probe(name="two")
    one.output(0, [0], [0])
    with pytest.raises(InputError, match=r"FMU 'two' failed .* it says: no solution for u = 4"):
        ct.input_output_response(two, T, 4.0, params={"trouble": TROUBLE["discard"]})
    with pytest.raises(InputError, match=r"FMU 'one' failed .* it says: no solution for u = 6"):
        ct.input_output_response(one, T, 6.0, params={"trouble": TROUBLE["discard"]})
    assert capfd.readouterr().out == ""
    start = {"trouble": TROUBLE["error"]}
    with pytest.raises(Exception, match="fmi2DoStep"):
        fmpy.simulate_fmu(
            str(one.path), stop_time=1.0, step_size=STEP, start_values=start, debug_logging=True
        )
    assert "the tank is empty, level -1.5" in capfd.readouterr().out


# --- a process of its own ---


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


def test_what_an_isolated_fmu_prints_is_no_answer(probe):
    system = probe(isolated=True, params={"trouble": TROUBLE["print"], "at": 0.0})
    np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)


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


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Return the folder where FMUs are unpacked."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


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


@pytest.mark.slow("here")
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
    with pytest.raises(InputError, match="is not the FMU it was when the system was pickled"):
        pickle.loads(stored)


def test_an_fmu_that_allows_one_instance_has_one(once_library, tmp_path, calls):
    path = write_fmu(tmp_path / "once.fmu", once_library, once=True)
    with load(path) as system:
        for _ in range(2):
            np.testing.assert_allclose(ct.input_output_response(system, T, U).outputs, exact(), atol=1e-14)
        assert calls().count("instantiate") == 1
        with pytest.raises(InputError, match="allows one instance in a process and has one; isolated=True"):
            load(path)
        with load(path, isolated=True) as other:
            assert other.output(0, [0], [0])[0] == 1.0
    load(path).close()


# --- FMUs that are none ---


def test_the_step_is_the_fmus_or_must_be_given(probe):
    assert probe(step=0.02).dt == 0.02 and probe().dt == 0.1
    assert probe(preferred=None, step=0.3).dt == 0.3
    for step in (0, -1, np.nan, np.inf, "fast", True):
        with pytest.raises(InputError, match=r"step( .s. must be a positive|: expected a) number"):
            probe(step=step)


def test_a_fixed_internal_step_of_fmi_3_is_the_default_and_the_measure(probe):
    fixed = {"preferred": None, "attributes": 'fixedInternalStepSize="0.05"'}
    assert probe(3, **fixed).dt == 0.05
    assert probe(3, step=0.2, **fixed).dt == 0.2
    for step in (0.07, 0.01):
        with pytest.raises(InputError, match=r"must be a multiple of the FMU's own 0.05 s"):
            probe(3, step=step, **fixed)


@pytest.mark.parametrize("name", ["a.b", "", 3])
def test_a_name_with_dots_is_refused(probe, name):
    with pytest.raises(InputError, match=r"a system's name is a word without dots|name: expected a text"):
        probe(name=name)


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_for_other_uses_or_platforms_is_refused(fmu, library, tmp_path, fmi):
    with pytest.raises(InputError, match="is an FMU for Model Exchange only; expected one for Co-Simulation"):
        load(fmu(fmi, kind="ModelExchange"))
    path = tmp_path / "other.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(fmi))
        archive.writestr("binaries/win64/probe.dll", b"")
        archive.writestr("binaries/x86_64-darwin/probe.dylib", b"")
    with pytest.raises(
        InputError, match=r"no binary for this platform .*; those it has: win64, x86_64-darwin"
    ):
        load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(fmi))
        archive.writestr("sources/all.c", b"")
    with pytest.raises(InputError, match=r"no binary for this platform .*; it has none at all"):
        load(path)


@pytest.mark.parametrize(
    "old, new, line",
    [
        ('fmiVersion="2.0"', 'fmiVersion="1.0"', "is an FMU of FMI 1.0; expected FMI 2.0 or 3.0"),
        ('fmiVersion="2.0"', "", "no FMI model description"),
        ("fmiModelDescription", "somethingElse", "no FMI model description"),
        ("</ModelVariables>", "", "modelDescription.xml is no XML: mismatched tag: line"),
        ('causality="output"', 'causality="outcome"', r"breaks FMI 2.0: ERROR \(line .*outcome"),
        ('valueReference="10"', 'valueReference="-1"', "breaks FMI 2.0"),
        ('name="x"', 'name="u"', "breaks FMI 2.0: .*not unique"),
        ('<Unknown index="2"', '<Unknown index="999"', "cannot be read"),
        ('modelIdentifier="probe"', 'modelIdentifier="../../probe"', "'../../probe' is no identifier of C"),
        ('modelIdentifier="probe"', 'modelIdentifier="/lib/libc"', "'/lib/libc' is no identifier of C"),
        (' unit="N"', ' unit="kN"', "breaks FMI 2.0"),
    ],
)
def test_a_description_that_breaks_the_standard_is_refused(library, tmp_path, old, new, line):
    path = tmp_path / "broken.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        text = description(2)
        assert old in text
        archive.writestr("modelDescription.xml", text.replace(old, new))
        archive.write(library, binary(2))
    with pytest.raises(InputError, match=line) as caught:
        load(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_a_huge_array_is_refused_before_it_is_made(fmu):
    text = (
        '<Float64 name="big" valueReference="38" causality="output"><Dimension start="4000000000"/></Float64>'
    )
    with pytest.raises(InputError, match="more than 100000 signals and parameters"):
        load(fmu(3, extra=text))


@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
def test_a_binary_that_cannot_be_loaded_is_one_line(compiler, tmp_path, temporary, isolated):
    source = tmp_path / "empty.c"
    source.write_text("int nothing;")
    subprocess.run([*compiler, "-shared", "-fPIC", source, "-o", tmp_path / "empty.so"], check=True)
    here = os.getcwd()
    for library, line in (
        (b"no library", "its binary cannot be loaded: .*probe"),
        (tmp_path / "empty.so", "its binary cannot be loaded: .*fmi2GetTypesPlatform|undefined symbol: fmi2"),
    ):
        path = write_fmu(tmp_path / "bad.fmu", library)
        with pytest.raises(InputError, match=line) as caught:
            load(path, isolated=isolated)
        assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    assert os.getcwd() == here and list(temporary.iterdir()) == []


def test_nothing_is_left_behind_where_load_refuses(fmu, temporary):
    for given in ({"name": "a.b"}, {"step": -1}, {"params": {"nothing": 1.0}}, {"timeout": 0}):
        with pytest.raises(InputError):
            load(fmu(), **given)
    assert list(temporary.iterdir()) == []


# --- FMUs made here ---


@pytest.fixture(scope="session")
def craft():
    return hc.vehicle("c17_simulation")


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
def test_an_exported_plant_moves_as_scipy_integrates_it(compiler, craft, tmp_path, version, isolated):
    plant = craft.plant()
    path = plant.to_fmu(tmp_path / "plant.fmu", version=version, friction="smooth", rtol=1e-10, atol=1e-12)
    times = np.arange(301) * 0.01
    inputs = np.array([1.5 + np.sin(times), 0.3 * np.cos(2 * times)])
    changed = {"plant.yaw_linear_drag": 0.9}
    with load(path, isolated=isolated) as system:
        response = ct.input_output_response(system, times, inputs, params=changed)
        assert system.units["r"] == "rad/s" and system.dt == 0.01
        assert system.params == pytest.approx(plant.default_parameters)
    held = dict(zip(system.input_labels, inputs, strict=True))
    reference = hc.simulate(plant, times, held, params=changed, rtol=1e-11)
    np.testing.assert_allclose(response.outputs, reference.outputs, rtol=0, atol=1e-8)


@pytest.mark.parametrize("version", [2, 3])
def test_an_exported_controller_answers_in_the_same_instant(compiler, craft, tmp_path, rng, version):
    block = hc.tracking_controller(craft)
    path = block.to_fmu(tmp_path / "controller.fmu", version=version)
    truth = block.to_control()
    with load(path) as system:
        state = [0.0]
        for k in range(5):
            for u in rng.normal(size=(3, system.ninputs)):
                answer = system.output(k * system.dt, state, u)
                np.testing.assert_allclose(answer, truth.output(0, [], u), rtol=1e-12, atol=1e-12)
            state = system.dynamics(k * system.dt, state, u)


def test_a_loop_of_three_exported_fmus_comes_to_the_fused_loop_as_the_step_shrinks(compiler, craft, tmp_path):
    parts = [craft.plant(), hc.tracking_controller(craft), hc.ellipse(1.5, 2.5, rate=-1.0)]
    paths = [p.to_fmu(tmp_path / f"{p.name}.fmu", friction="smooth", rtol=1e-9) for p in parts]
    end = 0.5
    loop = hc.interconnect(parts, outputs=["x", "y"])
    fused = np.asarray(hc.simulate(loop, [0, end], {}, rtol=1e-9).outputs)[:, -1]
    errors = []
    for step in (0.01, 0.005):
        systems = [load(path, step=step) for path in paths]
        loop = ct.interconnect(systems, outputs=["x", "y"], check_unused=False)
        response = ct.input_output_response(loop, np.arange(round(end / step) + 1) * step, 0)
        errors.append(np.abs(np.asarray(response.outputs)[:, -1] - fused).max())
        for system in systems:
            system.close()
    assert 0 < errors[0] < 0.05
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)  # inputs held over a step: first order
