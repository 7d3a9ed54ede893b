"""The tracking controller against C17 (15)-(16), (25)-(26), and its Lyapunov function."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends import library
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import ellipse, line
from hovercontrol.control.controllers.thrust_limits import within_limits
from hovercontrol.craft.effects import Coefficient, Effect, effect
from hovercontrol.craft.models.actuated import actuated
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import RUDDER, THRUST
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, four_fan, hoverdemon

DRAG = (
    "surge_coulomb",
    "surge_linear_drag",
    "sway_coulomb",
    "sway_linear_drag",
    "yaw_coulomb",
    "yaw_linear_drag",
)
C17 = (*DRAG, "thrust", "rudder_torque")


def rotation(psi):
    return np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])


S = np.array([[0.0, -1.0], [1.0, 0.0]])


def c17_errors(state, reference, dx):
    """C17 (15)-(16): z1, z2."""
    x, y, psi, u, v, r = state
    R, delta = rotation(psi), np.array([dx, 0.0])
    z1 = np.array([x, y]) - reference[:2] + R @ delta
    z2 = R @ np.array([u, v]) - reference[2:4] + R @ S @ delta * r
    return z1, z2


def c17_controller(state, reference, c, dx, k1, k2, width=0.01):
    """C17 (25)-(26): thrust, rudder."""
    _x, _y, psi, u, v, r = state
    c1, c2, c3, c4, c5, c6, c7, c8 = c
    e1, e2 = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    z1, z2 = c17_errors(state, reference, dx)
    sgn_u, sgn_v, sgn_r = (np.tanh(w / width) for w in (u, v, r))
    B = np.diag([c7, c7 - c8 * dx])
    R = rotation(psi)
    inside = (
        -np.array([c1 * sgn_u + c2 * u, c3 * sgn_v + c4 * v])
        - (c5 * sgn_r + c6 * r) * dx * e2
        - R.T @ reference[4:6]
        - dx * r**2 * e1
        + R.T @ (k1 * z1 + k2 * z2)
    )
    push = -np.linalg.inv(B) @ inside
    return np.array([np.linalg.norm(push), np.arctan2(push[1], push[0])])


def draw(rng):
    state = np.array([*rng.uniform(-3, 3, 2), rng.uniform(-7, 7), *rng.normal(0, 1, 3)])
    return state, rng.normal(0, 1.5, 6)


def test_the_command_is_equations_25_and_26_for_random_states_coefficients_and_gains(rng):
    f = tracking_controller(c17_simulation()).to_numpy()
    for _ in range(150):
        state, reference = draw(rng)
        c, (k1, k2), dx = rng.uniform(0.1, 8, 8), rng.uniform(0.5, 4, 2), rng.uniform(0.05, 0.4)
        if abs(c[6] - c[7] * dx) < 0.2:
            continue
        params = {f"controller.{n}": v for n, v in zip(C17, c, strict=True)}
        params |= {"controller.k1": k1, "controller.k2": k2, "controller.control_point": dx}
        found = f.outputs(0.0, (), [*state, *reference], params)
        thrust, rudder = c17_controller(state, reference, c, dx, k1, k2)
        assert found[0] == pytest.approx(thrust, rel=1e-12)
        # a 1e-12 of the force vector is a 1e-12 of angle
        assert np.hypot(np.cos(found[1]) - np.cos(rudder), np.sin(found[1]) - np.sin(rudder)) < 1e-12 * max(
            1.0, 20 / thrust
        )
        assert found[2:] == pytest.approx(c17_errors(state, reference, dx)[0], rel=1e-12, abs=1e-13)


def nominal_loop(k1=2.0, k2=2.0):
    craft = c17_simulation()
    return interconnect(
        [ellipse(1.5, 2.5, -1, np.pi / 2), tracking_controller(craft, k1=k1, k2=k2), craft.plant()],
        "loop",
    )


def test_the_closed_loops_error_obeys_z1_second_derivative_plus_k2_z1_prime_plus_k1_z1(rng):
    k1, k2 = 1.75, 1.5
    loop, path = nominal_loop(k1, k2), ellipse(1.5, 2.5, -1, np.pi / 2).to_numpy()
    f = loop.to_numpy()

    def z(t, x):
        return np.array(c17_errors(x, path.outputs(t, ()), 0.2))

    h = 1e-5
    for _ in range(20):
        t, x = rng.uniform(0, 6), draw(rng)[0]
        dx = f.derivatives(t, x)
        z1, z2 = z(t, x)
        dz1, dz2 = (z(t + h, x + h * dx) - z(t - h, x - h * dx)) / (2 * h)
        scale = 1 + np.abs(z1).max() + np.abs(z2).max()
        assert np.allclose(dz1, z2, atol=1e-7 * scale)
        assert np.allclose(dz2, -k1 * z1 - k2 * z2, atol=1e-7 * scale)


def lyapunov(z1, z2, k1, k2, beta):
    """V and W of C17 section VI."""
    V = k1 * (z1**2).sum(0) / 2 + (z2**2).sum(0) / 2 + beta * (z1 * z2).sum(0)
    W = k1 * beta * (z1**2).sum(0) + k2 * beta * (z1 * z2).sum(0) + (k2 - beta) * (z2**2).sum(0)
    return V, W


def test_along_the_nominal_closed_loop_v_falls_by_w():
    k1 = k2 = 2.0
    bound = min(np.sqrt(k1), 4 * k1 * k2 / (4 * k1 + k2**2))  # (18), (19)
    h = 1e-3
    t = np.arange(0, 2.0, h)
    run = simulate(
        nominal_loop(),
        t,
        x0=[0.5, 1.0, 1.5, 0.3, 0.1, 0.2],
        rtol=1e-11,
        atol=1e-13,
        method="DOP853",
    )
    path = ellipse(1.5, 2.5, -1, np.pi / 2).to_numpy().outputs(t, ())
    z = np.array([c17_errors(x, r, 0.2) for x, r in zip(run.states.T, path.T, strict=True)])
    z1, z2 = z[:, 0].T, z[:, 1].T
    for beta in (0.1 * bound, 0.5 * bound, 0.99 * bound):
        V, W = lyapunov(z1, z2, k1, k2, beta)
        slope = (8 * (V[3:-1] - V[1:-3]) - (V[4:] - V[:-4])) / (12 * h)
        assert np.allclose(slope, -W[2:-2], atol=1e-6 * W.max())
        assert (W > 0).all()
        assert (np.diff(V) < 0).all()


@given(st.floats(0.1, 9), st.floats(0.1, 9), st.floats(0.01, 0.999))
def test_inside_19_both_v_and_w_are_positive_definite(k1, k2, share):
    beta = share * 4 * k1 * k2 / (4 * k1 + k2**2)
    assert beta < np.sqrt(k1)  # (19) implies (18)
    assert np.linalg.eigvalsh([[k1 / 2, beta / 2], [beta / 2, 0.5]]).min() > 0
    assert np.linalg.eigvalsh([[k1 * beta, k2 * beta / 2], [k2 * beta / 2, k2 - beta]]).min() > 0


def test_a_controller_that_knows_the_craft_loses_its_tracking_error():
    run = simulate(nominal_loop(), [0, 5.0, 12.0], x0={"plant.u": 0.3}, rtol=1e-8, atol=1e-10)
    names = run.output_labels
    error = np.hypot(run.outputs[names.index("error_x")], run.outputs[names.index("error_y")])
    assert error[0] > 2.0
    assert error[-1] < 1e-3


def test_a_control_point_beside_the_centre_line_follows_too():
    """C17: "the proposed controller can accommodate arbitrary vectors delta"; to its stable side."""
    craft, delta = c17_simulation(), np.array([0.2, 0.05])
    controller = tracking_controller(craft, control_point=delta[0], control_point_side=delta[1])
    loop = interconnect([ellipse(1.5, 2.5, -1, np.pi / 2), controller, craft.plant()], "loop")
    run = simulate(loop, [0, 5.0, 12.0], x0={"plant.y": 1.5, "plant.u": 1.0}, rtol=1e-8, atol=1e-10)
    o = dict(zip(run.output_labels, run.outputs, strict=True))
    cos, sin = np.cos(o["psi"]), np.sin(o["psi"])
    x, y = o["x"] + cos * delta[0] - sin * delta[1], o["y"] + sin * delta[0] + cos * delta[1]
    np.testing.assert_allclose(o["error_x"], x - o["x_ref"], atol=1e-12)
    np.testing.assert_allclose(o["error_y"], y - o["y_ref"], atol=1e-12)
    assert np.hypot(o["error_x"], o["error_y"])[-1] < 1e-3
    assert "controller.control_point_side" in controller.default_parameters
    assert "controller.control_point_side" not in tracking_controller(craft).default_parameters


# ---- adaptation and limits -----------------------------------------------------------------------


def test_estimates_are_blended_in_by_the_parameter_adaptation(rng):
    plain = tracking_controller(c17_simulation()).to_numpy()
    adaptive = tracking_controller(c17_simulation(), adapt=DRAG).to_numpy()
    for share in (0.0, 0.3, 1.0):
        state, reference = draw(rng)
        own = np.array([c17_simulation().coefficients()[n] for n in DRAG])
        hats = rng.uniform(-1, 2, 6)
        found = adaptive.outputs(0.0, (), [*state, *reference, *hats], {"controller.adaptation": share})
        used = {f"controller.{n}": v for n, v in zip(DRAG, own + share * (hats - own), strict=True)}
        assert found == pytest.approx(plain.outputs(0.0, (), [*state, *reference], used), rel=1e-11)


@pytest.mark.parametrize("name", ["thrust", "rudder_torque"])
def test_what_enters_b_is_not_adapted(name):
    with pytest.raises(InputError, match="enters B"):
        tracking_controller(c17_simulation(), adapt=[name])


@pytest.mark.parametrize("name", ["yaw_colomb", "yaw_coulomb_width"])
def test_only_coefficients_can_be_adapted(name):
    with pytest.raises(InputError, match=r"unknown coefficient.*did you mean 'yaw_coulomb'"):
        tracking_controller(c17_simulation(), adapt=[name])


def by_hand(force, upper, most):
    """Keep the side force; push ahead as much as the rudder needs for it; shorten at the thrust's limit."""
    fx, fy = force
    ahead = max(fx, abs(fy) / np.tan(most))
    return min(np.hypot(ahead, fy), upper), np.arctan2(fy, max(ahead, 0.01 * upper))


def test_limits_keep_the_commands_within_what_the_craft_can_do(rng):
    craft = c17_experiment()
    bounded, free = (
        tracking_controller(craft, limits=limits, control_point=0.3).to_numpy() for limits in (True, False)
    )
    inputs = rng.normal(0, 0.7, (12, 300))
    (thrust, rudder), wanted = bounded.outputs(0.0, (), inputs)[:2], free.outputs(0.0, (), inputs)
    forces = wanted[0] * np.array([np.cos(wanted[1]), np.sin(wanted[1])])
    for k, force in enumerate(forces.T):
        assert (thrust[k], rudder[k]) == pytest.approx(by_hand(force, 6.1, np.radians(26)), abs=1e-12)
    within = (wanted[0] < 6.1) & (np.abs(wanted[1]) < np.radians(26)) & (forces[0] > 0.061)
    assert within.sum() > 5
    assert thrust[within] == pytest.approx(wanted[0][within])
    assert rudder[within] == pytest.approx(wanted[1][within])
    assert thrust.max() == 6.1
    assert np.abs(rudder).max() <= np.radians(26)


def test_commands_within_limits_are_continuous_where_the_demand_points_astern():
    thrust, rudder = THRUST.replace(lower=0.0, upper=4.0), RUDDER.replace(lower=-0.5, upper=0.5)
    fx, fy = sp.symbols("fx fy", real=True)
    commands = within_limits(fx, fy, thrust, rudder)
    values = {b.symbol: b.start for b in commands[2]}
    f = sp.lambdify((fx, fy), [e.subs(values) for e in commands[:2]], "numpy")
    angles = np.linspace(-np.pi, np.pi, 20001)
    T, theta = f(2.0 * np.cos(angles), 2.0 * np.sin(angles))
    for values in (T, theta, T * np.sin(theta)):
        assert np.abs(np.diff(values, append=values[0])).max() < 0.02
    assert T * np.sin(theta) == pytest.approx(
        np.clip(2.0 * np.sin(angles), *4.0 * np.sin([-0.5, 0.5])), abs=0.03
    )


def test_a_rudder_that_turns_further_or_to_one_side_only_is_clipped_by_itself():
    craft = replace(c17_experiment(), rudder=RUDDER.replace(lower=-2.0, upper=2.0))
    bounded, free = (tracking_controller(craft, limits=limits).to_numpy() for limits in (True, False))
    inputs = np.random.default_rng(4).normal(0, 0.7, (12, 100))
    wanted = free.outputs(0.0, (), inputs)
    assert np.array_equal(bounded.outputs(0.0, (), inputs)[1], np.clip(wanted[1], -2.0, 2.0))


#: Gains and a start with which the demand points astern on the way.
ASTERN, START = {"k1": 4.0, "k2": 4.0}, {"plant.x": 3.77, "plant.y": 2.2, "plant.psi": 1.83}


def narrow():
    """Return C17's craft with thrust 0 to 4 N and the rudder within 0.5 rad, limited."""
    thrust = THRUST.replace(unit="N", lower=0.0, upper=4.0)
    return replace(
        c17_simulation(), thrust=thrust, rudder=RUDDER.replace(lower=-0.5, upper=0.5), limited=True
    )


@pytest.mark.parametrize("lag", [None, {"thrust": 0.1, "rudder": 0.05}])
def test_a_loop_within_narrow_limits_goes_on_where_the_reference_is_astern(lag):
    craft = narrow()
    there = line((1e-9, 0.0), start=(-3.0, 0.0))
    loop = interconnect([actuated(craft, lag=lag), tracking_controller(craft, **ASTERN), there])
    times = np.linspace(0.0, 30.0, 301)
    found = loop.compile().simulate(times, x0=START)
    names = list(found.output_labels)
    outputs = np.asarray(found.outputs)
    assert 0.0 <= outputs[names.index("thrust")].min() <= outputs[names.index("thrust")].max() <= 4.0
    assert np.abs(outputs[names.index("rudder")]).max() <= 0.5
    again = simulate(loop, times[:61], x0=START)
    assert np.asarray(again.outputs) == pytest.approx(outputs[:, :61], abs=2e-2)


def test_the_rudder_chatters_where_only_the_plant_is_limited_and_the_error_says_so(monkeypatch):
    monkeypatch.setattr(library, "MAX_STEPS", 20_000)
    law = tracking_controller(narrow(), limits=False, **ASTERN)
    loop = interconnect([narrow().plant(), law, line((1e-9, 0.0), start=(-3.0, 0.0))])
    cause = r"the state plant\.r = .* the switch atan2\(controller\.thrust_y, .* in rudder chatters"
    with pytest.raises(InputError, match=rf"at t = 4\.\d* s: too many steps: {cause}"):
        loop.compile().simulate(np.linspace(0.0, 30.0, 301), x0=START)


# ---- what it refuses -----------------------------------------------------------------------------


def test_a_control_point_with_a_dx_equal_j_over_m_is_refused():
    dx = 0.01 / 0.585 / 0.14  # C17 Theorem 3
    with pytest.raises(InputError, match="a dx = J/m"):
        tracking_controller(c17_simulation(), control_point=dx)
    for near in (0.99, 1.01):
        tracking_controller(c17_simulation(), control_point=near * dx)


def test_a_craft_that_cannot_push_is_refused():
    with pytest.raises(InputError, match="needs the effect 'thrust'"):
        tracking_controller(Model("puck", [effect("surge_coulomb", 1.0)]))
    with pytest.raises(InputError, match="needs the effect 'thrust'"):
        tracking_controller(c17_simulation().with_coefficients({"thrust": 0.0}))
    with pytest.raises(InputError):
        tracking_controller(four_fan())


def test_an_effect_that_bends_the_thrust_is_refused_by_name():
    class Bent(Effect):
        value = Coefficient("m/s^2", lower=0.0)

        def terms(self, c, s):
            return {"u": c.value * s.thrust_x**2}

    Bent.name = "bent"
    with pytest.raises(InputError, match=r"effect 'bent'.*not a linear"):
        tracking_controller(Model("odd", [*hoverdemon().effects, Bent(1.0)]))


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"k1": 0.0}, "k1"),
        ({"k2": -1.0}, "k2"),
        ({"k1": np.nan}, "k1"),
        ({"control_point": np.nan}, "control_point"),
    ],
)
def test_gains_are_positive_numbers(arguments, name):
    with pytest.raises(InputError, match=name):
        tracking_controller(c17_simulation(), **arguments)


def test_another_drag_needs_no_other_controller(rng):
    """The controller cancels what the model has, whatever that is."""

    class Gale(Effect):
        value = Coefficient("1/s")

        def terms(self, c, s):
            return {"v": -c.value * s.v + c.value * s.u, "r": -c.value * s.r}

    Gale.name = "gale"
    craft = c17_simulation()
    craft = Model("windy", [*craft.effects, Gale(0.7)])
    loop = interconnect([ellipse(1.5, 2.5), tracking_controller(craft), craft.plant()])
    path, f, h = ellipse(1.5, 2.5).to_numpy(), loop.to_numpy(), 1e-5
    t, x = 0.4, draw(rng)[0]
    dx = f.derivatives(t, x)
    z1, z2 = c17_errors(x, path.outputs(t, ()), 0.2)
    ahead, behind = (c17_errors(x + s * h * dx, path.outputs(t + s * h, ()), 0.2)[1] for s in (1, -1))
    assert np.allclose((ahead - behind) / (2 * h), -2 * z1 - 2 * z2, atol=1e-6 * (1 + np.abs(x).max()) * 10)


def test_friction_with_bristles_is_refused():
    numbers = {"stiffness": 300.0, "coulomb": 0.2, "static": 0.3}
    with pytest.raises(InputError, match="has friction with the internal state 'lugre_u'"):
        tracking_controller(c17_simulation().with_effects([effect("lugre_surge", **numbers)]))
