"""What a map and an animation show beside the craft: the tracked point, obstacles, waypoints, plans."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.app.animation.frames import plan_at
from hovercontrol.app.animation.motion import motion_of, scenery_of

TURN = {"x": [0.0, 1.0, 1.0], "y": [0.0, 0.0, 1.0], "psi": [0.0, np.pi / 2, np.pi]}


def test_the_tracked_point_is_the_reference_plus_the_error():
    x, y, psi = (np.array(TURN[k]) for k in ("x", "y", "psi"))
    ahead = {"x": x + 0.2 * np.cos(psi), "y": y + 0.2 * np.sin(psi)}  # C17 (15)
    errors = {f"{k}_ref": ahead[k] - 0.05 for k in "xy"} | {f"error_{k}": np.full(3, 0.05) for k in "xy"}
    log = hc.Log("run", [0.0, 1.0, 2.0], TURN | errors)
    found = motion_of(log)
    assert found.tracked["x"] == pytest.approx(ahead["x"]) and found.tracked["y"] == pytest.approx(ahead["y"])
    names = [line.get_label() for line in hc.plot_path(log).axes[0].lines]
    assert {"tracked point", "centre of mass", "reference"} <= set(names)


def test_obstacles_and_waypoints_are_on_the_map_and_in_the_page(tmp_path):
    log = hc.Log("run", [0.0, 1.0, 2.0], TURN)
    page = tmp_path / "run.html"
    hc.animate(log, page, obstacles=[(3.0, 0.0, 0.5)], waypoints=[[1.0, 4.0]])
    data = json.loads(re.search(r"const run = (\{.*\});", page.read_text(encoding="utf-8"))[1])
    assert (data["obstacles"], data["waypoints"]) == ([[3.0, 0.0, 0.5]], [[1.0, 4.0]])
    assert data["box"][1] > 3.5 and data["box"][3] > 4.0
    axes = hc.plot_path(log, obstacles=[(3.0, 0.0, 0.5)], waypoints=[[1.0, 4.0]]).axes[0]
    assert axes.get_legend_handles_labels()[1][:2] != [] and "obstacle" in axes.get_legend_handles_labels()[1]


def test_a_run_of_a_predictive_controller_brings_its_surroundings_and_plans():
    plans = np.arange(12.0).reshape(2, 3, 2)
    run = SimpleNamespace(
        obstacles=np.array([[1.0, 2.0, 0.3]]), plans=plans, waypoints=(SimpleNamespace(point=(4.0, 0.0)),)
    )
    found = scenery_of(run, [], [])
    assert found.waypoints.tolist() == [[4.0, 0.0]] and found.obstacles.tolist() == [[1.0, 2.0, 0.3]]
    whole = SimpleNamespace(scenery=found, time=np.array([0.0, 0.5, 1.0]))
    assert [plan_at(whole, t)[0, 0] for t in (0.0, 0.49, 0.5, 1.0)] == [0.0, 0.0, 6.0, 6.0]


def test_what_is_no_obstacle_is_refused():
    with pytest.raises(hc.InputError, match="obstacles as"):
        hc.animate(hc.Log("run", [0.0, 1.0, 2.0], TURN), obstacles=[(1.0, 2.0)])
