"""Logs of different noise: each counts by its own."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.evidence.comparison import compare
from hovercontrol.identification.diagnose.evidence.holdout import gap, held_fit
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import estimate, first_noise
from hovercontrol.identification.engine.levels import noise_levels
from hovercontrol.identification.engine.prior import prior_of
from hovercontrol.identification.engine.problem import Problem

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
    assert found.agrees, found.text()
    calm, noisy = ({c.channel: c for c in found.channels if c.log == log.name} for log in logs)
    assert noisy["u"].noise == pytest.approx(4.0 * calm["u"].noise, rel=0.1)
    assert noisy["u"].short == pytest.approx(4.0 * calm["u"].short, rel=0.2)


@pytest.mark.slow
def test_the_gap_of_both_is_in_units():
    case, logs = unlike([], 4.0)
    both = gap(held_fit(case.truth, gather(case.truth, logs)))
    alone = [gap(held_fit(case.truth, gather(case.truth, [log]))) for log in logs]
    assert both.rms["u"] == pytest.approx(np.sqrt(np.mean([a.rms["u"] ** 2 for a in alone])), rel=0.1)


def test_together_they_tell_what_each_tells_alone_added():
    case, logs = unlike([], 4.0)
    told = [information(case.truth, some) for some in (logs, *([k] for k in logs))]
    assert np.diag(told[0]) == pytest.approx(np.diag(told[1] + told[2]), rel=0.15)


def information(model, logs):
    """Return what logs say of the coefficients of a model that lacks nothing."""
    problem = Problem(model, gather(model, logs))
    noise = replace(first_noise(problem), process=np.zeros(3))
    return estimate(problem, prior_of(problem, model), noise, levels=False).S.sum(axis=0)[:8, :8]


@pytest.mark.slow
def test_an_effect_is_named_from_a_calm_and_a_noisy_log():
    case, logs = unlike(["yaw_quadratic_drag"], 4.0)
    found = diagnose(case.model, logs)
    assert any("the logs differ in noise (x: up to" in w for w in found.warnings)
    assert found.verdict == "effect" and [e.effect for e in found.effects] == ["yaw_quadratic_drag"]
    wanted = case.truth.effect("yaw_quadratic_drag").values["value"]
    assert abs(found.effects[0].value - wanted) < 4.0 * found.effects[0].std


def test_rows_that_are_there_for_a_command_only_do_not_hide_the_noise():
    """Poses at 120 Hz joined with commands at 100 Hz: three rows of a channel in a row are rare."""
    rng = np.random.default_rng(3)
    poses, sent = np.arange(0.0, 10.0, 1 / 120), np.arange(0.0, 10.0, 0.01)
    time = np.union1d(np.round(poses, 6), np.round(sent, 6))
    x = np.full(time.size, np.nan)
    at = np.searchsorted(time, np.round(poses, 6))
    x[at] = np.sin(poses) + 1e-3 * rng.normal(size=poses.size)
    log = SimpleNamespace(
        name="joined", time=time, channels=("x",), values=x[None], segments=((0, time.size),)
    )
    assert noise_levels([log], ["x"])[0] == pytest.approx(1e-3, rel=0.1)
