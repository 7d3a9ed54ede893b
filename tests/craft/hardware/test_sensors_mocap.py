"""Motion capture: the pose with noise and rounding, velocities by backward difference."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.hardware.sensors import mocap, noisy_motion, poor_view

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")
poses = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-9, 9)), min_size=2, max_size=6)


CAMERAS = {period: Ticking(mocap(period=period)) for period in (0.01, 0.5)}


def run(camera, path, **params):
    camera.set_parameters({f"mocap.{key}": value for key, value in params.items()})
    block = camera.block
    camera.state = tuple(s.start for s in block.states)
    told = [camera.tick(k * block.period, dict(zip(POSE, pose, strict=True))) for k, pose in enumerate(path)]
    return {name.removesuffix("_measured"): np.array([row[name] for row in told]) for name in told[0]}


@given(poses, st.sampled_from(sorted(CAMERAS)))
def test_velocities_are_the_backward_difference_in_the_measured_heading(path, period):
    told = run(CAMERAS[period], path, first_u=1.0, first_v=2.0, first_r=3.0)
    assert [told[name][0] for name in VELOCITY] == [1.0, 2.0, 3.0]
    rate = np.diff(path, axis=0) / period
    for k, (dx, dy, dpsi) in enumerate(rate, 1):
        c, s = math.cos(path[k][2]), math.sin(path[k][2])
        wanted = [c * dx + s * dy, -s * dx + c * dy, dpsi]
        assert [told[name][k] for name in VELOCITY] == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@given(poses, st.floats(1e-4, 0.1))
def test_rounding_is_to_the_nearest_multiple(path, step):
    told = run(CAMERAS[0.01], path, position_step=step, heading_step=2 * step)
    for name, true, unit in zip(POSE, np.transpose(path), (step, step, 2 * step), strict=True):
        counts = told[name] / unit
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
        assert np.abs(told[name] - true).max() <= unit / 2 * (1 + 1e-6) + 1e-12


def test_noise_is_of_the_size_asked_for_and_grows_in_the_difference():
    n, sigma, period = 4000, 0.001, 0.01
    told = run(CAMERAS[period], [(1.0, 2.0, 0.0)] * n, position_noise=sigma)
    for name, true in (("x", 1.0), ("y", 2.0)):
        assert told[name].mean() == pytest.approx(true, abs=5 * sigma / math.sqrt(n))
        assert told[name].std() == pytest.approx(sigma, rel=5 / math.sqrt(2 * n))
    assert np.all(told["psi"] == 0.0)
    # A difference of two independent readings over a tick.
    assert told["u"][1:].std() == pytest.approx(math.sqrt(2) * sigma / period, rel=7 / math.sqrt(2 * n))


def test_measured_velocities_have_noise_of_their_own():
    n, sizes = 2000, (0.01, 0.01, 0.02, 0.05, 0.05, 0.1)
    block = noisy_motion(position_noise=0.01, heading_noise=0.02, velocity_noise=0.05, rate_noise=0.1)
    true = dict(zip((*POSE, *VELOCITY), (1.0, -2.0, 0.3, 0.4, -0.5, 0.6), strict=True))
    sensor = Ticking(block)
    told = [sensor.tick(0.01 * k, true) for k in range(n)]
    z = np.array(
        [
            [(row[f"{k}_measured"] - v) / s for (k, v), s in zip(true.items(), sizes, strict=True)]
            for row in told
        ]
    )
    assert np.abs(z.mean(axis=0)).max() < 5 / math.sqrt(n)
    assert np.abs(z.std(axis=0) - 1).max() < 5 / math.sqrt(2 * n)
    assert np.abs(np.corrcoef(z.T) - np.eye(6)).max() < 5 / math.sqrt(n)
    still = Ticking(noisy_motion()).tick(0.0, true)
    assert [still[f"{k}_measured"] for k in true] == list(true.values())


def test_a_negative_noise_of_velocities_is_refused():
    with pytest.raises(InputError, match="rate_noise must not be negative"):
        noisy_motion(rate_noise=-1.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"period": 0.0}, "must be positive"),
        ({"position_noise": -1e-3}, "position_noise must not be negative"),
        ({"heading_step": -1e-3}, "heading_step must not be negative"),
        ({"first_velocity": (0.0, 1.0)}, "expected three numbers"),
    ],
)
def test_wrong_numbers_are_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        mocap(**wrong)


def test_a_poor_view_is_noisy_inside_its_circle_only():
    view = Ticking(poor_view(centre=(1.0, 2.0), radius=0.5, position_noise=0.01, heading_noise=0.02))
    n = 3000
    inside, outside = ({"x": 1.2, "y": 2.3, "psi": 0.4}, {"x": 1.2, "y": 2.6, "psi": 0.4})
    seen = np.array([list(view.tick(0.01 * k, inside).values()) for k in range(n)]) - [1.2, 2.3, 0.4]
    assert seen.std(axis=0) == pytest.approx([0.01, 0.01, 0.02], rel=5 / math.sqrt(2 * n))
    assert list(view.tick(0.0, outside).values()) == list(outside.values())


def test_outliers_of_a_poor_view_come_as_often_and_are_as_large_as_asked_for():
    view = Ticking(poor_view(outlier_share=0.1, outlier_noise=0.5))
    n = 3000
    seen = np.array([view.tick(0.01 * k, dict.fromkeys(POSE, 0.0))["x_viewed"] for k in range(n)])
    hit = seen[seen != 0]
    assert len(hit) / n == pytest.approx(0.1, abs=5 * math.sqrt(0.09 / n))
    assert hit.std() == pytest.approx(0.5, rel=5 / math.sqrt(2 * len(hit)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"centre": (1.0,)}, "expected two numbers"),
        ({"radius": 0.0}, "radius must be positive"),
        ({"position_noise": -1.0}, "position_noise must not be negative"),
        ({"outlier_share": 1.5}, "outlier_share must be between 0 and 1"),
    ],
)
def test_a_poor_view_refuses_what_makes_no_sense(given, said):
    with pytest.raises(InputError, match=said):
        poor_view(**given)
