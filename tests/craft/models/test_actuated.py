"""Actuators in front of a plant, against equations by hand, SciPy and python-control's own saturation."""

from dataclasses import replace

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.actuated import actuated
from hovercontrol.craft.models.fans import BenchCurve
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, four_fan

TIMES = np.linspace(0.0, 2.0, 41)


def cart(**force):
    v, m = hc.Signal("v", "m/s"), hc.Signal("m", "kg", start=2.0)
    F = hc.Signal("F", "N", **{"lower": -1.0, "upper": 4.0, **force})
    return hc.Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol})


def column(response, name):
    return np.reshape(response.outputs, (-1, len(response.time)))[list(response.output_labels).index(name)]


def everywhere(block, inputs, times=TIMES):
    """Return the responses of hc.simulate, of machine code and of python-control."""
    system = block.to_control()
    u = [np.broadcast_to(inputs.get(s.name, s.start), times.shape) for s in block.inputs] or 0.0
    x0 = [s.start for s in block.states]
    return (
        hc.simulate(block, times, inputs),
        block.compile().simulate(times, inputs),
        ct.input_output_response(system, times, u, x0, solve_ivp_kwargs={"rtol": 1e-8, "atol": 1e-10}),
    )


# ---- saturation ------------------------------------------------------------------------------------------


def test_the_applied_command_is_python_controls_saturation_of_the_command():
    saturation = ct.saturation_nonlinearity(4.0)
    outputs = actuated(cart(lower=-4.0)).to_numpy().outputs
    for F in (-899.0, -1.0, -0.3, 0.0, 3.999, 4.0, 4.1, 899.0):
        assert outputs(0.0, [0.0], [F])[1] == saturation(F)


@pytest.mark.parametrize("craft", [c17_experiment(), four_fan()], ids=lambda m: m.name)
def test_a_limited_craft_moves_as_the_free_one_does_under_clipped_commands(craft, rng):
    free, limited = craft.plant(), craft.plant(limited=True)
    lower, upper = ([getattr(s, key) for s in free.inputs] for key in ("lower", "upper"))
    compiled = limited.compile()
    for _ in range(20):
        x, u = rng.normal(0, 1, 6), rng.normal(0, 5, len(free.inputs))
        wanted = free.to_numpy().derivatives(0.0, x, np.clip(u, lower, upper))
        assert limited.to_numpy().derivatives(0.0, x, u) == pytest.approx(wanted, rel=1e-12, abs=1e-12)
        assert compiled.derivatives(0.0, x, u) == pytest.approx(wanted, rel=1e-12, abs=1e-12)
        assert limited.to_control().dynamics(0.0, x, u) == pytest.approx(wanted, rel=1e-12, abs=1e-12)


def test_bounds_are_parameters_that_a_sweep_varies():
    block = actuated(cart())
    runs = block.compile().sweep([0.0, 1.0], inputs={"F": 899.0}, params={"cart.F_upper": [1.0, 2.0, 6.0]})
    assert runs["v"].final == pytest.approx([0.5, 1.0, 3.0])


def test_bounds_may_be_given_where_the_signal_has_none():
    block = actuated(c17_simulation(), bounds={"thrust": (0.0, 4.0), "rudder": (-0.5, 0.5)})
    assert [(s.lower, s.upper, s.saturates) for s in block.inputs] == [(0, 4, True), (-0.5, 0.5, True)]
    assert block.to_numpy().outputs(0.0, np.zeros(6), [899.0, 3.14])[-2:].tolist() == [4.0, 0.5]


def test_an_input_without_bounds_passes_as_it_is():
    assert actuated(c17_simulation()) is not None
    assert [s.name for s in actuated(c17_simulation()).outputs] == ["x", "y", "psi", "u", "v", "r"]
    assert actuated(cart(), bounds=False) == cart()


# ---- dead zone, rate limit, lag --------------------------------------------------------------------------


def test_dead_zone_then_saturation():
    block = actuated(cart(), deadzone=0.5)
    for F, applied in ((0.4, 0.0), (-0.5, 0.0), (1.5, 1.0), (4.3, 3.8), (4.5, 4.0), (9.0, 4.0), (-9.0, -1.0)):
        assert block.to_numpy().outputs(0.0, [0.0], [F])[1] == pytest.approx(applied)


def test_a_lag_follows_the_saturated_command_exponentially():
    wanted = 4.0 * (1.0 - np.exp(-TIMES / 0.3))
    for response in everywhere(actuated(cart(), lag=0.3), {"F": np.full(TIMES.size, 9.0)}):
        assert column(response, "F_applied") == pytest.approx(wanted, abs=2e-5)


def test_a_rate_limit_is_a_ramp_to_the_bound():
    wanted = np.minimum(3.0 * TIMES, 4.0)
    for response in everywhere(actuated(cart(), rate=3.0), {"F": np.full(TIMES.size, 9.0)}):
        assert column(response, "F_applied") == pytest.approx(wanted, abs=3.5e-3)  # rate times tau, 1 ms


def test_a_rate_limit_and_a_lag_are_one_servo_whose_rate_is_limited():
    command = np.where(TIMES < 1.0, 3.0, -0.5)

    def servo(t, x):
        c = 3.0 if t < 1.0 else -0.5
        return [np.clip((c - x[0]) / 0.2, -5.0, 5.0)]

    first = solve_ivp(servo, (0, 1), [0.0], t_eval=TIMES[TIMES <= 1], rtol=1e-9, max_step=0.01)
    second = solve_ivp(servo, (1, 2), first.y[:, -1], t_eval=TIMES[TIMES >= 1], rtol=1e-9, max_step=0.01)
    wanted = np.concatenate([first.y[0], second.y[0][1:]])
    block = actuated(cart(), rate=5.0, lag=0.2)
    for response in (
        hc.simulate(block, TIMES, {"F": command}),
        block.compile().simulate(TIMES, {"F": command}),
    ):
        assert column(response, "F_applied") == pytest.approx(wanted, abs=1e-4)
    assert [s.name for s in block.states] == ["v", "F_rate_limited"]


def test_actuators_rest_at_the_inputs_start_values():
    block = actuated(cart(start=2.0, lower=1.0), deadzone=0.4, lag=0.1)
    assert block.states[1].start == pytest.approx(1.6)
    assert column(hc.simulate(block, [0.0, 1.0]), "F_applied") == pytest.approx([1.6, 1.6])


def test_each_input_has_its_own_actuator():
    block = actuated(c17_experiment(), rate={"rudder": 2.0}, lag={"thrust": 0.1})
    assert [s.name for s in block.states[6:]] == ["thrust_lagged", "rudder_rate_limited"]
    assert [s.name for s in block.outputs[6:]] == ["thrust_applied", "rudder_applied"]
    assert block.parameter("rudder_rate_limit_limit").unit == "rad/s"


def test_an_actuator_of_a_model_with_effects_of_its_own_and_a_delay():
    craft = c17_experiment().with_effects([hc.effect("input_delay", 0.2), hc.effect("thrust_curve", 0.3)])
    block = actuated(craft, lag={"thrust": 0.1})
    run = block.compile().simulate(TIMES, {"thrust": np.full(TIMES.size, 9.0)})
    wanted = 6.1 * (1 - np.exp(-np.maximum(TIMES - 0.2, 0.0) / 0.1))
    assert column(run, "thrust_applied") == pytest.approx(wanted, abs=2e-5)


def test_a_sampled_block_saturates_too():
    n, u = hc.Signal("n"), hc.Signal("u", lower=0.0, upper=1.0)
    counter = hc.Block("counter", [n], [u], [n], [], {"n": n.symbol + u.symbol}, period=0.5)
    found = hc.simulate(actuated(counter), np.arange(0.0, 2.1, 0.5), {"u": 7.0})
    assert column(found, "n").tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    with pytest.raises(InputError, match="sampled"):
        actuated(counter, lag=0.1)


# ---- the switch of a model -------------------------------------------------------------------------------


def test_the_switch_of_a_model_and_of_its_file(tmp_path):
    craft = replace(c17_experiment(), limited=True)
    again = hc.load_model(hc.save_model(craft, tmp_path / "craft.toml"))
    assert again == craft
    assert again.plant() == c17_experiment().plant(limited=True)
    assert again.plant(limited=False) == c17_experiment().plant()
    assert "thrust_upper" in [p.name for p in hc.tracking_controller(craft).parameters]
    assert "thrust_upper" not in [p.name for p in hc.tracking_controller(c17_experiment()).parameters]


def test_the_switch_of_a_block_model(rng):
    model = hc.BlockModel(cart(), limited=True)
    lagged = model.with_effects([model.effect_class("F_lag")(0.1)])
    run = hc.simulate(lagged.plant(), TIMES, {"F": np.full(TIMES.size, 9.0)})
    assert column(run, "v")[-1] == pytest.approx(2.0 * (2.0 - 0.1), abs=1e-4)
    assert actuated(model, lag=0.2).states[1].name == "F_lagged"


def test_the_largest_force_of_a_fan(tmp_path):
    craft = replace(four_fan(), fans=tuple(replace(f, upper=0.3) for f in four_fan().fans))
    assert hc.load_model(hc.save_model(craft, tmp_path / "fans.toml")) == craft
    assert {(s.lower, s.upper) for s in craft.plant().inputs} == {(0.0, 0.3)}
    both = hc.Fan("stern", -0.1, 0.0, 0.0, reverses=True, upper=0.3).command()
    assert (both.lower, both.upper) == (-0.3, 0.3)
    assert hc.Fan("stern", -0.1, 0.0, 0.0, curve=[0.1], upper=0.5).command().upper == 0.5


def test_a_scenario_switches_the_limits_on(tmp_path):
    from hovercontrol.documents.scenarios import load_scenario, run_scenario

    text = """
        [scenario]
        step = 0.1
        [plant]
        vehicle = "c17_experiment"
        {limited}
        [reference]
        kind = "circle"
        radius = 2.0
        rate = 1.0
        [controller]
        control_point = 0.3
        [[phase]]
        until = 5.0
    """
    largest = {}
    for limited in ("", "limited = true"):
        (tmp_path / "circle.toml").write_text(text.format(limited=limited))
        run = run_scenario(load_scenario(tmp_path / "circle.toml"))
        largest[limited] = max(run.columns["thrust"])
    assert largest[""] > 10.0
    assert largest["limited = true"] == pytest.approx(6.1)


def test_a_loop_within_its_limits_is_the_same_in_python_machine_code_and_python_control():
    craft = replace(c17_experiment(), limited=True)
    plant = actuated(craft, lag={"thrust": 0.1}, rate={"rudder": 4.0})
    law = hc.tracking_controller(craft, control_point=0.3)
    loop = hc.interconnect([plant, law, hc.circle(2.0, 0.5)])
    python, machine, control = everywhere(loop, {}, np.linspace(0.0, 4.0, 41))
    for name in ("x", "y", "thrust_applied", "rudder_applied"):
        assert column(machine, name) == pytest.approx(column(python, name), abs=1e-3)
        assert column(control, name) == pytest.approx(column(python, name), abs=1e-3)
    assert column(machine, "thrust").max() == 6.1
    assert np.abs(column(machine, "rudder_applied")).max() <= np.radians(26) + 1e-5  # solver tolerance


# ---- what is refused -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"lag": {"thurst": 0.1}}, "lag: no input 'thurst'; did you mean 'thrust'"),
        ({"bounds": {"ruder": (0.0, 1.0)}}, "bounds: no input 'ruder'; did you mean 'rudder'"),
        ({"bounds": {"rudder": (1.0, 0.0)}}, "lower = 1 is above upper = 0"),
        ({"rate": 3.0}, "different units"),
        ({"rate": {"rudder": -3.0}}, "must be positive"),
        ({"lag": 0.0}, "must be positive"),
    ],
)
def test_wrong_numbers_are_refused(options, text):
    with pytest.raises(InputError, match=text):
        actuated(c17_experiment(), **options)


def test_an_input_passes_one_actuator():
    with pytest.raises(InputError, match="'F' already has an actuator"):
        actuated(actuated(cart()), lag=0.1)


def test_what_a_model_file_may_say_of_limits(tmp_path):
    file = tmp_path / "craft.toml"
    file.write_text('[plant]\nlimited = "yes"\n[effects]\n')
    with pytest.raises(InputError, match="limited: expected true or false"):
        hc.load_model(file)
    with pytest.raises(InputError, match="its curve ends at 1"):
        hc.Fan("f", 0.0, 0.0, 0.0, curve=BenchCurve([0.0, 1.0], [0.0, 0.4]), upper=0.5)


# ---- estimators ------------------------------------------------------------------------------------------

DRAG = {"surge_coulomb": 1.35, "yaw_coulomb": 0.83, "sway_linear_drag": 1.2}


@pytest.mark.slow
@pytest.mark.parametrize("lag", [None, 0.2])
def test_an_estimator_that_sees_applied_commands_does_not_wind_up(lag, rng):
    craft = c17_experiment()
    plant, sent = actuated(craft, lag=lag), hc.kalman_bucy(craft.plant(), list(DRAG))
    seen = {"sent": sent, "applied": hc.applied_inputs(sent, plant)}
    if lag is None:
        seen["limited"] = hc.kalman_bucy(craft.plant(limited=True), list(DRAG))
    times = np.linspace(0.0, 20.0, 401)
    u = {name: np.repeat(rng.uniform(low, high, 41), 10)[:401]
         for name, low, high in (("thrust", 0.0, 14.0), ("rudder", -1.2, 1.2))}  # fmt: skip
    off = {}
    for name, estimator in seen.items():
        run = hc.interconnect([plant, estimator]).compile().simulate(times, u)
        off[name] = max(abs(column(run, f"{c}_hat")[-1] - value) for c, value in DRAG.items())
    assert off.pop("sent") > 0.1
    assert max(off.values()) < 0.01


def test_an_estimator_of_a_plant_that_tells_nothing_is_refused():
    estimator = hc.kalman_bucy(c17_simulation().plant(), ["yaw_coulomb"])
    with pytest.raises(InputError, match="no applied command that is an input of 'estimator'"):
        hc.applied_inputs(estimator, c17_simulation().plant())
