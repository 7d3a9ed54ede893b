"""A drive with one axis, of which only the position is measured."""

import numpy as np
import pytest

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log

TIME = np.arange(0.0, 12.0, 0.005)


def drive():
    q, v, force = Signal("q", "m"), Signal("v", "m/s"), Signal("force", "N")
    per_mass, viscous = Signal("per_mass", "1/kg", start=0.05, lower=0.0), Signal("viscous", "1/s", start=1.0)
    slope = per_mass.symbol * force.symbol - viscous.symbol * v.symbol
    return BlockModel(Block("drive", [q, v], [force], [q], [per_mass, viscous], {"q": v.symbol, "v": slope}))


def trial(truth, seed):
    rng = np.random.default_rng(seed)
    force = np.repeat(rng.uniform(-60.0, 60.0, TIME.size // 60), 60)
    run = truth.plant().compile(friction="smooth").simulate(TIME, [force])
    return Log(
        f"trial {seed}",
        TIME,
        {"q": np.ravel(run.outputs) + 2e-5 * rng.normal(size=TIME.size), "force": force},
    )


@pytest.mark.slow
def test_coulomb_friction_and_an_offset_are_named_though_a_scale_of_the_sensor_scores_more():
    """Scaling the only sensor scores without end while friction is missing, and fits nothing."""
    coulomb, offset = (drive().effect_class(name) for name in ("v_coulomb", "v_offset"))
    truth = drive().with_effects([coulomb(0.6, width=1e-3), offset(-0.2)])
    found = diagnose(drive(), [trial(truth, 1)], trial(truth, 2))
    assert {e.effect for e in found.effects} == {"v_coulomb", "v_offset"}
    assert not [r for r in found.rivals if not r.same], (
        "Stribeck friction has a number more that pays for nothing"
    )
    sizes = {e.effect: e.value for e in found.effects}
    assert sizes["v_coulomb"] == pytest.approx(0.6, rel=0.03)
    assert sizes["v_offset"] == pytest.approx(-0.2, rel=0.05)


@pytest.mark.slow
def test_friction_that_fades_is_told_from_one_that_does_not():
    truth = drive().with_effects([drive().effect_class("v_stribeck")(0.8, speed=0.3, width=1e-3)])
    found = diagnose(drive(), [trial(truth, 3)], trial(truth, 4))
    assert [e.effect for e in found.effects] == ["v_stribeck", "v_stribeck"]


#: One of each kind of law that a user's Block may lack, besides those above; benchmarks/own_machines has all.
LAWS = {
    "v_quadratic_drag": {"value": 0.5},
    "v_lugre": {"stiffness": 300.0, "damping": 10.0, "coulomb": 0.4, "static": 0.6, "speed": 0.05},
    "force_deadzone": {"width": 8.0},
    "force_backlash": {"width": 10.0},
    "force_second_order_lag": {"seconds": 0.02, "damping": 0.4},
    "force_hysteresis": {"value": 0.4, "play": 20.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_each_law_is_named_and_measured(name):
    truth = drive().with_effects([drive().effect_class(name)(**LAWS[name])])
    found = diagnose(drive(), [trial(truth, 1)], trial(truth, 2))
    assert found.verdict == "effect"
    assert {e.effect for e in found.effects} == {name}
    sizes = {e.parameter.removeprefix(f"{name}_"): e.value for e in found.effects}
    for key, hidden in LAWS[name].items():
        assert sizes[key if key in sizes else name] == pytest.approx(hidden, rel=0.02)


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_missing():
    found = diagnose(drive(), [trial(drive(), 1)], trial(drive(), 2))
    assert (found.verdict, list(found.effects)) == ("none", [])


@pytest.mark.slow
def test_an_offset_of_the_command_is_one_finding_with_two_places():
    truth = drive().with_effects([drive().effect_class("force_offset")(5.0)])
    found = diagnose(drive(), [trial(truth, 1)], trial(truth, 2))
    assert (found.verdict, [e.effect for e in found.effects]) == ("effect", ["v_offset"])
    assert found.effects[0].value == pytest.approx(0.05 * 5.0, abs=2.0 * found.effects[0].std + 1e-3)
    result = found.result()
    assert result["effects"][0]["readings"] == ["v_offset", "force_offset"]
    assert result["effects"][0]["place"] == "force in v'"
    assert [r["place"] for r in result["rivals"]] == ["command of force"]
