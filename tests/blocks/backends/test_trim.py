"""Operating points: closed solutions by hand, python-control's own search, and what cannot be met."""

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.blocks.backends.trim_conditions import ignorable_states, rate_unit
from hovercontrol.blocks.interconnect import interconnect

C17 = hc.vehicle("c17_simulation").coefficients()


@pytest.fixture(scope="module")
def craft():
    return hc.vehicle("c17_simulation").plant()


@pytest.fixture(scope="module")
def cart():
    x, v = hc.Signal("x", "m"), hc.Signal("v", "m/s")
    F, m, k = (
        hc.Signal("F", "N", upper=4.0, lower=0.0),
        hc.Signal("m", "kg", start=0.5),
        hc.Signal("k", "kg/s", start=2.0),
    )
    rate = (F.symbol - k.symbol * v.symbol) / m.symbol
    return hc.Block("cart", [x, v], [F], [v], [m, k], {"x": v.symbol, "v": rate})  # fmt: skip


def test_a_straight_course_needs_the_thrust_that_drag_takes(craft):
    ahead = craft.trim(states={"u": 1.5})
    assert ahead.inputs["thrust"] == pytest.approx(C17["surge_coulomb"] / C17["thrust"], abs=1e-9)  # c1/c7
    assert (ahead.states["v"], ahead.states["r"], ahead.inputs["rudder"]) == (0.0, 0.0, 0.0)
    assert ahead.rates == pytest.approx(
        {"x": 1.5, "y": 0.0, "psi": 0.0, "u": 0.0, "v": 0.0, "r": 0.0}, abs=1e-8
    )


def test_a_circle_is_the_one_of_the_equations_by_hand(craft):
    # C17 (11): 0 = -c1 + c7 T cos + r v,  0 = -c4 v + c7 T sin - u r,  0 = -c8 T sin - c5 - c6 r, u, r > 0
    u, r = 1.2, 0.6
    T_sin = -(C17["yaw_coulomb"] + C17["yaw_linear_drag"] * r) / C17["rudder_torque"]
    v = (C17["thrust"] * T_sin - u * r) / C17["sway_linear_drag"]
    T_cos = (C17["surge_coulomb"] - r * v) / C17["thrust"]
    circle = craft.trim({"u": u, "r": r})
    assert circle.states["v"] == pytest.approx(v, abs=1e-7)
    assert circle.inputs == pytest.approx(
        {"thrust": np.hypot(T_sin, T_cos), "rudder": np.arctan2(T_sin, T_cos)}, abs=1e-7
    )
    assert circle.how["v"] == "solved" and circle.how["u"] == "given"


def test_it_agrees_with_control_find_operating_point(craft):
    # u and r are given as outputs 3 and 5; x, y and psi are held, and their rates are not asked
    found = ct.find_operating_point(
        craft.to_control(), [0, 0, 0, 1.0, -0.5, 0.5], [2.0, 0.0], [0, 0, 0, 1.0, 0, 0.5],
        state_indices=[0, 1, 2], output_indices=[3, 5], deriv_indices=[3, 4, 5],
    )  # fmt: skip
    own = craft.trim({"u": 1.0, "r": 0.5})
    np.testing.assert_allclose(own.x, found.states, atol=1e-7)
    np.testing.assert_allclose(own.u, found.inputs, atol=1e-7)


def test_a_craft_at_its_trim_draws_the_circle(craft):
    u, r = 0.8, -0.4
    circle = craft.trim({"u": u, "r": r})
    run = craft.compile().simulate(np.linspace(0, 20, 201), dict(circle.inputs), x0=circle.x)
    x, y, _, *velocities = np.asarray(run.states)
    np.testing.assert_allclose(velocities, np.outer(circle.x[3:], np.ones(201)), atol=1e-6)
    speed = np.hypot(u, circle.states["v"])
    centre = np.array([-circle.states["v"], u]) / r  # psi = 0: (0, 0) + R [-v, u]/r
    np.testing.assert_allclose(np.hypot(x - centre[0], y - centre[1]), speed / abs(r), atol=1e-5)


def test_a_thrust_below_dry_friction_creeps_and_says_so(craft):
    slow = craft.trim({"v": 0.0, "r": 0.0}, {"thrust": 1.0, "rudder": 0.0})
    level = C17["thrust"] / C17["surge_coulomb"]  # tanh(u/w) = c7 T/c1
    assert slow.states["u"] == pytest.approx(0.01 * np.arctanh(level))
    assert slow.how["u"] == "solved, creeping: dry friction would hold it"


def test_a_turn_in_the_wind_is_not_steady_and_the_line_says_what_to_leave_free():
    windy = hc.vehicle("c17_simulation").with_effects([hc.effect("wind", x=0.5)]).plant()
    with pytest.raises(
        hc.InputError, match=r"psi' = 0.5 rad/s, wanted 0; rates=\{'psi': None\} leaves that free"
    ):
        windy.trim({"u": 1.0, "r": 0.5})
    assert windy.trim({"u": 1.0, "r": 0.5}, rates={"psi": None}).rates["psi"] == pytest.approx(0.5)


def test_k06s_craft_cannot_circle_under_way_without_side_force():
    # r' = -d F_Y/J = 0 asks for F_Y = 0, and then v' = -r u is not 0
    craft = hc.vehicle("hoverdemon").plant()
    assert craft.trim({"u": 1.1}).inputs == pytest.approx({"thrust": 0.0, "rudder": 0.0})
    assert craft.trim({"u": 0.0, "r": 3.0}).inputs["thrust"] == pytest.approx(0.0, abs=1e-8)
    with pytest.raises(hc.InputError, match="no trim found, nearest with v, thrust, rudder free"):
        craft.trim({"u": 1.1, "r": 0.5})


def test_given_inputs_leave_the_states_free(cart):
    assert cart.trim(inputs={"F": 3.0}).states["v"] == pytest.approx(1.5)
    assert cart.trim(inputs={"F": 3.0}, params={"cart.k": 6.0}).states["v"] == pytest.approx(0.5)
    assert cart.trim(outputs={"v": 1.5}).inputs["F"] == pytest.approx(3.0)
    assert cart.trim(rates={"x": 0.5}).inputs["F"] == pytest.approx(1.0)
    assert cart.trim({"v": 1.0}, {"F": 3.0}, rates={"v": None}).rates["v"] == pytest.approx(2.0)


def test_which_states_may_move(craft, cart):
    assert ignorable_states(craft) == ("x", "y", "psi")
    assert ignorable_states(cart) == ("x",)
    model = hc.vehicle("c17_simulation")
    assert ignorable_states(model.with_effects([hc.effect("wind", x=0.5)]).plant()) == ("x", "y")
    assert ignorable_states(hc.vehicle("hoverdemon").plant()) == ("x", "y", "psi")
    double = hc.Block("free", cart.states, [hc.Signal("a", "m/s^2")], [], derivatives={
        "x": cart.states[1].symbol, "v": hc.Signal("a").symbol})  # fmt: skip
    assert ignorable_states(double) == ("x",)
    with pytest.raises(hc.InputError, match=r"v' = 2 m/s\^2, wanted 0"):
        double.trim({"v": 1.0}, {"a": 2.0})


def test_what_moves_steadily_is_not_what_grows_faster_and_faster():
    # a charge may grow at a constant current; the current itself may not, though only the charge sees it
    q, i, volt = hc.Signal("q", "A*s"), hc.Signal("i", "A"), hc.Signal("volt", "V")
    L, k = hc.Signal("L", "V*s/A", start=1.0), hc.Signal("k", "1/s", start=1.0)
    rates = {"q": i.symbol, "i": volt.symbol / L.symbol, "volt": -k.symbol * volt.symbol}
    coil = hc.Block("coil", [q, i, volt], [], [q], [L, k], rates)
    assert ignorable_states(coil) == ("q",)
    assert coil.trim({"i": 2.0}).rates["q"] == pytest.approx(2.0)


def test_a_course_by_rates_keeps_the_heading(craft):
    north = craft.trim(rates={"x": 0.0, "y": 1.0})
    assert north.states["psi"] == pytest.approx(np.pi / 2)
    assert north.inputs == pytest.approx(
        {"thrust": C17["surge_coulomb"] / C17["thrust"], "rudder": 0.0}, abs=1e-7
    )


def test_a_craft_holds_its_place_against_the_wind():
    # along the surge axis drag c (u - wind): at rest c7 T = -c wind, nose into the wind
    wind, drag = -0.6, 0.4
    model = hc.vehicle("c17_simulation").with_effects(
        [hc.effect("wind", x=wind), hc.effect("surge_linear_drag", drag)]
    )
    craft = model.plant()
    hover = craft.trim(states={"u": 0.0, "v": 0.0, "r": 0.0})
    assert hover.inputs["thrust"] == pytest.approx(-drag * wind / C17["thrust"])
    assert hover.states["psi"] == pytest.approx(0.0, abs=1e-8)
    np.testing.assert_allclose(craft.to_numpy().derivatives(0.0, hover.x, hover.u), 0.0, atol=1e-8)
    by_rates = craft.trim(rates={"x": 0.0, "y": 0.0}, guess={"psi": 0.2})
    assert by_rates.inputs["thrust"] == pytest.approx(hover.inputs["thrust"])


def test_a_closed_loop_rests_where_its_simulation_ends(craft):
    psi, r = hc.Signal("psi", "rad"), hc.Signal("r", "rad/s")
    goal, push = hc.Signal("goal", "rad", start=1.0), hc.Signal("push", "1", start=2.0)
    kd = hc.Signal("kd", "s", start=0.4)
    law = {"thrust": push.symbol, "rudder": 0.6 * (psi.symbol - goal.symbol) + kd.symbol * r.symbol}
    pilot = hc.Block("pilot", [], [psi, r], craft.inputs, [kd, push, goal], output_expressions=law)
    model = hc.vehicle("c17_simulation").with_effects([hc.effect("surge_linear_drag", 0.5)])
    model = model.without_effects("yaw_coulomb")  # below its width the smoothed friction only creeps to rest
    loop = interconnect([model.plant(), pilot], "heading")
    steady = loop.trim()
    assert steady.states["plant.u"] == pytest.approx((2 * C17["thrust"] - C17["surge_coulomb"]) / 0.5)
    assert steady.states["plant.psi"] == pytest.approx(1.0)
    end = hc.simulate(loop, np.linspace(0, 40, 401)).states[:, -1]
    np.testing.assert_allclose(end[2:], steady.x[2:], atol=1e-4)  # x and y have moved on
    fast = loop.compile().simulate([0.0, 5.0], x0=steady.x)
    np.testing.assert_allclose(np.asarray(fast.states)[2:, -1], steady.x[2:], atol=1e-6)


def test_what_is_left_to_choose_is_nearest_to_the_guess_and_told():
    craft = hc.vehicle("four_fan").plant()
    ahead = craft.trim(states={"u": 1.0, "r": 0.0, "v": 0.0})
    assert ahead.inputs["rear_left"] == pytest.approx(ahead.inputs["rear_right"])  # least sum of squares
    assert ahead.inputs["front_left"] == 0.0 and ahead.how["front_left"] == "at its lower bound"
    assert set(ahead.free) == {"rear_left", "rear_right"}
    other = craft.trim({"u": 1.0, "r": 0.0, "v": 0.0}, guess={"front_left": 0.5, "front_right": 0.5})
    # least |a|^2 + |b - 0.5|^2 with a - b = d, the difference that surge drag takes
    d = ahead.inputs["rear_left"] - ahead.inputs["front_left"]
    assert other.inputs["front_left"] == pytest.approx((0.5 - d) / 2)
    assert other.inputs["rear_right"] == pytest.approx((0.5 + d) / 2)


def test_a_trim_is_a_guess_for_the_next(craft):
    astern = craft.trim({"u": -1.0}, guess={"thrust": -1.5})
    faster = craft.trim({"u": -1.2}, guess=astern)
    assert faster.inputs["thrust"] == pytest.approx(-C17["surge_coulomb"] / C17["thrust"])
    assert faster.inputs["rudder"] == pytest.approx(0.0, abs=1e-8)


def test_a_sampled_block_has_a_fixed_point():
    v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s")
    step = hc.Block("step", [v], [a], [v], derivatives={"v": 0.8 * v.symbol + a.symbol}, period=0.1)
    assert step.trim(inputs={"a": 1.0}).states["v"] == pytest.approx(5.0)  # a/(1 - 0.8)


def test_a_late_input_has_the_value_that_arrives():
    model = hc.vehicle("c17_simulation").with_effects([hc.effect("input_delay", seconds=0.1)])
    late = model.plant()
    assert late.delays
    assert late.trim({"u": 1.0}).inputs["thrust"] == pytest.approx(C17["surge_coulomb"] / C17["thrust"])


def test_a_trim_that_cannot_be_met_says_what_lacks_and_which_bound_holds(cart):
    with pytest.raises(hc.InputError) as error:
        cart.trim({"v": 2.5})
    assert str(error.value) == (
        "block 'cart': no trim found, nearest with F free: v' = -2 m/s^2, wanted 0; "
        "F is at its upper bound 4 N"
    )
    at_bound = cart.trim({"v": 2.0})
    assert at_bound.how["F"] == "at its upper bound" and at_bound.inputs["F"] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"states": {"w": 1.0}}, "no state 'w'"),
        ({"states": {"F": 1.0}}, "no state 'F'; it is an input"),
        ({"inputs": {"F": 5.0}}, r"F = 5 N is out of its bounds \[0, 4\]"),
        ({"rates": {"F": 0.0}}, "rates: no state 'F'; it is an input"),
        ({"guess": {"y": 0.0}}, "guess: no state or input 'y'"),
        ({"states": {"v": np.nan}}, "v must be"),
        ({"params": {"cart.kk": 1.0}}, "did you mean 'cart.k'"),
        ({"states": [1.0]}, "Block.trim: states: expected"),
    ],
)
def test_wrong_arguments_are_one_line(cart, asked, line):
    with pytest.raises(hc.InputError, match=line):
        cart.trim(**asked)


def test_it_reads_as_a_table(cart):
    found = cart.trim({"v": 1.0})
    assert str(found).splitlines() == [
        "Trim of 'cart'",
        "  x   0  m    at its start",
        "  v   1  m/s  given",
        "  F   2  N    solved",
        "  x'  1  m/s  rate",
    ]
    assert "<table" in found._repr_html_() and "m/s" in found._repr_html_()


def test_units_of_rates(cart):
    assert (rate_unit(cart, "x"), rate_unit(cart, "v")) == ("m/s", "m/s^2")


def test_it_is_an_operating_point_of_python_control(craft):
    circle = craft.trim({"u": 1.0, "r": 0.5})
    own = ct.linearize(craft.to_control(), circle.operating_point)
    np.testing.assert_allclose(own.A, craft.linearize(circle.x, circle.u).A)


def test_a_controller_that_ticks_rests_with_the_craft(craft):
    psi, r = hc.Signal("psi", "rad"), hc.Signal("r", "rad/s")
    goal, gain = hc.Signal("goal", "rad", start=1.0), hc.Signal("gain", "1", start=0.6)
    integral = hc.Signal("integral", "rad")
    law = {
        "thrust": 1.8 + 0 * gain.symbol,
        "rudder": gain.symbol * (psi.symbol - goal.symbol) + integral.symbol,
    }
    adds = {"integral": integral.symbol + 0.1 * (psi.symbol - goal.symbol)}
    slow = hc.Block("pilot", [integral], [psi, r], craft.inputs, [gain, goal], adds, law, period=0.2)
    loop = interconnect([craft, slow], "loop")
    steady = loop.trim(states={"plant.u": 1.0})
    assert steady.states["plant.psi"] == pytest.approx(1.0)
    assert steady.states["pilot.held_thrust"] == pytest.approx(1.8)
    after = hc.simulate(loop, [0.0, 0.2, 0.6], x0=steady.x)
    np.testing.assert_allclose(after.states[2:, -1], steady.x[2:], atol=1e-9)
    with pytest.raises(hc.InputError, match=r"pilot.held_thrust per step = 0.8, wanted 0"):
        loop.trim(states={"plant.u": 1.0, "pilot.held_thrust": 1.0})


def test_a_plant_of_ones_own_is_trimmed_like_a_craft(cart):
    own = hc.BlockModel(cart).plant()
    assert own.trim({"v": 1.0}).inputs["F"] == pytest.approx(2.0)


def test_the_parameters_given_are_in_the_table(cart):
    assert "  cart.k  4  kg/s  given" in str(cart.trim({"v": 1.0}, params={"cart.k": 4.0}))
