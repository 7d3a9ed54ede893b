"""G along a motion: what the plant's derivative says, and what is missing is named."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.control.observers import regression, regressors_along
from hovercontrol.craft.models.vehicles import c17_simulation

PLANT = c17_simulation().plant()


def motion(rng):
    return {name: rng.normal(size=11) for name in ("u", "v", "r", "thrust", "rudder")}


def test_it_is_the_derivative_of_the_accelerations_by_each_coefficient(rng):
    s = motion(rng)
    G = regressors_along(regression(PLANT), np.arange(11.0), s)
    names = [f"plant.{n}" for n in c17_simulation().linear_coefficients()]
    for k in range(11):
        x, u = [0, 0, 0, s["u"][k], s["v"][k], s["r"][k]], [s["thrust"][k], s["rudder"][k]]
        for j, name in enumerate(names):
            ones = dict.fromkeys(names, 0.0)
            rates = [PLANT.to_numpy().derivatives(0, x, u, ones | {name: size})[3:] for size in (0.0, 1.0)]
            np.testing.assert_allclose(G[:, j, k], rates[1] - rates[0], atol=1e-12)


def test_what_a_motion_lacks_is_named(rng):
    t, s, model = 0.01 * np.arange(11), motion(rng), regression(PLANT)
    with pytest.raises(InputError, match="missing signals r, rudder"):
        regressors_along(model, t, {k: v for k, v in s.items() if k not in ("r", "rudder")})
    with pytest.raises(InputError, match="signal 'v': expected 11 values"):
        regressors_along(model, t, s | {"v": s["v"][1:]})
    with pytest.raises(InputError, match=r"signal 'v': not finite at t = 0.03 s \(row 3\)"):
        regressors_along(model, t, s | {"v": np.where(np.arange(11) == 3, np.nan, s["v"])})
    with pytest.raises(InputError, match="increasing"):
        regressors_along(model, t[::-1], s)
