"""A log without a craft in it, white noise in every channel, ends in a result: that nothing is explained."""

from __future__ import annotations

import numpy as np
import pytest

from hovercontrol.craft.models.vehicles import c17_experiment
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")


def noise_log(seed: int, names: tuple[str, ...], rows: int = 1000, step: float = 0.02) -> Log:
    """White noise of 1 m, 1 rad, 1 m/s, 1 rad/s under random commands, each held for 20 rows."""
    rng = np.random.default_rng(seed)

    def command(low: float, high: float) -> np.ndarray:
        return np.repeat(rng.uniform(low, high, rows // 20 + 1), 20)[:rows]

    commands = {"thrust": command(1.0, 4.0), "rudder": command(-0.4, 0.4)}
    return Log("noise", step * np.arange(rows), {name: rng.normal(size=rows) for name in names} | commands)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_pose_of_pure_noise_ends_in_a_result(seed):
    """Yaw friction is fitted so steep that sub-steps short enough for the noisy path are unstable at rest."""
    found = identify(c17_experiment(), [noise_log(seed, POSE)])
    assert found.misfit
    assert all(np.isfinite(c.value) and c.std >= 0.0 for c in found.coefficients)


@pytest.mark.slow("1")
@pytest.mark.parametrize("step", [0.005, 0.1])
def test_body_velocities_of_pure_noise_end_in_a_result(step):
    found = identify(c17_experiment(), [noise_log(0, VELOCITY, rows=400, step=step)])
    assert all(np.isfinite(c.value) and c.std >= 0.0 for c in found.coefficients)
