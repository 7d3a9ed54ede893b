"""Disturbance observers: accelerations that act on a craft are found and compensated."""

import control
import numpy as np
import pytest
from scipy.signal import butter

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from tests.control.observers.observed_plants import H, cart, soft_craft

CRAFT = {
    "measurement_noise": {"x": 0.005, "y": 0.005, "psi": 0.01},
    "disturbance_noise": {"u": 0.05, "v": 0.05, "r": 0.05},
    "process_noise": {"u": 0.01, "v": 0.01, "r": 0.01},
}
TRUE = {"u": -0.3, "v": 0.25, "r": 0.4}
MOVING = {"u": 1.0}


def test_the_larger_plant_has_the_disturbance_in_the_equation_and_no_other():
    plant, larger = cart(), hc.with_disturbances(cart(), ["v"], correlation_time=4.0)
    f, g = plant.to_numpy(), larger.to_numpy()
    x, u, d = [0.3, -0.4], [0.2], 0.7
    position, speed = f.derivatives(0.0, x, u)
    wanted = [position, speed + d, -d / 4.0]
    np.testing.assert_allclose(g.derivatives(0.0, [*x, d], u), wanted, atol=1e-15)
    assert [s.name for s in larger.outputs] == ["x", "v", "disturbance_v"]
    assert larger.signal("disturbance_v").dimension == hc.Signal("a", "m/s^2").dimension


def test_of_a_linear_plant_it_is_the_kalman_bucy_filter_of_the_larger_plant():
    A = np.array([[0.0, 1.0, 0.0], [0.0, -0.8, 1.0], [0.0, 0.0, -0.25]])
    root = 0.02 * H**0.5
    _, P, _ = control.lqe(A, np.eye(3), np.eye(1, 3), np.diag([0.0, 0.01, 0.25]), [[root**2]])
    observer = hc.disturbance_observer(
        cart(), ["x"], disturbance_noise={"v": 0.5}, process_noise={"v": 0.1},
        measurement_noise={"x": root}, correlation_time=4.0,
    )  # fmt: skip
    t = np.array([0.0, 15.0, 30.0])
    run = hc.simulate(observer, t, {"x": 0 * t}, rtol=1e-9, atol=1e-12)
    found = run.outputs[[s.name for s in observer.outputs].index("disturbance_v_std"), -1]
    assert found == pytest.approx(P[2, 2] ** 0.5, rel=1e-5)


def test_its_bandwidth_is_that_of_a_butterworth_filter():
    q, s, h = 0.5, 0.002, 0.01
    free = cart(drag=0.0)
    observer = hc.disturbance_observer(
        free, ["x"], disturbance_noise={"v": q}, measurement_noise={"x": s * h**0.5}
    )
    t = np.array([0.0, 2.0, 4.0])
    x = hc.simulate(observer, t, {"x": 0 * t}, rtol=1e-9, atol=1e-12).states[:, -1]
    poles = np.linalg.eigvals(observer.linearize(x, [0.0, 0.0]).A[:3, :3])
    _, wanted = butter(3, (q / (s * h**0.5)) ** (1 / 3), analog=True)
    np.testing.assert_allclose(np.poly(poles), wanted, rtol=1e-4)


def craft_run(observer, craft, seconds, seed=0):
    """The observer beside a craft that is disturbed: its outputs at the end."""
    h, rng = observer.period, np.random.default_rng(seed)
    t = np.arange(round(seconds / h) + 1) * h
    larger = hc.with_disturbances(craft).with_values({f"disturbance_{k}": v for k, v in TRUE.items()})
    inputs = {"thrust": 2.5 + 0.3 * np.sin(t), "rudder": 0.15 * np.sin(0.9 * t)}
    pose = larger.compile().simulate(t, inputs).outputs[:3]
    noisy = pose + rng.normal(size=pose.shape) * np.array([0.005, 0.005, 0.01])[:, None]
    signals = inputs | dict(zip(("x", "y", "psi"), noisy, strict=True))
    run = observer.compile().simulate(t, signals)
    return dict(zip((s.name for s in observer.outputs), run.outputs[:, -1], strict=True))


@pytest.mark.slow
def test_wind_and_slope_on_a_craft_are_found_within_the_standard_deviation_that_is_stated():
    craft = soft_craft().with_values(MOVING)
    observer = hc.disturbance_observer(craft, **CRAFT, period=H)
    z = []
    for seed in range(8):
        shown = craft_run(observer, craft, 8.0, seed)
        for axis, value in TRUE.items():
            std = shown[f"disturbance_{axis}_std"]
            assert std < 0.15
            z.append((shown[f"disturbance_{axis}_hat"] - value) / std)
    assert np.abs(z).max() < 3.5 and 0.2 < np.std(z) < 1.5


def test_fed_forward_the_estimate_removes_the_offset_that_a_push_leaves():
    """A proportional-derivative law holds a cart against a push of 0.5 m/s^2; alone it gives way by 0.5/k."""
    k, d = 4.0, 3.0
    pushed = hc.with_disturbances(cart(), ["v"]).with_values({"disturbance_v": 0.5}).named("plant")
    observer = hc.disturbance_observer(
        cart(), ["x"], disturbance_noise={"v": 1.0}, measurement_noise={"x": 0.002}, period=H
    )
    names = ("x_hat", "v_hat", "disturbance_v_hat")
    x, v, a = (hc.Signal(n, u) for n, u in zip(names, ("m", "m/s", "m/s^2"), strict=True))
    kp, kd, use = (
        hc.Signal("kp", "1/s^2", start=k),
        hc.Signal("kd", "1/s", start=d),
        hc.Signal("use", start=1.0),
    )
    law = -kp.symbol * x.symbol - kd.symbol * v.symbol - use.symbol * a.symbol
    pilot = hc.Block(
        "pilot", [], [x, v, a], [hc.Signal("push", "m/s^2")], [kp, kd, use], output_expressions={"push": law}
    )
    loop = hc.interconnect([pushed, observer, pilot], "loop")
    t = np.arange(201) * H
    at = [s.name for s in loop.outputs].index("x")
    with_it, without = (
        loop.compile().simulate(t, params={"pilot.use": value}).outputs[at, -1] for value in (1.0, 0.0)
    )
    assert without == pytest.approx(0.5 / k, abs=2e-3) and abs(with_it) < 1e-3


def test_a_disturbance_that_the_measurements_do_not_show_is_told():
    """Of a cart whose speed alone is measured the position is hidden; its disturbance is not."""
    with pytest.warns(UserWarning, match="with v measured: 2 of 3 states are observable; unobservable: x"):
        hc.disturbance_observer(
            cart(), ["v"], disturbance_noise={"v": 1.0}, measurement_noise={"v": 0.1}, period=H
        )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"disturbance_noise": {"w": 1.0}}, "has no state 'w'"),
        ({"disturbance_noise": {}}, "on: expected different names of states"),
        ({"disturbance_noise": {"v": -1.0}}, "disturbance_v must not be negative"),
        ({"correlation_time": 0.0}, "correlation_time must be positive"),
    ],
)
def test_what_it_cannot_use_is_refused_in_one_line(changes, said):
    options = {"disturbance_noise": {"v": 1.0}, "measurement_noise": {"x": 0.1}} | changes
    with pytest.raises(InputError, match=said):
        hc.disturbance_observer(cart(), ["x"], **options)
