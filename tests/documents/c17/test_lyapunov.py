"""C17's V, W, (18), (19) and the decay they guarantee, against the paper's formulas written by hand."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.sgn import sgn
from hovercontrol.control.analysis.byrnes_isidori import ERRORS, coefficient, normal_form, symbol
from hovercontrol.control.analysis.loops import tracking_loop
from hovercontrol.control.analysis.lyapunov import decay, fastest_beta, lyapunov_function, lyapunov_rate
from hovercontrol.control.analysis.zero_dynamics import predict
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation
from hovercontrol.documents.c17.beta_region import beta_region
from hovercontrol.documents.c17.gain_region import gain_region
from hovercontrol.documents.k06.turn_basins import turn_basins

GAINS = st.floats(0.05, 20.0)


def test_v_and_w_are_those_of_the_paper():
    F = lyapunov_function()
    z1, z2 = sp.symbols("z1 z2")
    z = sp.Matrix([z1, z2])
    V = F.k1 * z1**2 / 2 + z2**2 / 2 + F.beta * z1 * z2  # (17)
    W = F.k1 * F.beta * z1**2 + F.k2 * F.beta * z1 * z2 + (F.k2 - F.beta) * z2**2
    assert sp.expand((z.T * F.P * z)[0] - V) == 0
    assert sp.expand((z.T * F.Q * z)[0] - W) == 0


@pytest.mark.slow
def test_both_axes_obey_the_same_error_equation_for_any_craft_with_rudder_and_propeller():
    for craft in (c17_simulation(), c17_experiment()):
        errors = normal_form(craft).errors
        k1, k2 = coefficient("k1"), coefficient("k2")
        e = {name: symbol(name) for name in ERRORS}
        for axis in "xy":
            assert errors[f"error_{axis}"] == e[f"error_rate_{axis}"]
            wanted = -k1 * e[f"error_{axis}"] - k2 * e[f"error_rate_{axis}"]
            assert sp.expand(errors[f"error_rate_{axis}"] - wanted) == 0


def test_19_implies_18_because_the_difference_of_their_squares_is_a_square():
    F = lyapunov_function()
    k1, k2 = F.k1, F.k2
    assert F.condition_18() == sp.sqrt(k1)
    assert sp.simplify(F.condition_19() - 4 * k1 * k2 / (4 * k1 + k2**2)) == 0
    assert F.margin().is_nonnegative
    assert sp.solve(F.margin(), k2) == [2 * sp.sqrt(k1)]  # equal at k2 = 2 k1^(1/2) only


@given(GAINS, GAINS, st.floats(0.001, 0.999))
def test_no_beta_guarantees_more_than_the_true_rate_and_the_fastest_guarantees_it(k1, k2, share):
    best = decay(k1, k2)
    assert best.admissible
    assert best.guaranteed == pytest.approx(best.true, rel=3e-3)
    some = decay(k1, k2, share * best.bound_19)
    assert 0 < some.guaranteed <= best.true * (1 + 1e-9)


def test_away_from_critical_damping_the_guarantee_is_the_true_rate_to_rounding(rng):
    k1, k2 = rng.uniform(0.1, 9.0, (2, 300))
    away = abs(k2**2 / (4 * k1) - 1) > 0.01
    found = decay(k1[away], k2[away])
    np.testing.assert_allclose(found.guaranteed, found.true, rtol=1e-9)
    np.testing.assert_allclose(found.beta, fastest_beta(k1, k2)[away])


def test_beyond_19_nothing_is_guaranteed():
    for share in (1.001, 1.02, 2.0):
        found = decay(2.0, 2.0, share * decay(2.0, 2.0).bound_19)
        assert not found.admissible
        assert found.guaranteed < 0


def test_the_simulated_loop_stays_under_the_guaranteed_bound_and_decays_at_the_true_rate():
    k1 = k2 = 2.0
    loop = tracking_loop(c17_simulation(), outputs=["error_x", "error_y", "tracking_error"], k1=k1, k2=k2)
    t = np.linspace(0.0, 12.0, 241)
    run = loop.compile(friction="smooth").simulate(
        t, x0={"plant.y": 1.5, "plant.u": 1.0}, rtol=1e-9, atol=1e-12
    )
    error = run.outputs[2]
    promise = decay(k1, k2)
    # |z1| <= |[k1^(1/2) z1, z2]|/k1^(1/2); at t = 0 z1 = (0.2, -1), z2 = (1 - 1.5, 0)
    size = np.sqrt(k1 * (0.2**2 + 1.0) + 0.5**2)
    bound = promise.overshoot * size / np.sqrt(k1) * np.exp(-promise.guaranteed * t)
    assert (error <= bound * (1 + 1e-6) + 1e-9).all()
    # complex poles: the error beats with exp(-t) around it; compare where the phase is the same
    half = round(np.pi / (t[1] - t[0]))
    rate = np.log(error[20] / error[20 + half]) / (t[20 + half] - t[20])
    assert rate == pytest.approx(promise.true, rel=0.03)


def test_the_beta_region_lies_under_both_bounds():
    region = beta_region(points=40)
    beta, k2 = region.y.values[:, None], region.x.values[None, :]
    by_hand = (beta < np.sqrt(2.0)) & (beta < 8 * k2 / (8 + k2**2))
    assert (region["admissible"] == by_hand).all()
    assert (region["guaranteed"][by_hand] > 0).all()
    assert np.isnan(region["guaranteed"][~by_hand]).all()


@pytest.mark.slow
def test_no_simulated_loop_contradicts_theorem_3_and_it_covers_nearly_all():
    region = gain_region(points=12)
    assert region.outside("guaranteed", "simulated") == []
    assert region.outside("exact", "simulated") == region.outside("simulated", "exact") == []
    assert region.share("guaranteed", "simulated") > 0.95
    assert region.share("with limits", "simulated") < 0.95  # the theorem knows no limits of the commands


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: decay(-1.0, 2.0), "k1 must be positive"),
        (lambda: decay(1.0, 0.0), "k2 must be positive"),
        (lambda: decay(1.0, 1.0, [0.1, -0.1]), "beta must be positive"),
        (lambda: decay(np.nan, 1.0), "k1 must be positive"),
        (lambda: beta_region(0.0), "k1 must be positive"),
        (lambda: beta_region(k2=(3.0, 1.0)), "k2: the range 3 to 1 1/s is reversed"),
        (lambda: gain_region(k1=(-1.0, 1.0)), "k1 must be positive"),
        (lambda: gain_region(k2=(1.0, 1.0)), "k2: the range 1 to 1 1/s is empty"),
        (lambda: gain_region(points=1), "needs 2 or more points"),
        (lambda: gain_region(tolerance=0.0), "tolerance must be positive"),
    ],
)
def test_what_is_no_gain_or_no_range_is_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()


def test_what_is_no_number_is_refused_in_one_line():
    with pytest.raises(InputError, match="k1: expected numbers, found 'a'"):
        decay("a", 2.0)
    with pytest.raises(InputError, match="arm: expected numbers, found 'a'"):
        predict("a", 0.1)
    with pytest.raises(InputError, match="at: expected names, each with a number"):
        turn_basins(at=3.0)


def test_20_is_the_derivative_of_v_under_any_command(rng):
    """C17 (20) written by hand at random points, for a thrust that no controller chose."""
    craft = c17_simulation()
    motion = ["x", "y", "psi", "u", "v", "r"]
    told = ["x_ref", "y_ref", "vx_ref", "vy_ref", "ax_ref", "ay_ref"]
    names = [*motion, *told, "thrust_x", "thrust_y"]
    given_names = [coefficient(n) for n in (*craft.coefficients(), "k1", "k2", "control_point")]
    symbols = [*(symbol(n) for n in names), *given_names, sp.Symbol("beta", positive=True)]
    rate = sp.lambdify(symbols, lyapunov_rate(craft).replace(sgn, lambda v, w: sp.sign(v)))
    k1, k2, dx, beta = 2.0, 1.5, 0.2, 0.4
    for _ in range(20):
        values = rng.uniform(-2, 2, len(names))
        c = dict(zip(craft.coefficients(), rng.uniform(0.2, 2.0, len(craft.coefficients())), strict=True))
        x, y, psi, u, v, r, xr, yr, vx, vy, ax, ay, fx, fy = values
        R = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
        z1 = np.array([x - xr, y - yr]) + R @ [dx, 0]
        z2 = R @ [u, v] - [vx, vy] + R @ [0, dx * r]
        W = k1 * beta * z1 @ z1 + k2 * beta * z1 @ z2 + (k2 - beta) * z2 @ z2
        B = np.diag([c["thrust"], c["thrust"] - c["rudder_torque"] * dx])
        drag = -np.array([c["surge_coulomb"] * np.sign(u) + c["surge_linear_drag"] * u,
                          c["sway_coulomb"] * np.sign(v) + c["sway_linear_drag"] * v])  # fmt: skip
        yaw = c["yaw_coulomb"] * np.sign(r) + c["yaw_linear_drag"] * r
        bracket = B @ [fx, fy] + drag - R.T @ [ax, ay] - [dx * r**2, dx * yaw] + R.T @ (k1 * z1 + k2 * z2)
        by_hand = -W + (beta * z1 + z2) @ R @ bracket
        assert rate(*values, *c.values(), k1, k2, dx, beta) == pytest.approx(by_hand, rel=1e-9, abs=1e-9)
