"""An imported FMU is a python-control system like any other: pure, exact, named, and safe to let go of."""

import control as ct
import fmpy
import numpy as np
import pytest

import hovercontrol as hc
import hovercontrol.fmi
from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load
from hovercontrol.fmi.importer.follow import HELD

from .probe import EXACT, STEP, T, U, controller, exact

# --- the numbers ---


@pytest.mark.slow("isolated-3", "cannot save-isolated")
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


# --- FMUs made here ---


@pytest.fixture(scope="session")
def craft():
    return hc.vehicle("c17_simulation")


@pytest.mark.slow("isolated-3")
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
