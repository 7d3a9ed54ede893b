"""Logs of different noise: each counts by its own."""

from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.discrepancy import diagnose
from hovercontrol.discrepancy.compare import compare
from hovercontrol.discrepancy.data import gather
from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.holdout import gap

from .generator import NOISE, Conditions, make, simulated

CALM = Conditions(duration=20.0, logs=1)


def unlike(names, factor, seed=3):
    """Return a case, and a calm and a noisy log of its craft."""
    case = make(seed, names, CALM)
    noisy = simulated(case.truth, np.random.default_rng(8), replace(CALM, noise=factor), "noisy")
    return case, [case.logs[0], noisy]


def test_logs_of_the_same_noise_are_alike():
    case, logs = unlike([], 1.0)
    assert (gather(case.model, logs).scales == 1.0).all()


def test_the_noise_of_each_log_is_found():
    case, logs = unlike([], 4.0)
    data = gather(case.model, logs)
    found = data.scales * data.noise
    wanted = np.array([[NOISE[c] for c in data.channels], [4.0 * NOISE[c] for c in data.channels]])
    assert found == pytest.approx(wanted, rel=0.15)


def test_a_channel_of_one_log_alone_is_like_itself():
    case, (calm, noisy) = unlike([], 4.0)
    calm = type(calm)(calm.name, calm.time, {k: v for k, v in calm.columns.items() if k != "v"})
    data = gather(case.model, [calm, noisy])
    scales = dict(zip(data.channels, data.scales.T, strict=True))
    assert (scales["v"] == 1.0).all() and (scales["u"] != 1.0).all()


def test_a_model_that_lacks_nothing_agrees_with_both():
    case, logs = unlike([], 4.0)
    found = compare(case.truth, logs)
    assert found.agrees, str(found)
    calm, noisy = ({c.channel: c for c in found.channels if c.log == log.name} for log in logs)
    assert noisy["u"].noise == pytest.approx(4.0 * calm["u"].noise, rel=0.1)
    assert noisy["u"].short == pytest.approx(4.0 * calm["u"].short, rel=0.2)


def test_the_gap_of_both_is_in_units_and_counts_each_by_its_noise():
    case, logs = unlike([], 4.0)
    both = gap(case.truth, gather(case.truth, logs), 1.0)
    alone = [gap(case.truth, gather(case.truth, [log]), 1.0) for log in logs]
    mean = np.sqrt(np.mean([a.rms["u"] ** 2 for a in alone]))
    assert both.rms["u"] == pytest.approx(mean, rel=0.02)
    assert both.chi2 == pytest.approx(sum(a.chi2 for a in alone), rel=0.05)


def test_the_floor_counts_each_log_by_its_rows():
    case, (calm, noisy) = unlike([], 4.0)
    data = gather(case.truth, [calm, noisy.between(0.0, 5.0)])
    found, rows = gap(case.truth, data, 1.0), [m.time.size for m in data.logs]
    wanted = np.sqrt(np.average((data.scales * data.noise) ** 2, axis=0, weights=rows))
    floors = [found.floor[c] * found.rms[c] / found.nrmse[c] for c in data.channels]
    assert floors == pytest.approx(wanted, rel=0.01)


def test_together_they_tell_what_each_tells_alone_added():
    case, logs = unlike([], 4.0)
    told = [
        fit(case.truth, gather(case.truth, some), 1.0, frozen=True).normal.S
        for some in (logs, *([k] for k in logs))
    ]
    assert np.diag(told[0]) == pytest.approx(np.diag(told[1] + told[2]), rel=0.1)


def test_an_effect_is_named_from_a_calm_and_a_noisy_log():
    case, logs = unlike(["yaw_quadratic_drag"], 4.0)
    found = diagnose(case.model, logs)
    assert any("the logs differ in noise (x: up to" in w for w in found.warnings)
    assert found.verdict == "effect" and [e.effect for e in found.effects] == ["yaw_quadratic_drag"]
    wanted = case.truth.effect("yaw_quadratic_drag").values["value"]
    assert abs(found.effects[0].value - wanted) < 4.0 * found.effects[0].std
