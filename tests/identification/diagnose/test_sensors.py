"""Sensors whose errors last: no random force explains them, and nothing may be called complete."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.own_machines import FAMILIES, drawn, simulated
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.sensors import only_noise, slow_errors
from hovercontrol.identification.diagnose.report import remainder_sentence, write_report
from hovercontrol.identification.diagnose.search.base import base_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.logs import Log

from .generator import NOISE, Conditions, make

SHORT = Conditions(duration=20.0, logs=1)
BENT = 0.05  # of a compass near iron [rad]


def bent(log):
    psi = log["psi"]
    return Log(log.name, log.time, {**log.columns, "psi": psi + BENT * np.sin(psi)})


@pytest.fixture(scope="module")
def case():
    return make(23, (), SHORT)


@pytest.fixture(scope="module")
def compass(case):
    return diagnose(case.model, [bent(log) for log in case.logs], bent(case.holdout), names=["slope"])


@pytest.mark.slow
def test_a_heading_that_others_contradict_is_no_noise(case, compass):
    assert compass.verdict == "unexplained" and compass.effects == ()
    (slow,) = compass.slow_errors
    truth = BENT * np.std(np.sin(case.logs[0]["psi"]))
    assert (slow.channel, slow.unit, slow.over) == ("psi", "rad", 0.2)
    assert truth / 2 < slow.rms < 3 * truth  # coefficients and the start give way to it
    assert slow.noise == pytest.approx(NOISE["psi"], rel=0.1)
    assert not any(r.there for r in compass.remainders)


def test_it_is_told_in_words_and_numbers(compass, tmp_path):
    (slow,) = compass.slow_errors
    said = remainder_sentence(compass)
    assert (
        said.startswith("Unmodelled residual: lasting errors of ") and "rad in measured psi (noise: " in said
    )
    told = compass.result()["slow_errors"]["psi"]
    assert told == {"rms": slow.rms, "noise": slow.noise, "unit": "rad", "over": 0.2}
    page = write_report(compass, tmp_path / "r.html").read_text(encoding="utf-8")
    assert "In what is measured" in page and said in page


def test_noise_alone_is_no_such_error(case):
    fit = base_fit(case.model, gather(case.model, case.logs))
    assert slow_errors(fit) == () and only_noise(fit, CRITERIA)
    short = base_fit(case.model, gather(case.model, [case.logs[0].between(0.0, 1.5)]))
    assert slow_errors(short) == ()


def test_outliers_that_were_missed_are_no_lasting_error(case):
    fit = base_fit(case.model, gather(case.model, case.logs))
    left = fit.left.copy()
    left[::13] += 30.0  # in most stretches there is one
    assert slow_errors(replace(fit, left=left)) == ()
    assert {s.channel for s in slow_errors(replace(fit, left=fit.left + 2.0))} == {*NOISE}


@pytest.mark.slow
def test_random_forces_take_what_acts_on_the_craft(gusty):
    assert gusty.found.slow_errors == () and not only_noise(gusty.found.selection.final, CRITERIA)


@pytest.mark.slow
def test_a_gyro_that_drifts_has_no_constant_bias(case):
    """Its mean is one, but not the same in all blocks."""

    def drifting(log):
        return replace(log, columns={**log.columns, "r": log["r"] + 0.01 * log.time})

    logs = [drifting(log) for log in case.logs]
    found = diagnose(case.model, logs, drifting(case.holdout), names=["gyro_bias", "gyro_scale"])
    assert found.verdict == "unexplained" and [s.channel for s in found.slow_errors] == ["r"]
    bias = next(lead for lead in found.leads if lead.name == "gyro_bias")
    assert "segment" in bias.reason  # segments do not agree on it, or its size differs between them


@pytest.mark.slow
def test_biases_of_two_speeds_that_no_log_tells_apart_are_rivals():
    """Only the difference of two shafts' speeds acts; beside a wrong scale both biases promised as much."""
    drive = next(f for f in FAMILIES if f.name == "two-mass drive")
    true, given = drawn(drive, 3)
    found = diagnose(drive.block(given), [simulated(drive, true, 3, 1000, "bias")])
    assert {*(e.effect for e in found.effects), *(r.name for r in found.rivals)} == {"w_bias", "W_bias"}
