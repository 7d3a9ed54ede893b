"""LQR with integral action: gains against python-control's, offsets, anti-windup."""

import control
import numpy as np
import pytest
import scipy.linalg

import hovercontrol as hc
from hovercontrol.base.errors import InputError

POINT, INPUT = np.array([0, 0, 0, 1.0, 0, 0]), np.array([1.8, 0])
STRAIGHT = control.OperatingPoint(POINT, INPUT)


def craft(**coefficients):
    return hc.vehicle("c17_experiment").with_coefficients(coefficients).plant()


def test_the_gains_are_those_of_control_lqr_with_integral_action():
    """Speed by the thrust: u' = 0.75 T - friction, by hand."""
    K = control.lqr([[0.0]], [[0.75]], np.diag([2.0, 3.0]), [[0.5]], integral_action=np.array([[1.0]]))[0]
    block = hc.lqi(craft(), STRAIGHT, {"u": 2.0, "integral_u": 3.0}, {"thrust": 0.5}, integrate="u")
    found = [block.default_parameters[f"controller.K_thrust_{s}"] for s in ("u", "integral_u")]
    assert found == pytest.approx(K[0], rel=1e-9)
    assert block.signal("integral_u").unit == "m"


def test_two_integrals_are_those_of_control_lqr_too():
    plant = craft()
    states, rows = ["y", "psi", "u", "v", "r"], [1, 2, 3, 4, 5]
    weights = {"y": 4.0, "psi": 2.0, "u": 1.0, "integral_y": 0.5, "integral_u": 2.0}
    block = hc.lqi(plant, STRAIGHT, weights, {"thrust": 1.0, "rudder": 3.0}, integrate=["y", "u"])
    linear = plant.linearize(POINT, INPUT, friction="none")
    A, B = linear.A[np.ix_(rows, rows)], linear.B[rows]
    C = np.array([[1.0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0]])
    Q = np.diag([weights.get(s, 0.0) for s in (*states, "integral_y", "integral_u")])
    K = control.lqr(A, B, Q, np.diag([1.0, 3.0]), integral_action=C)[0]
    for i, command in enumerate(("thrust", "rudder")):
        for j, name in enumerate((*states, "integral_y", "integral_u")):
            found = block.default_parameters[f"controller.K_{command}_{name}"]
            assert found == pytest.approx(K[i, j], abs=1e-8)


def test_the_integral_removes_the_offset_of_a_craft_with_more_drag_than_the_model():
    t, rough = np.linspace(0, 20, 201), craft(surge_coulomb=1.6, surge_linear_drag=0.3)
    weights = {"u": 1.0, "integral_u": 1.0}
    with_integral = hc.lqi(craft(), STRAIGHT, weights, {"thrust": 1.0}, integrate="u")
    without = hc.lqr(craft(), STRAIGHT, {"u": 1.0}, {"thrust": 1.0})
    speeds = {}
    for block in (with_integral, without):
        run = hc.simulate(hc.interconnect([rough, block]), t, x0={"plant.u": 1.0})
        speeds[len(block.states)] = run.outputs[run.output_labels.index("u")][-1]
    assert speeds[1] == pytest.approx(1.0, abs=1e-3)
    assert speeds[0] < 0.7


def overshoot(tracking_time=None, period=None, limits=True, **kwargs):
    """A speed step of 8 m/s, which takes the thrust to its limit for seconds: overshoot and demand."""
    weights = {"u": 1.0, "integral_u": 4.0}
    block = hc.lqi(
        craft(), STRAIGHT, weights, {"thrust": 1.0}, integrate="u",
        tracking_time=tracking_time, period=period, limits=limits, **kwargs,
    )  # fmt: skip
    loop, t = hc.interconnect([craft(), block]), np.linspace(0, 40, 801)
    x0 = {"plant.u": 1.0}
    run = loop.compile().simulate(t, {"u_ref": 9.0}, x0=x0)
    u, thrust = (run.outputs[run.output_labels.index(s)] for s in ("u", "thrust"))
    assert thrust.max() <= 6.1 + 1e-12 and thrust.min() >= -1e-12
    assert thrust[5] == pytest.approx(6.1)
    assert u[-1] == pytest.approx(9.0, abs=0.02)
    return u.max() - 9.0


@pytest.mark.parametrize("period", [None, 0.05])
def test_while_the_thrust_is_limited_the_integral_does_not_wind_up(period):
    held, wound_up = overshoot(period=period), overshoot(1e6, period)
    assert held < 0.6
    assert wound_up > 3 * held


def test_back_calculation_brings_the_demand_to_the_limit_with_its_time_constant():
    """Demand d at a constant error, limit s: K_i L = 1/T, so that (d - s)' = -K_i e - (d - s)/T."""
    block = hc.lqi(
        craft(), STRAIGHT, {"u": 1.0, "integral_u": 4.0}, {"thrust": 1.0}, integrate="u", tracking_time=0.25
    )
    p = block.default_parameters
    assert p["controller.K_thrust_integral_u"] * p["controller.L_integral_u_thrust"] == pytest.approx(4.0)
    f = block.to_numpy()
    error = 3.0
    z = np.array([-50.0])
    demand = 1.8 - p["controller.K_thrust_u"] * error - p["controller.K_thrust_integral_u"] * z[0]
    rate = f.derivatives(0.0, z, [1.0 + error, 1.0])[0]
    expected = error + (demand - 6.1) / 0.25 / p["controller.K_thrust_integral_u"]
    assert rate == pytest.approx(expected, rel=1e-12)


def test_the_anti_windup_can_read_what_the_actuator_applies():
    block = hc.lqi(
        craft(), STRAIGHT, {"u": 1.0, "integral_u": 4.0}, {"thrust": 1.0}, integrate="u", applied=True
    )
    assert [s.name for s in block.inputs] == ["u", "u_ref", "thrust_applied"]
    assert block.feedthrough["thrust"] == ("u", "u_ref")  # no algebraic loop with the actuator
    f, p = block.to_numpy(), block.default_parameters
    rate = f.derivatives(0.0, [0.0], [1.0, 1.0, 0.8])[0]
    assert rate == pytest.approx(p["controller.L_integral_u_thrust"] * (1.8 - 0.8))


def test_a_sampled_integral_is_a_sum():
    h = 0.1
    M = scipy.linalg.expm(np.array([[0, 0.75], [0, 0]]) * h)
    A, B = np.array([[M[0, 0], 0], [h, 1]]), np.array([[M[0, 1]], [0]])
    K = control.dlqr(A, B, np.diag([2.0, 3.0]), [[0.5]])[0]
    weights = {"u": 2.0, "integral_u": 3.0}
    block = hc.lqi(craft(), STRAIGHT, weights, {"thrust": 0.5}, integrate="u", period=h)
    found = [block.default_parameters[f"controller.K_thrust_{s}"] for s in ("u", "integral_u")]
    assert found == pytest.approx(K[0], rel=1e-8)
    assert block.to_numpy().derivatives(0.0, [0.2], [1.3, 1.0])[0] == pytest.approx(0.2 + h * 0.3)


def test_an_output_that_is_no_state_can_be_integrated():
    u = hc.Signal("u", "m/s")
    force, speed = hc.Signal("force", "m/s^2"), hc.Signal("knots", "m/s")
    plant = hc.Block("cart", [u], [force], [u, speed], [], {"u": force.symbol}, {"knots": 2 * u.symbol})
    at = control.OperatingPoint([0.5], [0.0])
    block = hc.lqi(plant, at, {"u": 1.0, "integral_knots": 1.0}, {"force": 1.0}, integrate="knots")
    assert {s.name: s.start for s in block.inputs} == {"u": 0.5, "knots": 1.0, "u_ref": 0.5, "knots_ref": 1.0}
    K = control.lqr([[0.0]], [[1.0]], np.eye(2), [[1.0]], integral_action=np.array([[2.0]]))[0]
    assert block.default_parameters["controller.K_force_integral_knots"] == pytest.approx(K[0, 1])


@pytest.mark.parametrize("period", [None, 0.05])
def test_the_loop_runs_alike_in_python_in_machine_code_and_in_python_control(period):
    plant, t = craft(), np.arange(81) * 0.05
    weights = {"u": 1.0, "integral_u": 4.0}
    loop = hc.interconnect(
        [plant, hc.lqi(plant, STRAIGHT, weights, {"thrust": 1.0}, integrate="u", period=period)]
    )
    u = {"u_ref": 2.0, "rudder": 0.0}
    python = hc.simulate(loop, t, u, x0={"plant.u": 1.0}, rtol=1e-9, atol=1e-11)
    compiled = loop.compile().simulate(t, u, x0={"plant.u": 1.0}, rtol=1e-9, atol=1e-11)
    x = [1.0 if s.name == "plant.u" else s.start for s in loop.states]
    system = loop.to_control()
    given = np.outer([u[name] for name in system.input_labels], np.ones_like(t))
    keywords = {} if period else {"solve_ivp_kwargs": {"rtol": 1e-9, "atol": 1e-11}}
    response = control.input_output_response(system, t, given, x, **keywords)
    assert compiled.outputs == pytest.approx(python.outputs, abs=1e-6)
    assert response.outputs == pytest.approx(python.outputs, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"integrate": "w"}, "no state or output 'w'"),
        ({"integrate": ["u", "v"]}, "1 inputs cannot hold 2 setpoints"),
        ({"integrate": []}, "integrate: expected one or more"),
        ({"Q": {"u": 1.0}}, "Q does not weight the mode at 0 1/s, which moves integral_u"),
        ({"tracking_time": 0.01, "period": 0.1}, "tracking_time must be the period 0.1 s or more"),
        ({"tracking_time": -1.0}, "tracking_time must be positive"),
    ],
)
def test_wrong_input_is_refused_in_one_line(change, words):
    given = {"Q": {"u": 1.0, "integral_u": 1.0}, "R": {"thrust": 1.0}, "integrate": "u"} | change
    with pytest.raises(InputError) as caught:
        hc.lqi(craft(), STRAIGHT, **given)
    assert words in str(caught.value)


def test_a_lag_that_an_output_shows_as_the_applied_command_is_fed_back_under_that_name():
    u, lag = hc.Signal("u", "m/s"), hc.Signal("lag", "m/s^2")
    force, applied = hc.Signal("force", "m/s^2", lower=-1.0, upper=1.0), hc.Signal("force_applied", "m/s^2")
    T = hc.Signal("T", "s", start=0.2)
    plant = hc.Block(
        "cart",
        [u, lag],
        [force],
        [u, applied],
        [T],
        {"u": lag.symbol, "lag": (force.symbol - lag.symbol) / T.symbol},
        {"force_applied": lag.symbol},
    )
    weights = {"u": 1.0, "integral_u": 1.0}
    block = hc.lqi(plant, plant.trim({"u": 0.0}), weights, {"force": 1.0}, integrate="u", applied=True)
    assert [s.name for s in block.inputs] == ["u", "force_applied", "u_ref", "force_applied_ref"]
    A, B = np.array([[0, 1.0], [0, -5.0]]), np.array([[0], [5.0]])
    K = control.lqr(A, B, np.diag([1.0, 0, 1.0]), [[1.0]], integral_action=np.array([[1.0, 0]]))[0]
    names = ("u", "force_applied", "integral_u")
    assert [block.default_parameters[f"controller.K_force_{s}"] for s in names] == pytest.approx(K[0])
    run = hc.simulate(hc.interconnect([plant, block]), np.linspace(0, 30, 301), {"u_ref": 3.0})
    speed = run.outputs[run.output_labels.index("u")]
    assert speed[-1] == pytest.approx(3.0, abs=1e-3)
    assert speed.max() < 3.6
