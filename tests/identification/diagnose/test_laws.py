"""The missing force: what it depends on, in words and numbers; and that named effects are what is shown."""

import numpy as np
import pytest

from hovercontrol.blocks.units import dimension
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.evidence.laws import is_there, law, regime, worst
from hovercontrol.identification.diagnose.evidence.missing import Missing, Quantity, running_mean
from hovercontrol.logs import Log

T = np.arange(0.0, 40.0, 0.02)
R = 1.5 * np.sin(0.7 * T) + 0.6 * np.sin(1.9 * T + 1.0)
THRUST = 2.0 + np.sin(0.31 * T)


def missing(force, equation="u'", unit="m/s^2", seed=3, noise=0.02):
    """Return a force with noise, over a yaw rate and a command that have nothing to do with each other."""
    seen = force + noise * np.random.default_rng(seed).normal(size=T.size)
    over = (Quantity("r", "rad/s", R), Quantity("thrust", "N", THRUST, is_command=True))
    return Missing("a.csv", equation, unit, T, seen, np.full(T.size, noise), over)


@pytest.mark.parametrize(
    ("force", "quantity", "value", "unit", "words"),
    [
        (-2.4 * R, "r", -2.4, "m/s/rad", "in proportion to r: about -2.4"),
        (-0.0095 * R**2 * 10, "r", -0.095, "m/rad^2", "like r^2: about -0.09"),
        (-0.3 * R * np.abs(R), "r", -0.3, "m/rad^2", "like r |r|: about -0.3"),
        (0.07 * THRUST**2, "thrust", 0.07, "m/s^2/N^2", "like thrust^2: about 0.07"),
        (np.full(T.size, 0.1), "", 0.1, "m/s^2", "constant: about 0.1"),
        (-0.35 * np.tanh(R / 0.02), "r", -0.35, "m/s^2", "with the sign of r: about -0.3"),
    ],
)
def test_a_force_of_one_quantity_is_told_as_such(force, quantity, value, unit, words):
    found = law([missing(force)])
    assert found.quantity == quantity and found.text.startswith(words)
    assert found.value == pytest.approx(value, rel=0.06)
    assert dimension(found.unit) == dimension(unit)
    assert found.explained > 0.9
    assert regime([missing(force)]).startswith(f"in u', {words}")


def test_a_force_of_two_quantities_is_no_law_of_one():
    force = np.sin(3.0 * T)
    assert law([missing(force)]) is None
    inside = np.where(THRUST > 2.5, force, 0.0)
    assert regime([missing(inside)]) == "in u', where thrust is large"


def test_a_law_of_a_lesser_equation_is_told_too():
    found = regime([missing(np.sin(3.0 * T), "r'", "rad/s^2"), missing(0.2 * R**2)])
    assert found.startswith("in r', ") and "; in u', like r^2: about 0.2" in found


def test_nothing_is_told_of_a_force_within_its_band():
    assert regime([missing(0.0 * T)]) == "nowhere beyond the noise"


def test_a_force_at_steps_of_a_command_is_told_as_such():
    steps = np.where((T // 5) % 2 == 1, 1.0, -1.0)
    force = np.where(T % 5 < 0.2, steps, 0.0)
    over = (Quantity("r", "rad/s", R), Quantity("rudder", "rad", steps, is_command=True))
    m = Missing("a.csv", "r'", "rad/s^2", T, force, np.full(T.size, 0.02), over)
    assert regime([m]) == "in r', just after steps of rudder"


def test_segments_close_together_are_one():
    force = np.zeros(T.size)
    for begin, end in ((1.0, 3.0), (3.3, 5.0), (9.0, 10.0), (15.0, 15.1)):  # the last is too short
        force[round(begin / 0.02) : round(end / 0.02) + 1] = 1.0
    found = missing(force, noise=1e-3).segments
    assert found == [pytest.approx((1.0, 5.0)), pytest.approx((9.0, 10.0))]


@pytest.fixture(scope="module")
def turned():
    """K06's craft with a drag in yaw that its model does not have."""
    rng, t = np.random.default_rng(5), np.arange(0.0, 30.0, 0.02)
    model = vehicle("hoverdemon")
    truth = model.with_effects([effect("yaw_linear_drag", 2.459)])
    low, high = (1.0, -0.2), (3.0, 0.4)
    commands = {
        s.name: np.repeat(rng.uniform(a, b, 10), 150)
        for s, a, b in zip(model.plant().inputs, low, high, strict=True)
    }
    run = truth.plant().compile(friction="smooth").simulate(t, list(commands.values()))
    clean = dict(zip(run.output_labels, run.outputs, strict=True))
    size = {"x": 0.01, "y": 0.01, "psi": 0.005, "u": 0.01, "v": 0.01, "r": 0.01}
    seen = {k: clean[k] + s * rng.normal(size=t.size) for k, s in size.items()}
    log = Log("turn.csv", t, {**seen, **commands})
    return log, clean["r"], diagnose(model, [log], names=["yaw_linear_drag", "yaw_coulomb"])


def test_the_missing_force_is_that_of_the_named_effect(turned):
    """Less what other coefficients, fitted without it, take of it."""
    _, r, found = turned
    assert [e.parameter for e in found.effects] == ["yaw_linear_drag"]
    torque = next(m for m in found.missing if m.equation == "r'")
    known = np.isfinite(torque.force)
    slope, offset = np.polyfit(r[known], torque.force[known], 1)
    assert slope < -0.5 and abs(offset) < 0.05
    assert np.corrcoef(r[known], torque.force[known])[0, 1] < -0.85
    assert torque.share > 0.5
    assert worst(found.missing) is torque and not any(is_there(m) for m in found.missing if m is not torque)
    assert found.regime.startswith("in r', in proportion to r: about -")


def test_the_yaw_rate_is_reconstructed(turned):
    _, r, found = turned
    rate = next(q for q in found.missing[0].over if q.name == "r").values
    known = np.isfinite(rate)
    assert np.sqrt(np.mean((rate - r)[known] ** 2)) < 0.01  # better than the sensor's noise


def test_a_running_mean_is_that_of_the_rows_about_each():
    values = np.array([1.0, 3.0, np.nan, 5.0, 7.0])
    found = running_mean(0.1 * np.arange(5), values, 0.25)
    np.testing.assert_allclose(found, [2.0, 2.0, np.nan, 6.0, 6.0])
    np.testing.assert_array_equal(running_mean(T, np.full(T.size, np.nan), 0.2), np.nan)


def test_where_rows_are_missing_nothing_is_there():
    force = np.full(T.size, np.nan)
    force[100:300] = 1.0
    m = missing(force, noise=1e-3)
    assert m.share == pytest.approx(200 / T.size) and m.rms == pytest.approx(1.0, rel=1e-2)
    assert m.segments == [pytest.approx((T[100], T[299]))]
