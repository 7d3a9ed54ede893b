"""Simulation in time: a step stays a step, bad input is refused, results carry their names."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.controllers.references import circle
from hovercontrol.craft.models.vehicles import c17_simulation, hoverdemon

V, A = Signal("v", "m/s"), Signal("a", "m/s^2")
CART = Block("cart", [V], [A], [V, A], derivatives={"v": A.symbol})
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def test_a_step_on_a_coarse_grid_stays_a_step():
    v = simulate(CART, [0, 1, 2, 3], {"a": [0, 0, 1, 1]}, **TIGHT).states[0]
    assert v == pytest.approx([0, 0, 0, 1], abs=1e-9)  # python-control's ramp would give 0.5 at t = 2


def test_a_parameter_may_be_given_by_the_last_part_of_its_key_where_that_is_unique():
    plant, t = c17_simulation().plant(), np.linspace(0.0, 1.0, 3)
    commands, code = {"thrust": 2.0, "rudder": 0.3}, plant.compile()
    runs = [
        run(t, commands, params={key: 2.0}).states[:, -1]
        for key in ("plant.yaw_coulomb", "yaw_coulomb")
        for run in (code.simulate, lambda *args, **more: simulate(plant, *args, **more))
    ]
    assert (runs[0] == runs[2]).all() and (runs[1] == runs[3]).all()
    sweeps = [
        code.sweep(t, inputs=commands, params={key: [0.5, 2.0]})
        for key in ("plant.yaw_coulomb", "yaw_coulomb")
    ]
    assert (sweeps[0]["r"].final == sweeps[1]["r"].final).all()
    with pytest.raises(InputError, match=r"unknown parameter 'thrust'; did you mean 'plant\.thrust'"):
        simulate(plant, t, commands, params={"thrust": 2.0})  # an input has that name


def test_an_interpolated_input_is_a_ramp_if_asked_for():
    v = simulate(CART, [0, 1, 2, 3], {"a": [0, 0, 1, 1]}, hold="linear", **TIGHT).states[0]
    assert v == pytest.approx([0, 0, 0.5, 1.5], abs=1e-9)


@pytest.mark.parametrize(("hold", "gained"), [("zero", 1.0), ("linear", 1.0)])
def test_a_short_pulse_after_a_long_rest_is_not_stepped_over(hold, gained):
    time, a = np.arange(1001.0), np.zeros(1001)
    a[700] = 1.0
    assert simulate(CART, time, {"a": a}, hold=hold).states[0, -1] == pytest.approx(gained, abs=1e-6)


def test_an_interpolated_input_is_exact_on_an_uneven_grid(rng):
    time = np.cumsum(rng.uniform(0.01, 0.5, 40))
    a = rng.normal(size=40)
    v = simulate(CART, time, {"a": a}, hold="linear", **TIGHT).states[0]
    assert v == pytest.approx(
        np.concatenate([[0], np.cumsum(np.diff(time) * (a[1:] + a[:-1]) / 2)]), abs=1e-9
    )


def test_a_step_at_the_last_sample_shows_in_the_outputs_and_not_in_the_state():
    response = simulate(CART, [0, 1], {"a": [0.0, 5.0]})
    assert response.states[0, -1] == 0.0
    assert response.outputs[1, -1] == 5.0


def test_inputs_by_name_by_row_and_by_one_value_are_the_same():
    plant, time = hoverdemon().plant(), np.linspace(0, 1, 5)
    one = simulate(plant, time, {"thrust": 1.0, "rudder": np.full(5, 0.2)})
    two = simulate(plant, time, [1.0, 0.2])
    three = simulate(plant, time, [[1.0] * 5, [0.2] * 5])
    assert np.array_equal(one.states, two.states)
    assert np.array_equal(one.states, three.states)


def test_inputs_that_are_not_given_keep_their_start_value():
    plant = hoverdemon().plant().with_values({"thrust": 2.0, "u": 0.1})
    response = simulate(plant, [0, 1], {"rudder": 0.0}, **TIGHT)
    assert response.states[3, -1] == pytest.approx(0.1 + 2.0 / 2.6)


def test_time_may_start_anywhere():
    reference = circle(1.0)
    watch = Block(
        "watch",
        [Signal("x", "m")],
        [Signal("vx_ref", "m/s")],
        [Signal("x", "m")],
        derivatives={"x": Signal("vx_ref").symbol},
    )
    response = simulate(interconnect([reference, watch]), [3.0, 4.0, 5.0], **TIGHT)
    assert response.states[0] == pytest.approx(np.cos([3, 4, 5]) - np.cos(3.0), abs=1e-8)


def test_the_result_carries_names_plots_and_tables():
    response = simulate(c17_simulation().plant(), np.linspace(0, 1, 11), {"thrust": 1.0}, {"u": 0.2})
    assert response.output_labels == ["x", "y", "psi", "u", "v", "r"]
    assert response.input_labels == ["thrust", "rudder"]
    assert len(response.plot().lines.ravel()) >= 6
    pandas = pytest.importorskip("pandas")
    assert isinstance(response.to_pandas(), pandas.DataFrame)


def test_a_block_without_states_is_sampled():
    assert simulate(circle(2.0), [0, np.pi]).outputs[0] == pytest.approx([2.0, -2.0])


def test_parameters_and_initial_states_are_taken_by_name():
    response = simulate(
        c17_simulation().plant(),
        [0, 0.5],
        x0={"r": 3.0},
        **TIGHT,
        params={"plant.yaw_coulomb": 0.0, "plant.yaw_linear_drag": 2.0},
    )
    assert response.states[5, -1] == pytest.approx(3.0 * np.exp(-1.0), rel=1e-8)


def test_tighter_tolerance_means_smaller_error():
    plant = c17_simulation().plant()
    errors = []
    for rtol in (1e-4, 1e-7, 1e-10):
        end = simulate(
            plant,
            [0, 1],
            x0={"r": 3.0},
            rtol=rtol,
            atol=rtol * 1e-2,
            params={"plant.yaw_coulomb": 0.0},
        ).states[5, -1]
        errors.append(abs(end - 3.0 * np.exp(-0.48)))
    assert errors[0] > errors[1] > errors[2]


def test_progress_is_reported_up_to_the_end():
    seen = []
    simulate(CART, [0, 1, 2], {"a": [0, 1, 1]}, progress=seen.append)
    assert max(seen) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"time": [0]}, "two or more"),
        ({"time": [0, 0]}, "increasing"),
        ({"time": [0, np.nan]}, "finite"),
        ({"inputs": {"aa": 1.0}}, "no signal 'aa'; did you mean 'a'"),
        ({"inputs": {"v": 1.0}}, "'v' is not an input"),
        ({"inputs": {"a": [1.0, 2.0]}}, "input 'a': expected one or 3"),
        ({"inputs": {"a": np.nan}}, "input 'a': expected finite values, found nan$"),
        ({"inputs": {"a": [0.0, np.nan, 0.0]}}, r"input 'a': .* found nan at t = 1 s \(row 1\)"),
        ({"inputs": [[0.0, 0.0, np.inf]]}, r"input 'a': .* found inf at t = 2 s \(row 2\)"),
        ({"x0": [np.nan]}, "block 'cart': initial state 'v' is nan"),
        ({"x0": {"v": np.inf}}, "block 'cart': initial state 'v' is inf"),
        ({"inputs": [[1.0] * 3] * 2}, "expected 1 rows"),
        ({"x0": [1.0, 2.0]}, "expected 1 initial states, found 2"),
        ({"x0": {"a": 1.0}}, "'a' is not a state"),
        ({"x0": {"vv": 1.0}}, "no signal 'vv'"),
        ({"params": {"cart.k": 1.0}}, "unknown parameter 'cart.k'"),
        ({"hold": "first"}, "hold: expected 'zero' or 'linear'"),
    ],
)
def test_wrong_arguments_are_refused_in_words(arguments, message):
    with pytest.raises(InputError, match=message):
        simulate(CART, **{"time": [0, 1, 2], **arguments})


@pytest.mark.parametrize("run", ["simulate", "sweep"])
def test_machine_code_tells_a_command_that_is_not_a_number_with_its_time(run):
    message = r"input 'a': expected finite values, found nan at t = 0.5 s \(row 1\)"
    with pytest.raises(InputError, match=message):
        getattr(CART.compile(), run)([0.0, 0.5, 1.0], inputs=[[0.0, np.nan, 0.0]])


def test_a_motion_that_runs_away_names_the_time_it_did():
    k = Signal("k", "1/m", start=1.0)
    runaway = Block("runaway", [V.replace(start=1.0)], [], [V], [k], {"v": k.symbol * V.symbol**2})
    with pytest.raises(InputError, match=r"'runaway': the simulation stops at t = (0\.9|1)"):
        simulate(runaway, [0, 0.5, 2.0])


def test_a_derivative_that_is_no_number_is_an_error_and_not_a_result():
    k = Signal("k", "m^(1/2)/s^(3/2)", start=1.0)
    rooted = Block("rooted", [V.replace(start=-1.0)], [], [V], [k], {"v": k.symbol * sp.sqrt(V.symbol)})
    with pytest.raises(InputError, match="stops at"):
        simulate(rooted, [0, 1.0])


def test_every_solver_of_scipy_gives_the_same_motion():
    plant = c17_simulation().plant()
    ends = [
        simulate(plant, [0, 0.5], {"thrust": 2.0, "rudder": 0.2}, method=m, rtol=1e-8, atol=1e-10).states[
            :, -1
        ]
        for m in ("RK45", "DOP853", "LSODA", "Radau")
    ]
    for end in ends[1:]:
        assert np.allclose(end, ends[0], atol=1e-6)


def test_a_system_out_of_its_own_hands_agrees_with_a_closed_form():
    k, w = Signal("k", "1/s", start=0.5), Signal("w", "rad/s", start=3.0)
    y = Signal("y", "m/s", start=1.0)
    x = Signal("x", "m/s")
    spiral = Block(
        "spiral",
        [y, x],
        [],
        [y, x],
        [k, w],
        {
            "y": -k.symbol * y.symbol - w.symbol * x.symbol,
            "x": w.symbol * y.symbol - k.symbol * x.symbol,
        },
    )
    t = np.linspace(0, 4, 9)
    run = simulate(spiral, t, **TIGHT)
    assert np.allclose(run.states, np.exp(-t / 2) * np.array([np.cos(3 * t), np.sin(3 * t)]), atol=1e-8)


@pytest.mark.parametrize("name", ["rtol", "atol"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_a_tolerance_is_a_positive_finite_number(name, value):
    with pytest.raises(InputError, match=name):
        simulate(CART, [0, 1], {"a": 1.0}, **{name: value})
