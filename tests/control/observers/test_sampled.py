"""The sampled estimator: the textbook's filter, near the Kalman-Bucy Block, and a log's tool."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.observers import (
    SampledEstimator,
    estimate_from_log,
    kalman_bucy,
)
from hovercontrol.craft.models.vehicles import c17_simulation, hoverdemon

SIGNALS = ("u", "v", "r", "thrust", "rudder")
TRUTH = c17_simulation().coefficients()
DRAG = [n for n in TRUTH if n.endswith(("coulomb", "drag"))]
#: A prior 30 % off, with no zeros in it.
PRIOR = {f"plant.{n}": 1.3 * TRUTH[n] + 0.1 for n in c17_simulation().linear_coefficients()}


def rich_commands() -> Block:
    """Thrust and rudder that swing with incommensurate periods."""
    second = Signal("second", "s", start=1.0)
    w = time / second.symbol
    return Block(
        "commands",
        parameters=[second],
        outputs=[Signal("thrust"), Signal("rudder", "rad")],
        output_expressions={
            "thrust": 3 + sp.sin(1.3 * w) + sp.sin(3.1 * w),
            "rudder": sp.Rational(2, 5) * sp.sin(0.9 * w) + sp.Rational(3, 10) * sp.cos(2.3 * w),
        },
    )


def drive(seconds, dt, held=False):
    """Simulate the C17 craft under rich commands, continuous or held between samples."""
    t = np.arange(0, seconds + dt / 2, dt)
    start = {"u": 1.0, "v": 0.3, "r": 0.4}
    plant = c17_simulation().plant().with_values(start)
    if held:
        given = rich_commands().to_numpy().outputs(t, ())
        response = simulate(plant, t, given, rtol=1e-8, atol=1e-10)
        extra = dict(zip(("thrust", "rudder"), given, strict=True))
    else:
        loop = interconnect([plant, rich_commands()], "loop")
        response = simulate(loop, t, rtol=1e-8, atol=1e-10)
        extra = {}
    found = dict(zip(response.output_labels, response.outputs, strict=True)) | extra
    return t, {name: found[name] for name in SIGNALS}


def textbook(y, u, dt, R, Q, P0, x0, c0):
    """Discrete Kalman filter with C17 (13) written out, P = (I - K H) P."""
    xi, P = np.concatenate([x0, c0]), np.diag(P0)
    H = np.hstack([np.eye(3), np.zeros((3, 8))])

    def hG(s, a):
        U, V, r = s
        T, th = a
        sg = np.tanh(np.array(s) / 0.01)
        G = np.zeros((3, 8))
        G[0, :2], G[1, 2:4], G[2, 4:6] = (-sg[0], -U), (-sg[1], -V), (-sg[2], -r)
        G[0, 6], G[1, 6], G[2, 7] = T * np.cos(th), T * np.sin(th), -T * np.sin(th)
        return np.array([V * r, -U * r, 0.0]), G

    history = []
    for k in range(len(y)):
        if k:
            (h0, G0), (h1, G1) = hG(y[k - 1], u[k]), hG(y[k], u[k])
            F = np.eye(11)
            F[:3, 3:] = dt * (G0 + G1) / 2
            xi = F @ xi + np.concatenate([dt * (h0 + h1) / 2, np.zeros(8)])
            P = F @ P @ F.T + dt * np.diag(Q)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(R) / dt)
        xi = xi + K @ (y[k] - H @ xi)
        P = (np.eye(11) - K @ H) @ P
        history.append(xi.copy())
    return np.array(history), P


def test_it_is_the_textbooks_kalman_filter():
    rng = np.random.default_rng(1)
    y, u = rng.normal(size=(60, 3)), rng.normal(size=(60, 2))
    R, Q, P0 = rng.uniform(0.5, 2, 3), rng.uniform(0.1, 1, 11), rng.uniform(0.5, 2, 11)
    block = c17_simulation().plant()
    e = SampledEstimator(block, dt=0.02, R=R, Q=Q, P0=P0, x0=[0.1, 0.2, 0.3])
    assert e.measured == ("u", "v", "r") and e.inputs == ("thrust", "rudder")
    got = [(e.step(0.02 * k, y[k], u[k]), list(e.states.values())) for k in range(60)]
    c0 = [TRUTH[n] for n in e.names]
    wanted, P = textbook(y, u, 0.02, R, Q, P0, [0.1, 0.2, 0.3], c0)
    np.testing.assert_allclose([c for c, _ in got], wanted[:, 3:], rtol=0, atol=1e-12)
    np.testing.assert_allclose([x for _, x in got], wanted[:, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(e.covariance, P, rtol=0, atol=1e-12)
    np.testing.assert_allclose(list(e.std.values()), np.sqrt(np.diag(P))[3:], atol=1e-12)


@pytest.mark.slow
def test_without_disturbances_it_is_one_ridge_regression_over_all_samples():
    """Q = 0: x[k] = x[0] + (integral of h) + (integral of G) c, with a prior on x[0] and c."""
    rng = np.random.default_rng(2)
    t, s = drive(4.0, 0.02)
    y = np.column_stack([s[n] for n in "uvr"]) + 0.01 * rng.normal(size=(len(t), 3))
    u = np.column_stack([s["thrust"], s["rudder"]])
    R, dt, prior = 1e-4, 0.02, 0.5
    block = c17_simulation().plant().with_values(PRIOR)
    noisy = s | dict(zip("uvr", y.T, strict=True))
    history = estimate_from_log(block, t, noisy, R=R, Q=0, P0=prior, x0=[0.0, 0.0, 0.0])

    held = np.vstack([u[:1], u[:-1]])
    ends = np.array([regressors(a, b) for a, b in zip(y, held, strict=True)])
    starts = np.array([regressors(a, b) for a, b in zip(y[:-1], held[1:], strict=True)])
    steps = np.concatenate([np.zeros((1, 3, 9)), dt * (starts + ends[1:]) / 2]).cumsum(axis=0)
    A = np.concatenate([np.broadcast_to(np.eye(3), (len(t), 3, 3)), steps[:, :, 1:]], axis=2)
    c0 = np.array(list(PRIOR.values()))
    left = np.vstack([A.reshape(-1, 11) / np.sqrt(R / dt), np.eye(11) / np.sqrt(prior)])
    right = np.concatenate(
        [
            (y - steps[:, :, 0]).ravel() / np.sqrt(R / dt),
            np.zeros(3),
            c0 / np.sqrt(prior),
        ]
    )
    wanted = np.linalg.lstsq(left, right, rcond=None)[0][3:]
    np.testing.assert_allclose(history.values[-1], wanted, atol=1e-9)
    inverse = np.linalg.inv(left.T @ left)
    std = [v[-1] for v in history.std.values()]
    np.testing.assert_allclose(std, np.sqrt(np.diag(inverse))[3:], rtol=1e-8)


def regressors(motion, command):
    """[h G] by way of the plant: its derivative at c = 0 and at each unit coefficient."""
    plant = c17_simulation().plant()
    names = [f"plant.{n}" for n in c17_simulation().linear_coefficients()]
    x = np.array([0, 0, 0, *motion])

    def rates(values):
        return plant.to_numpy().derivatives(0, x, command, dict.fromkeys(names, 0.0) | values)[3:]

    h = rates({})
    return np.column_stack([h, *(rates({n: 1.0}) - h for n in names)])


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_on_exact_signals_it_finds_the_truth(held):
    t, s = drive(20.0, 0.005, held)
    block = c17_simulation().plant().with_values(PRIOR)
    hold = "zero" if held else "linear"
    history = estimate_from_log(block, t, s, hold=hold, R=1e-6, Q=0, P0=1.0)
    for name, values in history.coefficients.items():
        assert values[-1] == pytest.approx(TRUTH[name], abs=0.02), name


def test_as_the_step_shrinks_it_becomes_the_kalman_bucy_block():
    """The error against the continuous estimator falls in proportion to the step.

    Friction is smooth here: of width 0.01 m/s it switches between two samples.
    """
    names = ["surge_coulomb", "surge_linear_drag", "thrust"]
    widths = {f"plant.{axis}_coulomb_width": 0.3 for axis in ("surge", "sway", "yaw")}
    start = {"u": 1.0, "v": 0.3, "r": 0.4}
    craft = c17_simulation().plant().with_values(start | widths)
    prior = {f"plant.{name}": PRIOR[f"plant.{name}"] for name in names}
    belief = craft.with_values(prior)
    tuning = dict(R=1e-2, Q=1e-2, P0=0.1)
    estimator = kalman_bucy(belief, names, **tuning)
    loop = interconnect([craft, rich_commands(), estimator], "loop")
    errors = []
    for dt in (0.02, 0.01, 0.005):
        t = np.arange(0, 3 + dt / 2, dt)
        response = simulate(loop, t, rtol=1e-9, atol=1e-11)
        found = dict(zip(response.output_labels, response.outputs, strict=True))
        history = estimate_from_log(belief, t, found, names, hold="linear", x0=[1.0, 0.3], **tuning)
        exact = np.column_stack([found[f"{n}_hat"] for n in names])
        errors.append(np.abs(history.values - exact)[t >= 0.5].max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 5e-3
    np.testing.assert_allclose(orders, 1.0, atol=0.2)


def test_only_the_chosen_coefficients_are_estimated():
    t, s = drive(2.0, 0.01)
    history = estimate_from_log(c17_simulation().plant(), t, s, DRAG)
    assert list(history.coefficients) == DRAG
    assert history.values.shape == (len(t), 6)
    assert history.units["yaw_coulomb"] == "rad/s^2"


def test_the_covariance_stays_positive_when_measurements_are_almost_exact():
    rng = np.random.default_rng(3)
    e = SampledEstimator(c17_simulation().plant(), dt=0.01, R=1e-14, Q=0, P0=1e6)
    for k in range(500):
        e.step(0.01 * k, rng.normal(size=3), rng.normal(size=2))
        values = np.linalg.eigvalsh(e.covariance)
        assert values[0] > -1e-15 * max(values[-1], 1.0)
    assert (e.covariance == e.covariance.T).all()


def test_behind_a_gap_the_states_are_taken_afresh():
    """A log with 5 s missing gives the truth, not the coefficients that would explain the jump."""
    t, s = drive(20.0, 0.01)
    keep = (t < 8.0) | (t > 13.0)
    block = c17_simulation().plant()
    cut = estimate_from_log(block, t[keep], {k: v[keep] for k, v in s.items()}, hold="linear")
    for name, values in cut.coefficients.items():
        assert np.abs(values - TRUTH[name]).max() < 0.1, name


def test_the_inputs_of_a_step_are_those_since_the_sample_before():
    """Thrust starts at t = 0.1 and shows in the velocity at 0.2: both belong to one step."""
    plant = hoverdemon().plant()
    prior = plant.with_values({"plant.thrust": 0.0})
    e = SampledEstimator(prior, ["thrust"], dt=0.1, R=1e-9, Q=0, P0=1.0)
    e.step(0.0, [0, 0, 0], [0, 0])
    e.step(0.1, [0, 0, 0], [0, 0])
    assert e.coefficients["thrust"] == 0.0
    (found,) = e.step(0.2, [0.1 * 2 / 2.6, 0, 0], [2, 0])
    assert found == pytest.approx(1 / 2.6, rel=1e-3)


def test_wrong_values_are_refused_and_change_nothing():
    e = SampledEstimator(c17_simulation().plant(), dt=0.01)
    e.step(0.0, [1, 0, 0], [1, 0])
    before = e.covariance.copy()
    with pytest.raises(InputError, match=r"expected 3 measured values \(u, v, r\), found 2"):
        e.step(0.01, [1, 0], [1, 0])
    with pytest.raises(InputError, match=r"rudder not finite at t = 0\.01 s"):
        e.step(0.01, [1, 0, 0], [1, np.nan])
    with pytest.raises(InputError, match="dt must be positive"):
        e.step(0.01, [1, 0, 0], [1, 0], 0.0)
    assert (e.covariance == before).all()
    with pytest.raises(InputError, match="dt must be positive"):
        SampledEstimator(c17_simulation().plant(), dt=0.0)
    with pytest.raises(InputError, match="R must be finite and positive"):
        SampledEstimator(c17_simulation().plant(), dt=0.01, R=0.0)
    with pytest.raises(InputError, match=r"x0: expected 3 finite values \(u, v, r\)"):
        SampledEstimator(c17_simulation().plant(), dt=0.01, x0=[0.0])


def test_what_a_log_lacks_is_named():
    t, s = drive(0.1, 0.01)
    block = c17_simulation().plant()
    with pytest.raises(InputError, match="missing signals r, rudder"):
        estimate_from_log(block, t, {k: v for k, v in s.items() if k not in ("r", "rudder")})
    with pytest.raises(InputError, match="signal 'v': expected 11 values"):
        estimate_from_log(block, t, s | {"v": s["v"][1:]})
    with pytest.raises(InputError, match=r"signal 'v': not finite at t = 0.03 s \(row 3\)"):
        estimate_from_log(block, t, s | {"v": np.where(np.arange(11) == 3, np.nan, s["v"])})
    with pytest.raises(InputError, match="increasing"):
        estimate_from_log(block, t[::-1], s)
    with pytest.raises(InputError, match="hold: expected 'zero' or 'linear'"):
        estimate_from_log(block, t, s, hold="cubic")


def test_a_history_can_be_drawn():
    t, s = drive(1.0, 0.01)
    history = estimate_from_log(c17_simulation().plant(), t, s, DRAG[:3])
    figure = history.plot()
    assert [ax.get_title() for ax in figure.axes if ax.get_visible()] == DRAG[:3]
    assert figure.axes[0].get_ylabel() == "[m/s^2]"
    assert len(history.table().splitlines()) == 3
