"""Names, units, types and parameters of an imported FMU, and the values and states that it refuses."""

import copy

import control as ct
import fmpy
import numpy as np
import pytest

from hovercontrol.base.errors import InputError

from .probe import EXACT, STEP, TROUBLE, T, U, controller, exact

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
    with pytest.warns(UserWarning, match=r"left out, .*: input 'label' \(of type String, not a number\)"):
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


@pytest.mark.slow("isolated")
@pytest.mark.parametrize(
    "fmi, trouble, line",
    [
        (2, "error", "fmi2DoStep returned fmi2Error; its message: the tank is empty, level -1.5"),
        (3, "error", "fmi3DoStep returned fmi3Error; its message: the tank is empty, level -1.5"),
        (2, "discard", "fmi2DoStep returned fmi2Discard; its message: no solution for u = 2"),
        (3, "discard", "fmi3DoStep returned fmi3Discard; its message: no solution for u = 2"),
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
    with pytest.raises(InputError, match="fmi2Fatal; its message: memory is gone 0"):
        ct.input_output_response(system, T, U, params={"trouble": TROUBLE["fatal"]})
    with pytest.raises(InputError, match="cannot be used after its fatal error"):
        ct.input_output_response(system, T, U)


def test_messages_of_two_fmus_and_of_fmpy_itself_do_not_mix(probe, capfd):
    one, two = probe(name="one"), probe(name="two")
    one.output(0, [0], [0])
    with pytest.raises(InputError, match=r"FMU 'two' failed .* its message: no solution for u = 4"):
        ct.input_output_response(two, T, 4.0, params={"trouble": TROUBLE["discard"]})
    with pytest.raises(InputError, match=r"FMU 'one' failed .* its message: no solution for u = 6"):
        ct.input_output_response(one, T, 6.0, params={"trouble": TROUBLE["discard"]})
    assert capfd.readouterr().out == ""
    start = {"trouble": TROUBLE["error"]}
    with pytest.raises(Exception, match="fmi2DoStep"):
        fmpy.simulate_fmu(
            str(one.path), stop_time=1.0, step_size=STEP, start_values=start, debug_logging=True
        )
    assert "the tank is empty, level -1.5" in capfd.readouterr().out
