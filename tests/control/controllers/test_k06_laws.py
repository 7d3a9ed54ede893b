"""K06's laws against the thesis: the forces, their Lyapunov functions, their limits (section 2.2)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.controllers.k06 import (
    both_ways,
    drive,
    force_driven,
    force_to_command,
    forward,
    forward_alternate,
    reverse,
    stop,
    turn,
)
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import Body, four_fan, hoverdemon

M, J, D = 2.6, 0.096, 0.32
PLANT = hoverdemon().plant()
COMMANDS = force_to_command()
velocity, yaw_rate, gain = st.floats(-2, 2), st.floats(-8, 8), st.floats(0.1, 10)

BOTH = both_ways(k1=1.0, k2=4.0, reverse_k1=1.5, reverse_k2=1.0, alpha=1.44).to_numpy()

#: The whole loop of each law, made once: gains are parameters.
LOOPS = {
    law.__name__: interconnect([PLANT, law(**gains), COMMANDS], "loop")
    for law, gains in (
        (stop, {"k1": 1.0, "k2": 2.5}),
        (forward, {"k1": 1.0, "k2": 4.0}),
        (forward_alternate, {"k1": 1.0}),
        (reverse, {"k1": 1.5, "k2": 1.0, "alpha": 1.44}),
        (turn, {"k1": 0.5, "k2": 3.5}),
    )
}


def slope(name, u, v, r, told=(), **gains):
    """u', v', r' of the ideal closed loop at a velocity."""
    params = {f"controller.{k}": value for k, value in gains.items()}
    found = LOOPS[name].to_numpy().derivatives(0.0, [0.3, -0.2, 0.7, u, v, r], list(told), params)
    return found[3:]


def k06_dynamics(u, v, r, force):
    """K06 (2.10) with P_X = m u, P_Y = m v, Pi = J r."""
    PX, PY, Pi = M * u, M * v, J * r
    rates = np.array([PY * Pi / J + force[0], -PX * Pi / J + force[1], -D * force[1]])
    return rates / [M, M, J]


# ---- the equations ---------------------------------------------------------------------------------


@given(velocity, velocity, yaw_rate, gain, gain)
def test_the_closed_loops_are_those_of_the_thesis(u, v, r, k1, k2):
    PX, PY, Pi, up, back, spin = M * u, M * v, J * r, 1.1, -0.76, 3.0
    slip = PY / M - D * Pi / J
    forces = {
        "stop": ((-k1 * PX / M, -k2 * slip), ()),  # (2.16)
        "forward": ((-k1 * (PX - M * up) / M, -k2 * slip), (up,)),  # (2.24)
        "reverse": ((-k1 * (PX - M * back) / M, k2 * (PY / M + 1.44 * D * Pi / J)), (back,)),  # (2.30)
        "turn": ((-k1 * PX / M, -k2 * (PY / M - D * (Pi - J * spin) / J)), (spin,)),  # (2.39)
    }
    for name, (force, told) in forces.items():
        found = slope(name, u, v, r, told, k1=k1, k2=k2)
        assert found == pytest.approx(k06_dynamics(u, v, r, force), rel=1e-9, abs=1e-9), name
    alternate = (-k1 * (PX - M * up) / M, -M * up / (2 * D) * slip)  # (2.29)
    found = slope("forward_alternate", u, v, r, (up,), k1=k1)
    assert found == pytest.approx(k06_dynamics(u, v, r, alternate), rel=1e-9, abs=1e-9)


@given(velocity, velocity, yaw_rate, st.floats(0, 1), st.floats(-3, 3))
def test_drive_is_stop_forward_and_turn_in_one(u, v, r, surge, spin):
    both = drive(k1=1.0, k2=2.5).to_numpy()
    for law, told, references in (
        (stop, (), (0.0, 0.0)),
        (forward, (surge,), (surge, 0.0)),
        (turn, (spin,), (0.0, spin)),
    ):
        alone = law(k1=1.0, k2=2.5).to_numpy().outputs(0.0, (), [u, v, r, *told])
        assert both.outputs(0.0, (), [u, v, r, *references]).tolist() == alone.tolist()


@given(velocity, velocity, yaw_rate, st.floats(-1, 1), st.floats(-3, 3))
def test_both_ways_is_drive_ahead_and_the_reverse_law_astern(u, v, r, surge, spin):
    law = BOTH.outputs(0.0, (), [u, v, r, surge, spin])
    if surge < 0:
        own = reverse(k1=1.5, k2=1.0, alpha=1.44).to_numpy().outputs(0.0, (), [u, v, r, surge])
    else:
        own = drive(k1=1.0, k2=4.0).to_numpy().outputs(0.0, (), [u, v, r, surge, spin])
    assert law.tolist() == own.tolist()


# ---- Lyapunov functions: none grows in the ideal loop -------------------------------------------------


def power(rates, u, v, r, yaw_weight=1.0):
    """The derivative of (m u^2 + m v^2 + weight J r^2)/2, u and r less the reference if there is one."""
    return M * (u * rates[0] + v * rates[1]) + yaw_weight * J * r * rates[2]


@given(velocity, velocity, yaw_rate, gain, gain)
def test_the_stop_law_takes_energy_out_by_2_17(u, v, r, k1, k2):
    expected = -k1 * u**2 - k2 * (v - D * r) ** 2
    assert power(slope("stop", u, v, r, k1=k1, k2=k2), u, v, r) == pytest.approx(expected, abs=1e-9)
    assert expected <= 0


@given(velocity, velocity, yaw_rate, gain, gain, st.floats(-4, 4))
def test_the_turn_law_lowers_w_of_2_36(u, v, r, k1, k2, spin):
    expected = -k1 * u**2 - k2 * (v - D * (r - spin)) ** 2
    found = power(slope("turn", u, v, r, (spin,), k1=k1, k2=k2), u, v, r - spin)
    assert found == pytest.approx(expected, abs=1e-9)
    assert expected <= 0


@given(velocity, velocity, yaw_rate, gain, st.floats(0.05, 2), st.floats(1.001, 5))
def test_above_m_u_ref_over_d_the_forward_law_lowers_w_of_2_19(u, v, r, k1, up, more):
    k2 = more * M * up / D
    d_tilde = D - M * up / k2
    expected = -k1 * (u - up) ** 2 - k2 * (v - d_tilde * r) ** 2 - d_tilde * M * up * r**2  # (2.23)
    rates = slope("forward", u, v, r, (up,), k1=k1, k2=k2)
    assert power(rates, u - up, v, r, yaw_weight=d_tilde / D) == pytest.approx(expected, abs=1e-8)
    assert expected <= 0


@given(velocity, velocity, yaw_rate, gain, st.floats(0.05, 2))
def test_the_alternate_forward_law_lowers_w_of_2_19_with_weight_one(u, v, r, k1, up):
    # (2.27) with (2.28): the cross terms cancel
    expected = -k1 * (u - up) ** 2 - M * up / (2 * D) * v**2 - M * up * D / 2 * r**2
    rates = slope("forward_alternate", u, v, r, (up,), k1=k1)
    assert power(rates, u - up, v, r) == pytest.approx(expected, abs=1e-8)


def test_along_a_stopping_run_the_energy_only_falls():
    run = simulate(
        LOOPS["stop"],
        np.arange(0, 15, 0.01),
        x0={"plant.u": 0.2, "plant.v": -0.7, "plant.r": 6.4},
        rtol=1e-10,
        atol=1e-12,
    )
    u, v, r = run.states[3:]
    energy = 0.5 * M * (u**2 + v**2) + 0.5 * J * r**2
    assert (np.diff(energy) < 0).all()
    assert energy[-1] < 1e-3 * energy[0]


# ---- linearisations, limits ----------------------------------------------------------------------------


def eigenvalues(law, u, v, r, told, **gains):
    """Of the body velocities in the loop of a law."""
    loop = interconnect([force_driven(PLANT), law(**gains)], "loop")
    f = loop.to_numpy()
    at = [0, 0, 0, u, v, r]
    assert f.derivatives(0.0, at, [told])[3:] == pytest.approx([0, 0, 0], abs=1e-12)
    return np.sort_complex(np.linalg.eigvals(f.jacobian(0.0, at, [told])[3:, 3:]))


def test_below_the_theorems_gain_the_forward_loop_is_stable_all_the_same():
    """K06's own k2 = 4.0 is below P_X/d = 8.75 with its P_X = 2.8 (table 6.2)."""
    up = 2.8 / M
    found = eigenvalues(forward, up, 0, 0, up, k1=1.0, k2=4.0)
    assert 4.0 < M * up / D == pytest.approx(8.75)
    assert found[:2] == pytest.approx([-2.90 - 2.44j, -2.90 + 2.44j], abs=0.01)


@given(st.floats(-2, -0.1), gain, gain, st.floats(0.4, 4))
def test_reverse_has_the_eigenvalues_of_2_33_and_is_stable_above_the_bound_on_alpha(back, k1, k2, alpha):
    found = eigenvalues(reverse, back, 0, 0, back, k1=k1, k2=k2, alpha=alpha)
    b, c = k2 * (D**2 * alpha * M - J) / (M * J), -4 * k2 * M * back * D / (M * J)
    root = np.sqrt(complex(b**2 - c))
    expected = [-k1 / M, (-b + root) / 2, (-b - root) / 2]
    assert found == pytest.approx(np.sort_complex(expected), rel=1e-6, abs=1e-9)
    assert (found.real < 0).all() == (alpha > J / (D**2 * M))


def test_the_turn_law_has_two_limit_points_and_the_unwanted_one_has_a_zero_eigenvalue():
    spin = 3.0
    assert slope("turn", 0, 0, spin, (spin,)) == pytest.approx([0, 0, 0], abs=1e-12)
    assert slope("turn", 0, -D * spin, 0, (spin,)) == pytest.approx([0, 0, 0], abs=1e-12)
    found = eigenvalues(turn, 0, -D * spin, 0, spin, k1=0.5, k2=3.5)
    assert np.abs(found).min() < 1e-12


def test_from_below_w_bad_the_turn_law_reaches_the_wanted_yaw_rate():
    rng = np.random.default_rng(3)
    spin = 1.5
    bad = 0.5 * M * (D * spin) ** 2 + 0.5 * J * spin**2
    for _ in range(5):
        direction = rng.normal(size=3)
        u, v, w = direction / np.linalg.norm(direction) * np.sqrt(2 * 0.95 * bad)
        start = {"plant.u": u / M**0.5, "plant.v": v / M**0.5, "plant.r": spin + w / J**0.5}
        run = simulate(LOOPS["turn"], [0, 200.0], {"yaw_rate_ref": spin}, start, {"controller.k1": 1.0})
        assert run.states[3:, -1] == pytest.approx([0, 0, spin], abs=0.02)


# ---- forces to commands ------------------------------------------------------------------------------


@given(st.tuples(velocity, velocity, yaw_rate), st.floats(-3, 3), st.floats(-3, 3))
def test_the_force_driven_plant_is_k06_2_10(state, x, y):
    f = force_driven(PLANT).to_numpy()
    found = f.derivatives(0.0, [1.0, 2.0, 0.7, *state], [x, y])
    assert found[3:] == pytest.approx(k06_dynamics(*state, (x, y)), rel=1e-12, abs=1e-12)
    behind = interconnect([PLANT, COMMANDS]).to_numpy().derivatives(0.0, [1.0, 2.0, 0.7, *state], [x, y])
    assert found == pytest.approx(behind, rel=1e-9, abs=1e-9)


def test_a_plant_that_is_not_driven_by_a_force_vector_is_refused():
    bent = hoverdemon().with_effects([effect("thrust_yaw_torque", 0.1)])
    with pytest.raises(InputError, match="expected thrust and rudder to act only as a force vector"):
        force_driven(bent.plant())
    with pytest.raises(InputError, match="expected the inputs thrust and rudder"):
        force_driven(four_fan().plant())


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_commands_give_back_the_force(x, y):
    for reversing in (False, True):
        thrust, rudder = force_to_command(reversing=reversing).to_numpy().outputs(0.0, (), [x, y])
        assert thrust * np.cos(rudder) == pytest.approx(x, abs=1e-12)
        assert thrust * np.sin(rudder) == pytest.approx(y, abs=1e-12)
        assert (thrust >= 0) if not reversing else abs(rudder) <= np.pi / 2


def test_components_in_the_dead_zone_count_as_zero():
    f = force_to_command(dead_zone=0.05).to_numpy()
    assert f.outputs(0.0, (), [0.05, -0.05]).tolist() == [0.0, 0.0]
    assert f.outputs(0.0, (), [0.04, -0.06]) == pytest.approx([0.06, -np.pi / 2])


# ---- what is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: stop(k1=0.0, k2=1.0), "controller: k1 must be positive, found 0"),
        (lambda: turn(k1=1.0, k2=-1.0), "controller: k2 must be positive, found -1"),
        (lambda: reverse(k1=1.0, k2=1.0, alpha=0.0), "controller: alpha must be positive"),
        (lambda: force_to_command(dead_zone=-0.1), "dead_zone must not be negative, found -0.1"),
        (lambda: Body(mass=0.0, inertia=1.0, arm=1.0), "body: mass must be positive"),
    ],
)
def test_wrong_numbers_are_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_the_reverse_laws_reference_is_not_positive_and_the_forward_laws_not_negative():
    astern = reverse(k1=1.0, k2=1.0, alpha=1.0).signal("surge_ref")
    ahead = forward(k1=1.0, k2=1.0).signal("surge_ref")
    with pytest.raises(InputError, match="out of its bounds"):
        astern.check(0.1)
    for signal in (ahead, drive(k1=1.0, k2=1.0).signal("surge_ref")):
        with pytest.raises(InputError, match="out of its bounds"):
            signal.check(-0.1)
