"""K06's propositions 2.3.2 and 2.3.4, and other systems whose answer is known."""

import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.control.analysis.polynomials import unsolvable
from hovercontrol.control.analysis.stabilizability import stabilizability
from hovercontrol.control.controllers.k06 import force_to_command
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_simulation, hoverdemon


def pushed(model):
    """A craft whose inputs are the components of its force."""
    actuation = force_to_command()
    plant = Model(model.name, model.effects, thrust=hoverdemon().thrust).plant()
    return interconnect([plant, actuation], "craft")


def names(text):
    return [f"plant.{n}" for n in text.split()]


HOVERDEMON = pushed(hoverdemon())


def test_proposition_2_3_2_no_smooth_feedback_holds_the_pose():
    found = stabilizability(HOVERDEMON)
    assert found.verdict == "impossible"
    theorem = found.byrnes_isidori
    assert theorem.pushed == tuple(names("u v r")) and theorem.carried == tuple(names("x y psi"))
    assert theorem.unmet == ""
    assert (theorem.directions, len(theorem.pushed), theorem.stabilizable) == (2, 3, False)
    assert found.brockett.onto is False  # Brockett's condition fails as well
    assert "push in 2 directions, and plant.u, plant.v, plant.r are 3" in found.sentence()
    assert found.sentence().startswith("No smooth static state feedback can hold")


def test_proposition_2_3_4_no_smooth_feedback_holds_the_heading():
    found = stabilizability(HOVERDEMON, names("u v r psi"))
    assert found.verdict == "impossible"
    assert found.brockett.onto is False and found.brockett.rank == 3
    # epsilon_3 = -d epsilon_2 is needed where epsilon_4 = 0 (K06 (2.60)); in rates: r' = -(d m/J) v'
    missed = found.brockett.missed
    d, m, J = 0.32, 2.6, 0.096
    assert missed["plant.psi"] == missed["plant.u"] == 0
    assert missed["plant.r"] != -d * m / J * missed["plant.v"]
    assert found.linearised.rank == 3 and found.linearised.uncontrollable == (0j,)
    assert found.byrnes_isidori.unmet.startswith("H1")
    assert "Brockett's condition fails" in found.sentence()


def test_forward_motion_can_be_held_and_standstill_is_left_open():
    reduced = names("u v r")
    moving = stabilizability(HOVERDEMON, reduced, at={"plant.u": 1.1})
    assert moving.verdict == "possible" and moving.linearised.rank == 3
    assert "its linearisation is controllable" in moving.sentence()
    rest = stabilizability(HOVERDEMON, reduced)  # K06's stop law holds it, but not by a linearisation
    assert rest.verdict == "undecided" and rest.brockett.onto is None


@pytest.mark.slow
def test_sway_drag_makes_a_heading_possible_but_not_a_pose():
    craft = pushed(c17_simulation())
    assert stabilizability(craft, names("psi u v r")).verdict == "possible"
    pose = stabilizability(craft)
    assert pose.verdict == "impossible" and pose.byrnes_isidori.stabilizable is False


def block(derivatives, inputs=("a",), parameters=()):
    x = [Signal(n) for n in derivatives]
    return Block("b", x, [Signal(n) for n in inputs], [], parameters, derivatives)


x, y, z, a, b = sp.symbols("x y z a b", real=True)


def seconds(**rates):
    """A Block without dimensions but for a rate of 1/s."""
    rate = Signal("rate", "1/s", start=1.0)
    inputs = sorted({s.name for e in rates.values() for s in sp.sympify(e).free_symbols} & {"a", "b"})
    return block({n: rate.symbol * e for n, e in rates.items()}, inputs, [rate])


def test_brocketts_integrator_is_the_classic_that_fails():
    found = stabilizability(seconds(x=a, y=b, z=x * b - y * a))
    assert found.verdict == "impossible"
    assert found.brockett.onto is False and found.brockett.missed == {"x": 0, "y": 0, "z": 1}


def test_an_unstable_mode_that_no_input_moves_is_impossible_a_stable_one_possible():
    unstable = stabilizability(seconds(x=a, y=y))
    assert unstable.verdict == "impossible" and unstable.linearised.uncontrollable == (1 + 0j,)
    stable = stabilizability(seconds(x=x + a, y=-3 * y))
    assert stable.verdict == "possible" and stable.linearised.uncontrollable == (-3 + 0j,)


def test_modes_on_the_axis_are_told_with_their_multiplicity():
    found = stabilizability(seconds(x=a, y=z, z=0 * a + x**3))
    assert found.linearised.uncontrollable == (0j, 0j)


def test_a_fully_pushed_body_can_hold_its_pose():
    """Byrnes and Isidori's condition met: as many directions as states that are pushed."""
    found = stabilizability(seconds(x=a, y=b, z=x * (1 + y)))
    assert found.verdict == "possible"


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: stabilizability(hoverdemon().plant()), "not affine in the input 'thrust'.*force_to_command"),
        (lambda: stabilizability(HOVERDEMON, ["plant.x"]), "plant.x' depends on the state plant.psi"),
        (lambda: stabilizability(HOVERDEMON, ["plant.z"]), "no state 'plant.z'; did you mean"),
        (lambda: stabilizability(HOVERDEMON, at={"force_z": 1.0}), "did you mean 'force_"),
        (lambda: stabilizability(HOVERDEMON, at={"plant.u": 1.0}), "no equilibrium: plant.x' = 1.0"),
        (lambda: stabilizability(seconds(x=y, y=x)), "needs states and inputs"),
        (lambda: stabilizability(seconds(x=a + sp.sin(time))), "depends on time|dimension|unit|add"),
    ],
)
def test_what_the_checks_cannot_take_is_refused(call, text):
    with pytest.raises(InputError, match=text):
        call()


def test_unsolvable_says_yes_only_with_proof():
    assert unsolvable([x + y, x - y], [x, y], nonzero=x)
    assert unsolvable([x * sp.cos(z) - y * sp.sin(z), x * sp.sin(z) + y * sp.cos(z)], [x, y, z], nonzero=y)
    assert not unsolvable([x * y - 1], [x, y], nonzero=x)
    assert not unsolvable([sp.tanh(x)], [x], nonzero=x)  # true, but no polynomial: not decided
