"""The python-control backend: names, checked parameters, and python-control's own functions on it."""

import pickle
import warnings

import control as ct
import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, prefix
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import circle, ellipse
from hovercontrol.craft.models.vehicles import c17_experiment, c17_simulation, hoverdemon

X, U = np.array([0.1, -0.2, 0.3, 0.5, -0.1, 0.8]), np.array([1.5, 0.2])


def plant():
    return c17_simulation().plant().to_control()


def parts():
    craft = c17_simulation()
    return [ellipse(1.5, 2.5, -1, np.pi / 2), tracking_controller(craft), craft.plant()]


def test_the_system_carries_the_blocks_names_and_numbers():
    system = plant()
    assert system.state_labels == system.output_labels == ["x", "y", "psi", "u", "v", "r"]
    assert system.input_labels == ["thrust", "rudder"]
    assert system.params["plant.yaw_coulomb"] == 0.83
    assert system.isctime()
    assert c17_simulation().plant().to_control("left").name == "left"


def test_it_computes_what_the_block_computes(rng):
    block, system = c17_simulation().plant(), plant()
    for _ in range(20):
        x, u = rng.normal(size=6), rng.normal(size=2)
        p = {"plant.yaw_coulomb": rng.uniform()}
        assert np.array_equal(system.dynamics(0.0, x, u, p), block.to_numpy().derivatives(0.0, x, u, p))
        assert np.array_equal(system.output(0.0, x, u), x)


@pytest.mark.parametrize(
    "use",
    [
        lambda s, p: s.dynamics(0, X, U, params=p),
        lambda s, p: s.output(0, X, U, params=p),
        lambda s, p: s.linearize(X, U, params=p),
        lambda s, p: ct.linearize(s, X, U, params=p),
        lambda s, p: ct.input_output_response(s, [0, 1], [[1, 1], [0, 0]], X, params=p),
        lambda s, p: ct.find_operating_point(s, X, U, params=p),
    ],
)
def test_a_misspelt_key_is_refused_and_the_nearest_named(use):
    with pytest.raises(
        InputError, match=r"unknown parameter 'plant.yaw_colomb'; did you mean 'plant.yaw_coulomb'"
    ):
        use(plant(), {"plant.yaw_colomb": 1.0})


def test_a_misspelt_key_is_refused_inside_an_interconnection_too():
    wired = ct.interconnect([b.to_control() for b in parts()], name="loop", outputs=["x", "y"])
    with pytest.raises(InputError, match=r"did you mean 'plant.yaw_coulomb'"):
        ct.input_output_response(wired, [0, 0.1], 0, [0.1] * 6, params={"plant.yaw_colomb": 1.0})
    with pytest.raises(InputError, match=r"did you mean 'controller.k1'"):
        ct.input_output_response(wired, [0, 0.1], 0, [0.1] * 6, params={"controller.k_1": 1.0})


def test_inside_an_interconnection_each_key_reaches_its_own_block_only():
    craft = c17_simulation()
    wired = ct.interconnect([b.to_control() for b in parts()], name="loop", outputs=["r"])
    fused = interconnect(parts()).to_numpy()
    x = np.array([0.1, -0.2, 0.3, 0.5, -0.1, 0.8])
    for key in ("plant.yaw_coulomb", "controller.yaw_coulomb"):
        found = wired.dynamics(0.2, x, [], params={key: 3.0})
        assert np.allclose(found, fused.derivatives(0.2, x, (), {key: 3.0}), rtol=1e-12)
        assert not np.allclose(found, fused.derivatives(0.2, x))
    assert craft.coefficients()["yaw_coulomb"] == 0.83


def test_parameters_given_for_one_call_are_gone_in_the_next():
    system = plant()
    before = system.dynamics(0, X, U)
    changed = system.dynamics(0, X, U, params={"plant.yaw_coulomb": 3.0})
    assert not np.allclose(changed, before)
    assert np.array_equal(system.dynamics(0, X, U, params={}), before)


def test_parameters_are_checked_when_they_change_and_not_at_each_call(monkeypatch):
    system, calls = plant(), []
    check = type(system.block).parameter_values
    monkeypatch.setattr(
        type(system.block), "parameter_values", lambda *a, **k: calls.append(1) or check(*a, **k)
    )
    for _ in range(5):
        system.dynamics(0, X, U)
        system.output(0, X, U)
    assert len(calls) == 1
    key = "plant.yaw_coulomb"
    for value in (0.5, 0.5, 0.6):
        given = {key: value}
        system.dynamics(0, X, U, given)
        given[key] = 0.7  # what the caller does to its own mapping afterwards is no parameter
        assert system.dynamics(0, X, U, {key: value})[5] == plant().dynamics(0, X, U, {key: value})[5]
    system.params[key] = 3.0
    changed = system.dynamics(0, X, U)
    assert changed[5] == plant().dynamics(0, X, U, {key: 3.0})[5]
    with pytest.raises(InputError, match="out of its bounds"):
        system.dynamics(0, X, U, {key: -1.0})
    assert np.array_equal(system.dynamics(0, X, U), changed)
    with pytest.raises(InputError, match="expected a number"):
        system.dynamics(0, X, U, {key: np.array([0.1, 0.2])})


def test_two_craft_of_one_kind_do_not_share_a_value():
    left, right = (prefix(hoverdemon().plant(), n).to_control() for n in ("left", "right"))
    both = ct.interconnect(
        [left, right],
        inputs=["left_thrust", "left_rudder", "right_thrust", "right_rudder"],
        outputs=["left_u", "right_u"],
        name="both",
    )
    dx = both.dynamics(0.0, np.zeros(12), [1.0, 0.0, 1.0, 0.0], params={"right.thrust": 2.0})
    assert (dx[3], dx[9]) == (pytest.approx(1 / 2.6), 2.0)


def cart(drag):
    """v' = a - drag v, of every drag under the same name."""
    v, a, k = Signal("v", "m/s"), Signal("a", "m/s^2"), Signal("drag", "1/s", start=drag)
    return Block("plant", [v], [a], [v], [k], {"v": a.symbol - k.symbol * v.symbol})


def together(*systems):
    """Return the systems in one interconnection, each with its own input and output."""
    n = len(systems)
    each = [(k, 0) for k in range(n)]
    return ct.interconnect(systems, inplist=each, outlist=each, inputs=n, outputs=n, warn_duplicate=False)


def test_the_keys_follow_the_name_that_a_system_is_given():
    left, right = cart(1.0).to_control("left"), cart(3.0).to_control("right")
    both = together(left, right)
    assert both.params == {"left.drag": 1.0, "right.drag": 3.0}
    assert both.dynamics(0.0, [1.0, 1.0], [0.0, 0.0]).tolist() == [-1.0, -3.0]
    assert both.dynamics(0.0, [1.0, 1.0], [0.0, 0.0], params={"right.drag": 2.0}).tolist() == [-1.0, -2.0]
    right.update_names(name="third")
    assert right.params == {"third.drag": 3.0}
    assert ct.c2d(left, 0.1).params == left.copy().params == {"left.drag": 1.0}


def test_systems_of_one_name_keep_their_own_values_and_a_warning_says_so():
    with pytest.warns(UserWarning, match=r"'plant.drag', with the values 1 and 3: each keeps its own"):
        both = together(cart(1.0).to_control(), cart(3.0).to_control())
    assert both.dynamics(0.0, [1.0, 1.0], [0.0, 0.0]).tolist() == [-1.0, -3.0]
    fleet = ct.interconnect(
        [both, cart(5.0).to_control("plant")],
        inplist=[(0, 0), (0, 1), (1, 0)], outlist=[(0, 0), (0, 1), (1, 0)], inputs=3, outputs=3,
    )  # fmt: skip
    assert fleet.dynamics(0.0, [1.0] * 3, [0.0] * 3).tolist() == [-1.0, -3.0, -5.0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        together(cart(1.0).to_control(), cart(1.0).to_control())


def test_linearisation_is_that_of_finite_differences_on_a_plain_system():
    system = plant()
    twin = ct.nlsys(lambda t, x, u, p: system._rhs(t, x, u), None, inputs=2, outputs=6, states=6, name="twin")
    exact, rough = ct.linearize(system, X, U), ct.linearize(twin, X, U, eps=1e-7)
    for name in "ABCD":
        assert np.allclose(getattr(exact, name), getattr(rough, name), atol=1e-5)
    assert exact.state_labels == system.state_labels
    assert exact.input_labels == ["thrust", "rudder"]
    assert ct.linearize(system, X, U, name="near").name == "near"


def test_linearisation_is_exact():
    A = c17_simulation().plant().linearize(X, U).A
    cos, sin, (u, v, r) = np.cos(0.3), np.sin(0.3), X[3:]
    assert np.allclose(A[0], [0, 0, -u * sin - v * cos, cos, -sin, 0], atol=1e-15)
    slope = (1 - np.tanh(0.5 / 0.01) ** 2) / 0.01
    assert A[3] == pytest.approx([0, 0, 0, -1.35 * slope, r, v], abs=1e-14)
    assert A[5, 5] == pytest.approx(-0.48 - 0.83 * (1 - np.tanh(80.0) ** 2) / 0.01)


def test_an_operating_point_is_found_and_linearised():
    model = c17_simulation().with_coefficients({"surge_coulomb": 0.0, "surge_linear_drag": 0.5})
    system = model.plant().to_control()
    point = ct.find_operating_point(
        system,
        [0, 0, 0, 1, 0, 0],
        [1.0, 0.0],
        iu=[1],
        ix=[0, 1, 2],
        y0=[0, 0, 0, 1, 0, 0],
        iy=[3],
        idx=[3, 4, 5],
    )
    assert point.inputs[0] == pytest.approx(0.5 * 1.0 / 0.75, rel=1e-6)
    assert np.allclose(system.linearize(point).A, system.linearize(point.states, point.inputs).A)


def test_python_controls_simulation_is_ours_and_plots():
    system, t = plant(), np.linspace(0, 1, 21)
    u = np.vstack([np.ones(21), 0.2 * np.ones(21)])
    theirs = ct.input_output_response(system, t, u, X, solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-11})
    ours = simulate(c17_simulation().plant(), t, u, X, rtol=1e-9, atol=1e-11)
    assert np.allclose(theirs.states, ours.states, atol=1e-6)
    assert theirs.plot().figure is not None
    assert ours.plot().figure is not None


def test_copies_work_and_are_independent():
    system = plant()
    twin = system.copy(name="twin")
    assert twin.name == "twin"
    assert np.array_equal(twin.dynamics(0, X, U), system.dynamics(0, X, U))
    twin.dynamics(0, X, U, params={"twin.yaw_coulomb": 3.0})
    assert np.array_equal(system.dynamics(0, X, U), plant().dynamics(0, X, U))
    with pytest.raises(InputError):
        twin.dynamics(0, X, U, params={"plant.yaw_coulomb": 3.0})


def test_changing_the_parameters_of_a_copy_leaves_the_original_alone():
    system = plant()
    twin = system.copy(name="twin")
    twin.params["twin.yaw_coulomb"] = 3.0
    assert twin.dynamics(0, X, U)[5] != plant().dynamics(0, X, U)[5]
    assert np.array_equal(system.dynamics(0, X, U), plant().dynamics(0, X, U))


def test_a_fused_loop_can_be_pickled():
    system = interconnect(parts(), "loop").to_control()
    twin = pickle.loads(pickle.dumps(system))
    assert np.array_equal(twin.dynamics(0.1, X, []), system.dynamics(0.1, X, []))
    assert twin.state_labels == system.state_labels
    with pytest.raises(InputError):
        twin.dynamics(0.1, X, [], params={"plant.yaw_colomb": 1.0})


def test_the_fused_loop_is_python_controls_interconnection_of_the_blocks(rng):
    fused = interconnect(parts(), "loop").to_control()
    wired = ct.interconnect([b.to_control() for b in parts()], name="wired", outputs=fused.output_labels)
    for _ in range(20):
        x, t = rng.normal(size=6), rng.uniform(0, 9)
        assert np.allclose(fused.dynamics(t, x, []), wired.dynamics(t, x, []), rtol=1e-12, atol=1e-12)
        assert np.allclose(fused.output(t, x, []), wired.output(t, x, []), rtol=1e-12, atol=1e-12)


def test_a_reference_alone_is_a_static_system():
    out = ct.input_output_response(circle(1.0).to_control(), [0, np.pi], 0)
    assert out.outputs[0] == pytest.approx([1.0, -1.0])


@pytest.mark.parametrize("point", [(X[:4], U), (X, np.zeros(3))])
def test_a_linearisation_at_a_point_of_the_wrong_size_is_refused(point):
    with pytest.raises(InputError, match="expected"):
        c17_experiment().plant().linearize(*point)


@pytest.mark.parametrize("step", [None, 0.1])
def test_states_of_another_number_are_refused_in_one_line(step):
    system = c17_experiment().plant().to_control(step=step)
    for x, u in ((X[:4], U), (X, [1.0])):
        with pytest.raises(InputError, match=r"expected 6 states and 2 inputs, found shapes"):
            system.dynamics(0.0, x, u)
