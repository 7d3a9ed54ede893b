"""C17 (27): what wrong coefficients do to the error equation, and how much error they cost."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad

from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis.iss import (
    DRAG,
    iss_gain,
    lyapunov_gain,
    mismatch,
    mismatch_numbers,
    peak_gain,
)
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference, tracking_loop
from hovercontrol.craft.models.vehicles import c17_simulation

CRAFT = c17_simulation()
M = mismatch(CRAFT)
GAINS = st.floats(0.1, 10.0)


def test_wrong_coefficients_act_as_the_drag_they_leave(rng):
    u, v, r = rng.normal(0.0, 2.0, (3, 50))
    dx, width, zero = 0.2, 0.01, np.zeros(50)
    su, sv, sr = (np.tanh(w / width) for w in (u, v, r))
    by_hand = [[su, u, zero, zero, zero, zero], [zero, zero, sv, v, dx * sr, dx * r]]
    np.testing.assert_allclose(mismatch_numbers(M, CRAFT, dx, u, v, r), by_hand, atol=1e-12)


def test_27_as_printed_has_factors_that_the_loop_has_not(rng):
    """z1'' + k2 z1' + k1 z1 = R M (c_hat - c), without the 1/zeta_7 and 1/(zeta_7 - zeta_8 dx) of (27)."""
    truth = np.array([CRAFT.coefficients()[n] for n in DRAG])
    wrong = truth + rng.uniform(0.3, 0.6, 6)
    loop = tracking_loop(CRAFT, outputs=["error_x", "error_y", "u", "v", "r", "psi"])
    params = {f"controller.{n}": c for n, c in zip(DRAG, wrong, strict=True)}
    f, x0 = loop.to_numpy(), on_reference(c17_ellipse(), 0.2, heading=0.4)
    x = np.array([x0[s.name] for s in loop.states])
    h = 1e-3

    def errors(t, state):
        return f.outputs(t, state, (), params)[:2]

    def flow(t, state, step):  # one step of Runge-Kutta, forwards or backwards
        k1 = f.derivatives(t, state, (), params)
        k2 = f.derivatives(t + step / 2, state + step / 2 * k1, (), params)
        k3 = f.derivatives(t + step / 2, state + step / 2 * k2, (), params)
        k4 = f.derivatives(t + step, state + step * k3, (), params)
        return state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    ahead, here, behind = (errors(s, flow(0.0, x, s) if s else x) for s in (h, 0.0, -h))
    acceleration = (ahead - 2 * here + behind) / h**2
    left = acceleration + 2.0 * (ahead - behind) / (2 * h) + 2.0 * here
    u, v, r, psi = f.outputs(0.0, x, (), params)[2:]
    R = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
    along = mismatch_numbers(M, CRAFT, 0.2, *(np.array([w]) for w in (u, v, r)))[..., 0] @ (wrong - truth)
    assert left == pytest.approx(R @ along, abs=2e-3)
    printed = np.diag([1 / 0.75, 1 / (0.75 - 6.1425 * 0.2)]) @ -along  # zeta_tilde = zeta - zeta_hat
    for sign in (1.0, -1.0):
        assert np.linalg.norm(sign * R @ printed - left) > 0.1


@pytest.mark.slow
@given(GAINS, GAINS)
def test_the_exact_gain_is_the_integral_of_the_impulse_responses_size(k1, k2):
    p1, p2 = np.roots([1.0, k2, k1]).astype(complex)
    assume(abs(p1 - p2) > 1e-3)
    t = np.linspace(0.0, 40.0 / -max(p1.real, p2.real), 200_001)
    h = ((np.exp(p1 * t) - np.exp(p2 * t)) / (p1 - p2)).real
    assert peak_gain(k1, k2) == pytest.approx(np.trapezoid(abs(h), t), rel=5e-3)
    assert lyapunov_gain(k1, k2) >= peak_gain(k1, k2) * (1 - 1e-9)


def test_the_gains_at_k1_k2_2():
    h = quad(lambda t: np.exp(-t) * abs(np.sin(t)), 0.0, 60.0, limit=400)[0]
    assert peak_gain(2.0, 2.0) == pytest.approx(h, rel=1e-6)
    assert lyapunov_gain(2.0, 2.0) == pytest.approx(1.0, rel=1e-4)


def test_simulated_errors_stay_under_the_gain_whatever_is_wrong(rng):
    """|z1| <= gain max|d| along the motion itself, started on the reference."""
    loop = tracking_loop(CRAFT, outputs=["tracking_error", "u", "v", "r"]).compile(friction="smooth")
    start, t = on_reference(c17_ellipse(), 0.2), np.linspace(0.0, 15.0, 1501)
    truth = np.array([CRAFT.coefficients()[n] for n in DRAG])
    reached = []
    for size in (0.05, 0.1, 0.2, 0.3) * 2:
        error = np.maximum(size * rng.uniform(-1.0, 1.0, 6), -truth)  # no drag is negative
        params = {f"controller.{n}": c for n, c in zip(DRAG, truth + error, strict=True)}
        run = loop.simulate(t, x0=start, params=params)
        d = np.einsum("imk,m->ik", mismatch_numbers(M, CRAFT, 0.2, *run.outputs[1:]), error)
        bound = peak_gain(2.0, 2.0) * np.hypot(*d).max()
        assert run.outputs[0].max() <= bound * (1 + 1e-3)
        reached.append(run.outputs[0].max() / bound)
    assert max(reached) > 0.5  # the gain is not idle


def test_small_errors_along_the_ellipse_stay_under_the_tabled_gain():
    gain = iss_gain(CRAFT)
    assert set(gain.regressor) == set(DRAG)
    assert gain.regressor["surge_coulomb"] == pytest.approx(1.0, abs=1e-6)
    assert gain.regressor["yaw_coulomb"] == pytest.approx(0.2, abs=1e-6)  # dx sgn r
    assert gain.exact == pytest.approx(peak_gain(2.0, 2.0))
    assert "m per rad/s^2" in gain.table()
    loop = tracking_loop(CRAFT, outputs=["tracking_error"]).compile(friction="smooth")
    rng = np.random.default_rng(3)
    size = 0.02
    truth = np.array([CRAFT.coefficients()[n] for n in DRAG])
    believed = np.maximum(truth[:, None] + size * rng.choice([-1.0, 1.0], (6, 40)), 0.0)
    params = {f"controller.{n}": believed[k] for k, n in enumerate(DRAG)}
    runs = loop.sweep(np.linspace(0.0, 30.0, 301), params=params, x0=on_reference(c17_ellipse(), 0.2))
    worst = runs["tracking_error"].maximum.max()
    assert 0.4 * gain.error(size) < worst <= 1.02 * gain.error(size)


def test_gains_and_periods_that_are_none_are_refused():
    for call in (lambda: iss_gain(CRAFT, k1=0.0), lambda: lyapunov_gain(1.0, -1.0)):
        with pytest.raises(InputError, match="must be positive"):
            call()
    with pytest.raises(InputError, match="period must be positive"):
        iss_gain(CRAFT, period=0.0)
    with pytest.raises(InputError, match="did you mean 'yaw_coulomb'"):
        mismatch(CRAFT, ("yaw_colomb",))
