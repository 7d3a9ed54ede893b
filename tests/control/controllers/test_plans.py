"""Plans of predictive control where derivatives by commands vanish, solvers fail or waypoints are missed."""

import warnings

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.control.controllers.approach import passed, reference_status, way_status
from hovercontrol.control.controllers.mpc import stage_of
from hovercontrol.control.controllers.suggestion import suggested_periods, times_of
from hovercontrol.control.controllers.way_reference import WayReference

pytest.importorskip("casadi")

V, N, P, Q = hc.Signal("v", "m/s"), hc.Signal("n"), hc.Signal("p"), hc.Signal("q")
K, D = hc.Signal("k", "m/s^2", start=2.0), hc.Signal("d", "1/s", start=0.5)
n, p, q = (s.symbol for s in (N, P, Q))


def driven(force, *commands):
    """v' = k force - d v."""
    return hc.Block("driven", [V], commands, [V], [K, D], {"v": K.symbol * force - D.symbol * V.symbol})


#: Each has no derivative by its commands at rest.
HIDDEN = {
    "n abs(n)": (driven(n * sp.Abs(n), N), (-2.0, 2.0)),
    "n^2": (driven(n**2, N), (0.0, 2.0)),
    "n^3": (driven(n**3, N), (-2.0, 2.0)),
    "abs(n)": (driven(sp.Abs(n) / 2, N), (-2.0, 2.0)),
    "dead zone": (driven(sp.Max(n - 1.5, 0) + sp.Min(n + 1.5, 0), N), (-2.0, 2.0)),
    "product": (driven(p * q, P, Q), (-1.0, 1.0)),
    "products of three": (driven(p * q * n, P, Q, N), (-1.0, 1.0)),
}
COST = {"period": 0.2, "horizon": 10, "weights": {"v": 10.0}}


@pytest.mark.parametrize("solver", ["rti", "ipopt"])
@pytest.mark.parametrize("name", HIDDEN)
def test_from_rest_a_plant_moves_to_its_set_point(name, solver):
    plant, limit = HIDDEN[name]
    limits = {s.name: limit for s in plant.inputs}
    run = hc.mpc(plant, **COST, limits=limits, solver=solver).simulate(4.0, reference={"v": 0.5}, rows=1)
    assert np.ravel(run.states)[-1] == pytest.approx(0.5, abs=0.025)
    assert run.reached and not run.failures


def test_at_rest_on_its_set_point_it_answers_a_new_one():
    plant, limit = HIDDEN["n abs(n)"]
    controller, run = hc.mpc(plant, **COST, limits={"n": limit}), plant.start()
    for k in range(40):
        run.step(controller.control(run.state, {"v": 0.0 if k < 10 else -0.5}), 0.2)
    assert run.state[0] == pytest.approx(-0.5, abs=0.025)


def test_where_rest_is_the_cheapest_plan_a_warning_says_so():
    # a constant n costs 4 n^2 a sample, more than it can save
    plant, limit = HIDDEN["n^2"]
    controller = hc.mpc(plant, period=0.2, horizon=10, weights={"v": 1.0, "n": 9.0}, limits={"n": limit})
    with pytest.warns(
        UserWarning, match="the first plan holds the inputs.* v stays 0.5 m/s from its reference"
    ):
        assert controller.control([0.0], {"v": 0.5}) == 0.0
    with pytest.warns(UserWarning, match="v stays 0.5 m/s from its reference; other weights"):
        assert not controller.simulate(2.0, reference={"v": 0.5}).reached


@pytest.mark.parametrize("horizon", [2, 20])
def test_where_holding_the_inputs_brings_the_state_nearer_nothing_is_said(horizon):
    # v' = 2 q - v/2 with q <= 0: of all plans q = 0 comes nearest to a reference between 0 and v
    plant = driven(q, Q)
    controller = hc.mpc(plant, period=0.2, horizon=horizon, weights={"v": 1.0}, limits={"q": (-1.0, 0.0)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert controller.control([-1.0], {"v": -0.1}) == pytest.approx(0.0, abs=1e-4)
    controller.reset()
    with pytest.warns(UserWarning, match=r"the first plan holds the inputs.* v stays .* from its reference"):
        controller.control([1.0], {"v": 2.0})  # v falls


def test_a_point_without_derivatives_is_named():
    h, flow, k = hc.Signal("h", "m"), hc.Signal("flow", "m/s"), hc.Signal("k", "m^(1/2)/s", start=1.0)
    tank = hc.Block("tank", [h], [flow], [h], [k], {"h": flow.symbol - k.symbol * sp.sqrt(h.symbol)})
    for solver in ("rti", "ipopt"):
        controller = hc.mpc(tank, weights={"h": 1.0}, limits={"flow": (0.0, 1.0)}, solver=solver)
        with pytest.raises(hc.InputError, match="h' has no finite derivative by h at h = 0 m"):
            controller.control([0.0], {"h": 1.0})


# ---- a solver that fails


def integrator():
    return hc.Block(
        "integrator", [V], [hc.Signal("a", "m/s^2")], [V], derivatives={"v": sp.Symbol("a", real=True)}
    )


@pytest.mark.parametrize("solver", ["rti", "ipopt"])
@pytest.mark.parametrize(("low", "high"), [(100.0, 101.0), (101.0, 100.0)], ids=["infeasible", "refused"])
def test_after_a_failure_the_last_plan_goes_on_and_is_counted(solver, low, high):
    controller = hc.mpc(
        integrator(), period=0.1, horizon=5, weights={"v": 1.0, "a": 0.1}, limits={"a": (-1.0, 1.0)},
        rate_limits={"a": 1.0}, solver=solver,
    )  # fmt: skip
    controller.control([1.0])
    planned = controller._memory.w[controller.problem.inputs].ravel()
    rates = np.isfinite(controller.problem.lbg) & (controller.problem.ubg == 0.1)
    controller.problem.lbg[rates], controller.problem.ubg[rates] = low, high
    with pytest.warns(UserWarning, match=f"no solution at sample 1, the best known plan goes on: {solver}"):
        again = controller.control([1.0 + 0.1 * planned[0]])
    assert again == pytest.approx(planned[1], abs=1e-5) and controller.failures == 1


# ---- horizon, weights and the way


def pushed_and_turned():
    """A craft with u' = a and r' = b alone: its times follow by hand."""
    names = {"x": "m", "y": "m", "psi": "rad", "u": "m/s", "r": "rad/s", "a": "m/s^2", "b": "rad/s^2"}
    s = {name: hc.Signal(name, unit) for name, unit in names.items()}
    u, psi = s["u"].symbol, s["psi"].symbol
    rates = {"x": u * sp.cos(psi), "y": u * sp.sin(psi), "psi": s["r"].symbol, "u": s["a"].symbol}
    states = [s[name] for name in ("x", "y", "psi", "u", "r")]
    return hc.Block("craft", states, [s["a"], s["b"]], states[:3], derivatives=rates | {"r": s["b"].symbol})


def test_the_suggested_horizon_has_the_times_to_get_going_to_turn_and_to_stop():
    limits = {"a": (-1.0, 1.0), "b": (-2.0, 2.0)}
    args = (pushed_and_turned(), 0.1, limits, None, (), 0.0, ("x", "y"), None, None)
    times = times_of(stage_of("mpc", *args, planar=True), 0.5, 2)
    by_hand = 0.5, np.sqrt(2 * np.pi / 2.0), 0.5 * (1 - np.exp(-1))
    assert times == pytest.approx(by_hand, rel=0.03)
    assert suggested_periods(times, 0.1) == (0.1, int(np.ceil(sum(times) / 0.1)))


def boat():
    """A heavy craft without reverse thrust and with little drag."""
    values = {"surge_coulomb": 0.0, "sway_coulomb": 0.0, "yaw_coulomb": 0.0, "surge_linear_drag": 0.28}
    values |= {"sway_linear_drag": 0.75, "yaw_linear_drag": 1.5, "thrust": 0.31, "rudder_torque": 4.4}
    return hc.vehicle("c17_simulation").with_coefficients(values)


BOAT = {"limits": {"thrust": (0.0, 6.0), "rudder": (-0.45, 0.45)}, "waypoints": [[4, 0], [4, 2]]}


@pytest.mark.slow
def test_with_the_suggested_horizon_a_craft_without_reverse_reaches_its_waypoints_and_stops():
    controller = hc.mpc(boat(), **BOAT)
    assert controller.weights["x"] == 0.25**-2
    run = controller.simulate(30.0)
    assert run.reached
    x, y = run.states[:2]
    assert np.hypot(x - 4, y).min() < 0.25 and np.hypot(x[-1] - 4, y[-1] - 2) < 0.25


@pytest.mark.slow
def test_a_horizon_too_short_for_a_waypoint_is_said():
    controller = hc.mpc(boat(), **BOAT, period=0.1, horizon=5)
    with pytest.warns(UserWarning, match=r"waypoint 2 \(4, 2\) m"):
        run = controller.simulate(20.0)
    assert not run.reached and run.waypoints[1].point == (4.0, 2.0)


def test_the_reference_slows_down_before_the_last_waypoint_as_its_equation_says():
    args = (pushed_and_turned(), 0.1, None, None, (), 0.0, ("x", "y"), None, None)
    way = WayReference(stage_of("mpc", *args, planar=True), np.array([[3.0, 0.0]]), 0.5, 2.0, 2)
    way.rows(0.0, np.zeros(5), 3)
    s, times = 0.0, np.arange(1, 100) * 0.1
    for t, found in zip(times, way._moved(0.0, times), strict=True):
        for _ in range(100):  # s' = min(speed, (L - s)/stop)
            s += 0.001 * min(0.5, (3.0 - s) / 2.0)
        assert found == pytest.approx(s, abs=1e-3), t


def test_waypoints_are_passed_in_order_and_a_missed_one_is_named():
    t = np.linspace(0.0, 10.0, 101)
    there_and_back = np.array([5.0 - np.abs(5.0 - t), 0.0 * t])
    first, second = passed(t, there_and_back, np.array([[5.0, 0.1], [1.0, 0.0]]), 0.2)
    assert (first.time, second.time) == pytest.approx((5.0, 9.0)) and first.distance == pytest.approx(0.1)
    away = passed(t, there_and_back, np.array([[5.0, 1.0], [0.0, 0.0]]), 0.2)
    said = way_status(t, there_and_back, away, 0.2, 0.5)
    assert said == "waypoint 1 (5, 1) m is not reached: 1 m off at 5 s"
    half = t <= 4.0
    ahead = passed(t[half], there_and_back[:, half], np.array([[5.0, 0.0]]), 0.2)
    assert way_status(t[half], there_and_back[:, half], ahead, 0.2, 0.5) == "on the way"


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (lambda t: np.exp(-t), "reached"),
        (lambda t: np.exp(-t / 5), "on the way"),
        (lambda t: 1.0 - 0.01 * t, "on the way"),
        (lambda t: 0.3 + 0.7 * np.exp(-3 * t), "v stays 0.3 m/s from its reference"),
        (lambda t: 1.0 + 0.0 * t, "v stays 1 m/s from its reference"),
        (lambda t: np.exp(t / 10), "v stays 2.72 m/s from its reference"),
    ],
)
def test_a_run_to_a_set_point_is_judged(error, status):
    t = np.linspace(0.0, 10.0, 201)
    assert reference_status(error(t)[:, None], ["v"], ["m/s"], np.ones(1)) == status


def test_weights_are_wanted_without_waypoints():
    with pytest.raises(hc.InputError, match="expected weights by name; only with waypoints"):
        hc.mpc(integrator())
    with pytest.raises(hc.InputError, match="expected limits of each input"):
        hc.mpc(pushed_and_turned(), waypoints=[[1.0, 0.0]])


def test_a_run_that_is_reached_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = hc.mpc(integrator(), weights={"v": 1.0, "a": 0.01}).simulate(3.0, [1.0])
    assert run.status == "reached" and "reached" in repr(run)
