"""K06's forward and reverse laws: theorem, linearisation (2.33), simulation, and what delay costs."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.control.controllers.k06 import forward, reverse
from hovercontrol.documents.k06.law_loop import delayed_force, force_craft, law_loop, linearly_stable
from hovercontrol.documents.k06.law_regions import forward_region, reverse_region

MASS, INERTIA, ARM = 2.6, 0.096, 0.32


def test_the_craft_is_k06_2_10_in_velocities(rng):
    f = force_craft().to_numpy()
    for _ in range(20):
        (u, v, r), (F_X, F_Y) = rng.normal(0.0, 1.0, 3), rng.normal(0.0, 1.0, 2)
        P_X, P_Y, Pi = MASS * u, MASS * v, INERTIA * r
        momenta = [P_Y * Pi / INERTIA + F_X, -P_X * Pi / INERTIA + F_Y, -ARM * F_Y]
        rates = f.derivatives(0.0, [u, v, r], [F_X, F_Y]) * [MASS, MASS, INERTIA]
        assert rates == pytest.approx(momenta, rel=1e-9, abs=1e-12)


def test_the_linearisation_at_table_6_2_is_stable_below_the_theorem():
    """k2 = 4 at 1.1 m/s: below the 8.75 that the theorem asks for, eigenvalues -2.90 +- 2.50i."""
    loop = law_loop(forward(k1=1.0, k2=4.0))
    here = dict(zip([s.symbol for s in loop.states], (1.1, 0.0, 0.0), strict=True))
    here |= {s.symbol: s.start for s in loop.parameters}
    J = np.array(loop.jacobian().xreplace(here), dtype=float)
    pair = sorted(np.linalg.eigvals(J), key=lambda s: s.imag)[-1]
    assert pair == pytest.approx(-2.9026 + 2.4984j, abs=1e-4)
    assert linearly_stable(loop, {"reference.speed": np.array([1.1])}).all()
    assert MASS * 1.1 / ARM > 8.75


def test_without_delay_linear_stability_of_the_reverse_law_is_the_theorems_condition(rng):
    loop = law_loop(reverse(k1=1.5, k2=1.0, alpha=1.44))
    speed, alpha, k2 = rng.uniform(-2.0, -0.05, 200), rng.uniform(0.05, 3.0, 200), rng.uniform(0.1, 9.0, 200)
    stable = linearly_stable(loop, {"reference.speed": speed, "law.alpha": alpha, "law.k2": k2})
    assert (stable == (alpha > INERTIA / (ARM**2 * MASS))).all()


def test_the_delay_is_that_of_its_frequency_response():
    delay = delayed_force(0.08).to_control().linearize(np.zeros(8), np.zeros(2))
    for w in (0.5, 3.0, 12.0):
        assert delay[0, 0](1j * w) == pytest.approx(np.exp(-0.08j * w), abs=2e-3)


def test_with_delay_surge_is_stable_up_to_the_gain_of_the_delay_margin():
    """m u' = -k1 u(t - tau) is stable iff k1 < pi m/(2 tau)."""
    loop, limit = law_loop(forward(k1=1.0, k2=1.0), delay=True), np.pi * MASS / (2 * 0.07754)
    k1 = np.array([0.97, 1.03]) * limit
    stable = linearly_stable(loop, {"reference.speed": np.array([1.0, 1.0]), "law.k1": k1})
    assert stable.tolist() == [True, False]


@pytest.fixture(scope="module")
def ahead():
    return forward_region(points=8, duration=80.0)


@pytest.mark.slow
def test_the_forward_theorem_holds_but_is_far_from_necessary_and_blind_to_delay(ahead):
    assert ahead.outside("theorem", "simulated") == []
    assert 0.4 < ahead.share("theorem", "simulated") < 0.8
    assert ahead["linear"].all()  # for every k2 > 0
    assert len(ahead.outside("theorem", "delayed")) > 0.5 * ahead["theorem"].sum()
    assert (ahead["linear delayed"] == ahead["delayed"]).mean() > 0.9


@pytest.mark.slow
def test_the_theorem_line_is_where_the_map_changes(ahead):
    (u, k2), _ = ahead.lines.values()
    assert k2 == pytest.approx(MASS * u / ARM)
    by_hand = ahead.y.values[:, None] > MASS / ARM * ahead.x.values[None, :]
    assert (ahead["theorem"] == by_hand).all()


@pytest.mark.slow
def test_the_reverse_law_is_stable_where_its_local_theorem_says():
    region = reverse_region(points=6, duration=80.0)
    assert (region["theorem"] == region["linear"]).all()
    assert region.share("theorem", "simulated") == 1.0
    assert region.share("delayed", "simulated") < 1.0


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: reverse_region(speed=(-1.0, 0.5)), "reverse law: u_ref must be negative, found 0.5"),
        (lambda: forward_region(speed=(-0.1, 1.0)), "forward law: u_ref must be positive"),
        (lambda: forward_region(k2=(0.0, 1.0)), "k2 must be positive"),
        (lambda: reverse_region(alpha=(-1.0, 1.0)), "alpha must be positive"),
        (lambda: forward_region(k1=0.0), "k1 must be positive"),
        (lambda: forward_region(speed=(2.0, 1.0)), "is reversed"),
        (lambda: reverse_region(duration=0.0), "duration must be positive"),
    ],
)
def test_wrong_signs_and_ranges_are_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()
