"""C17's Theorem 4: (23) and (24) by hand, the side the craft settles on, and simulations as the judge."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st

from hovercontrol.analysis.loops import c17_ellipse, initial_errors, on_reference, tracking_loop
from hovercontrol.analysis.normal_form import coefficient
from hovercontrol.analysis.zero_dynamics import arm_region, predict, zero_dynamics
from hovercontrol.errors import InputError
from hovercontrol.references import line
from hovercontrol.vehicles import c17_simulation

CRAFT = c17_simulation()
DYNAMICS = zero_dynamics(CRAFT)
NAMES = ("sway_linear_drag", "yaw_linear_drag", "thrust", "rudder_torque", "control_point")


def number(expression, c4, c6, c7, c8, dx, U=1.0):
    values = dict(zip((coefficient(n) for n in NAMES), (c4, c6, c7, c8, dx), strict=True))
    return float(expression.xreplace({**values, sp.Symbol("U", positive=True): U}))


positive = st.floats(0.05, 5.0)


@given(positive, positive, positive, positive, st.floats(-0.5, 0.5))
def test_the_growth_of_the_yaw_rate_is_that_of_23_and_24_with_kappa(c4, c6, c7, c8, dx):
    assume(abs(c7 - c8 * dx) > 0.05 and abs(dx) > 1e-6)
    m, J = 0.585, 0.01
    d_v, d_r, b_T, a = m * c4, J * c6, m * c7, J * c8 / (m * c7)
    # the bracket before r^2 in (23), b_T of (21) cancels
    printed_23 = -d_r / J + a / J / (1 / m - dx * a / J) * (d_v / m - d_r / J) * dx
    assert b_T * a / J == pytest.approx(c8)
    growth = number(DYNAMICS.growth, c4, c6, c7, c8, dx)
    assert growth == pytest.approx(printed_23, rel=1e-9, abs=1e-9)
    kappa = c8 * dx / (c7 - c8 * dx)
    assert growth == pytest.approx(kappa * (c4 - c6) - c6, rel=1e-9, abs=1e-9)


def test_24_as_printed_differs_by_the_inertia():
    # the simulation's a = 0.14 m at dx = 0.1 m: rho = 0.819, kappa = 4.52
    found = predict(0.14, 0.1)
    assert not found.bounded  # 0.48 > 4.52 * 0.72 is false
    assert found.printed  # 0.48 > 0.01 * 4.52 * 0.72 is true
    assert predict(0.14, 0.2).bounded
    kappa = 6.1425 * 0.2 / (0.75 - 6.1425 * 0.2)
    assert kappa == pytest.approx(-2.57, abs=0.005)


def test_with_the_simulations_kappa_the_condition_is_c4_over_0_61_c6():
    for share, stable in ((0.60, False), (0.62, True)):
        craft = CRAFT.with_coefficients({"yaw_linear_drag": 1.0, "sway_linear_drag": share})
        assert bool(predict(0.14, 0.2, model=craft).bounded) == stable


@given(positive, positive, positive, positive, st.floats(0.01, 0.5), st.floats(0.2, 3.0))
def test_straight_motion_obeys_the_equation_of_small_turns(c4, c6, c7, c8, dx, U):
    rho = c8 * dx / c7
    assume(abs(1 - rho) > 0.05)
    # (1 - rho) psi'' = -(c6 - rho c4) psi' + (c8 c4 U/c7) psi
    for way, sign in ((DYNAMICS.nose, 1.0), (DYNAMICS.stern, -1.0)):
        a1, a0 = (number(e, c4, c6, c7, c8, dx, U) for e in way)
        assert a1 == pytest.approx((c6 - rho * c4) / (1 - rho), rel=1e-9, abs=1e-9)
        assert a0 == pytest.approx(-sign * c8 * c4 * U / c7 / (1 - rho), rel=1e-9, abs=1e-9)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_theorem_4_is_where_one_side_of_straight_motion_is_stable(arm, dx):
    assume(abs(arm) > 1e-3 and abs(arm * dx * 58.5 - 1) > 1e-3)
    found = predict(arm, dx)
    assert bool(found.bounded) == bool(found.nose | found.stern)
    assert not (found.nose & found.stern)


def test_nose_first_needs_the_control_point_beyond_the_centre_of_percussion():
    dx = np.array([0.03, 0.06, 0.09, 0.115, 0.13, 0.3, 0.5])
    found = predict(0.14, dx)
    assert found.nose.tolist() == [False, False, False, False, True, True, True]
    assert found.stern.tolist() == [True, False, False, False, False, False, False]
    ahead = predict(-0.14, dx)  # a rudder ahead of the centre of mass: nose-first at once
    assert ahead.nose.all()


def test_the_linearised_growth_is_that_of_the_simulated_loop_about_a_straight_line():
    craft = CRAFT.with_coefficients({"yaw_coulomb": 0.0, "surge_coulomb": 0.0})
    reference = line((2.0, 0.0))
    loop = tracking_loop(craft, reference, outputs=["psi"])
    run = loop.compile().simulate(
        np.linspace(0.0, 4.0, 81), x0=on_reference(reference, 0.2, heading=1e-3), rtol=1e-10, atol=1e-13
    )
    a1, a0 = (number(e, 1.2, 0.48, 0.75, 6.1425, 0.2, U=2.0) for e in DYNAMICS.nose)
    t = np.linspace(0.0, 4.0, 81)
    poles = np.roots([1.0, a1, a0])
    c = np.linalg.solve(np.vstack([np.ones(2), poles]), [1e-3, 0.0])
    np.testing.assert_allclose(run.outputs.ravel(), (c @ np.exp(np.outer(poles, t))).real, atol=2e-7)


def test_a_craft_put_on_the_reference_has_no_error():
    loop = tracking_loop(CRAFT)
    for heading in (0.0, np.pi, 0.7):
        start = on_reference(c17_ellipse(), 0.2, heading)
        np.testing.assert_allclose(initial_errors(loop, start), 0.0, atol=1e-12)


def test_simulations_agree_with_the_corrected_theorem_and_contradict_the_printed_one():
    theory, judge = arm_region(points=15, duration=20.0)
    assert judge.outside("theorem", "bounded") == []
    assert judge.share("theorem", "bounded") > 0.9
    assert (theory["printed"] & ~judge["bounded"]).sum() >= 5
    strong = np.abs(np.tile(judge.x.values, (15, 1))) > 0.03  # a rudder near the centre turns too slowly
    for side, other in (("nose", "stern"), ("stern", "nose")):
        where = theory[side] & strong
        assert (judge[side] & where).sum() > 0.93 * where.sum()
        assert not (judge[other] & where & theory["bounded"]).sum() > 0.03 * where.sum()


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: predict(0.1, 0.01 / 0.585 / 0.1), "a dx = J/m"),
        (lambda: predict(0.1, 0.1, mass=0.0), "mass must be positive"),
        (lambda: predict(0.1, 0.1, inertia=-1.0), "inertia must be positive"),
        (lambda: arm_region(arm=(0.3, -0.3)), "arm: the range 0.3 to -0.3 m is reversed"),
        (lambda: arm_region(control_point=(0.1, 0.1)), "is empty"),
        (lambda: arm_region(points=0), "needs 2 or more points"),
    ],
)
def test_singular_and_empty_ranges_are_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()
