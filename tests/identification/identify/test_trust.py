"""Coefficients of an incomplete model: other readings, and the interval that covers them."""

import shlex

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log

LENGTH = 2.22


def car():
    """A turn rate of speed and steering angle, that acts at once."""
    S = hc.Signal
    speed, heading, steer = S("speed", "m/s"), S("heading", "rad"), S("steer", "rad")
    per_length = S("per_length", "1/m", start=2.0, lower=0.0)
    slope = per_length.symbol * speed.symbol * sp.tan(steer.symbol)
    return hc.Block("car", [heading], [speed, steer], [heading], [per_length], {"heading": slope})


def drive(lag, rng, jitter=0.1, rows=1200, dt=0.05, gusts=0.0):
    """The car with a steering servo of first order, `lag` in seconds, that the model lacks."""
    t = np.arange(rows) * dt
    steer = (
        0.25 * np.sin(2 * np.pi * t / 9) + 0.1 * np.sin(2 * np.pi * t / 23) + jitter * rng.normal(size=rows)
    )
    speed = 1.5 + 0.3 * np.sin(2 * np.pi * t / 31)
    angle, heading = np.zeros(rows), np.zeros(rows)
    for k in range(rows - 1):
        fade = np.exp(-dt / lag) if lag else 0.0
        angle[k + 1] = steer[k] + (angle[k] - steer[k]) * fade
        over = 0.5 * (angle[k] + angle[k + 1]) if lag else steer[k]
        heading[k + 1] = heading[k] + dt * (LENGTH * speed[k] * np.tan(over) + gusts * rng.normal())
    return Log(
        "drive", t, {"speed": speed, "steer": steer, "heading": heading + 2e-3 * rng.normal(size=rows)}
    )


@pytest.mark.parametrize("lag", [0.05, 0.3])
def test_a_servo_that_the_model_lacks_is_named_and_the_gain_beside_it_is_right(lag):
    found = identify(car(), [drive(lag, np.random.default_rng(1))])
    length = found["per_length"]
    assert abs(length.value - LENGTH) > 1.0, "as the model is, row-to-row changes bend it"
    (beside, *longer) = length.readings
    assert beside.cause == "with steer_lag"
    assert beside.value == pytest.approx(LENGTH, rel=5e-3)
    assert {r.cause for r in longer} == {"over 2 s"}
    assert all(abs(r.value - LENGTH) < 3.0 * r.std for r in longer)
    assert length.std > abs(length.value - LENGTH) / 1.01 and not length.trusted
    assert found.missing[0].name == "steer_lag"
    assert found.missing[0].values["seconds"] == pytest.approx(lag, rel=0.1)
    assert "not to be trusted: per_length" in found.table() and "with steer_lag" in found.table()


@pytest.mark.slow
@pytest.mark.parametrize("gusts", [0.0, 0.1])
def test_nothing_is_said_where_nothing_is_missing(gusts):
    for seed in range(4):
        found = identify(car(), [drive(0.0, np.random.default_rng(seed), gusts=gusts)])
        length = found["per_length"]
        assert not length.readings and length.trusted and not found.bent and not found.missing
        assert length.std == length.noise_std
        assert abs(length.value - LENGTH) < 4.0 * length.std


def test_a_law_of_no_catalogue_shows_in_the_reading_over_longer_times():
    """The servo has two lags in series and the catalogue is empty: only the time scale can tell."""
    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.identification.diagnose.search.base import base_fit
    from hovercontrol.identification.engine.data import gather
    from hovercontrol.identification.identify.trust import trust

    model = BlockModel(car(), ())
    fit = base_fit(model, gather(model, [drive(0.15, np.random.default_rng(0))]))
    std = np.sqrt(np.diag(fit.covariance))
    (reading,) = trust(fit, std).readings["per_length"]
    assert reading.cause == "over 2 s"
    assert abs(reading.value - LENGTH) < 3.0 * reading.std < 1.0
    assert abs(fit.p[0] - LENGTH) > 20.0 * std[0]


@pytest.mark.slow
def test_the_scale_of_the_only_measured_channel_is_no_candidate():
    found = identify(car(), [drive(0.3, np.random.default_rng(1))])
    assert all(e.name != "heading_scale" for e in found.missing)


@pytest.mark.slow
def test_a_kept_width_of_friction_that_is_off_is_named():
    from dataclasses import replace

    from tests.identification.diagnose.generator import Conditions, make, mild

    case = make(402, (), replace(Conditions(duration=40.0, logs=1), commands=mild))
    found = identify(case.model, case.logs)
    truth = case.truth.coefficients()
    moved = [f for f in found.coefficients if f.readings]
    assert moved and all("_width" in f.readings[0].cause for f in moved)
    for f in moved:
        assert abs(f.readings[0].value - truth[f.name]) < 5.0 * f.readings[0].std
        assert abs(f.value - truth[f.name]) < 3.0 * f.std


@pytest.mark.slow
def test_the_next_command_is_printed_with_the_options_that_were_given(call, tmp_path):
    log = drive(0.3, np.random.default_rng(1), rows=800)
    columns = {"t": log.time, "speed": log["speed"], "steer": log["steer"], "yaw": log["heading"]}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "a b.csv", rows, delimiter=",", header=",".join(columns), comments="")
    (tmp_path / "car.py").write_text(
        "from tests.identification.identify.test_trust import car\nCAR = car()\n"
    )
    words = ["a b.csv", "--model", "car.py:CAR", "--columns", "time=t,heading=yaw"]
    done = call("identify", *words, "--out", "out", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert f"hovercontrol diagnose {shlex.join(words)}" in done.stdout
