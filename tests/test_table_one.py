"""C17's Table I in small: one fused Block against python-control's wiring of separate blocks."""

import shutil

import control as ct
import numpy as np
import pytest

from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts, phase_parameters

DRAG = (
    "surge_coulomb",
    "surge_linear_drag",
    "sway_coulomb",
    "sway_linear_drag",
    "yaw_coulomb",
    "yaw_linear_drag",
)
SOLVER = {"rtol": 1e-10, "atol": 1e-12}


def table_one():
    craft = c17_simulation()
    return [
        ellipse(1.5, 2.5, rate=-1, phase=np.pi / 2),
        tracking_controller(craft, adapt=DRAG),
        craft.plant(),
        kalman_bucy(craft.plant(), R=1e-5, Q=[1e-4] * 3 + [1e-2] * 8),
    ]


HALVED = {f"plant.{n}": c17_simulation().coefficients()[n] / 2 for n in DRAG}
PHASES = {
    "nominal": {"controller.adaptation": 0.0},
    "half the drag": {"controller.adaptation": 0.0, **HALVED},
    "adaptive": {"controller.adaptation": 1.0, **HALVED},
}


@pytest.fixture(scope="module")
def fused():
    return interconnect(table_one(), "table_one")


def test_the_closed_loop_has_the_plants_and_the_estimators_83_states_and_no_inputs(fused):
    assert len(fused.states) == 6 + 11 + 66
    assert fused.inputs == ()


def test_the_fused_loop_is_the_separate_blocks_in_every_phase(fused):
    shown = [
        "x",
        "y",
        "psi",
        "u",
        "v",
        "r",
        "error_x",
        "error_y",
        "yaw_coulomb_hat",
        "sway_linear_drag_hat",
    ]
    wired = ct.interconnect([b.to_control() for b in table_one()], name="separate", outputs=shown)
    one = fused.to_control()
    names = [label.replace("_", ".", 1) for label in wired.state_labels]
    order = [names.index(s.name) for s in fused.states]
    rows = [one.output_labels.index(name) for name in shown]
    x = np.array([s.start for s in fused.states])
    x[:6] = [0.5, 2.0, 0.3, 0.6, 0.1, -0.2]
    start = 0.0
    for params in PHASES.values():
        t = start + np.linspace(0, 0.4, 9)
        first = np.empty(len(x))
        first[order] = x
        fast = simulate(fused, t, x0=x, params=params, method="LSODA", **SOLVER)
        slow = ct.input_output_response(
            wired, t, 0, first, params=params, solve_ivp_method="LSODA", solve_ivp_kwargs=SOLVER
        )
        scale = np.maximum(1.0, np.abs(fast.outputs[rows]))
        assert np.max(np.abs(slow.outputs - fast.outputs[rows]) / scale) < 1e-6
        assert np.allclose(slow.states[order], fast.states, rtol=1e-6, atol=1e-8)
        x, start = fast.states[:, -1], t[-1]
    assert np.abs(x[:6] - [0.5, 2.0, 0.3, 0.6, 0.1, -0.2]).max() > 0.1  # it did move


def test_halved_drag_moves_the_craft_off_its_path_and_the_estimates_bring_it_back(fused):
    """FACTS 3: the error that C17 reports falls again once the estimates are used (shortened phases)."""
    x = np.array([s.start for s in fused.states])
    x[:6] = [0.0, 2.5, 0.0, 1.5, 0.0, 0.0]
    start, mean = 0.0, {}
    for (name, params), seconds in zip(PHASES.items(), (6.0, 6.0, 8.0), strict=True):
        t = start + np.linspace(0, seconds, 61)
        run = simulate(fused, t, x0=x, params=params, method="LSODA", rtol=1e-6, atol=1e-9)
        labels = run.output_labels
        error = np.hypot(run.outputs[labels.index("error_x")], run.outputs[labels.index("error_y")])
        mean[name] = error[-15:].mean()
        x, start = run.states[:, -1], t[-1]
    assert mean["nominal"] < 0.05
    assert 0.3 < mean["half the drag"] < 1.0  # "around 60 cm"
    assert mean["adaptive"] < 0.1 * mean["half the drag"]
    found = run.outputs[labels.index("yaw_coulomb_hat"), -1]
    assert found == pytest.approx(0.83 / 2, abs=0.1)


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
def test_the_third_phase_is_the_same_compiled_and_not_unless_coulomb_friction_is_asked_for():
    """Which friction is physical: see hovercontrol.blocks.friction.Friction."""
    scenario = load_scenario("table1")
    loop = interconnect([*loop_parts(scenario).values()], "loop")
    default, sticks = loop.compile(), loop.compile(friction="events")
    tight = {"rtol": 1e-9, "atol": 1e-12}
    x, begin = np.array([s.start for s in loop.states]), 0.0
    for phase in scenario.phases:
        grid, params = np.linspace(begin, phase.until, 41), phase_parameters(scenario, phase)
        start, x = x, default.simulate(grid, x0=x, params=params, **tight).states[:, -1]
        begin = phase.until
    python = simulate(loop, grid, x0=start, params=params, method="LSODA", **tight)
    np.testing.assert_allclose(python.states[:6, -1], x[:6], rtol=0.0, atol=1e-6)
    exact = sticks.simulate(grid, x0=start, params=params, **tight).states
    assert np.abs(exact[:2, -1] - x[:2]).max() > 0.01  # [m]: it sticks and slips
    velocities = exact[3:6, 1:]
    assert (velocities == 0.0).any()
    assert (python.states[3:6, 1:] != 0.0).all()
