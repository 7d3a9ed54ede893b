"""What a flight leaves in doubt: the Gramian's inverse, what one speed tells, and why c3 and c4 are slow."""

import math
from functools import cache

import numpy as np
import pyarrow.csv
import pytest
from matplotlib.figure import Figure

from hovercontrol import InputError, ellipse, figure_eight, kalman_bucy, waypoints
from hovercontrol.control.analysis import ellipse_errors, expected_errors, observability_gramian, signals_of
from hovercontrol.control.analysis.iss import DRAG
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference, tracking_loop
from hovercontrol.control.analysis.reference_runs import RUNS
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation
from hovercontrol.documents.c17.interconnection import ESTIMATOR

CRAFT = c17_simulation()


@cache
def references():
    """Those that are compared."""
    return {"C17": c17_ellipse(), "circle": ellipse(2.0, 2.0), "eight": figure_eight(6.0, 2.5, 0.5)}


@pytest.fixture(scope="module")
def found():
    return expected_errors(references())


@pytest.fixture(scope="module")
def region():
    return ellipse_errors((1.0, 2.5), (1.0, 2.5), points=3, duration=7.0)


def motion(reference, seconds):
    """Return times and signals of the craft from when it is on the reference."""
    loop = tracking_loop(CRAFT, reference, outputs=["tracking_error", "thrust", "rudder"])
    t = np.linspace(0.0, RUNS.settle + seconds, round(1000 * (RUNS.settle + seconds)) + 1)
    ready, x0 = loop.compile(friction="smooth"), on_reference(reference, 0.2)
    signals = signals_of(ready.simulate(t, x0=x0, method="rk4", step=0.01))
    on = t >= RUNS.settle
    return t[on], {name.removeprefix("plant."): values[on] for name, values in signals.items()}


@pytest.mark.slow
def test_without_disturbances_the_covariance_is_the_inverse_of_the_gramian():
    noise = 1e-3
    found = expected_errors({"C17": c17_ellipse()}, duration=3.0, noise=noise, disturbance=0.0)
    W = observability_gramian(CRAFT.plant(), *motion(c17_ellipse(), 3.0), list(DRAG), scaled=False)
    before = np.diag([1 / noise] * 3 + [1.0] * 6)
    by_gramian = np.sqrt(np.diag(np.linalg.inv(W.matrix / noise + before)))[3:]
    assert found.error[0] == pytest.approx(by_gramian, rel=1e-3)


@pytest.mark.slow
def test_a_circle_shows_one_sum_of_friction_and_drag_in_each_direction(found):
    """After c + c' s is known, of two unknowns with variance 1, s^2/(1 + s^2) and 1/(1 + s^2) are left."""
    _, s = motion(ellipse(2.0, 2.0), 1.0)
    for k, name in enumerate(("u", "v", "r")):
        speed = np.abs(s[name]).mean()
        left = np.array([speed, 1.0]) / math.hypot(1.0, speed)
        assert found.error[1, 2 * k : 2 * k + 2] == pytest.approx(left, rel=1e-3)


@pytest.mark.slow
def test_on_c17s_ellipse_c3_and_c4_are_left_in_doubt_most(found):
    c17 = dict(zip(DRAG, found.error[0], strict=True))
    assert sorted(c17, key=c17.get)[-2:] == ["sway_linear_drag", "sway_coulomb"]
    _, s = motion(c17_ellipse(), 2 * math.pi)
    assert np.ptp(np.sign(s["v"])) == 0  # it always slides to the same side
    eight = dict(zip(DRAG, found.error[2], strict=True))
    _, s = motion(references()["eight"], 4 * math.pi)
    assert s["v"].min() < -0.2 and s["v"].max() > 0.2
    assert eight["sway_coulomb"] < 0.6 * c17["sway_coulomb"]


def test_the_estimator_of_c17_itself_finds_c3_and_c4_last():
    """C17 VIII-A, with its R and Q: the last 1 % of what each wrong coefficient does to all six estimates."""
    estimator = kalman_bucy(CRAFT.plant(), list(DRAG), **ESTIMATOR)
    loop = tracking_loop(CRAFT, more=[estimator], outputs=[f"{name}_hat" for name in DRAG])
    ready, true = loop.compile(friction="smooth"), np.array([CRAFT.coefficients()[name] for name in DRAG])
    start, t = on_reference(c17_ellipse(), 0.2), np.linspace(0.0, 25.0, 2501)
    start |= {f"estimator.xhat[{k}]": start[f"plant.{name}"] for k, name in enumerate("uvr")}
    square = np.zeros((6, len(t)))
    for wrong in np.eye(6):
        begin = start | {f"estimator.xhat[{k + 3}]": c for k, c in enumerate(true + wrong)}
        square += (ready.simulate(t, x0=begin, method="rk4", step=0.002).outputs - true[:, None]) ** 2
    found = {name: t[np.flatnonzero(row > 1e-4)[-1]] for name, row in zip(DRAG, square, strict=True)}
    order = sorted(found, key=found.get)
    assert order[-2:] == ["sway_linear_drag", "sway_coulomb"]
    assert found[order[-2]] > found[order[-3]] + 1.0


@pytest.mark.slow
def test_more_time_and_less_noise_leave_less_doubt(found):
    short = expected_errors({"C17": c17_ellipse()}, duration=6.0)
    assert (found.error[0] < short.error[0]).all()
    for quieter in ({"noise": 1e-6}, {"disturbance": 1e-5}):
        assert (expected_errors({"C17": c17_ellipse()}, duration=6.0, **quieter).error < short.error).all()


@pytest.mark.slow
def test_the_map_of_ellipses_has_the_numbers_of_each_and_is_as_good_along_x_as_along_y(region):
    own = ellipse(1.0, 2.5, -1.0, math.pi / 2)
    one = expected_errors({"own": own}, duration=7.0)
    assert [region[name][2, 0] for name in DRAG] == pytest.approx(one.error[0], rel=1e-9)
    assert region["worst"][2, 0] == pytest.approx(one.error[0].max(), rel=1e-9)
    np.testing.assert_allclose(region["worst"], region["worst"].T, rtol=0.35)  # begins a quarter lap later
    assert np.diag(region["worst"]).min() > 10 * region["worst"][2, 0]  # circles


@pytest.mark.slow
def test_limits_are_those_of_the_commands_that_the_reference_needs(found, region):
    _, s = motion(c17_ellipse(), 4 * math.pi)
    assert found.thrust[0] == pytest.approx([s["thrust"].min(), s["thrust"].max()], abs=1e-3)
    assert found.rudder[0] == pytest.approx([s["rudder"].min(), s["rudder"].max()], abs=1e-3)
    assert found.within_limits.all()
    weak = c17_experiment()
    weak = type(weak)(weak.name, weak.effects, weak.thrust.replace(upper=4.0), weak.rudder)
    assert expected_errors(references(), actuators=weak, duration=6.0).within_limits.tolist() == [
        False,
        True,
        True,
    ]
    assert not region["within limits"][2, 0] and region["within limits"][2, 1]  # 1 x 2.5: too much rudder


def test_a_craft_that_does_not_get_on_its_reference_tells_nothing():
    near = CRAFT.with_coefficients({"rudder_torque": 3.7})  # a dx close to J/m
    spins = expected_errors({"C17": c17_ellipse()}, near, duration=1.0)
    assert np.isnan(spins.error).all() and not spins.within_limits.any()


def test_results_are_drawn_and_tabled(found, tmp_path):
    figure = found.plot()
    assert isinstance(figure, Figure)
    written = [text.get_text() for text in figure.axes[0].texts]
    assert written == [f"{value:.2g}" for value in found.error.ravel()]
    table = pyarrow.csv.read_csv(found.save(tmp_path / "errors.csv"))
    assert table["reference"].to_pylist() == list(references())
    assert table["sway_coulomb [m/s^2]"].to_pylist() == found.error[:, 2].tolist()


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: expected_errors({}), "expected one or more, found none"),
        (lambda: expected_errors(references(), coefficients=["sway_colomb"]), "did you mean"),
        (lambda: expected_errors(references(), duration=0.0), "duration must be positive"),
        (lambda: expected_errors(references(), duration=1e9), "would take .* h"),
        (lambda: expected_errors(references(), noise=0.0), "noise must be positive"),
        (lambda: expected_errors(references(), disturbance=-1.0), "disturbance must be 0 or more"),
        (lambda: expected_errors({"rest": waypoints([[0, 0], [1, 1]], [0, 1])}), "stands still at t = 0"),
        (lambda: ellipse_errors(semi_x=(0.0, 1.0)), "semi_x must be positive, found 0"),
        (lambda: ellipse_errors(semi_y=(2.0, 1.0)), "is reversed"),
        (lambda: ellipse_errors(rate=0.0), "rate must be positive"),
        (lambda: ellipse_errors(points=31623), r"1e\+09 runs would take .* h and .* GiB"),
    ],
)
def test_bad_input_is_refused(call, line):
    with pytest.raises(InputError, match=line):
        call()
