"""C17's Theorem 4: (23) and (24) by hand, the side the craft settles on, and simulations as the judge."""

import sys
from functools import cache

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.sgn import sgn
from hovercontrol.control.analysis.byrnes_isidori import coefficient
from hovercontrol.control.analysis.loops import c17_ellipse, initial_errors, on_reference, tracking_loop
from hovercontrol.control.analysis.zero_dynamics import (
    kinetic_energy_rate,
    predict,
    theorem_4_margin,
    zero_dynamics,
)
from hovercontrol.control.controllers.references import line
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.documents.c17.zero_dynamics import arm_region

CRAFT = c17_simulation()
NAMES = ("sway_linear_drag", "yaw_linear_drag", "thrust", "rudder_torque", "control_point")


@cache
def dynamics():
    """Those of the simulated craft."""
    return zero_dynamics(CRAFT)


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
    growth = number(dynamics().growth, c4, c6, c7, c8, dx)
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
    for way, sign in ((dynamics().nose, 1.0), (dynamics().stern, -1.0)):
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
    a1, a0 = (number(e, 1.2, 0.48, 0.75, 6.1425, 0.2, U=2.0) for e in dynamics().nose)
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


@given(positive, positive, positive, st.floats(0.5, 8.0) | st.floats(-8.0, -0.5), st.floats(0.02, 0.98))
def test_delta_of_theorem_4_is_the_nearest_place_where_24_fails(c4, c6, c7, c8, share):
    """(24) is c6 > kappa (c4 - c6), kappa = c8 dx/(c7 - c8 dx): by hand at both sides and just beyond."""
    names = ("sway_linear_drag", "yaw_linear_drag", "thrust", "rudder_torque")
    delta = theorem_4_margin(CRAFT.with_coefficients(dict(zip(names, (c4, c6, c7, c8), strict=True))))

    def holds(dx):
        kappa = c8 * dx / (c7 - c8 * dx)
        return c6 > kappa * (c4 - c6)

    assume(abs(c4 - c6) > 0.01)
    assert holds(share * delta) and holds(-share * delta)
    assert not (holds(1.001 * delta) and holds(-1.001 * delta))


def test_within_delta_a_fast_spin_dies_and_beyond_it_grows():
    delta = theorem_4_margin(CRAFT)
    assert delta == pytest.approx(0.0488, abs=1e-4)
    loop = tracking_loop(CRAFT, outputs=["r"]).compile(friction="smooth")
    for share, bounded in ((0.9, True), (1.1, False)):
        start = on_reference(c17_ellipse(), share * delta) | {"plant.r": 60.0}
        start["plant.v"] -= share * delta * (60.0 - start["plant.r"])
        rate = loop.simulate([0.0, 0.5, 3.0], x0=start, params={"controller.control_point": share * delta})
        assert (abs(rate.outputs.ravel()[-1]) < 60.0) == bounded


def test_without_a_rudder_arm_or_sway_drag_delta_is_what_is_left():
    assert theorem_4_margin(CRAFT.with_coefficients({"rudder_torque": 0.0})) == np.inf
    bare = CRAFT.with_coefficients({"sway_linear_drag": 0.0})
    assert theorem_4_margin(bare) == pytest.approx(0.75 / 6.1425, rel=1e-9)


@pytest.mark.slow
def test_a_control_point_off_the_centre_line_has_no_delta():
    """By hand: r' has -c8 delta_y r^2/(c7 - c8 delta_x), so r escapes in finite time to one side."""
    cubic = zero_dynamics(CRAFT, side=True).cubic
    numbers = {coefficient(n): v for n, v in CRAFT.coefficients().items()}
    numbers |= {coefficient("control_point"): 0.03, coefficient("control_point_side"): 0.02}
    assert float(cubic.subs(numbers)) == pytest.approx(-6.1425 * 0.02 / (0.75 - 6.1425 * 0.03), rel=1e-9)
    assert dynamics().cubic == 0


def test_23_is_the_derivative_of_the_yaw_energy_with_its_bracket_closed(rng):
    """C17 (23) by hand at random points: the sign is that of the whole sway velocity."""
    rate = kinetic_energy_rate(CRAFT)
    names = ["error_x", "error_y", "error_rate_x", "error_rate_y", "psi", "r"]
    names += ["vx_ref", "vy_ref", "ax_ref", "ay_ref"]
    symbols = [sp.Symbol(n, real=True) for n in names]
    given = [coefficient(n) for n in (*CRAFT.coefficients(), "k1", "k2", "control_point")]
    known = sp.lambdify([*symbols, *given], rate.replace(sgn, lambda v, w: sp.sign(v)))
    m, J, k1, k2, dx = 0.585, 0.01, 2.0, 1.5, 0.2
    for _ in range(20):
        values = rng.uniform(-2, 2, len(symbols))
        c = dict(zip(CRAFT.coefficients(), rng.uniform(0.2, 2.0, len(CRAFT.coefficients())), strict=True))
        e1, e2, w1, w2, psi, r, vx, vy, ax, ay = values
        across = np.array([-np.sin(psi), np.cos(psi)])  # e2' R'
        d_v0, d_v = m * c["sway_coulomb"], m * c["sway_linear_drag"]
        d_r0, d_r = J * c["yaw_coulomb"], J * c["yaw_linear_drag"]
        a = c["rudder_torque"] * J / (c["thrust"] * m)
        gain = a / (1 / m - dx * a / J)
        slip = across @ [w1 + vx, w2 + vy]
        by_hand = -d_r0 / J * np.sign(r) * r + (-d_r / J + gain / J * (d_v / m - d_r / J) * dx) * r**2
        by_hand += (
            r / J * gain * (
                (-d_v0 * np.sign(slip - dx * r) - d_v * slip) / m
                - d_r0 / J * np.sign(r) * dx
                + across @ [k1 * e1 + k2 * w1 - ax, k1 * e2 + k2 * w2 - ay]
            )
        )  # fmt: skip
        assert known(*values, *c.values(), k1, k2, dx) == pytest.approx(by_hand, rel=1e-9, abs=1e-9)


def test_what_has_not_settled_on_a_side_is_on_neither(monkeypatch):
    """Without a rudder arm nothing turns the craft; next to none, it still turns after 30 s."""
    ranges = (-0.012, 0.012), (-0.25, 0.05)
    _, judge = arm_region(*ranges, points=13)
    maps = [judge[n] for n in ("nose", "stern", "unsettled")]
    assert (sum(m.astype(int) for m in maps) == judge["bounded"]).all()
    assert judge["unsettled"][:, 6].all()  # a = 0
    module = sys.modules[
        "hovercontrol.documents.c17.zero_dynamics"
    ]  # the package has a function of that name
    monkeypatch.setattr(module, "MOTION", module.MotionCriteria(settled=2.0))  # whatever it still does
    _, hasty = arm_region(*ranges, points=13)
    wrongly = hasty["nose"] & judge["unsettled"]
    assert wrongly.any() and not (judge["nose"] & ~hasty["nose"]).any()
