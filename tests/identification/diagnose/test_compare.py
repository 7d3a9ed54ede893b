"""A model beside logs: the true one leaves noise, a wrong one leaves more, and it is said what."""

import numpy as np
import pytest

from hovercontrol.craft.effects import effect
from hovercontrol.identification.diagnose.evidence.comparison import compare
from hovercontrol.identification.diagnose.evidence.holdout import held_fit
from hovercontrol.identification.diagnose.evidence.traces import Trace, simulated_traces
from hovercontrol.identification.diagnose.evidence.whiteness import independence, innovations, whiteness
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.noise import Noise
from hovercontrol.logs import Log

from .generator import NOISE, Conditions, make

SHORT = Conditions(duration=20.0, logs=1)


@pytest.mark.parametrize("seed", range(3))
def test_the_true_model_leaves_nothing_beyond_noise(seed):
    case = make(seed, ["slope"], SHORT)
    found = compare(case.truth, [*case.logs, case.holdout])
    assert found.agrees, found.text()
    assert "no disagreement beyond noise" in found.text()
    for one in found.channels:
        assert one.noise == pytest.approx(NOISE[one.channel], rel=0.15)
        assert 0.8 < one.short / one.noise < 1.2
        assert one.free >= 0.95 * one.short


@pytest.mark.parametrize("name", ["slope", "thrust_lag", "gyro_scale"])
def test_a_model_that_lacks_an_effect_disagrees(name):
    case = make(5, [name], SHORT)
    without = case.truth.with_effects([])
    without = type(without)(without.name, [e for e in without.effects if e.name != name])
    found = compare(without, case.logs)
    assert not found.agrees
    worst = max(found.channels, key=lambda c: c.remains / c.largest)
    assert found.beyond(worst) and f"what remains of {worst.channel}" in found.text()


def test_gusts_count_as_noise_where_they_are_said_to_be_there():
    case = make(14, [], Conditions(duration=20.0, logs=1, gusts=True))
    data = gather(case.truth, case.logs)
    gusts = Noise(data.noise, data.scales, np.array([0.05, 0.05, 0.15]), np.full(3, 0.3), ("u", "v", "r"))
    assert not compare(case.truth, case.logs).agrees
    told = compare(case.truth, case.logs, noise=gusts)
    assert all(c.remains < c.largest for c in told.channels)


def test_innovations_of_the_true_model_are_standard_normal_and_white():
    case = make(3, [], SHORT)
    z = innovations(held_fit(case.truth, gather(case.truth, case.logs)))
    assert z[np.isfinite(z)].std() == pytest.approx(1.0, abs=0.05)
    assert all(whiteness(z[..., c]) > 1e-4 for c in range(z.shape[-1]))


def test_what_follows_a_command_is_seen_to_follow_it(rng):
    past = [np.repeat(rng.normal(size=(10, 30)), 5, axis=0) for _ in range(2)]
    noise = rng.normal(size=(50, 30))
    assert independence(noise, past) > 1e-3
    assert independence(noise + 0.3 * past[1], past) < 1e-6
    assert independence(noise, [np.zeros((50, 30))]) == 1.0


def test_outliers_do_not_make_noise_correlated(rng):
    z = rng.normal(size=(60, 40))
    z[rng.random(z.shape) < 0.02] *= 50.0
    assert whiteness(z) > 1e-3


def test_a_free_run_of_the_true_model_stays_with_the_log():
    case = make(4, ["input_delay"], SHORT)
    fit = held_fit(case.truth, gather(case.truth, [case.holdout]))
    (whole,), (parts,) = simulated_traces(fit), simulated_traces(fit, 5.0)
    assert len(whole.starts) == 1 and len(parts.starts) == 4
    assert whole.rms()["r"] < 1.1 * NOISE["r"] and parts.rms()["x"] < 10 * NOISE["x"]


def test_velocities_alone_can_be_compared():
    case = make(2, [], Conditions(duration=10.0, logs=1, channels=("u", "v", "r")))
    found = compare(case.truth, case.logs)
    assert [c.channel for c in found.channels] == ["u", "v", "r"] and found.agrees


def test_a_run_that_flies_off_has_an_infinite_error():
    time = np.arange(4.0)
    measured, simulated = np.zeros((1, 4)), np.array([[0.0, 1e200, np.inf, np.nan]])
    assert Trace("a", time, ("u",), {"u": "m/s"}, measured, simulated, (0.0,)).rms() == {"u": np.inf}


def test_sizes_are_those_of_the_effect():
    """A slope of g adds g t in a second's free run: the error of surge and sway is near g/sqrt(3)."""
    case = make(6, [], Conditions(duration=10.0, logs=1, noise=0.1))
    log = case.logs[0]
    tilted = case.truth.with_effects([effect("body_side_force", 0.4)])
    errors = {c.channel: c.short for c in compare(tilted, [Log("a", log.time, log.columns)]).channels}
    assert 0.02 < errors["v"] < 0.4 / np.sqrt(3) and errors["u"] < errors["v"]
