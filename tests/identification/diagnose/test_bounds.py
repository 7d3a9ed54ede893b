"""A search stays within the bounds of the effects that it tries, whatever the logs are like."""

from dataclasses import replace

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.effects import Shape, effect_class, effect_names
from hovercontrol.craft.effects.generic import generic_effects
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.search import candidates as module
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.diagnose.search.candidates import Candidate, candidates
from hovercontrol.identification.engine.data import gather
from hovercontrol.logs import Log


def motor():
    """A first-order speed, driven by a voltage."""
    speed, voltage = hc.Signal("speed", "rad/s"), hc.Signal("voltage", "V")
    gain = hc.Signal("gain", "rad/s^2/V", start=14.0, lower=0.0)
    damping = hc.Signal("damping", "1/s", start=4.0, lower=0.0)
    slope = gain.symbol * voltage.symbol - damping.symbol * speed.symbol
    return hc.BlockModel(hc.Block("motor", [speed], [voltage], [speed], [gain, damping], {"speed": slope}))


def staircase(speed, hold=2.0, step=0.02):
    """Voltages held for seconds; the speed is a function of time and voltage."""
    levels = np.array([0, 2, 4, 6, 8, 6, 4, 2, 0, -2, -4, -2, 0], dtype=float)
    t = np.arange(0.0, hold * levels.size, step)
    voltage = levels[(t / hold + 1e-9).astype(int)]
    return Log("stairs", t, {"voltage": voltage, "speed": speed(t, voltage)})


EVERY = {n: effect_class(n) for n in effect_names()} | dict(generic_effects(motor().block))


def within(e):
    return all(n.lower <= e.values[k] <= n.upper for k, n in type(e).numbers.items())


@pytest.mark.parametrize("name", EVERY)
def test_an_effect_that_a_search_proposes_is_within_its_bounds(name, rng):
    cls = EVERY[name]
    for size in (0.0, 1e-300, 1e-12, 1.0, 1e12, 1e100, -1.0):
        trial = cls.within_bounds(**dict.fromkeys(cls.numbers, size))
        assert within(trial) and within(trial.neutral())
        amplitudes = tuple(k for k, n in cls.numbers.items() if not np.isnan(n.neutral))
        candidate = Candidate(name, trial, amplitudes)
        for part in (*rng.normal(size=3), 1e-9, -1e9, 1e9):
            assert within(candidate.at([part] * max(len(amplitudes), 1)))
        shapes = [k for k in amplitudes if isinstance(cls.numbers[k], Shape)]
        if len(amplitudes) == len(shapes) == 1:
            assert len(trial.begins(trial)) == (1 if cls.kind() == "measurement" else 4)
        assert all(map(within, trial.begins(trial)))


@pytest.mark.parametrize("scale", [1e-300, 1e-10, 1e10])
def test_trial_values_are_within_bounds_of_a_state_of_any_size(scale, monkeypatch):
    """Of a motor that hardly moves, 0.05 of its speed is below the least of Stribeck's."""
    model, log = motor(), staircase(lambda t, v: 3.5 * v)
    fit = base_fit(model, gather(model, [log]))
    sizes = dict.fromkeys(("speed_speed", "time", "step"), scale)
    monkeypatch.setattr(module, "_scales", lambda fit: sizes)
    found = candidates(fit)
    assert len(found) > 10 and all(within(c.trial) for c in found)
    assert len({c.trial for c in found}) == len(found)


@pytest.mark.parametrize("factor", [1e200, np.nan, np.inf])
def test_a_fit_that_ran_away_has_trial_values(factor):
    """'effect omega_stribeck: speed must be a number, found nan', of a log in ms that was read in us."""
    model, log = motor(), staircase(lambda t, v: 3.5 * v)
    fit = base_fit(model, gather(model, [log]))
    with np.errstate(all="ignore"):
        found = candidates(replace(fit, path=fit.path * factor))
    assert {c.trial for c in found} and all(within(c.trial) for c in found)


@pytest.mark.slow
@pytest.mark.parametrize(
    "speed",
    [
        lambda t, v: 1e-11 * np.random.default_rng(0).normal(size=t.size),
        lambda t, v: np.random.default_rng(0).normal(size=t.size),
        lambda t, v: np.round(3.5 * v) + 1e-9 * t,
    ],
    ids=["stands", "noise", "jumps"],
)
def test_a_motors_staircase_ends_in_a_verdict(speed):
    """'effect speed_stribeck: speed = 3.7e-13 is out of its bounds' was told as the user's fault."""
    assert diagnose(motor(), [staircase(speed)]).verdict in (
        "none",
        "unexplained",
        "effect",
        "partial",
        "ambiguous",
    )
