"""C17's whole closed loop from rest: dry friction holds the craft until the controller breaks it away."""

import shutil

import numpy as np
import pytest

from hovercontrol import interconnect
from hovercontrol.blocks.backends.compiled import compile_block
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
LOOP = interconnect(list(loop_parts(load_scenario("table1")).values()), "loop")
WIDTHS = ["plant.surge_coulomb_width", "plant.sway_coulomb_width", "plant.yaw_coulomb_width"]
GRID = np.linspace(0.0, 5.0, 1001)
#: A slow reference, which leaves the craft behind; the controller trusts its model, the estimator looks on.
SLOW = {"reference.rate": 0.1, "controller.adaptation": 0.0}
START = {"plant.x": 0.2, "plant.y": 2.5, "plant.psi": np.pi, "plant.u": 0.0, "plant.v": 0.0, "plant.r": 0.0}


@pytest.fixture(scope="module")
def run():
    return lambda friction, widths, rtol: compile_block(LOOP, friction=friction).simulate(
        GRID, x0=START, params=SLOW | widths, rtol=rtol, atol=1e-3 * rtol
    )


@pytest.fixture(scope="module")
def exact(run):
    return run("events", {}, 1e-9)


def signal(response, name):
    labels = response.output_labels
    return np.asarray(response.outputs)[labels.index(name)]


def state(response, name):
    return np.asarray(response.states)[response.state_labels.index(f"plant.{name}")]


@pytest.mark.parametrize(("velocity", "until"), [("u", 3.43), ("r", 0.33)])
def test_a_velocity_is_exactly_zero_until_it_breaks_away_and_then_is_not(exact, velocity, until):
    v = state(exact, velocity)
    away = GRID[np.flatnonzero(v)[0]]
    assert away == pytest.approx(until, abs=0.02)
    assert not v[away > GRID].any()
    assert v[away <= GRID].all()


def test_surge_breaks_away_when_the_thrust_exceeds_the_friction(exact):
    c = LOOP.default_parameters
    u, v, r = (state(exact, name) for name in "uvr")
    force = c["plant.thrust"] * signal(exact, "thrust") * np.cos(signal(exact, "rudder")) + r * v
    stuck = u == 0.0
    assert (np.abs(force[stuck]) <= c["plant.surge_coulomb"]).all()
    assert np.abs(force[stuck][-1]) == pytest.approx(c["plant.surge_coulomb"], rel=0.01)


def test_smoothed_friction_comes_near_in_proportion_to_its_width(exact, run):
    """Smoothed, the craft creeps where it should stick, and breaks away too soon."""
    gaps = []
    for width in (1e-4, 1e-5):
        smooth = run("smooth", dict.fromkeys(WIDTHS, width), 1e-8)
        creep = np.abs(state(smooth, "u")[GRID < 3.0]).max()
        assert 0.0 < creep < 5 * width
        gaps.append(np.abs(smooth.states[:6] - exact.states[:6]).max(axis=1))
    assert (gaps[1] < 0.021).all()
    assert (np.divide(*gaps) > 6).all()
