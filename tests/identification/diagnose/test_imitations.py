"""Several effects of the catalogue may imitate one law: then they are not the only reading."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hovercontrol as hc
from hovercontrol.identification.diagnose import diagnose


def rotor_log(seed, n=1000, h=0.05):
    """Return a log of a rotor with cubic drag: 2.76 w' = u - 1.4 w - 20 w^3."""
    rng, u, at = np.random.default_rng(seed), np.empty(n), 0
    while at < n:
        last = int(rng.integers(10, 60))
        u[at : at + last], at = rng.uniform(-0.6, 0.6), at + last
    w = [0.0]
    for one in u[:-1]:
        way = solve_ivp(lambda t, x, u: (u - 1.4 * x - 20.0 * x**3) / 2.76, (0.0, h), w[-1:], args=(one,))
        w.append(float(way.y[0, -1]))
    return hc.Log(f"log{seed}", h * np.arange(n), {"w": w + 3e-3 * rng.normal(size=n), "u": u})


@pytest.mark.slow
def test_quadratic_drag_and_dry_friction_may_be_one_cubic_drag():
    w, u = hc.Signal("w", "rad/s"), hc.Signal("u", "N*m")
    J, d = hc.Signal("J", "kg*m^2", start=2.8), hc.Signal("d", "N*m*s", start=1.35)
    law = (u.symbol - d.symbol * w.symbol) / J.symbol
    found = diagnose(hc.Block("rotor", [w], [u], [w], [J, d], {"w": law}), [rotor_log(1)], rotor_log(2))
    told = {e.effect for e in found.effects} | {r.name for r in found.rivals}
    assert told & {"w_cubic_drag", "law_w__cub_w"}
