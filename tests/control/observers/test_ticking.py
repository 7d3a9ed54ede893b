"""The sampled estimator as a Block: the textbook's filter, near the Kalman-Bucy Block, on from its start."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.blocks.simulation.sampled import Ticking, simulate_runs
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.observers import kalman_bucy, sampled_estimator
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, hoverdemon
from tests.control.observers.textbook import Textbook

SIGNALS = ("u", "v", "r", "thrust", "rudder")
TUNING = {"R": [0.1, 0.2, 0.01], "Q": np.linspace(0.1, 0.3, 11), "P0": np.linspace(1.0, 2.0, 11)}


def covariance(ticks):
    states = dict(zip((s.name for s in ticks.block.states), ticks.state, strict=True))
    return np.array([[states[f"last_P[{min(i, j)},{max(i, j)}]"] for j in range(11)] for i in range(11)])


@pytest.mark.parametrize("begin", [0, 50])
def test_it_is_the_textbooks_kalman_filter_from_its_start_on(begin):
    craft = c17_experiment()
    c = [craft.coefficients()[name] for name in craft.linear_coefficients()]
    step = Textbook(c, 0.01, **TUNING)
    ticks = Ticking(sampled_estimator(craft.plant(), start=0.01 * begin, **TUNING))
    rng, held, wanted = np.random.default_rng(4), np.zeros(2), c
    for k in range(begin + 60):
        motion, commands = rng.normal(size=3), rng.normal(size=2)
        told = ticks.tick(0.01 * k, dict(zip(SIGNALS, (*motion, *commands), strict=True)))
        if k >= begin:
            wanted = step.step(motion, held)
        np.testing.assert_allclose(list(told.values()), wanted, rtol=0, atol=1e-11)
        held = commands
    np.testing.assert_allclose(covariance(ticks), step.P, rtol=0, atol=1e-11)


def rich_commands() -> Block:
    """Thrust and rudder that swing with incommensurate periods."""
    w = time / Signal("second", "s", start=1.0).symbol
    return Block(
        "commands",
        parameters=[Signal("second", "s", start=1.0)],
        outputs=[Signal("thrust"), Signal("rudder", "rad")],
        output_expressions={
            "thrust": 3 + sp.sin(1.3 * w) + sp.sin(3.1 * w),
            "rudder": sp.Rational(2, 5) * sp.sin(0.9 * w) + sp.Rational(3, 10) * sp.cos(2.3 * w),
        },
    )


def test_as_the_step_shrinks_it_becomes_the_kalman_bucy_block():
    """The error against the continuous estimator falls in proportion to the step.

    Friction is smooth here: of width 0.01 m/s it switches between two samples.
    """
    names = ["surge_coulomb", "surge_linear_drag", "thrust"]
    widths = {f"plant.{axis}_coulomb_width": 0.3 for axis in ("surge", "sway", "yaw")}
    craft = c17_simulation().plant().with_values({"u": 1.0, "v": 0.3, "r": 0.4} | widths)
    truth = c17_simulation().coefficients()
    belief = craft.with_values({f"plant.{name}": 1.3 * truth[name] + 0.1 for name in names})
    tuning = dict(R=1e-2, Q=1e-2, P0=[100.0, 100.0, 0.1, 0.1, 0.1])  # the first sample gives the states
    loop = interconnect([craft, rich_commands(), kalman_bucy(belief, names, **tuning)], "loop")
    t = np.arange(0, 3.0025, 0.005)
    response = simulate(loop, t, rtol=1e-9, atol=1e-11)
    found = dict(zip(response.output_labels, response.outputs, strict=True))
    errors = []
    for every in (4, 2, 1):
        estimator = sampled_estimator(belief, names, period=0.005 * every, **tuning)
        rows = simulate_runs(estimator, {s.name: found[s.name][::every] for s in estimator.inputs})
        differences = [rows[f"{n}_hat"][:, 0] - found[f"{n}_hat"][::every] for n in names]
        errors.append(np.abs(differences)[:, t[::every] >= 0.5].max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 0.015
    np.testing.assert_allclose(orders, 1.0, atol=0.2)


def test_the_covariance_stays_positive_when_measurements_are_almost_exact():
    rng = np.random.default_rng(3)
    ticks = Ticking(sampled_estimator(c17_simulation().plant(), R=1e-14, Q=0.0, P0=1e6))
    for k in range(200):
        ticks.tick(0.01 * k, dict(zip(SIGNALS, rng.normal(size=5), strict=True)))
        values = np.linalg.eigvalsh(covariance(ticks))
        assert values[0] > -1e-15 * max(values[-1], 1.0)


def test_the_inputs_of_a_step_are_those_since_the_sample_before():
    """Thrust of 2 N acts from 0.1 s on and shows in the velocity at 0.2 s: both belong to one step."""
    prior = hoverdemon().plant().with_values({"plant.thrust": 0.0})
    ticks = Ticking(sampled_estimator(prior, ["thrust"], period=0.1, R=1e-9, Q=0, P0=1.0))
    still = dict.fromkeys(("u", "v", "r", "rudder"), 0.0)
    assert ticks.tick(0.0, {**still, "thrust": 0.0})["thrust_hat"] == 0.0
    assert ticks.tick(0.1, {**still, "thrust": 2.0})["thrust_hat"] == 0.0
    found = ticks.tick(0.2, {**still, "u": 0.1 * 2 / 2.6, "thrust": 0.0})["thrust_hat"]
    assert found == pytest.approx(1 / 2.6, rel=1e-3)


def test_what_is_not_estimated_stays_a_parameter():
    drag = [n for n in c17_simulation().coefficients() if n.endswith(("coulomb", "drag"))]
    block = sampled_estimator(c17_simulation().plant(), drag)
    assert [s.name for s in block.outputs] == [f"{n}_hat" for n in drag]
    assert {"estimator.thrust", "estimator.rudder_torque"} <= set(block.default_parameters)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"period": 0.0}, "period must be positive"),
        ({"start": float("inf")}, "start must be finite"),
        ({"R": 0.0}, "R must be finite and positive"),
        ({"estimate": ["thrst"]}, "did you mean 'thrust'"),
    ],
)
def test_wrong_values_are_refused(given, said):
    with pytest.raises(InputError, match=said):
        sampled_estimator(c17_simulation().plant(), **given)
