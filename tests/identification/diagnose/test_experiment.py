"""The proposed experiment settles an ambiguous case, whichever rival is true."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.blocks.signals import Signal
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.experiment.manoeuvres import MANOEUVRES, family, reach
from hovercontrol.identification.diagnose.experiment.sharpen import sharpen

from .generator import Conditions, make, simulated

SEED, SHORT = 11012, Conditions(duration=6.0, logs=1)
LIMITS = {"thrust": (-1.0, 3.0), "rudder": (-0.4, 0.4)}


@pytest.fixture(scope="module")
def unclear():
    case = make(SEED, ["slope"], SHORT)
    return case, diagnose(case.model, case.logs)


def driven(truth, experiment, seed):
    """Return the log of a craft that drives the proposal."""
    step = float(experiment.time[1] - experiment.time[0])
    conditions = replace(
        SHORT,
        duration=MANOEUVRES.seconds,
        dt=step,
        commands=lambda rng, duration, dt: dict(experiment.commands),
    )
    return simulated(truth, np.random.default_rng(seed), conditions, "proposed")


def test_an_ambiguous_answer_comes_with_a_proposal(unclear, tmp_path):
    case, found = unclear
    assert found.verdict == "ambiguous"
    named, rivals = {e.effect for e in found.effects}, {r.name for r in found.rivals if not r.same}
    assert named & {"wind", "slope"} and rivals
    assert found.experiment.benefit > 40
    assert found.advice.startswith("Drive ") and any(name in found.advice for name in named)
    assert found.result()["next_experiment"] == found.advice
    found.save(tmp_path)
    rows = np.genfromtxt(tmp_path / "next_experiment.csv", delimiter=",", names=True)
    assert rows.dtype.names == ("time", "thrust", "rudder")
    for name in ("thrust", "rudder"):
        measured = case.logs[0][name]
        assert rows[name].min() >= measured.min() - 1e-6 and rows[name].max() <= measured.max() + 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("truth", ["named", "rival"])
def test_the_added_log_settles_it(unclear, truth):
    case, found = unclear
    rival = found.rivals[0]
    model = found.amended if truth == "named" else rival.fit.model
    wanted = rival.instead_of if truth == "named" else rival.name
    again = simulated(model, np.random.default_rng(5), SHORT, "first")
    settled = diagnose(case.model, [again, driven(model, found.experiment, 6)])
    assert settled.verdict == "effect"
    assert {e.effect for e in settled.effects} == {wanted}


def test_a_badly_known_coefficient_has_an_experiment_that_tells_it_better(unclear):
    _, found = unclear
    parameter = found.effects[-1].parameter
    sharper = sharpen(found.selection.final, [parameter], parameter)
    assert sharper.benefit > 1.5
    assert sharper.text.endswith(
        f"the standard error of {parameter} then falls by a factor of {sharper.benefit:.2g}."
    )


@pytest.mark.slow
def test_rivals_that_are_the_same_have_no_experiment():
    case = make(17, ["input_delay"], Conditions(duration=20.0))
    found = diagnose(case.model, case.logs, names=["input_delay", "time_offset"])
    assert [r.same for r in found.rivals] == [True] and found.experiment is None
    assert found.advice.startswith("no log distinguishes ")
    assert "one clock for commands and sensors" in found.advice


def test_a_proposal_goes_beyond_the_commands_only_within_bounds():
    bounded = Signal("thrust", "A", lower=-6.0, upper=6.0)
    assert reach(bounded, np.array([-1.0, 0.5, 2.0])) == (-2.0, 4.0)
    assert reach(bounded, np.array([-5.0, 5.0])) == (-6.0, 6.0)
    assert reach(bounded, np.array([0.5, 2.0])) == (0.5, 4.0)  # never off, never astern: so it stays
    assert reach(Signal("thrust", "A"), np.array([-1.0, 2.0])) == (-1.0, 2.0)
    assert reach(Signal("fan", "N", lower=0.0), np.array([0.0, 0.3])) == (0.0, 0.3)


@pytest.mark.parametrize(
    "limits", [LIMITS, {"thrust": (0.0, 2.0), "rudder": (-0.2, 0.4)}, {"force": (-1.0, 1.0)}]
)
def test_manoeuvres_keep_within_the_commands_limits(limits):
    for manoeuvre in family(limits, 0.02):
        assert set(manoeuvre.commands) == set(limits)
        for name, (low, high) in limits.items():
            values = manoeuvre.commands[name]
            assert values.shape == manoeuvre.time.shape
            assert values.min() >= low - 1e-12 and values.max() <= high + 1e-12
    assert any(m.name == "reverse" for m in family(LIMITS, 0.02))


def test_manoeuvres_drawn_at_random_are_those_of_their_seed():
    def drawn(seed):
        return [m.commands["thrust"] for m in family(LIMITS, 0.02, seed) if m.name.startswith("random")]

    first, again, other = drawn(3), drawn(3), drawn(4)
    assert len(first) == 2
    for a, b, c in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a, b)
        assert np.abs(a - c).max() > 0.1
    assert np.abs(first[0] - first[1]).max() > 0.1
