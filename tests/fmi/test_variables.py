"""Names, units and value references of an FMU's variables."""

import math

import pytest

from hovercontrol import Block, InputError, Signal
from hovercontrol.blocks.backends.c import partial_entries
from hovercontrol.blocks.friction import with_modes
from hovercontrol.blocks.units import conversion_factor
from hovercontrol.fmi.exporter.structure import Structure
from hovercontrol.fmi.exporter.units import DEGREES, fmi_unit
from hovercontrol.fmi.exporter.variables import Interface

from .blocks import BLOCKS


@pytest.mark.parametrize("name", BLOCKS)
def test_names_are_unique_and_references_follow_the_layout_of_the_runtime(name):
    interface = Interface(BLOCKS[name], "events")
    b, k = interface.block, len(interface.frictions)
    assert len({v.name for v in interface.variables}) == len(interface.variables)
    n, m, q, outputs = len(b.states), len(b.inputs), len(b.parameters), len(b.outputs)
    every = 1 + 2 * n + m + q + outputs + 2 * k
    listed = {v.reference for v in interface.variables}
    assert listed == set(range(every)) - {
        1 + 2 * n + m + q + j for j, s in enumerate(b.outputs) if s.name in interface.merged
    }
    assert [v.derivative_of for v in interface.of("derivative")] == list(range(1, n + 1))
    assert [v.reference for v in interface.of("input")] == list(range(1 + 2 * n, 1 + 2 * n + m))
    assert len(interface.outputs) == outputs


def test_an_input_and_a_parameter_of_one_name_are_told_apart():
    names = [v.name for v in Interface(BLOCKS["plant"], "events").variables]
    assert "thrust" in names and "plant.thrust" in names


def test_an_output_that_is_an_input_gets_a_name_of_its_own():
    interface = Interface(BLOCKS["odd"])
    assert [v.name for v in interface.outputs] == ["w_u03c8", "u_out", "jump", "late", "cut"]
    assert interface.variables[0].name == "time_2"  # a state is called time
    assert "der(P[0,1])" in {v.name for v in interface.variables}


def test_a_name_with_an_index_stays_one_when_it_is_taken():
    s = Signal("P[0]")
    block = Block("b", inputs=(s, Signal("P_out[0]")), outputs=(s,))
    assert [v.name for v in Interface(block).outputs] == ["P_2[0]"]


@pytest.mark.parametrize("text", ["m/s", "N", "rad/s^2/(N*m)", "(m/s^2)*(rad/s^2)", "A", "1", "Pa*s"])
def test_base_units_measure_the_same_without_a_factor(text):
    unit = fmi_unit(text)
    base = "*".join(f"{name}^({power})" for name, power in unit.exponents) or "1"
    assert conversion_factor(text, base) == pytest.approx(1.0, rel=1e-14)
    assert conversion_factor(unit.name, text) == pytest.approx(1.0, rel=1e-14)


def test_rates_are_per_second_and_angles_are_shown_in_degrees():
    assert fmi_unit("rad", per_second=True) == fmi_unit("rad/s")
    assert fmi_unit("rad/s").exponents == (("s", -1), ("rad", 1))
    assert [fmi_unit(u).display for u in ("rad", "rad/s", "rad/s^2", "m/s")] == [
        "deg",
        "deg/s",
        "deg/s^2",
        None,
    ]
    assert DEGREES * math.pi == pytest.approx(180)
    for unit in ("rad", "rad/s", "rad/s^2"):
        assert conversion_factor(unit, fmi_unit(unit).display) == pytest.approx(DEGREES)


def test_a_broken_power_of_a_unit_has_a_name_and_no_base_units():
    unit = fmi_unit("m/s^2.5")
    assert (unit.name, unit.exponents, unit.quantity) == ("m/s^2.5", None, "Quantity_m_per_s2_5")


def test_a_block_with_nothing_to_show_is_refused():
    with pytest.raises(InputError, match="neither states nor outputs"):
        Interface(Block("nothing", inputs=(Signal("u"),)))
    with pytest.raises(InputError, match="'events' or 'smooth'"):
        Interface(BLOCKS["plant"], "hard")


@pytest.mark.slow("loop", "estimator")
@pytest.mark.parametrize("friction", ["events", "smooth"])
@pytest.mark.parametrize("name", [n for n in BLOCKS if n != "odd"])
def test_dependencies_are_the_sparsity_of_the_jacobian(name, friction):
    """Found without differentiation, so that this is a check; time is no column of the Jacobian."""
    interface = Interface(BLOCKS[name], friction)
    block = with_modes(interface.block, interface.frictions)
    n = len(block.states)
    columns = [*range(1, n + 1), *range(1 + 2 * n, 1 + 2 * n + len(block.inputs) + len(block.parameters))]
    jacobian: dict[int, set[int]] = {}
    for row, column, _ in partial_entries(block):
        jacobian.setdefault(row, set()).add(columns[column])
    structure = Structure(interface)
    for row, unknown in enumerate((*structure.derivatives, *structure.outputs)):
        assert {r for r, _ in unknown.knowns} - {0} == jacobian.get(row, set())


def kinds(interface, unknown):
    names = {v.reference: v.name for v in interface.variables}
    return {names[r]: kind for r, kind in unknown.knowns}


def test_kinds_of_dependencies_are_those_of_the_equations():
    interface = Interface(BLOCKS["plant"], "events")
    _, _, psi, u, _, _ = Structure(interface).derivatives
    assert kinds(interface, psi) == {"r": "constant"}
    found = kinds(interface, u)  # u' = -c1 sgn u - c2 u + c7 T cos(theta) + r v, and 0 while it sticks
    assert found["u"] == "discrete" and found["plant.surge_coulomb"] == "discrete"
    assert found["thrust"] == found["rudder"] == found["v"] == found["plant.thrust"] == "dependent"
    smooth = Interface(BLOCKS["plant"], "smooth")
    assert kinds(smooth, Structure(smooth).derivatives[3])["u"] == "dependent"


def test_a_tunable_factor_is_not_constant_and_a_jump_is_no_factor():
    interface = Interface(BLOCKS["odd"])
    structure = Structure(interface)
    w, p, x = (kinds(interface, u) for u in structure.derivatives)
    assert w == {"w_u03c8": "tunable", "odd_u00f6.a": "dependent"}
    assert p["u"] == p["P[0,1]"] == "tunable"
    assert x["u"] == "dependent"  # floor(u), of which the derivative is zero
    jump, late = (kinds(interface, structure.outputs[k]) for k in (2, 3))
    assert jump["u"] == "dependent" and late == {"time_2": "constant"}
