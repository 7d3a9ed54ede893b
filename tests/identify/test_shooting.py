"""Many windows, many copies: the same numbers as one careful simulation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol.block import Block
from hovercontrol.identify import measure
from hovercontrol.identify.problem import Problem, states_that_matter
from hovercontrol.identify.shooting import Shooter, cut, known_states, stable_step
from hovercontrol.identify.windows import noise_levels, thin, windows
from hovercontrol.logs import Log
from hovercontrol.signals import Signal
from hovercontrol.vehicles import c17_experiment

VELOCITY = ("u", "v", "r")


@pytest.fixture
def plant():
    return c17_experiment().plant()


def irregular(log: Log, rng: np.random.Generator) -> Log:
    keep = rng.random(len(log)) < 0.6
    keep[0] = True
    return log.select(keep)


def careful(block: Block, log, x0, a, b, parameters=None):
    """Row by row with the inputs held, by an adaptive solver."""
    f = block.to_numpy()
    x, rows = np.array(x0), [np.array(x0)]
    for k in range(a, b - 1):
        u = log.inputs[:, k]
        x = solve_ivp(
            lambda t, x, u=u: f.derivatives(t, x, u, parameters),
            (log.time[k], log.time[k + 1]),
            x,
            rtol=1e-9,
            atol=1e-11,
        ).y[:, -1]
        rows.append(x)
    return np.array(rows)


def test_windows_on_irregular_time_agree_with_an_adaptive_solver(plant, rudder_log, rng):
    log = measure(plant, irregular(rudder_log(("x", "y", "psi", *VELOCITY), seconds=4), rng))
    ranges = windows([log], 1.0)
    states = known_states(plant, log, plant.parameter_values())
    cuts = cut([log], [states], VELOCITY, ranges)
    X = Shooter(plant, cuts, VELOCITY, 0.002).states(cuts.start[:, None], plant.parameter_values())
    for w in (0, 2):
        _, a, b = ranges[w]
        expected = careful(plant, log, cuts.start[:, w], a, b)
        assert np.allclose(X[: b - a, :, 0, w], expected, atol=2e-5)


def test_the_order_is_four(rng):
    """Halving the sub-step of a smooth system divides the error by sixteen."""
    x, v = Signal("x", "m", start=1.0), Signal("v", "m/s")
    k = Signal("k", "1/s^2", start=20.0)
    spring = Block("spring", [x, v], [], [x], [k], {"x": v.symbol, "v": -k.symbol * x.symbol})
    t = np.array([0.0, 0.5, 1.0])
    log = measure(spring, Log("spring", t, {"x": np.ones(3), "v": np.zeros(3)}))
    cuts = cut([log], [log.states], ["x"], [(0, 0, 3)])
    errors = [
        abs(
            Shooter(spring, cuts, ["x"], h).channels(cuts.start[:, None], [20.0])[-1, 0, 0, 0]
            - np.cos(np.sqrt(20.0))
        )
        for h in (0.05, 0.025, 0.0125)
    ]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([4, 4], abs=0.2)


def test_central_differences_agree_with_the_variational_equations(plant, rudder_log):
    log = measure(plant, rudder_log(VELOCITY, seconds=3, noise=0.0))
    states = [known_states(plant, log, plant.parameter_values())]
    names = ["plant.yaw_coulomb", "plant.yaw_linear_drag", "plant.thrust"]
    problem = Problem(plant, names, [log], states, VELOCITY, [(0, 120, 200)])
    problem.set_step(0.0005)
    point = problem.linearise(problem.start, [g.start for g in problem.groups])
    f = plant.to_numpy()
    keys = [p.name for p in plant.parameters]
    columns = [keys.index(n) for n in names]

    def slope(t, z, u):
        x, S = z[:6], z[6:].reshape(6, 6)
        A = f.jacobian(t, x, u)
        B = f.jacobian(t, x, u, columns="parameters")[:, columns]
        dS = A @ S
        dS[:, 3:] += B
        return np.concatenate([f.derivatives(t, x, u), dS.ravel()])

    S0 = np.zeros((6, 6))
    S0[3:, :3] = np.eye(3)
    z = np.concatenate([states[0][:, 120], S0.ravel()])
    for k in range(120, 199):
        z = solve_ivp(
            lambda t, z, u=log.inputs[:, k]: slope(t, z, u),
            (log.time[k], log.time[k + 1]),
            z,
            rtol=1e-8,
            atol=1e-10,
        ).y[:, -1]
    exact = z[6:].reshape(6, 6)[3:]
    assert np.allclose(point.jacobian[0][0, 79], exact, atol=1e-5 * np.abs(exact).max())


def test_only_states_that_reach_a_channel_are_sought(plant):
    names = [s.name for s in plant.states]
    assert [names[i] for i in states_that_matter(plant, VELOCITY)] == list(VELOCITY)
    assert len(states_that_matter(plant, ["x"])) == 5


def test_an_unmeasured_lag_follows_its_input():
    """A force that lags behind its command: known from the command, up to where it started."""
    v, f, c = Signal("v", "m/s"), Signal("f", "N"), Signal("c", "N")
    m, tau = Signal("m", "kg", start=2.0), Signal("tau", "s", start=0.2)
    block = Block(
        "lag", [v, f], [c], [v], [m, tau], {"v": f.symbol / m.symbol, "f": (c.symbol - f.symbol) / tau.symbol}
    )
    t = np.arange(0, 2, 0.05)
    log = measure(block, Log("lag", t, {"v": 0 * t, "c": np.where(t < 0.999, 0.0, 3.0)}))
    found = known_states(block, log, (2.0, 0.2))[1]
    assert np.allclose(found, np.where(t < 1, 0, 3 * (1 - np.exp(-(t - 1) / 0.2))), atol=2e-3)


def test_stiff_friction_asks_for_small_steps(plant, rudder_log):
    log = measure(plant, rudder_log(VELOCITY, seconds=10))
    states = [known_states(plant, log, plant.parameter_values())]
    cuts = cut([log], states, VELOCITY, windows([log], 0.2))
    parameters = list(plant.parameter_values())
    # 0.83 rad/s^2 over 0.01 rad/s is 83 1/s, as fast as anything here once yaw crosses zero
    assert stable_step(plant, cuts, parameters, 0.1) < 0.0125
    assert stable_step(plant, cuts, parameters, 0.001) == pytest.approx(0.001)


def test_windows_cover_every_row_once_and_thin_evenly(plant, rudder_log):
    log = measure(plant, rudder_log(VELOCITY, seconds=21))
    ranges = windows([log], 2.0)
    assert [b for _, _, b in ranges[:-1]] == [a for _, a, _ in ranges[1:]]
    assert ranges[0][1] == 0 and ranges[-1][2] == log.time.size
    few = thin(ranges, 900)
    assert sum(b - a for _, a, b in few) <= 900 and few[0] == ranges[0] and few[-1] == ranges[-1]


def test_noise_is_read_off_third_differences(plant, rudder_log):
    log = measure(plant, rudder_log(VELOCITY))
    assert noise_levels([log], VELOCITY) == pytest.approx([5e-3, 5e-3, 2e-2], rel=0.1)
