"""Cases with disturbances: they are what they say."""

import numpy as np
import pytest

from .generator import NOISE, Conditions, craft
from .imperfect import CAMERA, DISTURBANCES, SUITES, Key, driven, keys, lag_of_fans, move
from .windows import misfit


def test_a_model_predicts_its_own_motion():
    rng = np.random.default_rng(0)
    truth = craft(rng)
    motion = move(truth, driven("log", rng, Conditions(duration=10.0)))
    assert misfit(truth, [motion], tuple(NOISE), NOISE) < 0.05


@pytest.mark.slow("patch")
@pytest.mark.parametrize("kind", DISTURBANCES)
def test_a_disturbance_is_well_above_the_noise_and_every_log_meets_it(kind):
    case = Key("remainder", "", kind, "", 1).case()
    assert case.names == () and case.shares[1] > 1.0
    assert all(np.isfinite(c).all() for log in (*case.logs, case.holdout) for c in log.columns.values())
    if kind == "patch":
        d = case.disturbance.values
        for log in (*case.logs, case.holdout):
            inside = np.hypot(log["x"] - d["x"], log["y"] - d["y"]) < d["radius"]
            assert 0.05 < inside.mean() < 0.95


def test_beside_an_effect_a_disturbance_is_of_its_size():
    case = Key("partial", "munk_moment", "torque", "", 0).case()
    assert case.names == ("munk_moment",)
    of_effect, of_disturbance = case.shares
    assert 0.4 < of_disturbance / of_effect < 1.6


@pytest.mark.slow
def test_a_case_is_made_of_its_seed():
    a, b = (Key("partial", "slope", "bumps", "pose", 3).case() for _ in range(2))
    assert all(np.array_equal(a.logs[0][c], b.logs[0][c]) for c in a.logs[0].columns)
    assert not a.logs[0].has("u")


def test_dirty_logs_lose_rows_and_their_stamps_are_off():
    log = Key("dirty", "", "", "", 0).case().logs[0]
    assert 0.93 < len(log) / 6000 < 0.97
    assert 1e-3 < np.std(log.time - 0.01 * np.round(log.time / 0.01)) < 2.5e-3


@pytest.mark.slow
def test_the_fan_craft_turns_and_lags():
    case = Key("fans", lag_of_fans(), "patch", "", 0).case()
    log = case.logs[0]
    assert len(case.model.fans) == 6 and set(log.columns) == {
        "x",
        "y",
        "psi",
        *(f.name for f in case.model.fans),
    }
    assert np.isclose(np.median(np.diff(log.time)), 0.005)
    assert np.std(np.diff(log["x"], 3)) < 10 * CAMERA["x"]
    assert np.abs(np.diff(log["psi"]) / 0.005).max() < 40.0
    assert min(case.shares) > 1.0


def test_suites_are_as_large_as_planned():
    assert {s: len(list(keys(s, 5))) for s in SUITES} == {
        "partial": 100, "remainder": 50, "dirty": 55, "gusts": 55, "beyond": 30, "rest": 80, "fans": 5,
    }  # fmt: skip
    met = {(k.effect, k.disturbance) for k in keys("partial", 5) if not k.variant}
    assert len(met) == 50  # each effect beside each disturbance
