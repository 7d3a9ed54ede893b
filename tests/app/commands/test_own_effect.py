"""A Python file with a Model and an effect of the user's own, at every command that takes a model."""

import json

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.effects import Effect, effect
from hovercontrol.identification.diagnose.checks.stand_ins import switched_off
from hovercontrol.identification.diagnose.search.candidates import left_out
from hovercontrol.logs import Log

FILE = """
import sympy as sp, hovercontrol as hc

class SpinForce(hc.Effect):
    "A side force that grows with speed times yaw rate."
    name = "spin_force_in_a_test"
    value = hc.Coefficient("{unit}")

    def terms(self, c, s):
        return {{"v": c.value * sp.sqrt(s.u**2 + s.v**2) * s.r}}

MODEL = hc.vehicle("c17_simulation")
WITH = MODEL.with_effects([SpinForce(0.2)])
"""
NAME = "spin_force_in_a_test"


@pytest.fixture(autouse=True)
def _forgotten():
    yield
    Effect.known.pop(NAME, None)


def log() -> Log:
    rng, t = np.random.default_rng(3), np.arange(0.0, 20.0, 0.05)
    commands = [np.repeat(rng.uniform(*span, 20), 20) for span in ((1, 4), (-0.4, 0.4))]
    run = hc.simulate(
        hc.vehicle("c17_simulation").plant(), t, dict(zip(("thrust", "rudder"), commands, strict=True))
    )
    seen = {
        k: y + 1e-3 * rng.normal(size=t.size) for k, y in zip(run.output_labels, run.outputs, strict=True)
    }
    return Log("run", t, {**seen, "thrust": commands[0], "rudder": commands[1]})


@pytest.mark.slow
def test_its_model_is_simulated_identified_and_checked(call, tmp_path):
    (tmp_path / "own.py").write_text(FILE.format(unit="1"))
    log().save(tmp_path / "run.csv")
    done = call("simulate", "own.py:WITH", "--out", "first", cwd=tmp_path)
    assert done.returncode == 0 and (tmp_path / "first" / "velocities.png").exists(), done.stderr
    done = call("identify", "run.csv", "--model", "own.py:WITH", "--out", "found", "--json", cwd=tmp_path)
    found = {c["name"]: c for c in json.loads(done.stdout)["coefficients"]}
    assert abs(found[NAME]["value"]) < 4 * found[NAME]["std"] < 0.1  # the log has no such force
    done = call(
        "check", "run.csv", "--model", "own.py:WITH", "--frame", "z-up", "--out", "look", cwd=tmp_path
    )
    assert NAME in done.stdout and done.returncode == 0
    done = call("identify", "run.csv", "--model", "own.py:NONE", cwd=tmp_path)
    assert done.returncode == 2 and "known: MODEL, WITH" in done.stderr


def test_one_that_cannot_act_is_refused_where_it_is_named_and_told_where_it_is_not(call, tmp_path):
    (tmp_path / "own.py").write_text(FILE.format(unit="1/s").replace("WITH = ", "# "))
    log().save(tmp_path / "run.csv")
    words = ("diagnose", "run.csv", "--model", "own.py:MODEL", "--out", "out")
    done = call(*words, "--effects", NAME, cwd=tmp_path)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert f"plant.{NAME}*r*sqrt(u**2 + v**2)' is in m/s^3" in done.stderr
    assert not (tmp_path / "out").exists()
    (said,) = left_out(hc.vehicle("c17_simulation"))
    assert said.startswith("not tried: ") and NAME in said
    assert left_out(hc.vehicle("c17_simulation"), ["slope"]) == []


def test_a_given_effect_that_falls_to_nothing_beside_a_new_one_is_told():
    given = hc.vehicle("c17_simulation")
    amended = given.with_coefficients({"sway_linear_drag": 0.0}).with_effects(
        [effect("sway_quadratic_drag", 0.6)]
    )
    (said,) = switched_off(given, amended, ["sway_quadratic_drag"])
    assert said.startswith("sway_linear_drag falls from ") and "beside sway_quadratic_drag" in said
    assert switched_off(given, amended, ["slope"]) == []
    assert (
        switched_off(given, given.with_effects([effect("sway_quadratic_drag", 0.6)]), ["sway_quadratic_drag"])
        == []
    )
