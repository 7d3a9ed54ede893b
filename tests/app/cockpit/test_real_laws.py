"""All laws in one Block with a switch: each is the law that it is by itself."""

import math

import numpy as np
import pytest

from hovercontrol.app.cockpit.laws import CHOICES, law
from hovercontrol.app.cockpit.real_laws import LAW, reference_key, switched_laws
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.models.vehicles import vehicle

BLOCK = switched_laws()
MOVING = ("x", "y", "psi", "u", "v", "r")
STICK = ("stick_ahead", "stick_right")


def seen(rng, key):
    motion = dict(zip(MOVING, rng.normal(size=6), strict=True))
    stick = dict(zip(STICK, rng.uniform(-1, 1, size=2), strict=True))
    return {**motion, **stick, "law": LAW.mode(key)}


@pytest.mark.parametrize("key", [key for key in CHOICES if key != "manual"])
def test_a_law_asks_for_the_force_that_it_asks_for_alone(key):
    told = {s.name: 0.7 * s.start or 0.3 for s in CHOICES[key].references}
    whole = Ticking(BLOCK, {reference_key(key, name): value for name, value in told.items()})
    alone = Ticking(law(key, vehicle("hoverdemon")), {f"reference.{n}": value for n, value in told.items()})
    rng = np.random.default_rng(3)
    for k in range(30):
        signals = seen(rng, key)
        if "heading_ref" in told:  # alone it does not take whole turns off
            off = math.remainder(signals["psi"] - told["heading_ref"], math.tau)
            signals["psi"] = told["heading_ref"] + off
        asked, wanted = (run.tick(0.001 * k, signals) for run in (whole, alone))
        for name in ("force_x", "force_y"):
            assert asked[name] == pytest.approx(wanted[name], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("stick", [(1.0, 0.4), (-0.5, -1.0), (0.0, 1.0)])
def test_the_stick_is_a_force_and_its_angle(stick):
    signals = {
        **dict.fromkeys(MOVING, 0.3),
        **dict(zip(STICK, stick, strict=True)),
        "law": LAW.mode("manual"),
    }
    force = Ticking(BLOCK).tick(0.0, signals)
    assert math.hypot(force["force_x"], force["force_y"]) == pytest.approx(2.0 * abs(stick[0]))
    if stick[0]:
        angle = math.atan2(force["force_y"] / stick[0], force["force_x"] / stick[0])
        assert angle == pytest.approx(math.radians(35.0) * stick[1])


def test_guidance_begins_anew_when_its_law_is_chosen_again():
    run = Ticking(BLOCK)
    modes = BLOCK.signal("goal_mode").modes
    there = {**dict.fromkeys((*MOVING, *STICK), 0.0), "law": LAW.mode("goal")}  # the goal is the origin
    for k in range(6):
        told = run.tick(0.001 * k, there)
    assert modes[int(told["goal_mode"])] == "rest"
    run.tick(0.006, {**there, "law": LAW.mode("stop")})
    again = [run.tick(0.007 + 0.001 * k, there)["goal_mode"] for k in range(2)]
    assert [modes[int(m)] for m in again] == ["halt", "orient"]
