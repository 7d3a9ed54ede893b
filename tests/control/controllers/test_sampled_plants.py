"""Designs for plants that are sampled themselves, against SciPy's Riccati equation and python-control."""

from functools import partial

import control as ct
import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import linprog

import hovercontrol as hc
from hovercontrol.base.errors import InputError

H = 0.1


def linear(A, B, C=None):
    """The plant x[k+1] = A x + B u, every state measured."""
    n, m = np.shape(B)
    x, u = [f"x{k}" for k in range(n)], [f"u{k}" for k in range(m)]
    C = np.eye(n) if C is None else np.array(C, dtype=float)
    return hc.from_control(ct.ss(A, B, C, 0, H, states=x, inputs=u, outputs=x[: len(C)], name="plant"))


def drawn(seed=3, n=3, m=2):
    """A random plant with an unstable mode."""
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(n, n)), rng.normal(size=(n, m))
    return A * 1.2 / np.abs(np.linalg.eigvals(A)).max(), B


def gains(block, states, inputs):
    found = block.default_parameters
    return np.array([[found[f"controller.K_{u}_{x}"] for x in states] for u in inputs])


def riccati(A, B, Q, R):
    P = scipy.linalg.solve_discrete_are(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


STATES, INPUTS, REST = ["x0", "x1", "x2"], ["u0", "u1"], {"x0": 0.0}
Q, R = {"x0": 1.0, "x1": 2.0, "x2": 0.5}, {"u0": 1.0, "u1": 3.0}
QM, RM = np.diag([1.0, 2.0, 0.5]), np.diag([1.0, 3.0])


def test_lqr_solves_the_discrete_riccati_equation_and_is_sampled_like_the_plant():
    A, B = drawn()
    hold = hc.lqr(linear(A, B), REST, Q, R)
    assert hold.period == H
    assert gains(hold, STATES, INPUTS) == pytest.approx(riccati(A, B, QM, RM), rel=1e-9)
    poles = hc.interconnect([linear(A, B), hold]).linearize(np.zeros(3)).poles()
    assert np.sort_complex(poles) == pytest.approx(np.sort_complex(ct.dlqr(A, B, QM, RM)[2]), abs=1e-9)


def test_a_slower_controller_is_designed_on_the_steps_in_between():
    A, B = drawn()
    A3, B3 = A @ A @ A, B + A @ B + A @ A @ B
    hold = hc.lqr(linear(A, B), REST, Q, R, period=3 * H)
    assert hold.period == pytest.approx(3 * H)
    assert gains(hold, STATES, INPUTS) == pytest.approx(riccati(A3, B3, QM, RM), rel=1e-9)


def test_lqi_sums_the_error_over_the_steps():
    A, B = drawn(m=1)
    plant = linear(A, B)
    hold = hc.lqi(plant, REST, Q | {"integral_x0": 4.0}, {"u0": 1.0}, integrate="x0", limits=False)
    Aa = np.block([[A, np.zeros((3, 1))], [H, 0.0, 0.0, 1.0]])
    K = riccati(Aa, np.vstack([B, [[0.0]]]), np.diag([1.0, 2.0, 0.5, 4.0]), np.eye(1))
    assert gains(hold, [*STATES, "integral_x0"], ["u0"]) == pytest.approx(K, rel=1e-8)
    loop = hc.interconnect([plant, hold])
    run = loop.to_control().dynamics
    x = np.zeros(4)
    goal = [1.0 if s.name == "x0_ref" else 0.0 for s in loop.inputs]
    for _ in range(400):
        x = run(0.0, x, goal)
    assert x[0] == pytest.approx(1.0, abs=1e-9)


def test_place_takes_poles_in_the_z_plane():
    A, B = drawn(m=1)
    wanted = [0.5, 0.4 + 0.2j, 0.4 - 0.2j]
    hold = hc.place(linear(A, B), REST, wanted)
    found = np.linalg.eigvals(A - B @ gains(hold, STATES, ["u0"]))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(wanted), abs=1e-9)


def test_a_sampled_heading_is_an_angle_and_a_moving_position_is_left_free():
    x, psi, r, u = (
        hc.Signal(n, unit) for n, unit in (("x", "m"), ("psi", "rad"), ("r", "rad/s"), ("u", "m/s^2"))
    )
    h, k, speed = (
        hc.Signal("h", "s", start=H),
        hc.Signal("k", "rad/m", start=0.5),
        hc.Signal("speed", "m/s", start=2.0),
    )
    craft = hc.Block(
        "craft", [x, psi, r], [u], [x, psi, r], [h, k, speed],
        {
            "x": x.symbol + h.symbol * speed.symbol,
            "psi": psi.symbol + h.symbol * r.symbol,
            "r": r.symbol + h.symbol * k.symbol * u.symbol,
        },
        period=H,
    )  # fmt: skip
    hold = hc.lqr(craft, craft.trim({"psi": 0.0, "r": 0.0}), [1.0, 1.0], 1.0)
    assert [s.name for s in hold.inputs if not s.name.endswith("_ref")] == ["psi", "r"]
    assert "atan2" in hold.equations().splitlines()[0]
    assert riccati(
        np.array([[1.0, H], [0.0, 1.0]]), np.array([[0.0], [0.5 * H]]), np.eye(2), np.eye(1)
    ) == pytest.approx(gains(hold, ["psi", "r"], ["u"]))


def test_a_lag_that_no_output_shows_is_taken_to_follow_at_once():
    plant = linear([[0.9, 0.2], [0.0, 0.5]], [[0.0], [0.5]], [[1.0, 0.0]])
    hold = hc.lqr(plant, {"x0": 0.0, "u0": 0.0}, {"x0": 1.0}, {"u0": 1.0})
    # x1 = u0 in steps: x0+ = 0.9 x0 + 0.2 u0
    one = np.eye(1)
    assert gains(hold, ["x0"], ["u0"]) == pytest.approx(riccati(0.9 * one, 0.2 * one, one, one))


def test_gain_scheduling_takes_sampled_designs():
    y, c = hc.Signal("y", "1"), hc.Signal("c", "1")
    bent = hc.Block("bent", [y], [c], [y], [], {"y": y.symbol - 0.1 * y.symbol**3 + 0.2 * c.symbol}, period=H)
    trims = [bent.trim({"y": value}) for value in (0.0, 1.0)]
    hold = hc.gain_scheduled(bent, trims, partial(hc.lqr, Q={"y": 1.0}, R={"c": 1.0}), schedule="y")
    one = np.eye(1)
    for k, a in enumerate((1.0, 0.7)):
        K = riccati(a * one, 0.2 * one, one, one).item()
        assert hold.default_parameters[f"controller.K_c_y_{k}"] == pytest.approx(K)
    assert hold.period == H


@pytest.mark.parametrize(
    ("design", "text"),
    [
        (lambda p: hc.lqr(p, REST, Q, R, period=0.25),
         "expected a multiple of the plant's period, 0.1 s, found 0.25 s"),
        (lambda p: hc.place(p, REST, [-1.0, -2.0, -3.0]), "inside the unit circle, found -1, -2, -3"),
        (lambda p: hc.lqr(linear(np.diag([1.1, 0.5]), [[0.0], [1.0]]), {"x0": 0.0}, 1.0, 1.0),
         "u0 cannot move the mode at z = 1.1, the state combination x0"),
        (lambda p: hc.lqr(linear([[1.0, 0.0], [0.0, 0.5]], np.eye(2)), {"x0": 0.0}, [0.0, 1.0], 1.0),
         "Q does not weight the mode at z = 1, which moves x0"),
    ],
)  # fmt: skip
def test_what_cannot_be_designed_is_told_in_one_line(design, text):
    with pytest.raises(InputError) as caught:
        design(linear(*drawn()))
    assert text in str(caught.value) and "\n" not in str(caught.value)


def cart():
    return linear([[1.0, H], [0.0, 0.95]], [[0.0], [H]])


def test_a_long_horizon_of_predictive_control_begins_as_lqr():
    pytest.importorskip("casadi")
    A, B = np.array([[1.0, H], [0.0, 0.95]]), np.array([[0.0], [H]])
    plan = hc.mpc(cart(), weights={"x0": 1.0, "x1": 1.0, "u0": 0.1}, horizon=150)
    assert plan.stage.period == H
    K = riccati(A, B, np.eye(2), 0.1 * np.eye(1))
    assert plan.control([1.0, 0.5]) == pytest.approx(-K @ [1.0, 0.5], abs=1e-6)


def test_predictive_control_runs_over_several_steps_of_the_plant_within_limits():
    pytest.importorskip("casadi")
    A, B = np.array([[1.0, H], [0.0, 0.95]]), np.array([0.0, H])
    plan = hc.mpc(cart(), weights={"x0": 1.0, "u0": 0.1}, period=2 * H, limits={"u0": (-1.0, 1.0)})
    run = plan.simulate(6.0, {"x0": 1.0})
    x, u = run.states, run.inputs[0]
    assert x[:, 1:] == pytest.approx(A @ x[:, :-1] + np.outer(B, u[:-1]), abs=1e-12)
    assert (u[:-1:2] == u[1::2]).all() and np.abs(u).max() == 1.0
    assert run.time[1] == pytest.approx(H) and np.abs(x[:, -1]).max() < 0.02


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda p: hc.mpc(p, weights={"x0": 1.0}, period=0.15), "a multiple of the plant's period, 0.1 s"),
        (lambda p: hc.mpc(p, weights={"x0": 1.0}, substeps=2), "is sampled and takes its own steps"),
        (
            lambda p: hc.minimum_time(
                p, {"x0": 1.0}, limits={"u0": (-1, 1)}, waypoints=[[0.5, 0.0]], position=("x0", "x1")
            ),
            "between waypoints are whole steps",
        ),
    ],
)
def test_predictions_over_parts_of_a_step_are_refused_in_one_line(make, text):
    pytest.importorskip("casadi")
    with pytest.raises(InputError, match=text):
        make(cart())


def test_optimal_control_of_a_sampled_system_has_the_gradient_of_the_map():
    system = cart().to_control()
    Q, R, P = (
        np.eye(2),
        0.1 * np.eye(1),
        scipy.linalg.solve_discrete_are(
            *(np.array(m) for m in ([[1.0, H], [0.0, 0.95]], [[0.0], [H]])), np.eye(2), 0.1 * np.eye(1)
        ),
    )
    found = hc.solve_ocp(
        system, H * np.arange(16), [1.0, 0.5], ct.optimal.quadratic_cost(system, Q, R),
        terminal_cost=lambda x, u: float(x @ P @ x),
    )  # fmt: skip
    assert found.cost == pytest.approx(np.array([1.0, 0.5]) @ P @ [1.0, 0.5], rel=1e-6)
    assert found.problem.system_simulations < 60


def test_a_transfer_function_with_numbered_names_is_estimated_and_held_at_its_setpoint():
    oven = hc.from_control(ct.tf([0.9, 0.6], [1.0, -1.62, 0.65], 5.0, name="oven"))
    seen = hc.extended_kalman(oven, ["y[0]"], process_noise={"x[0]": 0.1}, measurement_noise={"y[0]": 0.1})
    hold = hc.lqi(
        oven, {"u[0]": 0.0}, {"x[0]": 1.0, "x[1]": 1.0, "integral_y[0]": 0.01}, {"u[0]": 10.0},
        integrate="y[0]", states=["x[0]", "x[1]"], measured="{}_hat",
    )  # fmt: skip
    assert [s.name for s in hold.inputs[:3]] == ["x_hat[0]", "x_hat[1]", "y[0]"]
    assert "controller.K_u_0_x_1" in hold.default_parameters
    loop = hc.interconnect([oven, seen, hold], "held")
    run = hc.simulate(loop, 5.0 * np.arange(200), {"y_ref[0]": 3.0})
    assert loop.period == 5.0
    assert run.outputs[run.output_labels.index("y[0]"), -1] == pytest.approx(3.0, abs=1e-6)
    rest = {s.name: 0.0 for s in loop.inputs}
    margins = hc.margins([oven, seen, hold], "u[0]", rest)
    assert margins.stable and margins.gain_up > 1.0


@pytest.mark.parametrize("step", [H, 0], ids=["sampled", "continuous"])
def test_an_estimate_is_read_by_the_states_name_where_an_output_has_another(step):
    A, B = np.array([[1.0, H], [0.0, 0.95]]), np.array([[0.0], [H]])
    plant = hc.from_control(ct.ss(A if step else A - np.eye(2), B, [[1.0, 0.0]], [[0.0]], dt=step))
    seen = hc.extended_kalman(plant, ["y[0]"], process_noise={"x[1]": 0.1}, measurement_noise={"y[0]": 0.1})
    hold = hc.lqr(plant, {}, np.eye(2), 1.0, states=["x[0]", "x[1]"], measured="{}_hat")
    loop = hc.interconnect([plant, seen, hold], "loop")
    assert {s.name for s in loop.inputs} == {"y_ref[0]", "x_ref[1]"}
    with pytest.raises(
        InputError, match=r"lqr: Q: expected weights of y\[0\], found 2 rows; x\[1\] is not fed back"
    ):
        hc.lqr(plant, {}, np.eye(2), 1.0)


@pytest.mark.parametrize(
    ("A", "B", "start", "end"),
    [
        ([[1.0, H], [0.0, 1.0]], [[0.0], [H]], [0.0, 0.0], {"x0": 1.0, "x1": 0.0}),
        ([[1.1, 0.2], [0.0, 0.9]], [[0.0], [0.5]], [0.5, 0.0], {"x0": 0.0, "x1": 0.0}),
        ([[0.9, 0.2], [-0.3, 0.95]], [[0.1], [0.5]], [2.0, -1.0], {"x0": 0.0}),
    ],
    ids=["double integrator", "unstable", "free end"],
)
def test_the_quickest_manoeuvre_has_the_fewest_steps_for_which_a_linear_program_is_feasible(A, B, start, end):
    pytest.importorskip("casadi")
    A, B, start = np.array(A), np.array(B), np.array(start)
    found = hc.minimum_time(
        linear(A, B), end, start={"x0": start[0], "x1": start[1]}, limits={"u0": (-1.0, 1.0)}
    )
    steps, rows = len(found.time) - 1, list(range(len(end)))

    def feasible(N):
        power = np.linalg.matrix_power
        reach = np.hstack([power(A, N - 1 - k) @ B for k in range(N)])[rows]
        gap = (np.array([*end.values(), 0.0][:2]) - power(A, N) @ start)[rows]
        return linprog(np.zeros(N), A_eq=reach, b_eq=gap, bounds=[(-1, 1)] * N).status == 0

    assert feasible(steps) and not feasible(steps - 1)
    x = start
    for k, u in enumerate(found.inputs["u0"][:-1]):
        x = A @ x + B[:, 0] * u
        assert [found.states["x0"][k + 1], found.states["x1"][k + 1]] == pytest.approx(x, abs=1e-6)
    with pytest.raises(InputError, match="no velocities and accelerations for a reference"):
        found.reference()


def test_an_end_out_of_reach_is_told():
    pytest.importorskip("casadi")
    plant = linear([[1.5]], [[0.1]])
    with pytest.raises(InputError, match="no manoeuvre found within the limits and 1024 steps"):
        hc.minimum_time(plant, {"x0": 0.0}, start={"x0": 5.0}, limits={"u0": (-1.0, 1.0)})
