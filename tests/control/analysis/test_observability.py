"""What a motion tells about coefficients: excitation (14a-c) and the Gramian (6) of C17."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.integrate import quad_vec, solve_ivp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.analysis import excitation, observability_gramian, signals_of
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import circle, ellipse
from hovercontrol.craft.models.vehicles import c17_simulation, four_fan

MODEL = c17_simulation()
PLANT = MODEL.plant()
DRAG = [n for n in MODEL.linear_coefficients() if n.endswith(("coulomb", "drag"))]


def closed_loop(reference, seconds, start):
    loop = interconnect([PLANT.with_values(start), tracking_controller(MODEL), reference], "loop")
    t = np.arange(0, seconds + 0.005, 0.01)
    return t, signals_of(simulate(loop, t))


@pytest.fixture(scope="module")
def table_one():
    """C17 Table I, 0-15 s: the ellipse."""
    return closed_loop(ellipse(1.5, 2.5, -1.0, np.pi / 2), 15.0, {"y": 1.5, "u": 1.0})


@pytest.fixture(scope="module")
def steady_circle():
    t, s = closed_loop(circle(2.0), 30.0, {"x": 1.8, "psi": np.pi / 2, "u": 2.0})
    late = t > 25
    return t[late], {name: values[late] for name, values in s.items()}


def constant(t, **values):
    full = dict.fromkeys(("u", "v", "r", "thrust", "rudder"), 0.0) | values
    return {name: np.full(len(t), value) for name, value in full.items()}


# ---- (14a-c) ------------------------------------------------------------------------------------


def test_at_constant_surge_friction_and_drag_cannot_be_told_apart():
    t = np.linspace(0, 2, 21)
    names = ["surge_coulomb", "surge_linear_drag"]
    e = excitation(PLANT, t, {"u": np.full(21, 2.5)}, names)
    (surge,) = e.sets
    assert not e.observable and not surge.independent and surge.not_excited == ()
    (hidden,) = surge.directions
    assert str(hidden) == "surge_coulomb - 0.4 surge_linear_drag"
    assert hidden.sentence() == "+1 m/s^2 surge_coulomb with -0.4 1/s surge_linear_drag"
    assert hidden.change == pytest.approx({"surge_coulomb": 1.0, "surge_linear_drag": -1 / 2.5})
    half = np.sqrt(0.5)
    assert hidden.normalised == pytest.approx({"surge_coulomb": half, "surge_linear_drag": -half})
    np.testing.assert_allclose(surge.gram, np.ones((2, 2)))
    np.testing.assert_allclose(surge.singular_values, [np.sqrt(2), 0], atol=1e-12)
    assert surge.condition > 1e12


def test_on_a_straight_run_sway_and_yaw_are_not_excited_at_all():
    t = np.linspace(0, 2, 201)
    s = constant(t, thrust=2.0) | {"u": 1 + np.sin(3 * t), "thrust": 2 + np.cos(5 * t)}
    e = excitation(PLANT, t, s)
    surge, sway, yaw = e.sets
    assert surge.independent
    assert sway.not_excited == ("sway_coulomb", "sway_linear_drag", "thrust")
    assert yaw.not_excited == ("yaw_coulomb", "yaw_linear_drag", "rudder_torque")
    assert np.isinf(sway.condition) and sway.gram.shape == (0, 0)
    # thrust is seen in surge; the rest is lost
    lost = ("sway_coulomb", "sway_linear_drag", "yaw_coulomb", "yaw_linear_drag", "rudder_torque")
    assert e.joint.not_excited == lost
    assert e.sentence() == f"not observable; not excited at all: {', '.join(lost)}"


def test_the_functions_of_each_equation_are_those_of_c17():
    t = np.linspace(0, 1, 5)
    e = excitation(PLANT, t, constant(t, u=1.0, v=1.0, r=1.0, thrust=1.0, rudder=0.5))
    assert [s.equation for s in e.sets] == ["u", "v", "r"]
    assert e.sets[0].functions == {
        "surge_coulomb": "-sgn(u, plant.surge_coulomb_width)",
        "surge_linear_drag": "-u",
        "thrust": "thrust*cos(rudder)",
    }
    assert e.sets[1].functions["thrust"] == "thrust*sin(rudder)"
    assert e.sets[2].functions["rudder_torque"] == "-thrust*sin(rudder)"
    assert e.sets[2].rms["rudder_torque"] == pytest.approx(np.sin(0.5))


def test_a_steady_circle_shows_one_number_for_each_equation(steady_circle):
    """All eight functions are constant: of eight directions three are seen."""
    e = excitation(PLANT, *steady_circle)
    assert [len(s.directions) for s in e.sets] == [2, 2, 2]
    assert len(e.joint.directions) == 5
    t, s = steady_circle
    surge = e.sets[0].directions
    ratio = 1 / s["u"].mean()
    assert any(str(d) == f"surge_coulomb - {ratio:.3g} surge_linear_drag" for d in surge)
    W = observability_gramian(PLANT, t, s)
    assert not W.observable and len(W.hidden) == 5 and np.isinf(W.condition)
    assert all(np.isinf(v) for v in W.std.values())


@pytest.mark.parametrize("vector", ["excitation", "gramian"])
def test_a_hidden_direction_leaves_the_derivatives_as_they_are(steady_circle, vector):
    t, s = steady_circle
    if vector == "excitation":
        directions = excitation(PLANT, t, s).joint.directions
    else:
        directions = observability_gramian(PLANT, t, s).hidden
    x = np.array([s[n] for n in ("x", "y", "psi", "u", "v", "r")])
    u = np.array([s["thrust"], s["rudder"]])
    f = PLANT.to_numpy().derivatives
    for d in directions:
        moved = {f"plant.{n}": MODEL.coefficients()[n] + v for n, v in d.change.items()}
        # the simulated circle is steady to within the solver's tolerance
        np.testing.assert_allclose(f(t, x, u, moved), f(t, x, u), atol=1e-5)


def test_table_one_excites_all_coefficients(table_one):
    e = excitation(PLANT, *table_one)
    assert e.observable and all(s.independent for s in e.sets)
    assert e.joint.condition == pytest.approx(18.2, rel=0.02)
    assert [s.condition for s in e.sets] == pytest.approx([22.0, 9.7, 4.3], rel=0.02)


def test_dependent_sets_do_not_mean_that_nothing_can_be_told():
    """C17 section V says 'iff'; thrust seen in surge resolves what sway alone cannot.

    Here T sin(theta) follows v, so (14b) is dependent; yet u' gives c7, and then v' gives c4.
    """
    t = np.linspace(0, 10, 2001)
    v = np.sin(t) + 1.5 * np.sin(2.3 * t)
    along, across = 3 + np.cos(1.7 * t), v
    s = {
        "u": 2 + np.sin(0.7 * t) + np.cos(3 * t),
        "v": v,
        "thrust": np.hypot(along, across),
        "rudder": np.arctan2(across, along),
    }
    names = [n for n in MODEL.linear_coefficients() if not n.startswith(("yaw", "rudder"))]
    e = excitation(PLANT, t, s, names)
    surge, sway = e.sets[:2]
    assert surge.independent
    assert [str(d) for d in sway.directions] == ["sway_linear_drag + thrust"]
    assert e.observable and observability_gramian(PLANT, t, s, names).observable


def test_any_block_will_do():
    """Four fans that all push alike leave the torque coefficient unknown."""
    t = np.linspace(0, 5, 501)
    plant = four_fan().plant()
    fans = {f.name: 0.1 + 0.05 * np.sin(t * (1 + ("rear" in f.name))) for f in four_fan().fans}
    motion = {"u": np.sin(3 * t), "v": np.cos(t), "r": np.sin(2 * t)}
    e = excitation(plant, t, motion | fans)
    assert e.joint.not_excited == ("fan_torque",)


# ---- the Gramian ------------------------------------------------------------------------------


def test_the_gramian_is_the_integral_of_c17():
    """(6), inner integral to t: by adaptive quadrature of functions known in closed form."""
    t = np.linspace(0, 2, 4001)

    def G(tau):
        u = 2 + np.sin(tau)
        return np.array([[-np.tanh(u / 0.01), -u, 3 + np.cos(2 * tau)]])

    def gamma(tau):
        travel = 2 * tau + 1 - np.cos(tau)
        return np.array([[-tau, -travel, 3 * tau + np.sin(2 * tau) / 2]])

    def integrand(tau):
        row = np.hstack([np.eye(1), gamma(tau)])
        return row.T @ row

    np.testing.assert_allclose(gamma(2.0), quad_vec(G, 0, 2)[0], atol=1e-9)
    wanted, _ = quad_vec(integrand, 0, 2)
    names = ["surge_coulomb", "surge_linear_drag", "thrust"]
    s = {"u": 2 + np.sin(t), "thrust": 3 + np.cos(2 * t), "rudder": 0 * t, "v": 0 * t}
    W = observability_gramian(PLANT, t, s, names, scaled=False)
    assert W.states == ("u", "v")
    pick = np.ix_([0, 2, 3, 4], [0, 2, 3, 4])  # v' is not excited: T sin(theta) = 0
    np.testing.assert_allclose(W.matrix[pick], wanted, rtol=1e-6)
    np.testing.assert_allclose(W.eigenvalues, np.linalg.eigvalsh(W.matrix), rtol=1e-6, atol=1e-10)
    schur = wanted[1:, 1:] - np.outer(wanted[0, 1:], wanted[0, 1:]) / wanted[0, 0]
    np.testing.assert_allclose(W.coefficient_matrix, schur, rtol=1e-4, atol=1e-6)
    std = np.sqrt(np.diag(np.linalg.inv(schur)))
    np.testing.assert_allclose(list(W.std.values()), std, rtol=1e-3)
    vector = np.array(list(W.weakest.normalised.values()))
    low = np.linalg.eigvalsh(schur)[0]
    assert vector @ schur @ vector == pytest.approx(low, rel=1e-3)


def test_the_gramian_is_that_of_the_transition_matrix():
    """By the textbook: W = integral of Phi' C' C Phi, Phi' = A Phi from (5)."""
    t = np.linspace(0, 1.5, 3001)
    x, k, b = Signal("x", "m"), Signal("k", "1/s", start=1.0), Signal("b", "m/s", start=1.0)
    block = Block("tank", [x], [], [x], [k, b], {"x": -k.symbol * x.symbol + b.symbol})

    def rates(tau, z):
        phi = z[:9].reshape(3, 3)
        A = np.zeros((3, 3))
        A[0, 1:] = -np.exp(-tau), 1.0
        C = np.array([[1.0, 0.0, 0.0]])
        return np.concatenate([(A @ phi).ravel(), (phi.T @ C.T @ C @ phi).ravel()])

    z0 = np.concatenate([np.eye(3).ravel(), np.zeros(9)])
    z = solve_ivp(rates, (0, 1.5), z0, rtol=1e-10, atol=1e-12).y[:, -1]
    W = observability_gramian(block, t, {"x": np.exp(-t)})
    np.testing.assert_allclose(W.matrix, z[9:].reshape(3, 3), rtol=1e-6)


def test_sampling_does_not_change_the_answer():
    """Twice, four times as many samples, and uneven ones."""

    def answers(t):
        s = {
            "u": 2 + np.sin(t),
            "v": 0.3 + np.cos(1.7 * t),
            "r": 0.2 + np.sin(2.3 * t),
            "thrust": 3 + np.sin(3.1 * t),
            "rudder": 0.4 * np.cos(1.1 * t),
        }
        W, e = observability_gramian(PLANT, t, s), excitation(PLANT, t, s)
        return np.concatenate([W.eigenvalues, e.joint.singular_values, list(W.std.values())])

    fine = answers(np.linspace(0, 6, 24001))
    for n in (1201, 2401):
        np.testing.assert_allclose(answers(np.linspace(0, 6, n)), fine, rtol=5e-3)
    uneven = np.sort(np.random.default_rng(0).uniform(0, 6, 6000))
    np.testing.assert_allclose(answers(np.concatenate([[0], uneven, [6]])), fine, rtol=5e-3)


def test_on_table_one_the_sway_drag_is_weakest_when_thrust_is_known(table_one):
    """C17 section VIII-A: zeta_3 and zeta_4 converge slowest, the ellipse is not rich in sway."""
    W = observability_gramian(PLANT, *table_one, DRAG)
    assert list(W.weakest.parts) == ["sway_coulomb", "sway_linear_drag"]
    assert max(W.std, key=W.std.get) == "sway_coulomb"
    assert "sway_coulomb" in W.sentence() and W.table().splitlines()[1].startswith("sway_coulomb")
    assert W.condition == pytest.approx(3.46e4, rel=0.02)


def test_on_table_one_with_thrust_to_be_found_surge_friction_is_weakest(table_one):
    """With all eight unknown, surge friction and thrust hide each other more than sway drag."""
    W = observability_gramian(PLANT, *table_one)
    assert W.observable and W.hidden == ()
    assert next(iter(W.weakest.parts)) == "surge_coulomb" and "thrust" in W.weakest.parts
    order = sorted(W.std, key=lambda n: -W.std[n] / W.sizes[n])
    assert order[:2] == ["surge_coulomb", "sway_coulomb"]
    assert W.condition == pytest.approx(3.25e5, rel=0.02)


def test_nominal_sizes_scale_the_gramian(table_one):
    t, s = table_one
    scaled = observability_gramian(PLANT, t, s)
    plain = observability_gramian(PLANT, t, s, scaled=False)
    sizes = np.array([scaled.sizes[n] for n in (*scaled.states, *scaled.coefficients)])
    np.testing.assert_allclose(scaled.matrix, plain.matrix * np.outer(sizes, sizes), rtol=1e-12)
    assert set(plain.sizes.values()) == {1.0}
    assert scaled.std == pytest.approx(plain.std)


def test_windows_are_parts_of_the_motion(table_one):
    t, s = table_one
    W = observability_gramian(PLANT, t, s, window=(5.0, 10.0))
    part = (t >= 5.0) & (t <= 10.0)
    alone = observability_gramian(PLANT, t[part], {n: v[part] for n, v in s.items()})
    np.testing.assert_array_equal(W.matrix, alone.matrix)
    assert W.window == pytest.approx((5.0, 10.0))
    sliding = observability_gramian(PLANT, t, s).sliding(5.0, 2.5)
    np.testing.assert_allclose(sliding.time, [5.0, 7.5, 10.0, 12.5, 15.0])
    np.testing.assert_allclose(sliding.eigenvalues[:, 2], W.eigenvalues, rtol=1e-9)
    assert sliding.condition[2] == pytest.approx(W.condition)


def test_results_can_be_drawn_and_tabled(table_one, steady_circle):
    for motion in (table_one, steady_circle):
        e, W = excitation(PLANT, *motion), observability_gramian(PLANT, *motion)
        assert len(e.table().splitlines()) == 5
        assert len(W.table().splitlines()) == 10
        assert isinstance(e.plot(), Figure)
        spectrum, condition = W.plot(1.0).axes
        assert spectrum.get_ylabel() == "eigenvalues [s]"
        assert condition.get_xlabel() == "end of the window [s]"


def test_wrong_input_is_refused_in_one_line():
    t = np.linspace(0, 1, 11)
    s = constant(t, u=1.0)
    for analysis in (excitation, observability_gramian):
        with pytest.raises(InputError, match=r"missing signals r, rudder \(needed: u, v, r,"):
            analysis(PLANT, t, {n: v for n, v in s.items() if n not in ("r", "rudder")})
        with pytest.raises(InputError, match="no parameter 'sway_colomb'; did you mean"):
            analysis(PLANT, t, s, ["sway_colomb"])
        with pytest.raises(InputError, match="increasing"):
            analysis(PLANT, t[::-1], s)
        with pytest.raises(InputError, match="signal 'u': expected 11 values"):
            analysis(PLANT, t, s | {"u": [1.0]})
    with pytest.raises(InputError, match="tolerance"):
        excitation(PLANT, t, s, tolerance=0.0)
    with pytest.raises(InputError, match="window: less than two samples"):
        observability_gramian(PLANT, t, s, window=(2.0, 3.0))
    W = observability_gramian(PLANT, t, s)
    for width, step in ((2.0, None), (0.0, None), (0.5, -1.0), (0.01, 0.005)):
        with pytest.raises(InputError, match="sliding"):
            W.sliding(width, step)
