"""K06's heading trials: their start, read off the axes of figure 6.11, and why the real craft swings."""

from functools import cache

import numpy as np
import pytest

from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.autopilot import Imperfections, seeds
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.measures import measure
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.real import real_loop

LAWS = ("bangbang", "proportional")
SEEDS = range(1, 13)


@cache
def built(trial):
    scenario = load_scenario(trial)
    loop = real_loop(scenario, loop_parts(scenario))
    told = phase_parameters(scenario, scenario.phases[0])
    return scenario, loop, loop.compile(), told | {f"ideal.{k}": v for k, v in told.items()}


@cache
def flown(trial, imperfections, runs):
    """Run a trial; return its scenario, the times, and the true motion by name, shape (runs, times)."""
    scenario, loop, compiled, told = built(trial)
    times = np.arange(round(scenario.end / 0.02) + 1) * 0.02
    params = told | (imperfections or scenario.autopilot.imperfections).parameters(loop)
    every = []
    for seed in runs:
        own = dict.fromkeys(seeds(loop, 1), seed)
        run = compiled.simulate(times, params=params | own, method="rk4", step=0.02)
        every.append(np.asarray(run.outputs))
    found = dict(zip(run.output_labels, np.stack(every, axis=1), strict=True))
    off = found["psi"] - found["heading_ref"]
    return scenario, times, found | {"heading_error": np.arctan2(np.sin(off), np.cos(off))}


def swing(law, *names, all_but=()):
    """Return the largest heading error after 15 s from rest [deg], the median over the seeds."""
    chosen = Imperfections().without(*all_but) if all_but else Imperfections.only(*names)
    noisy = "ins_noise" in chosen.names
    _, t, c = flown(f"k06-real-heading-{law}-rest", chosen, SEEDS if noisy else (1,))
    return float(np.degrees(np.median(np.abs(c["heading_error"][:, t >= 15.0]).max(axis=1))))


@pytest.mark.slow
@pytest.mark.parametrize("trial", [f"k06-real-heading-{law}{end}" for law in LAWS for end in ("", "-rest")])
def test_its_bounds_hold_for_every_seed(trial):
    scenario, t, c = flown(trial, None, SEEDS)
    for m in scenario.metrics:
        values = np.array([measure(m, t, row) for row in c[m.of]])
        assert ((m.low <= values) & (values <= m.high)).all(), (m.name, values)


DELAYS = ("ins_update", "downlink_delay", "uplink_delay", "update_20ms")
ACTUATORS = ("dead_zone", "saturation", "tables", "brake")


@pytest.mark.slow
def test_delays_or_actuators_make_the_bang_bang_law_swing_and_noise_does_not():
    assert swing("bangbang") < 1.05  # the pointing tolerance: all switched off
    assert swing("bangbang", "ins_noise", "ins_bias", "gyro_range") < 2.0
    assert swing("bangbang", *DELAYS) > 10.0
    assert swing("bangbang", *ACTUATORS) > 15.0


@pytest.mark.slow
def test_noise_or_the_dead_zone_makes_the_proportional_law_drift_and_delays_do_not():
    assert swing("proportional", *DELAYS) < 4.0
    assert swing("proportional", "ins_noise") > 10.0
    assert swing("proportional", "dead_zone") > 10.0
    assert swing("proportional", all_but=("dead_zone", "ins_bias", "ins_noise", "gyro_range")) < 4.0


@pytest.mark.slow
def test_the_real_bang_bang_craft_swings_no_more_than_the_thesis_own():
    """Axes of figure 6.12, real autopilot: heading to 2.5 rad, so above 2; |r| to 1.5, so above 1 rad/s."""
    _, _, c = flown("k06-real-heading-bangbang-rest", None, SEEDS)
    assert c["psi"].min() >= 0.0 and 1.3 < c["psi"].max(axis=1).min() <= c["psi"].max() < 2.5
    assert 0.8 < np.abs(c["r"]).max() < 1.5


@pytest.mark.parametrize("law", LAWS)
def test_the_first_trials_start_fills_the_axes_of_figure_6_11(law):
    """An axis ends at the first tick beyond the data; u and v: 0.5 m/s to a tick, r and psi: 2 rad(/s)."""
    scenario = load_scenario(f"k06-heading-{law}")
    loop = interconnect([*loop_parts(scenario).values()], "loop")
    t = np.arange(0.0, 35.0, 0.01)
    told = phase_parameters(scenario, scenario.phases[0])
    run = loop.compile().simulate(t, params=told, method="rk4", step=0.01)
    c = dict(zip(run.output_labels, np.asarray(run.outputs), strict=True))
    assert load_scenario(f"k06-real-heading-{law}").start == scenario.start
    assert -0.5 <= c["u"].min() < 0.0 and 1.0 < c["u"].max() <= 1.5
    assert -0.5 <= c["v"].min() < 0.0 and 1.0 < c["v"].max() <= 1.5
    assert -2.0 <= c["r"].min() < 0.0 and 4.0 < c["r"].max() <= 6.0
    assert c["psi"].min() >= 0.0 and 6.0 < c["psi"].max() <= 8.0
    left = np.degrees(abs(c["psi"][-1] - 5.0))
    assert left < 1.05 if law == "bangbang" else 1.05 < left < 20.0  # "exhibits steady state error"
