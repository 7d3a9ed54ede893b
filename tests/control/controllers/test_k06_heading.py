"""K06's hybrid heading controllers: the energies they compare, and the modes they pass through (2.3.3)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.controllers.k06 import (
    bang_bang_heading,
    force_to_command,
    proportional_heading,
    setpoints,
    turn,
)
from hovercontrol.control.controllers.k06.energy import (
    entry_energy,
    kinetic_energy,
    least_yaw_rate,
    unwanted_level,
)
from hovercontrol.craft.models.vehicles import hoverdemon
from tests.blocks.simulation.loops import run_loop

M, J, D = 2.6, 0.096, 0.32
DEGREE = math.radians(1.0)
spin = st.floats(0.01, 8)


def at(expression):
    return float(expression)


# ---- energies ---------------------------------------------------------------------------------------


@given(spin)
def test_the_entry_energy_is_2_48_in_momentum(r):
    Pi = J * r
    by_hand = (D**2 * M) ** 2 * Pi**2 / (8 * J**2 * (J + D**2 * M))
    assert at(entry_energy(M, J, D, r)) == pytest.approx(by_hand, rel=1e-12)
    root = (math.sqrt(2 * by_hand * J**3) + math.sqrt(2 * by_hand * (J**3 + D**2 * M * J**2))) / (D**2 * M)
    assert root < Pi  # (2.47): |Pi| must exceed Pi*, and K06 takes twice a bound of it
    assert root <= 2 * math.sqrt(2 * by_hand * (J**3 + D**2 * M * J**2)) / (D**2 * M) == pytest.approx(Pi)


@given(spin, st.floats(0, 0.999), st.floats(0, 2 * math.pi), st.floats(-1, 1))
def test_whoever_enters_by_2_48_starts_below_the_unwanted_level(r, share, angle, height):
    energy = share * at(entry_energy(M, J, D, r))
    flat = math.sqrt(1 - height**2)
    u, v = (math.sqrt(2 * energy / M) * flat * f(angle) for f in (math.cos, math.sin))
    now = math.sqrt(2 * energy / J) * height
    assert kinetic_energy(M, J, u, v, now) == pytest.approx(energy, abs=1e-12)
    assert kinetic_energy(M, J, u, v, now - r) < at(unwanted_level(M, J, D, r))


@given(spin, st.floats(0, 0.999), st.floats(1.0001, 3))
def test_above_2_67_the_craft_is_below_the_next_references_unwanted_level(r, share, over):
    """The worst place on the ball W <= level is the one farthest from the next reference: overshoot in r."""
    level = share * at(unwanted_level(M, J, D, r))
    after = over * at(least_yaw_rate(M, J, D, level, r))
    c = math.sqrt(2 * level * J) + J * r
    by_hand = J * c * (math.sqrt(1 + D**2 * M / J) - 1) / (D**2 * M)  # (2.67), in momentum
    assert after == pytest.approx(over * by_hand / J, rel=1e-12)
    farthest = r + math.sqrt(2 * level / J)
    if after < r:
        assert kinetic_energy(M, J, 0, 0, farthest - after) < at(unwanted_level(M, J, D, after))


# ---- one tick ---------------------------------------------------------------------------------------


def tick(block, *, psi=0.0, u=0.0, v=0.0, r=0.0, goal=0.0):
    return block.tick(0.0, {"psi": psi, "u": u, "v": v, "r": r, "heading_ref": goal})


def test_bang_bang_turns_towards_the_goal_when_off_and_calm():
    for goal, rate in ((1.0, 1.5), (-1.0, -1.5)):
        told = tick(Ticking(bang_bang_heading(yaw_rate=1.5)), goal=goal)
        assert (told["heading_mode"], told["yaw_rate_ref"]) == (1, rate)


@pytest.mark.parametrize("make", [bang_bang_heading, proportional_heading])
def test_within_the_tolerance_or_with_too_much_energy_the_craft_is_stopped(make):
    assert tick(Ticking(make()), goal=0.99 * DEGREE)["heading_mode"] == 0
    calm = at(entry_energy(M, J, D, 1.5))
    fast, slow = (math.sqrt(2 * share * calm / M) for share in (1.01, 0.99))
    assert tick(Ticking(make()), goal=1.5, u=fast)["yaw_rate_ref"] == 0.0
    assert tick(Ticking(make()), goal=1.5, u=slow)["yaw_rate_ref"] == pytest.approx(1.5)


def test_bang_bang_holds_its_yaw_rate_until_the_goal_is_reached():
    block = Ticking(bang_bang_heading())
    assert tick(block, goal=1.0)["yaw_rate_ref"] == 1.5
    assert tick(block, psi=0.9, goal=1.0, r=1.5, v=1.0)["yaw_rate_ref"] == 1.5  # energy no longer matters
    assert tick(block, psi=1.2, goal=1.0, r=1.5)["yaw_rate_ref"] == 1.5  # nor that it has passed by
    assert tick(block, psi=1.0, goal=1.0, r=1.5)["heading_mode"] == 0
    assert tick(block, psi=1.2, goal=1.0)["yaw_rate_ref"] == -1.5


def test_proportional_slows_down_no_faster_than_2_67_allows():
    block = Ticking(proportional_heading(k=1.0, margin=1.02))
    assert tick(block, goal=2.0)["yaw_rate_ref"] == pytest.approx(2.0)
    level = 0.5 * J * (1.8 - 2.0) ** 2
    least = 1.02 * at(least_yaw_rate(M, J, D, level, 2.0))
    assert tick(block, psi=1.9, goal=2.0, r=1.8)["yaw_rate_ref"] == pytest.approx(least, rel=1e-12)
    assert 0.1 < least < 2.0


# ---- the loop ---------------------------------------------------------------------------------------


def run(guidance, goal, until):
    law = [guidance, turn(k1=1.0, k2=2.5), force_to_command()]
    pilot = interconnect([setpoints(law, {"heading_ref": goal}), *law], "pilot")
    response = run_loop(hoverdemon().plant(), pilot, until)
    return response.time, dict(zip(response.output_labels, response.outputs, strict=True))


@pytest.fixture(scope="module")
def bang_bang():
    return run(bang_bang_heading(), 1.0, 15.0)


@pytest.fixture(scope="module")
def proportional():
    return run(proportional_heading(), 1.0, 15.0)


@pytest.mark.slow
def test_bang_bang_reaches_the_goal_and_chatters_there_as_the_thesis_says(bang_bang):
    time, c = bang_bang
    late = time > 10
    assert np.abs(c["heading_error"][late]).max() < 1.1 * DEGREE
    changes = np.flatnonzero(np.diff(c["heading_mode"]))
    assert len(changes) > 20
    assert np.abs(c["v"][late]).min() > 0.01  # "prevents V_Y from being driven to zero"
    assert set(np.unique(c["yaw_rate_ref"])) <= {-1.5, 0.0, 1.5}


@pytest.mark.slow
def test_the_ideal_proportional_law_keeps_a_steady_state_error(proportional, bang_bang):
    time, c = proportional
    late = time > 10
    assert np.abs(c["heading_error"][late]).min() > DEGREE
    assert np.abs(c["v"][late]).mean() < np.abs(bang_bang[1]["v"][late]).mean()  # its one advantage
    modes = c["heading_mode"][np.flatnonzero(np.diff(c["heading_mode"], prepend=-1))]
    assert modes.tolist() == [1, 0, 1]  # it turns, stops, drifts off, and may turn again only much later


@pytest.mark.slow
def test_while_it_turns_the_proportional_law_stays_below_the_unwanted_level(proportional):
    _, c = proportional
    goal = c["yaw_rate_ref"]
    W = 0.5 * M * (c["u"] ** 2 + c["v"] ** 2) + 0.5 * J * (c["r"] - goal) ** 2
    bad = 0.5 * (J + D**2 * M) * goal**2  # (d m Pi)^2/(2 m J^2) + Pi^2/(2 J)
    turning = c["heading_mode"] == 1
    assert (W[turning] < bad[turning]).all()


def test_a_turn_begins_only_where_2_48_holds(proportional, bang_bang):
    for _, c in (proportional, bang_bang):
        begins = np.flatnonzero(np.diff(c["heading_mode"], prepend=0) > 0)
        energy = 0.5 * M * (c["u"] ** 2 + c["v"] ** 2) + 0.5 * J * c["r"] ** 2
        limit = (D**2 * M) ** 2 * (J * c["yaw_rate_ref"]) ** 2 / (8 * J**2 * (J + D**2 * M))  # (2.48)
        assert len(begins) > 0
        assert (energy[begins] < limit[begins]).all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: bang_bang_heading(yaw_rate=0.0), "guidance: yaw_rate must be positive"),
        (lambda: bang_bang_heading(tolerance=-1.0), "guidance: tolerance must be positive"),
        (lambda: proportional_heading(k=0.0), "guidance: k must be positive"),
        (lambda: proportional_heading(margin=1.0), "margin must be more than 1, found 1.0"),
    ],
)
def test_wrong_numbers_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()
