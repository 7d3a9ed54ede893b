"""Which changes of sign leave a model's equations the same."""

import sympy as sp

import hovercontrol as hc
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.diagnose.laws.symmetry import broken_by, symmetries


def motor(extra=0):
    w, u = hc.Signal("w", "rad/s"), hc.Signal("u", "V")
    k, d = hc.Signal("k", "rad/s^2/V", start=3.0), hc.Signal("d", "1/s", start=0.5)
    c = hc.Signal("c", "rad/s^2", start=0.7)
    slope = k.symbol * u.symbol - d.symbol * w.symbol + extra * c.symbol
    return as_model(hc.Block("motor", [w], [u], [w], [k, d, c], {"w": slope}))


def test_a_motor_is_the_same_in_both_directions_unless_a_constant_load_hangs_on_it():
    assert [dict(s) for s in symmetries(motor())] == [{"w": -1, "u": -1}]
    assert symmetries(motor(extra=1)) == ()


def test_a_craft_is_the_same_to_port_and_to_starboard():
    (signs,) = symmetries(hc.vehicle("c17_experiment"))
    assert signs == dict.fromkeys(("y", "psi", "v", "r", "rudder"), -1)


def test_an_odd_law_keeps_the_symmetry_of_a_motor_and_an_even_one_breaks_it():
    model = motor()
    signs = symmetries(model)
    odd, even = (model.effect_class(f"law_w__{form}") for form in ("abs_w__w", "sqr_w"))
    assert (broken_by(odd, signs), broken_by(even, signs)) == (0, 1)


def test_a_pendulum_is_symmetric_about_its_rest():
    q, w, tau = hc.Signal("q", "rad"), hc.Signal("w", "rad/s"), hc.Signal("tau", "N*m")
    g, a = hc.Signal("g", "1/s^2", start=9.0), hc.Signal("a", "1/(kg*m^2)", start=1.0)
    pull = a.symbol * tau.symbol - g.symbol * sp.sin(q.symbol)
    model = as_model(hc.Block("pendulum", [q, w], [tau], [q], [g, a], {"q": w.symbol, "w": pull}))
    assert [dict(s) for s in symmetries(model)] == [{"q": -1, "w": -1, "tau": -1}]
