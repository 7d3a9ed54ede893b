"""Free runs and predictions: exact for the truth, worse for a wrong model, drawn with units."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.craft.models.vehicles import c17_experiment
from hovercontrol.identification.identify import free_run, measure, plot_free_run, window_prediction

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")


@pytest.fixture
def calm_log(rudder_log):
    """Without noise, so that a free run from the first row is exact."""
    return rudder_log(POSE + VELOCITY, seconds=8, noise=0.0)


def test_the_truth_runs_along_a_log_without_noise(calm_log):
    run = free_run(c17_experiment(), calm_log)
    assert run.starts == (0.0,) and run.channels == POSE + VELOCITY
    assert max(run.nrmse.values()) < 1e-2
    wrong = c17_experiment().with_coefficients({"rudder_torque": 2.0})
    assert free_run(wrong, calm_log).nrmse["r"] > 0.3


@pytest.mark.slow
def test_prediction_errors_grow_with_horizon_and_model_error(calm_log):
    wrong = c17_experiment().with_coefficients({"rudder_torque": 3.2})
    half, whole = (window_prediction(wrong, calm_log, h) for h in (0.5, 1.0))
    assert half.rms["r"] < whole.rms["r"]
    assert window_prediction(c17_experiment(), calm_log).rms["r"] < 0.02 * whole.rms["r"]
    assert whole.starts == 700
    assert whole.nrmse["r"] == pytest.approx(
        whole.rms["r"] / np.std(calm_log["r"][100:]), rel=2e-3
    )  # less outliers


def test_a_prediction_of_a_constant_offset_is_that_offset(cart, cart_log):
    """Without drag a cart with twice the gain is off by a known distance."""
    log = cart_log(1, drag=0.0, gain=1.0, noise=0.0)
    push = log.with_columns({"F": np.ones(len(log)), "p": 0.5 * log.time**2, "v": log.time})
    twice = cart.with_values({"cart.gain": 2.0, "cart.drag": 0.0})
    assert window_prediction(twice, push, 1.0).rms["p"] == pytest.approx(0.5, rel=2e-3)
    assert window_prediction(twice, push, 1.0).rms["v"] == pytest.approx(1.0, rel=2e-3)


def test_the_trivial_prediction_lets_velocities_stay_and_the_pose_move_on(calm_log):
    p = window_prediction(c17_experiment(), calm_log, 1.0)
    now, then = (calm_log.select(rows) for rows in (slice(None, -100), slice(100, None)))
    for c in VELOCITY:
        assert p.trivial[c] == pytest.approx(np.sqrt(np.mean((then[c] - now[c]) ** 2)), rel=1e-2)
    turned = now["psi"] + now["r"]
    assert p.trivial["psi"] == pytest.approx(np.sqrt(np.mean((then["psi"] - turned) ** 2)), rel=2e-3)
    middle, half = now["psi"] + now["r"] / 2, np.sinc(now["r"] / 2 / np.pi)  # along an arc for 1 s
    x = now["x"] + half * (now["u"] * np.cos(middle) - now["v"] * np.sin(middle))
    assert p.trivial["x"] == pytest.approx(np.sqrt(np.mean((then["x"] - x) ** 2)), rel=5e-3)
    assert p.share["r"] == p.rms["r"] / p.trivial["r"] < 0.05


def test_a_run_may_start_again_behind_a_gap(calm_log):
    broken = calm_log.select((calm_log.time < 3.0) | (calm_log.time > 4.0))
    wrong = c17_experiment().with_coefficients({"rudder_torque": 3.0})
    once, again = (free_run(wrong, broken, restart=flag) for flag in (False, True))
    assert len(once.starts) == 1 and len(again.starts) == 2
    assert again.rms["r"] < once.rms["r"]
    first = broken.time < 3.0
    assert np.array_equal(once.simulated[:, first], again.simulated[:, first])


def test_smoothed_velocities_stand_in_where_only_pose_is_measured(rudder_log):
    run = free_run(c17_experiment(), rudder_log(POSE, seconds=8))
    assert set(run.channels) == {*POSE, *VELOCITY}
    assert np.isfinite(run.rms["r"])


def test_a_horizon_longer_than_the_log_is_refused(calm_log):
    with pytest.raises(InputError, match="no stretch of 9 s"):
        window_prediction(c17_experiment(), calm_log, 9.0)


def test_a_run_that_blows_up_has_an_infinite_error(cart, cart_log):
    wild = cart.with_values({"cart.gain": 1e308})
    assert free_run(wild, cart_log(1)).rms["p"] == np.inf


def test_the_picture_has_units_names_and_rejected_spans(fan_log, fan_truth, tmp_path):
    log = fan_log(seconds=10)
    psi = log["psi"].copy()
    psi[200:210] += np.pi
    run = free_run(fan_truth, log.with_columns({"psi": psi}))
    assert run.rejected
    figure = plot_free_run(run)
    assert len(figure.axes) == 6
    assert {a.get_ylabel() for a in figure.axes} >= {"x [m]", "r [rad/s]"}
    assert "four_fan" in figure.get_suptitle() and "simulated" in figure.get_suptitle()
    assert (
        figure.axes[0].get_title(loc="right") == f"rms error {run.rms['x']:.3g} m, fit {run.fit['x']:.1f} %"
    )
    measured, simulated = figure.axes[0].lines
    assert measured.get_linewidth() > 2 * simulated.get_linewidth(), "both are seen where they agree"
    assert "run (held out)" not in figure.get_suptitle()
    assert "simulated (held out)" in plot_free_run(run, held_out=True).get_suptitle()
    figure.savefig(tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 20_000


def test_a_cart_is_drawn_too(cart, cart_log):
    figure = plot_free_run(free_run(cart, cart_log(1)))
    assert [a.get_ylabel() for a in figure.axes] == ["p [m]"]
    assert figure.axes[0].get_xlabel() == "time [s]"


def test_stretches_of_a_very_long_log_run_each_by_itself(calm_log):
    data = measure(c17_experiment().plant(), calm_log, most_rows=400)
    run = free_run(c17_experiment(), data)
    assert len(run.starts) == 10 and run.time.size == 400
