"""The unscented Kalman filter of any Block, against one written by hand with NumPy."""

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from tests.control.observers.observed_plants import NOISE, START, H, cart, covariance, soft_craft


def test_of_a_linear_plant_it_is_the_kalman_filter():
    options = NOISE | {"period": H, "start_std": {"x": 0.2, "v": 0.3}, "lost_samples": True}
    blocks = [make(cart(), ["x"], **options) for make in (hc.extended_kalman, hc.unscented_kalman)]
    extended, unscented = map(Ticking, blocks)
    rng = np.random.default_rng(5)
    for k in range(50):
        given = {"x": rng.normal(), "push": rng.normal(), "fresh": float(k % 5 > 0)}
        both = [list(ticks.tick(k * H, given).values()) for ticks in (extended, unscented)]
        np.testing.assert_allclose(*both, rtol=0, atol=1e-12)


def beacon():
    """A cart in the plane with a constant velocity; its distance and bearing from the origin are measured."""
    names, units = ("x", "y", "vx", "vy"), ("m", "m", "m/s", "m/s")
    x, y, vx, vy = (hc.Signal(n, u) for n, u in zip(names, units, strict=True))
    outputs = [hc.Signal("distance", "m"), hc.Signal("bearing", "rad")]
    return hc.Block(
        "beacon", [x, y, vx, vy], [], outputs,
        derivatives={"x": vx.symbol, "y": vy.symbol, "vx": 0, "vy": 0},
        output_expressions={
            "distance": sp.sqrt(x.symbol**2 + y.symbol**2), "bearing": sp.atan2(y.symbol, x.symbol),
        },
    ).with_values({"x": -2.0, "y": -0.3, "vx": 0.1, "vy": 0.4})  # fmt: skip


def beacon_filter(**options):
    return hc.unscented_kalman(
        beacon(), ["distance", "bearing"], period=0.1, process_noise={"vx": 0.2, "vy": 0.2},
        measurement_noise={"distance": 0.05, "bearing": 0.1}, **options,
    )  # fmt: skip


@pytest.mark.slow
def test_without_samples_it_predicts_also_where_outputs_bend():
    some, none = beacon_filter(lost_samples=["bearing"]), beacon_filter(lost_samples=True)
    given = {"distance": 2.1, "bearing": -3.0}
    lost = {"distance": float("nan"), "bearing": float("nan"), "fresh": 0.0}
    a, b, c = (
        Ticking(block).tick(0.0, values)
        for block, values in (
            (none, given | {"fresh": 1.0}),
            (some, given | {"fresh_bearing": 1.0}),
            (none, lost),
        )
    )
    assert a == pytest.approx(b, abs=1e-14)
    start = {f"{s.name}_hat": s.start for s in beacon().states} | {
        f"{s.name}_std": 1.0 for s in beacon().states
    }
    assert c == pytest.approx(start, abs=1e-12)
    distance = Ticking(some).tick(0.0, given | {"bearing": float("nan"), "fresh_bearing": 0.0})
    assert distance["x_std"] < 0.5 and distance["y_std"] > 0.8  # the beacon lies along x


def by_hand(x, P, samples, h, q, r, kappa):
    """An unscented filter for the cart with a constant velocity, whose prediction is exact."""
    n = 4
    Phi = np.eye(4) + h * np.eye(4, k=2)
    Q1 = q**2 * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]])
    Q = np.kron(Q1, np.eye(2))
    W = np.r_[kappa / (n + kappa), np.full(2 * n, 1 / (2 * (n + kappa)))]

    def turned(a):
        return np.angle(np.exp(1j * a))

    def output(points):
        return np.array([np.hypot(points[0], points[1]), np.arctan2(points[1], points[0])])

    for y in samples:
        L = np.sqrt(n + kappa) * np.linalg.cholesky(P)
        points = x[:, None] + np.hstack([np.zeros((n, 1)), L, -L])
        off = output(points) - output(x[:, None])
        off[1] = turned(off[1])
        mean = off @ W
        dy, dx = off - mean[:, None], points - x[:, None]
        S, C = dy * W @ dy.T + np.diag(np.square(r)), dx * W @ dy.T
        K = C @ np.linalg.inv(S)
        e = y - output(x)
        e[1] = turned(e[1])
        x, P = x + K @ (e - mean), P - K @ S @ K.T
        yield x, P
        x, P = Phi @ x, Phi @ P @ Phi.T + Q


@pytest.mark.parametrize("kappa", [0.0, 2.0])
def test_distance_and_bearing_beyond_pi_as_by_hand(kappa):
    h, q, r, std = 0.1, 0.2, (0.05, 0.1), np.array([0.5, 0.5, 0.3, 0.3])
    plant = beacon()
    estimator = hc.unscented_kalman(
        plant, ["distance", "bearing"], period=h, kappa=kappa,
        process_noise={"vx": q, "vy": q}, measurement_noise={"distance": r[0], "bearing": r[1]},
        start_std=dict(zip(("x", "y", "vx", "vy"), std, strict=True)),
    )  # fmt: skip
    rng, t = np.random.default_rng(2), np.arange(20) * h
    position = np.array([-2.2 + 0.1 * t, -0.4 + 0.4 * t])  # crosses the bearing pi
    samples = np.array([np.hypot(*position), np.arctan2(position[1], position[0])]).T
    samples += rng.normal(size=samples.shape) * r
    samples[:, 1] = np.angle(np.exp(1j * samples[:, 1]))
    ticks = Ticking(estimator)
    wanted = by_hand(np.array([-2.0, -0.3, 0.1, 0.4]), np.diag(std**2), samples, h, q, r, kappa)
    for k, (x, P) in enumerate(wanted):
        shown = list(ticks.tick(k * h, {"distance": samples[k, 0], "bearing": samples[k, 1]}).values())
        np.testing.assert_allclose(shown, [*x, *np.diag(P) ** 0.5], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_its_prediction_has_the_mean_of_many_runs():
    """A heading uncertain by 0.5 rad: the mean position is short of where the mean heading leads."""
    h = 0.3
    craft = soft_craft().with_values(START | {"psi": 0.0})
    std = {"x": 0.01, "y": 0.01, "psi": 0.5, "u": 0.05, "v": 0.05, "r": 0.05}
    options = {
        "process_noise": {}, "measurement_noise": {"x": 1.0, "y": 1.0, "psi": 1.0},
        "period": h, "start_std": std, "lost_samples": True, "substeps": 1,
    }  # fmt: skip
    given = {"x": 0.0, "y": 0.0, "psi": 0.0, "thrust": 2.0, "rudder": 0.1, "fresh": 0.0}
    rng = np.random.default_rng(1)
    names = [s.name for s in craft.states]
    start = np.array([s.start for s in craft.states])
    cloud = start[:, None] + rng.normal(size=(6, 5000)) * np.array(list(std.values()))[:, None]
    f = craft.to_numpy()
    for _ in range(40):
        k1 = f.derivatives(0.0, cloud, [2.0, 0.1])
        cloud = cloud + h / 40 * f.derivatives(0.0, cloud + h / 80 * k1, [2.0, 0.1])
    errors = {}
    for make in (hc.extended_kalman, hc.unscented_kalman):
        estimator = make(craft, **options)
        ticks = Ticking(estimator)
        ticks.tick(0.0, given)
        shown = dict(zip(names, covariance(estimator, ticks.state, 6)[0], strict=True))
        errors[make.__name__] = abs(shown["x"] - cloud[names.index("x")].mean())
    assert errors["unscented_kalman"] < 0.15 * errors["extended_kalman"]


def test_compiled_it_computes_the_same():
    estimator = hc.unscented_kalman(cart(), ["x"], **NOISE, period=H)
    t = np.arange(21) * H
    signals = {"x": np.sin(t), "push": np.cos(t)}
    plain = hc.simulate(estimator, t, signals)
    np.testing.assert_allclose(
        estimator.compile().simulate(t, signals).outputs, plain.outputs, rtol=0, atol=1e-10
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"kappa": -1.0}, "kappa must not be negative"),
        ({"period": -1.0}, "period must be positive"),
        ({"start_std": {"v": 0.0}}, "start_std: expected a positive number for 'v', found 0"),
        ({"process_noise": {"y": 0.0}}, "process_noise: unknown name 'y'"),
    ],
)
def test_what_it_cannot_use_is_refused_in_one_line(changes, said):
    with pytest.raises(InputError, match=said):
        hc.unscented_kalman(cart(), ["x"], **(NOISE | {"period": H} | changes))
