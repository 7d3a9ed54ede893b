"""K06's six-step pose controller: the order of its steps, and that it takes the craft to the goal (2.3.1)."""

import itertools
import math

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.controllers.k06 import both_ways, drive, force_to_command, origin, setpoints
from hovercontrol.control.controllers.k06.origin import GOAL, MODE
from hovercontrol.craft.models.vehicles import hoverdemon
from tests.blocks.simulation.loops import run_loop

#: What may follow a step (K06's steps 1 to 6; a goal already near is not driven to).
NEXT = {
    "point": {"drive", "halt"},
    "drive": {"halt"},
    "halt": {"orient", "point"},
    "orient": {"rest", "point"},
    "rest": {"halt"},
}


def tick(block, *, x=0.0, y=0.0, psi=0.0, u=0.0, v=0.0, r=0.0, goal=(0.0, 0.0, 0.0)):
    motion = {"x": x, "y": y, "psi": psi, "u": u, "v": v, "r": r}
    told = block.tick(0.0, motion | {s.name: g for s, g in zip(GOAL, goal, strict=True)})
    return MODE.modes[int(told["mode"])], told


def test_the_six_steps_in_order():
    block = Ticking(origin())
    goal = (2.0, 0.0, 1.0)
    step, told = tick(block, psi=-1.0, goal=goal)
    assert (step, told["yaw_rate_ref"], told["surge_ref"]) == ("point", 0.8, 0.0)
    step, told = tick(block, psi=0.0, goal=goal)
    assert (step, told["yaw_rate_ref"], told["surge_ref"]) == ("drive", 0.0, 0.4)
    _, told = tick(block, x=1.5, u=0.3, goal=goal)
    assert told["surge_ref"] == pytest.approx(0.4 * 0.5)  # slower near the goal
    assert tick(block, x=1.9, u=0.2, goal=goal)[0] == "halt"
    assert tick(block, x=1.9, u=0.2, goal=goal)[0] == "halt"  # until it is at rest
    step, told = tick(block, x=1.9, goal=goal)
    assert (step, told["yaw_rate_ref"]) == ("orient", 0.8)
    assert tick(block, x=1.9, psi=1.0, goal=goal)[0] == "rest"


def test_a_goal_missed_is_tried_again():
    block = Ticking(origin())
    goal = (2.0, 0.0, 0.0)
    assert tick(block, goal=goal)[0] == "drive"
    assert tick(block, x=2.0, y=0.5, goal=goal)[0] == "halt"  # abeam
    assert tick(block, x=2.0, y=0.5, goal=goal)[0] == "point"


def test_it_points_the_short_way_round():
    _, told = tick(Ticking(origin()), psi=3.0, goal=(-2.0, -0.5, 0.0))
    assert told["yaw_rate_ref"] == 0.8  # from 172 to 194 degrees


def test_it_drives_astern_where_the_stern_is_nearer_to_the_goal():
    block = Ticking(origin(reverse_surge=0.3))
    step, told = tick(block, psi=0.4, goal=(-2.0, 0.0, 0.0))
    assert (step, told["yaw_rate_ref"]) == ("point", -0.8)  # the stern to the goal, not the bow
    step, told = tick(block, psi=0.0, goal=(-2.0, 0.0, 0.0))
    assert (step, told["surge_ref"]) == ("drive", -0.3)
    _, told = tick(block, x=-1.5, u=-0.2, goal=(-2.0, 0.0, 0.0))
    assert told["surge_ref"] == pytest.approx(-0.4 * 0.5)
    assert tick(block, x=-1.9, u=-0.2, goal=(-2.0, 0.0, 0.0))[0] == "halt"
    ahead = Ticking(origin(reverse_surge=0.3))
    assert tick(ahead, goal=(2.0, 0.0, 0.0))[1]["surge_ref"] == 0.4
    with pytest.raises(InputError, match="reverse_surge must not be negative, found"):
        origin(reverse_surge=-0.1)


def test_astern_the_ideal_craft_comes_to_a_goal_behind_it_sooner():
    """The goal lies behind, the heading there is that of the start: astern nothing is to be turned."""
    arrived = {}
    for astern in (0.0, 0.4):
        gains = {"k1": 8.0, "k2": 4.0, "reverse_k1": 8.0, "reverse_k2": 1.0, "alpha": 1.44}
        law = [origin(period=0.01, reverse_surge=astern), both_ways(**gains), force_to_command()]
        told = setpoints(law, {"goal_x_ref": -2.0, "goal_y_ref": 0.1, "goal_heading_ref": 0.0})
        run = run_loop(hoverdemon().plant(), interconnect([told, *law], "pilot"), 45.0)
        c = dict(zip(run.output_labels, run.outputs, strict=True))
        resting = np.flatnonzero(c["mode"] == MODE.mode("rest"))
        arrived[astern] = run.time[resting[0]]
        assert c["distance"][resting].max() < 0.31
        assert (c["u"].min() < -0.2) == (astern > 0)
    assert arrived[0.4] < 0.7 * arrived[0.0]


def test_at_rest_it_bears_twice_the_tolerance():
    block = Ticking(origin())
    while tick(block)[0] != "rest":
        pass
    assert tick(block, x=0.29)[0] == "rest"
    assert tick(block, x=0.31)[0] == "halt"


@pytest.mark.slow("goal1")
@pytest.mark.parametrize("goal", [(3.0, 2.0, 1.5), (-2.0, 1.0, 3.0)])
def test_the_ideal_craft_comes_to_its_goal(goal):
    law = [origin(period=0.005), drive(k1=8.0, k2=4.0), force_to_command()]
    told = setpoints(law, {s.name: g for s, g in zip(GOAL, goal, strict=True)})
    pilot = interconnect([told, *law], "pilot")
    run = run_loop(hoverdemon().plant(), pilot, 60.0)
    c = dict(zip(run.output_labels, run.outputs, strict=True))
    steps = [MODE.modes[int(m)] for m in c["mode"][np.flatnonzero(np.diff(c["mode"], prepend=-1))]]
    assert steps[:2] == ["point", "drive"]
    assert "rest" in steps
    assert all(b in NEXT[a] for a, b in itertools.pairwise(steps))
    resting = c["mode"] == MODE.mode("rest")
    assert c["distance"][resting].max() < 0.31
    off = np.abs(np.angle(np.exp(1j * (c["psi"][resting] - goal[2]))))
    assert off.max() < math.radians(6.1)
    assert np.hypot(c["x"] - goal[0], c["y"] - goal[1])[run.time > 50].max() < 0.4


@pytest.mark.parametrize("key", ["surge", "slow_down", "position_tolerance", "rest_energy", "yaw_rate"])
def test_wrong_numbers_are_refused(key):
    with pytest.raises(InputError, match=f"guidance: {key} must be positive"):
        origin(**{key: 0.0})
