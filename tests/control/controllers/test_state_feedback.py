"""LQR and pole placement about an operating point, against python-control's own and SciPy's."""

import warnings

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import hovercontrol as hc
from hovercontrol.base.errors import InputError, SmoothedFrictionWarning

LINE = ("y", "psi", "v", "r")


def plant_without_friction():
    """C17's craft with viscous drag alone: its linearisation has no smoothed friction."""
    craft = hc.vehicle("c17_simulation")
    names = ("surge_coulomb", "sway_coulomb", "yaw_coulomb")
    return craft.with_coefficients(dict.fromkeys(names, 0.0) | {"surge_linear_drag": 1.35}).plant()


def straight(speed=1.0, thrust=1.8):
    return control.OperatingPoint([0, 0, 0, speed, 0, 0], [thrust, 0])


def on_course(x, speed=1.0):
    """A and B of (y, psi, v, r) against the rudder by hand: C17 (8), (11) about u = speed, T = 1.8."""
    T, c4, c6, c7, c8 = 1.8, 1.2, 0.48, 0.75, 0.14 * 0.75 * 0.585 / 0.01
    A = np.array([[0, speed, 1, 0], [0, 0, 0, 1], [0, 0, -c4, -speed], [0, 0, 0, -c6]])
    return A, np.array([[0], [0], [c7 * T], [-c8 * T]])


def test_the_gains_are_those_of_control_lqr_on_matrices_by_hand():
    A, B = on_course(LINE)
    K = control.lqr(A, B, np.diag([4.0, 2.0, 0.0, 1.0]), [[3.0]])[0]
    plant = hc.vehicle("c17_simulation").plant()
    block = hc.lqr(plant, straight(), {"y": 4.0, "psi": 2.0, "r": 1.0}, {"rudder": 3.0})
    found = block.default_parameters
    assert [found[f"controller.K_rudder_{s}"] for s in LINE] == pytest.approx(K[0], rel=1e-9)
    assert found["controller.rudder_trim"] == 0.0
    assert [s.name for s in block.outputs] == ["rudder"]
    assert block.signal("psi_ref").unit == "rad" and block.signal("K_rudder_y").unit == "rad/m"


def test_the_loop_has_the_poles_and_margins_of_the_design():
    plant, at = plant_without_friction(), straight()
    block = hc.lqr(plant, at, {"y": 4.0, "psi": 2.0, "r": 1.0, "u": 2.0}, {"rudder": 3.0, "thrust": 1.0})
    loop = hc.interconnect([plant, block])
    states = ["y", "psi", "u", "v", "r"]
    linear = plant.linearize(at)
    rows = [linear.state_labels.index(s) for s in states]
    A, B = linear.A[np.ix_(rows, rows)], linear.B[rows]
    K, _, poles = control.lqr(A, B, np.diag([4.0, 2.0, 2.0, 0.0, 1.0]), np.diag([1.0, 3.0]))
    found = loop.linearize(np.array([0, 0, 0, 1.0, 0, 0]), [s.start for s in loop.inputs]).poles()
    kept = found[np.argsort(np.abs(found))[1:]]  # the first is x, which nothing feeds back
    assert np.sort_complex(kept) == pytest.approx(np.sort_complex(poles), abs=1e-9)
    feedback = block.linearize([], [0, 0, 1.0, 0, 0, 0, 0, 1.0, 0, 0])
    assert -feedback.D[:, :5] == pytest.approx(K, abs=1e-9)
    margins = control.stability_margins(control.ss(A, B[:, 1:], K[1:], 0))[:3]
    ours = control.stability_margins(control.ss(A, B[:, 1:], -feedback.D[1:, :5], 0))[:3]
    assert ours == pytest.approx(margins, rel=1e-9)


@pytest.mark.parametrize("friction", ["smooth", "events"])
def test_a_craft_half_a_metre_beside_its_line_returns_to_it(friction):
    """Also with Coulomb's law, where a design on the smoothed friction sticks more than a metre away."""
    plant, t = hc.vehicle("c17_simulation").plant(), np.linspace(0, 30, 301)
    weights = {"y": 10.0, "psi": 1.0, "v": 1.0, "r": 0.1, "u": 1.0}

    def distance(**design):
        block = hc.lqr(plant, straight(), weights, {"rudder": 1.0, "thrust": 1.0}, **design)
        run = hc.interconnect([plant, block]).compile(friction=friction)
        result = run.simulate(t, x0={"plant.y": 0.5, "plant.u": 1.0})
        outputs = dict(zip(result.output_labels, result.outputs, strict=True))
        assert outputs["u"][-1] == pytest.approx(1.0, abs=0.1)
        assert outputs["x"][-1] > 25.0
        return np.abs(outputs["y"][50:]).max()

    assert distance() < 0.04
    assert 0.06 < distance(compensate_friction=False) < 0.12
    if friction == "events":
        with pytest.warns(SmoothedFrictionWarning):
            assert distance(friction="smooth") > 1.0


@pytest.mark.slow
def test_the_craft_of_the_experiment_follows_its_line_within_its_rudder_limit():
    """Dry friction in yaw makes it weave; less when compensated, also with a late rudder and gyro noise."""
    craft, t = hc.vehicle("c17_experiment"), np.linspace(0, 40, 801)
    at = craft.plant().trim({"u": 1.0, "r": 0.0, "psi": 0.0})
    late = craft.with_effects([hc.effect("rudder_lag", 0.1)]).plant()
    noise = 0.02 * np.random.default_rng(1).normal(size=t.size)
    r, n = hc.Signal("r", "rad/s"), hc.Signal("noise", "rad/s")
    gyro = hc.Block(
        "gyro", [], [r, n], [hc.Signal("r_seen", "rad/s")], [], {}, {"r_seen": r.symbol + n.symbol}
    )

    def distance(plant, noise=0.0, **design):
        weights = {"y": 1.0, "psi": 1.0, "v": 1.0, "r": 1.0, "u": 1.0}
        block = hc.lqr(craft.plant(), at, weights, {"rudder": 1.0, "thrust": 1.0}, period=0.02, **design)
        loop = hc.interconnect([plant, gyro, hc.rename(block, {"r": "r_seen"})])
        x0 = {"plant.y": 0.5, "plant.u": 1.0}
        run = loop.compile(friction="events").simulate(t, {"noise": noise}, x0=x0)
        rudder = run.outputs[run.output_labels.index("rudder")]
        assert np.abs(rudder).max() <= np.radians(26) + 1e-12
        return np.abs(run.outputs[run.output_labels.index("y")][300:]).max()

    assert distance(craft.plant()) < 0.1
    assert distance(late, noise) < 0.15
    assert distance(craft.plant(), compensate_friction=False) > 0.3


def test_the_loop_runs_alike_in_every_backend():
    plant, t = hc.vehicle("c17_experiment").plant(), np.linspace(0, 3, 61)
    block = hc.lqr(
        plant, straight(), max_states={"y": 0.5, "u": 0.2}, max_inputs={"rudder": 0.3, "thrust": 1.0}
    )
    loop, x0 = hc.interconnect([plant, block]), {"plant.y": 1.0, "plant.u": 1.0}
    x = [0, 1.0, 0, 1.0, 0, 0]
    python = hc.simulate(loop, t, x0=x0, rtol=1e-9, atol=1e-11)
    compiled = loop.compile().simulate(t, x0=x0, rtol=1e-9, atol=1e-11)
    u = np.outer([s.start for s in loop.inputs], np.ones_like(t))
    response = control.input_output_response(
        loop.to_control(), t, u, x, solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-11}
    )
    assert compiled.outputs == pytest.approx(python.outputs, abs=1e-6)
    assert response.outputs == pytest.approx(python.outputs, abs=1e-6)
    rudder = python.outputs[python.output_labels.index("rudder")]
    assert np.abs(rudder).max() == pytest.approx(np.radians(26))  # the bound of the craft's rudder


@pytest.mark.slow
def test_the_controller_flies_as_an_fmu(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    plant, t = hc.vehicle("c17_experiment").plant(), np.linspace(0, 3, 61)
    block = hc.lqr(plant, straight(), {"y": 4.0, "u": 1.0}, {"rudder": 3.0, "thrust": 1.0})
    loop = hc.interconnect([plant, block]).with_values({"plant.y": 0.5, "plant.u": 1.0})
    expected = loop.compile().simulate(t)
    path = loop.to_fmu(tmp_path / "loop.fmu")
    found = fmpy.simulate_fmu(str(path), stop_time=3.0, output_interval=0.05, output=["y", "rudder"])
    y = expected.outputs[expected.output_labels.index("y")]
    assert found["y"] == pytest.approx(y, abs=1e-4)
    changed = {"controller.K_rudder_y": 0.0, "controller.K_rudder_psi": 0.0}
    free = fmpy.simulate_fmu(
        str(path), stop_time=3.0, output_interval=0.05, output=["y"], start_values=changed
    )
    assert np.abs(free["y"] - y).max() > 0.05


def test_a_sampled_design_is_dlqr_on_the_exact_discretisation():
    A, B = on_course(LINE)
    h = 0.1
    M = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 5))]]) * h)
    K = control.dlqr(M[:4, :4], M[:4, 4:], np.diag([4.0, 2.0, 0.0, 1.0]), [[3.0]])[0]
    plant = hc.vehicle("c17_simulation").plant()
    weights = {"y": 4.0, "psi": 2.0, "r": 1.0, "u": 1.0}
    block = hc.lqr(plant, straight(), weights, {"rudder": 3.0, "thrust": 1.0}, period=h)
    found = [block.default_parameters[f"controller.K_rudder_{s}"] for s in LINE]
    assert found == pytest.approx(K[0], rel=1e-8)
    assert block.period == h
    loop, t = hc.interconnect([plant, block]), np.linspace(0, 10, 101)
    run = hc.simulate(loop, t, x0={"plant.y": 0.5, "plant.u": 1.0})
    y = run.outputs[run.output_labels.index("y")]
    assert np.abs(y[60:]).max() < 0.25
    compiled = loop.compile().simulate(t, x0={"plant.y": 0.5, "plant.u": 1.0})
    assert compiled.outputs == pytest.approx(run.outputs, abs=1e-4)
    assert loop.to_control().dt == h


def test_a_design_by_the_describing_function_has_the_slope_of_its_amplitude():
    """Dry friction c5 at the amplitude A of the yaw rate: 4 c5/(pi A)."""
    plant = hc.vehicle("c17_simulation").plant()
    A, B = on_course(LINE)
    A = A + np.diag([0, 0, 0, -4 * 0.83 / (np.pi * 0.2)])
    K = control.lqr(A, B, np.diag([4.0, 2.0, 0.0, 1.0]), [[3.0]])[0]
    block = hc.lqr(
        plant,
        straight(),
        {"y": 4.0, "psi": 2.0, "r": 1.0},
        {"rudder": 3.0},
        friction="describing",
        amplitude={"r": 0.2},
    )
    found = [block.default_parameters[f"controller.K_rudder_{s}"] for s in LINE]
    assert found == pytest.approx(K[0], rel=1e-8)


def test_heading_errors_are_wrapped():
    plant = hc.vehicle("c17_simulation").plant()
    block = hc.lqr(plant, straight(), {"psi": 1.0, "y": 1.0}, {"rudder": 1.0})
    f, names = block.to_numpy(), [s.name for s in block.inputs]

    def rudder(psi, psi_ref):
        values = {"psi": psi, "psi_ref": psi_ref}
        return f.outputs(0.0, (), [values.get(n, 0.0) for n in names])[0]

    assert rudder(3.1, -3.1) == pytest.approx(rudder(6.2 - 2 * np.pi, 0.0), rel=1e-9)
    assert rudder(0.2, 4 * np.pi) == pytest.approx(rudder(0.2, 0.0), rel=1e-9)


def test_place_puts_the_poles_where_scipy_does():
    plant, at = hc.vehicle("c17_simulation").plant(), straight()
    A, B = on_course(LINE)
    poles = [-1 + 1j, -1 - 1j, -2.0, -3.0]
    block = hc.place(plant, at, poles, states=LINE, inputs=["rudder"])
    K = [block.default_parameters[f"controller.K_rudder_{s}"] for s in LINE]
    assert pytest.approx(scipy.signal.place_poles(A, B, poles).gain_matrix[0], rel=1e-9) == K
    assert np.poly(A - B @ [K]) == pytest.approx(np.poly(poles), rel=1e-8)
    h = 0.05
    sampled = hc.place(plant, at, poles, states=LINE, inputs=["rudder"], period=h)
    K = np.array([[sampled.default_parameters[f"controller.K_rudder_{s}"] for s in LINE]])
    M = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 5))]]) * h)
    assert np.poly(M[:4, :4] - M[:4, 4:] @ K) == pytest.approx(np.poly(np.exp(np.array(poles) * h)), rel=1e-8)


def test_poles_of_an_unstable_loop_and_too_many_poles_are_refused():
    plant = hc.vehicle("c17_simulation").plant()
    text = refusal(hc.place, plant, straight(), [1, 1.5, -2, -3], states=LINE, inputs=["rudder"])
    assert "poles: expected negative real parts [1/s], found 1, 1.5, -2, -3" in text
    text = refusal(hc.place, plant, straight(), [-1, -1.5, -2, -2.5, -3, -4])
    assert "expected 5 poles for the states y, psi, u, v, r, found 6; x is not fed back" in text


def test_by_default_the_states_at_rest_are_fed_back():
    plant = hc.vehicle("c17_simulation").plant()
    block = hc.place(plant, straight(), [-1, -1.5, -2, -2.5, -3])
    assert [s.name for s in block.inputs][:5] == ["y", "psi", "u", "v", "r"]


def test_weights_come_by_name_as_diagonals_as_matrices_and_by_brysons_rule():
    plant = hc.vehicle("c17_simulation").plant()
    by_name = hc.lqr(plant, straight(), {"y": 4.0, "psi": 1.0}, {"rudder": 4.0, "thrust": 1.0}, states=LINE)
    others = [
        hc.lqr(plant, straight(), [4.0, 1.0, 0.0, 0.0], [1.0, 4.0], states=LINE),
        hc.lqr(plant, straight(), np.diag([4.0, 1, 0, 0]), np.diag([1.0, 4.0]), states=LINE),
        hc.lqr(
            plant, straight(), states=LINE,
            max_states={"y": 0.5, "psi": 1.0}, max_inputs={"rudder": 0.5, "thrust": 1.0},
        ),
    ]  # fmt: skip
    for other in others:
        assert other.default_parameters == pytest.approx(by_name.default_parameters)


def test_an_operating_point_comes_by_name_or_as_arrays():
    plant = hc.vehicle("c17_simulation").plant()
    named, trim = {"u": 1.0, "thrust": 1.8}, plant.trim({"u": 1.0, "r": 0.0, "psi": 0.0})
    blocks = [hc.lqr(plant, at, {"y": 1.0}, {"rudder": 1.0}) for at in (named, trim, straight())]
    assert blocks[0] == blocks[2]
    assert blocks[1].default_parameters == pytest.approx(blocks[2].default_parameters, abs=1e-9)


def test_an_estimator_stands_between():
    plant = hc.vehicle("c17_simulation").plant()
    block = hc.lqr(plant, straight(), {"y": 1.0}, {"rudder": 1.0}, measured="{}_hat")
    assert [s.name for s in block.inputs][:4] == ["y_hat", "psi_hat", "v_hat", "r_hat"]
    assert [s.name for s in block.inputs][4:] == ["y_ref", "psi_ref", "v_ref", "r_ref"]


def late_rudder(seconds):
    return hc.vehicle("c17_simulation").with_effects([hc.effect("rudder_lag", seconds)]).plant()


def test_a_lag_of_the_rudder_that_no_output_shows_is_taken_as_immediate():
    weights = ({"y": 4.0, "psi": 2.0, "r": 1.0}, {"rudder": 3.0})
    late = late_rudder(0.1)
    block = hc.lqr(late, late.trim({"u": 1.0, "r": 0.0, "psi": 0.0}), *weights)
    prompt = hc.lqr(hc.vehicle("c17_simulation").plant(), straight(), *weights)
    assert block.default_parameters == pytest.approx(prompt.default_parameters, rel=1e-6, abs=1e-9)
    assert [s.name for s in block.inputs] == [s.name for s in prompt.inputs]


def test_an_estimated_lag_of_the_rudder_is_fed_back():
    late = late_rudder(0.1)
    at = late.trim({"u": 1.0, "r": 0.0, "psi": 0.0})
    weights = ({"y": 4.0, "psi": 2.0, "r": 1.0}, {"rudder": 3.0})
    block = hc.lqr(late, at, *weights, measured="{}_hat")
    lag = next(s.name for s in late.states if "rudder" in s.name)
    assert f"{lag}_hat" in [s.name for s in block.inputs]
    A, B = on_course(LINE)
    A = np.block([[A, B], [np.zeros((1, 4)), np.array([[-10.0]])]])
    K = control.lqr(A, [[0], [0], [0], [0], [10.0]], np.diag([4.0, 2.0, 0.0, 1.0, 0.0]), [[3.0]])[0]
    found = [block.default_parameters[f"controller.K_rudder_{s}"] for s in (*LINE, lag)]
    assert found == pytest.approx(K[0], rel=1e-6)
    text = refusal(hc.lqr, late, at, *weights, states=[*LINE, lag])
    assert f"no output of block 'plant' shows the state {lag!r}" in text


def test_a_plant_with_a_controller_in_it_is_designed_for_by_its_outputs_names():
    """The states of an interconnection are named plant.y; its outputs are y."""
    plant = hc.vehicle("c17_simulation").plant()
    speed = hc.lqr(plant, straight(), {"u": 1.0}, {"thrust": 1.0}, name="speed")
    inner = hc.interconnect([plant, speed], "craft")
    at = {"plant.u": 1.0, "u_ref": 1.0}
    block = hc.lqr(inner, at, {"y": 4.0, "psi": 2.0, "r": 1.0}, {"rudder": 3.0}, name="steering")
    alone = hc.lqr(plant, straight(), {"y": 4.0, "psi": 2.0, "r": 1.0}, {"rudder": 3.0}, name="steering")
    assert block.default_parameters == pytest.approx(alone.default_parameters, rel=1e-9)
    assert [s.name for s in block.inputs] == [s.name for s in alone.inputs]


def test_a_craft_turns_steadily_about_a_trim_of_a_turn():
    plant, t = hc.vehicle("c17_simulation").plant(), np.linspace(0, 15, 151)
    turn = plant.trim({"u": 1.0, "r": 0.4})
    block = hc.lqr(plant, turn, {"u": 1.0, "v": 1.0, "r": 4.0}, {"thrust": 1.0, "rudder": 1.0})
    assert "controller.F_rudder_r" not in block.default_parameters  # the yaw friction is constant on a turn
    run = hc.interconnect([plant, block]).compile(friction="events").simulate(t, x0={"plant.u": 0.6})
    end = dict(zip(run.output_labels, run.outputs[:, -1], strict=True))
    for name in ("u", "v", "r"):
        assert end[name] == pytest.approx(turn.states[name], abs=1e-4)


# ---- what is refused -----------------------------------------------------------------------------


def refusal(function, *args, **kwargs):
    with pytest.raises(InputError) as caught:
        function(*args, **kwargs)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_craft_at_rest_cannot_be_steered_and_the_line_names_the_mode():
    plant = hc.vehicle("c17_simulation").plant()
    text = refusal(hc.lqr, plant, straight(0.0, 0.0), {"psi": 1.0}, {"rudder": 1.0})
    assert text.startswith("lqr: rudder cannot move the mode at 0 1/s, the state combination")
    assert "psi" in text


def test_a_mode_that_only_dry_friction_damps_is_named_with_the_option_that_has_its_slope():
    dry = hc.vehicle("c17_simulation").without_effects("sway_linear_drag")
    plant = dry.with_effects([hc.effect("sway_coulomb", 0.3)]).plant()
    at, weights = plant.trim({"u": 1.0, "r": 0.0, "psi": 0.0}), ({"y": 4.0, "psi": 2.0}, {"rudder": 3.0})
    assert "have the dry friction of v and r in the linear model (friction='smooth')" in refusal(
        hc.lqr, plant, at, *weights
    )
    with pytest.warns(hc.SmoothedFrictionWarning):
        hc.lqr(plant, at, *weights, friction="smooth")


@pytest.mark.parametrize("period", [None, 0.1])
def test_an_input_without_effect_at_the_operating_point_is_named(period):
    x, z, u, w = (hc.Signal(name, unit) for name, unit in zip("xzuw", ["m", "m", "m/s", "m/s"], strict=True))
    k, c = hc.Signal("k", "1/s", start=1.0), hc.Signal("c", "m/s", start=1.0)
    rates = {"x": u.symbol * abs(u.symbol) / c.symbol - k.symbol * x.symbol}
    rates["z"] = w.symbol - k.symbol * z.symbol
    plant = hc.Block("b", [x, z], [u, w], [x, z], [k, c], rates)
    rest, moving = (plant.trim({"x": at, "z": 0.0}) for at in (0.0, 1.0))
    # w moves z alone
    for Q, R in (({"x": 1.0}, {"u": 1.0}), ({"x": 1.0, "z": 1.0}, {"u": 1.0, "w": 1.0})):
        with pytest.warns(UserWarning, match="lqr: at this point u cannot move x: the gain is 0") as said:
            found = hc.lqr(plant, rest, Q, R, period=period)
        assert len(said) == 1 and found.default_parameters["controller.K_u_x"] == 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hc.lqr(plant, moving, {"x": 1e-6}, {"u": 1e6, "w": 1.0}, period=period)  # w is not needed
        hc.lqr(plant, rest, {"z": 1.0}, {"u": 1.0, "w": 1.0}, period=period)


def test_a_state_that_drifts_without_a_weight_is_named():
    plant = hc.vehicle("c17_simulation").plant()
    text = refusal(hc.lqr, plant, straight(), {"psi": 1.0}, {"rudder": 1.0}, states=LINE)
    assert "Q does not weight the mode at 0 1/s, which moves y;" in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"Q": {"ps": 1.0}}, "no state 'ps'; did you mean 'psi'?"),
        ({"Q": {"x": 1.0}}, "x moves by 1 m per second at the operating point"),
        ({"R": {"ruder": 1.0}}, "no input 'ruder'; did you mean 'rudder'?"),
        ({"R": {"rudder": -1.0}}, "positive definite"),
        ({"Q": {"y": -1.0}}, "positive semidefinite"),
        ({"Q": np.eye(3)}, "expected weights of y, psi, u, v, r"),
        ({"max_states": {"y": 1.0}}, "either Q or max_states, found both"),
        ({"period": 0.0}, "period must be positive"),
        ({"measured": "u_hat"}, "measured"),
        ({"states": ["y", "lag"]}, "no state 'lag'"),
    ],
)
def test_wrong_input_is_refused_in_one_line(change, words):
    plant = hc.vehicle("c17_simulation").plant()
    given = {"Q": {"y": 1.0}, "R": {"rudder": 1.0}} | change
    assert words in refusal(hc.lqr, plant, straight(), **given)


def test_a_trim_out_of_the_actuators_reach_is_refused():
    plant = hc.vehicle("c17_experiment").plant()
    text = refusal(hc.lqr, plant, straight(1.0, 7.0), {"u": 1.0}, {"thrust": 1.0})
    assert "the operating point is out of reach: thrust = 7 A" in text


def test_poles_are_as_many_as_states_and_in_pairs():
    plant = hc.vehicle("c17_simulation").plant()
    assert "expected 4 poles" in refusal(hc.place, plant, straight(), [-1], states=LINE)
    poles = [-1 + 1j, -2, -3, -4]
    assert refusal(hc.place, plant, straight(), poles, states=LINE, inputs=["rudder"]).startswith(
        "place: poles"
    )
    assert "cannot move the mode" in refusal(
        hc.place, plant, straight(), [-1, -2, -3, -4, -5], inputs=["rudder"]
    )
