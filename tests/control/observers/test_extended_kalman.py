"""The extended Kalman filter of any Block, against filters of SciPy, python-control and NumPy."""

from functools import cache

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are
from scipy.stats import chi2

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from tests.control.observers.observed_plants import (
    CRAFT_NOISE,
    NOISE,
    START,
    H,
    by_hand,
    cart,
    covariance,
    matrices,
    soft_craft,
    truth,
)


def discrete(drag=0.8, q=0.3**2):
    """Phi, Gamma and Qd over H, by Van Loan's matrix exponentials."""
    A, B, _ = matrices(drag)
    Phi_Gamma = expm(np.block([[A, B], [np.zeros((1, 3))]]) * H)
    whole = expm(np.block([[-A, np.diag([0.0, q])], [np.zeros((2, 2)), A.T]]) * H)
    Phi = whole[2:, 2:].T
    return Phi, Phi_Gamma[:2, 2:], Phi @ whole[:2, 2:]


def test_its_steady_covariance_is_that_of_the_riccati_equation():
    estimator = hc.extended_kalman(cart(), ["x"], **NOISE, period=H)
    ticks = Ticking(estimator)
    for k in range(400):
        ticks.tick(k * H, {"x": 0.0, "push": 0.0})
    Phi, _, Qd = discrete()
    P = solve_discrete_are(Phi.T, matrices()[2].T, Qd, [[0.02**2]])
    np.testing.assert_allclose(covariance(estimator, ticks.state, 2)[1], P, rtol=2e-6)


def test_of_a_linear_plant_it_is_the_kalman_filter_of_python_control():
    Phi, Gamma, Qd = discrete()
    B = np.hstack([Gamma, np.eye(2)])
    system = control.ss(Phi, B, matrices()[2], 0, H, inputs=["push", "w1", "w2"], outputs=["x"])
    theirs = control.create_estimator_iosystem(
        system, Qd, np.diag([0.02**2]), P0=np.diag([0.04, 0.09]), disturbance_indices=["w1", "w2"]
    )
    rng = np.random.default_rng(3)
    t, push, x = np.arange(60) * H, rng.normal(size=60), rng.normal(size=60) * 0.1
    wanted = control.input_output_response(
        theirs, t, np.vstack([x, push]), np.r_[0.0, 0.0, np.diag([0.04, 0.09]).ravel()]
    )
    estimator = hc.extended_kalman(cart(), ["x"], **NOISE, period=H, start_std={"x": 0.2, "v": 0.3})
    ours = control.input_output_response(
        estimator.to_control(), t, np.vstack([x, push]), [s.start for s in estimator.states]
    )
    # python-control's estimator shows its prediction, as our states do.
    np.testing.assert_allclose(ours.states[:2], wanted.outputs[:2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(ours.states[[2, 3, 4]], wanted.states[[2, 3, 5]], rtol=0, atol=1e-6)


def test_continuous_it_is_the_steady_kalman_bucy_filter():
    A, _, C = matrices()
    root = 0.02 * H**0.5
    L, P, _ = control.lqe(A, np.eye(2), C, np.diag([0.0, 0.3**2]), [[root**2]])
    noise = NOISE | {"measurement_noise": {"x": root}}
    estimator = hc.extended_kalman(cart(), ["x"], **noise)
    run = hc.simulate(estimator, [0.0, 10.0, 20.0], {"x": [0.0] * 3}, rtol=1e-10, atol=1e-13)
    _, found = covariance(estimator, run.states[:, -1], 2)
    np.testing.assert_allclose(found, P, rtol=1e-6)
    # At that covariance its linearisation is that of python-control's filter, A - L C.
    linear = estimator.linearize(run.states[:, -1], [0.0, 0.0])
    np.testing.assert_allclose(linear.A[:2, :2], A - L @ C, rtol=1e-6, atol=1e-9)


def test_continuous_on_a_craft_it_is_the_textbook_filter():
    root = {"x": 0.002, "y": 0.003, "psi": 0.004}
    craft = hc.vehicle("c17_simulation").plant()
    estimator = hc.extended_kalman(craft, **(CRAFT_NOISE | {"measurement_noise": root}))
    rng, f = np.random.default_rng(8), craft.to_numpy()
    x, u, y, half = rng.normal(size=6), rng.normal(size=2), rng.normal(size=3), rng.normal(size=(6, 6))
    y[2] = x[2] + 2 * np.pi + 0.3  # the same heading, and 0.3 rad
    P, C = half @ half.T, np.eye(3, 6)
    F, Q = f.jacobian(0.0, x, u), np.diag([0, 0, 0, 0.01, 0.01, 0.04])
    K = P @ C.T @ np.diag(np.array(list(root.values())) ** -2.0)
    found = estimator.to_numpy().derivatives(0.0, [*x, *P[np.triu_indices(6)]], [*y, *u])
    innovation = np.array([*(y - x[:3])[:2], 0.3])
    wanted = f.derivatives(0.0, x, u) + K @ innovation
    np.testing.assert_allclose(found[:6], wanted, rtol=1e-9)
    loss = K @ C @ P
    np.testing.assert_allclose(found[6:], (F @ P + P @ F.T + Q - loss)[np.triu_indices(6)], rtol=1e-9)


def test_continuous_without_measurements_the_variance_is_that_of_the_plant():
    estimator = hc.extended_kalman(cart(), ["x"], **NOISE, start_std={"v": 0.5}, lost_samples=True)
    t = np.array([0.0, 1.0, 2.0])
    signals = {"x": np.full(3, 7.0), "fresh": np.zeros(3)}
    run = hc.simulate(estimator.with_values({"xhat[1]": 1.0}), t, signals)
    shown = dict(zip((s.name for s in estimator.outputs), run.outputs, strict=True))
    decay = np.exp(-2 * 0.8 * t)
    np.testing.assert_allclose(shown["v_hat"], np.exp(-0.8 * t), rtol=1e-5)
    np.testing.assert_allclose(shown["v_std"] ** 2, 0.25 * decay + 0.09 * (1 - decay) / 1.6, rtol=1e-5)


@cache
def craft_filter():
    craft = soft_craft().with_values(START)
    options = {"period": 0.02, "lost_samples": True}
    return craft, hc.extended_kalman(craft, **CRAFT_NOISE, **options)


def test_on_a_craft_it_is_the_textbook_filter_also_past_pi_and_without_samples():
    h = 0.02
    craft, estimator = craft_filter()
    motion, samples, commands = truth(craft, h, 50, 1, [0.0, 0.0, 3.13, 1.2, -0.2, 0.4])
    assert np.abs(motion[:, 2]).max() > np.pi
    samples[:, 2] = np.angle(np.exp(1j * samples[:, 2]))  # as a compass has it
    fresh = np.arange(50) % 7 < 4
    Q, R = np.diag([0, 0, 0, 0.01, 0.01, 0.04]), np.diag([1e-4, 1e-4, 4e-4])
    P = np.diag([0.02, 0.02, 0.05, 0.1, 0.1, 0.1]) ** 2
    ticks, names = Ticking(estimator), [s.name for s in craft.states]
    wanted = by_hand(craft, np.array([0, 0, 3.13, 1.2, -0.2, 0.4]), P, Q, R, h, samples, commands, fresh)
    for k, (x, P) in enumerate(wanted):
        given = dict(zip(("x", "y", "psi"), samples[k], strict=True))
        given |= {"thrust": commands[k][0], "rudder": commands[k][1], "fresh": float(fresh[k])}
        shown = ticks.tick(k * h, given)
        np.testing.assert_allclose([shown[f"{n}_hat"] for n in names], x, rtol=0, atol=2e-5)
        np.testing.assert_allclose([shown[f"{n}_std"] for n in names], np.diag(P) ** 0.5, rtol=5e-3)


def test_sensors_of_different_rates_have_an_input_each():
    """Without samples of the speed the filter is that of the position alone."""
    noise = {"process_noise": {"v": 0.3}, "period": H}
    both = hc.extended_kalman(
        cart(), ["v", "x"], **noise, measurement_noise={"x": 0.02, "v": 0.1}, lost_samples=["v"]
    )
    assert both.inputs[-1].name == "fresh_v"
    alone = hc.extended_kalman(cart(), ["x"], **noise, measurement_noise={"x": 0.02})
    left, right = Ticking(both), Ticking(alone)
    for k in range(5):
        given = {"x": 0.1 * k, "push": 0.3}
        lost = given | {"v": float("nan"), "fresh_v": 0.0}
        shown = [list(ticks.tick(H * k, g).values()) for ticks, g in ((left, lost), (right, given))]
        np.testing.assert_allclose(*shown, rtol=0, atol=1e-12)


def nees(runs, steps, lost):
    """Normalised squared errors at the end of runs whose start is as uncertain as the filter assumes."""
    h = 0.02
    craft, estimator = craft_filter()
    filters = np.array([s.start for s in estimator.states])
    f, found = estimator.to_numpy().array_derivatives, []
    rng = np.random.default_rng(7)
    std = [0.02, 0.02, 0.05, 0.1, 0.1, 0.1]
    truths = [
        truth(craft, h, steps, 100 + k, np.array([0, 0, 3.13, 1.2, -0.2, 0.4]) + rng.normal(size=6) * std)
        for k in range(runs)
    ]
    z, p = np.repeat(filters[:, None], runs, 1), estimator.parameter_values()
    for k in range(steps - 1):
        u = [*np.array([t[1][k] for t in truths]).T, *np.array([t[2][k] for t in truths]).T]
        fresh = (rng.random(runs) >= lost).astype(float)
        z = np.array([np.broadcast_to(v, runs) for v in f(k * h, z, [*u, fresh], p)])
    for k, t in enumerate(truths):
        x, P = covariance(estimator, z[:, k], 6)
        e = t[0][-1] - x
        found.append(e @ np.linalg.solve(P, e))
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("lost", [pytest.param(0.0, marks=pytest.mark.slow), 0.5])
def test_its_errors_are_as_large_as_it_says(lost):
    errors = nees(50, 30, lost)
    low, high = chi2.ppf([0.005, 0.995], 50 * 6)
    assert low < errors.sum() < high


def loop(h=0.05):
    """A craft whose speed is held by a proportional law on the estimate alone."""
    craft = soft_craft()
    estimator = hc.extended_kalman(craft, **CRAFT_NOISE, period=h, name="filter")
    u, ref, k = hc.Signal("u_hat", "m/s"), hc.Signal("u_ref", "m/s"), hc.Signal("k", "s/m", start=4.0)
    cruise = hc.Signal("cruise", "1", start=1.8)
    law = cruise.symbol + k.symbol * (ref.symbol - u.symbol)
    pilot = hc.Block(
        "pilot", [], [u, ref], [hc.Signal("thrust"), hc.Signal("rudder", "rad")], [k, cruise],
        output_expressions={"thrust": law, "rudder": 0},
    )  # fmt: skip
    return hc.interconnect([craft, estimator, pilot], "loop")


def test_a_loop_closed_by_the_estimate_runs_alike_everywhere():
    system, t = loop(), np.arange(81) * 0.05
    ref = np.full(81, 0.8)
    plain = hc.simulate(system, t, {"u_ref": ref})
    fast = system.compile().simulate(t, {"u_ref": ref})
    python_control = control.input_output_response(
        system.to_control(step=0.05), t, ref, [s.start for s in system.states]
    )
    np.testing.assert_allclose(fast.outputs, plain.outputs, rtol=0, atol=1e-5)
    np.testing.assert_allclose(python_control.outputs, plain.outputs, rtol=0, atol=1e-5)
    names = [s.name for s in system.outputs]
    u, u_hat = (plain.outputs[names.index(n)] for n in ("u", "u_hat"))
    assert abs(u[-1] - 0.8) < 0.02 and np.abs(u_hat - u)[20:].max() < 0.05


def test_the_plants_coefficients_are_the_filters_own():
    craft = soft_craft()
    estimator = hc.extended_kalman(craft, **CRAFT_NOISE, period=0.05)
    assert estimator.default_parameters["estimator.yaw_coulomb"] == 0.83
    assert estimator.default_parameters["estimator.process_noise_r"] == 0.2
    assert estimator.default_parameters["estimator.measurement_noise_psi"] == 0.02
    whole = hc.interconnect([craft, hc.rename(estimator, {})], "whole")
    assert {"plant.yaw_coulomb", "estimator.yaw_coulomb"} <= set(whole.default_parameters)


def test_a_plant_of_parts_has_its_parts_names_in_the_outputs():
    moved = hc.interconnect([cart()], "whole")
    estimator = hc.extended_kalman(moved, ["x"], process_noise={"cart.v": 1.0}, measurement_noise={"x": 0.1})
    assert [s.name for s in estimator.outputs] == ["cart.x_hat", "cart.v_hat", "cart.x_std", "cart.v_std"]
    assert "estimator.cart.drag" in estimator.default_parameters
    hc.interconnect([moved.named("plant"), estimator], "both")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"measured": ["z"]}, "has no output 'z'"),
        ({"measured": ["x", "x"]}, "expected different names"),
        ({"process_noise": {"w": 1.0}}, "process_noise: unknown name 'w'"),
        ({"process_noise": {"v": -1.0}}, "process_noise: v must not be negative"),
        ({"measurement_noise": {}}, "expected a positive number for 'x', found none"),
        ({"measurement_noise": {"x": 0.0}}, "expected a positive number for 'x', found 0"),
        ({"start_std": {"y": 1.0}}, "start_std: unknown name 'y'"),
        ({"period": 0.0}, "period must be positive"),
        ({"period": 100.0}, "shorten the period, or give substeps=32"),
        ({"lost_samples": ["v"]}, "lost_samples: expected measured outputs, found 'v'"),
        ({"substeps": 2, "period": None}, "substeps are of a sampled filter"),
        ({"substeps": 0}, "substeps: expected 1 to 32, found 0"),
    ],
)
def test_what_it_cannot_use_is_refused_in_one_line(changes, said):
    with pytest.raises(InputError, match=said):
        hc.extended_kalman(cart(), **({"measured": ["x"], **NOISE, "period": H} | changes))


def test_late_inputs_are_refused():
    late = hc.vehicle("c17_simulation").with_effects([hc.effect("input_delay", 0.1)])
    with pytest.raises(InputError, match="acts with a delay"):
        hc.extended_kalman(late, **CRAFT_NOISE)


def test_measurements_that_do_not_show_the_state_are_told():
    with pytest.warns(UserWarning, match="x, y measured: 4 of 6 states are observable; unobservable: psi; r"):
        hc.extended_kalman(
            hc.vehicle("c17_simulation"), ["x", "y"],
            process_noise={}, measurement_noise={"x": 0.01, "y": 0.01}, period=0.05,
        )  # fmt: skip


@pytest.mark.slow
def test_it_is_exported_as_an_fmu(tmp_path):
    fmpy = pytest.importorskip("fmpy")
    _, estimator = craft_filter()
    path = estimator.to_fmu(tmp_path / "filter.fmu")
    t = np.arange(21) * 0.02
    values = {"x": 0.3, "y": 0.1, "psi": -3.1, "thrust": 2.0, "rudder": 0.1, "fresh": 1.0}
    signals = {name: np.full(21, value) for name, value in values.items()}
    rows = np.array(
        list(zip(t, *signals.values(), strict=True)), dtype=[(n, float) for n in ("time", *signals)]
    )
    result = fmpy.simulate_fmu(str(path), stop_time=0.4, output_interval=0.02, input=rows)
    ours = hc.simulate(estimator, t, signals).outputs
    k = [s.name for s in estimator.outputs].index("v_hat")
    np.testing.assert_allclose(result["v_hat"][-1], ours[k, -1], rtol=0, atol=1e-6)
