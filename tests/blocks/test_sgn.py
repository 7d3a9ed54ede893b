"""Dry friction changes sign with the velocity; its regularised form does so over a width."""

import numpy as np
import pytest
import sympy as sp

from hovercontrol.blocks.sgn import regularise, sgn
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.model import Model

V, W = sp.symbols("v w", real=True)


def test_the_regularised_sign_is_a_hyperbolic_tangent():
    assert regularise(3 * sgn(V, W) ** 2 + V) == 3 * sp.tanh(V / W) ** 2 + V


def test_a_sign_within_a_sign_is_regularised_too():
    assert not regularise(sgn(V + sgn(V, W), W)).has(sgn)


@pytest.mark.parametrize("symbol", [V, W])
def test_its_derivative_is_that_of_the_regularised_form(symbol):
    exact = sp.diff(sp.tanh(V / W), symbol)
    kept = regularise(sp.diff(sgn(V, W), symbol))
    for v, w in [(0.003, 0.01), (-0.02, 0.01), (0.0, 0.5)]:
        assert float(kept.subs({V: v, W: w})) == pytest.approx(float(exact.subs({V: v, W: w})), rel=1e-12)


def test_friction_becomes_the_sign_as_its_width_goes_to_zero():
    plant = Model("puck", [effect("surge_coulomb", 1.35)]).plant()
    u = np.array([-0.7, -0.01, 0.01, 0.7])
    x = np.zeros((6, 4))
    x[3] = u
    worst = []
    for width in (1e-1, 1e-2, 1e-3, 1e-4):
        friction = plant.to_numpy().derivatives(0.0, x, (), {"plant.surge_coulomb_width": width})[3]
        worst.append(np.abs(friction + 1.35 * np.sign(u)).max())
    assert worst == sorted(worst, reverse=True)
    assert worst[0] > 1.0
    assert worst[-1] < 1e-12


def test_at_rest_there_is_no_friction_and_no_division_by_zero():
    plant = Model("puck", [effect("surge_coulomb", 1.35, width=1e-9)]).plant()
    assert plant.to_numpy().derivatives(0.0, np.zeros(6))[3] == 0.0


def test_latex_writes_it_as_the_papers_do():
    assert sp.latex(sgn(V, W)) == r"\operatorname{sgn}\left(v\right)"
    assert sp.latex(sgn(V, W) ** 2).endswith("^{2}")
