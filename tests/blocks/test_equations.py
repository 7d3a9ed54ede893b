"""A Block's equations read as in the papers."""

import re

import pytest

from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import figure_eight
from hovercontrol.control.observers import kalman_bucy
from hovercontrol.craft.models.vehicles import c17_simulation, four_fan


def test_the_c17_plant_reads_as_equation_11():
    lines = c17_simulation().plant().equations().splitlines()
    assert lines == [
        "x' = u*cos(psi) - v*sin(psi)",
        "y' = u*sin(psi) + v*cos(psi)",
        "psi' = r",
        "u' = -plant.surge_coulomb*sgn(u) - plant.surge_linear_drag*u + plant.thrust*thrust*cos(rudder) + r*v",  # noqa: E501
        "v' = -plant.sway_coulomb*sgn(v) - plant.sway_linear_drag*v + plant.thrust*thrust*sin(rudder) - r*u",
        "r' = -plant.rudder_torque*thrust*sin(rudder) - plant.yaw_coulomb*sgn(r) - plant.yaw_linear_drag*r",
    ]


def blocks():
    craft = c17_simulation()
    loop = interconnect([figure_eight(3, 2), tracking_controller(craft), craft.plant()])
    return [
        craft.plant(),
        four_fan().plant(),
        tracking_controller(craft),
        loop,
        kalman_bucy(craft.plant()),
    ]


@pytest.mark.parametrize("block", blocks(), ids=lambda b: b.name)
def test_latex_has_one_balanced_line_for_each_equation(block):
    text = block.equations("latex")
    body = text.removeprefix("\\begin{align*}\n").removesuffix("\n\\end{align*}")
    lines = body.split(" \\\\\n")
    assert len(lines) == len(block.equations().splitlines())
    for line in lines:
        assert line.count("&=") == 1
        assert line.count("{") == line.count("}")
        assert not re.search(r"(?<!\\)_(?![{])[A-Za-z]{2}", line), "a bare underscore would not typeset"


def test_latex_typesets_in_matplotlibs_mathtext():
    from matplotlib.mathtext import MathTextParser

    parser = MathTextParser("agg")
    text = c17_simulation().plant().equations("latex")
    for line in text.splitlines()[1:-1]:
        parser.parse(
            "$" + line.removesuffix(r" \\").replace("&", "").replace(r"\operatorname", r"\mathrm") + "$"
        )
