"""Points without derivatives: every design and linearisation names the equation and the point in one line."""

import control
import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc


def tank(law, shown=None):
    """h' = law(h, q), dimensionless; `shown` is a further output."""
    h, q, k = hc.Signal("h"), hc.Signal("q"), hc.Signal("k", "1/s", start=1.0)
    outputs = [h, hc.Signal("z")] if shown else [h]
    rates = {"h": k.symbol * law(h.symbol, q.symbol)}
    return hc.Block("tank", [h], [q], outputs, [k], rates, {"z": shown(h.symbol, q.symbol)} if shown else {})


SINGULAR = {
    "root": (tank(lambda h, q: q - sp.sqrt(h)), "h' has no finite derivative by h at h = 0"),
    "turbulent flow": (tank(lambda h, q: q - sp.sign(h) * sp.sqrt(sp.Abs(h))), "h' has no .* by h at h = 0"),
    "power": (tank(lambda h, q: q - h**0.7), "h' has no finite derivative by h"),
    "angle": (tank(lambda h, q: sp.atan2(q, h) - h), "h' has no finite derivative by h at h = 0, q = 0"),
    "root of a command": (tank(lambda h, q: sp.sqrt(q) - h), "h' has no finite derivative by q"),
    "logarithm": (tank(lambda h, q: q + sp.log(h)), "h' has no finite derivative by h"),
    "ratio": (tank(lambda h, q: q - 1 / h), "h' has no finite derivative by h"),
    "ratio in an output": (
        tank(lambda h, q: q - h, lambda h, q: q / h),
        "output z has no .* by h at h = 0, q",
    ),
}
WAYS = {
    "linearize": lambda plant: plant.linearize([0.0], [0.0]),
    "without friction": lambda plant: plant.linearize([0.0], [0.0], friction="none"),
    "control.linearize": lambda plant: control.linearize(plant.to_control(), [0.0], [0.0]),
    "with held inputs": lambda plant: control.linearize(plant.to_control(step=0.1), [0.0], [0.0]),
    "lqr": lambda plant: hc.lqr(plant, {"h": 0.0}, max_states={"h": 1.0}, max_inputs={"q": 1.0}),
    "place": lambda plant: hc.place(plant, {"h": 0.0}, poles=[-1.0]),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SINGULAR)
def test_a_point_without_derivatives_is_named(name, way):
    plant, said = SINGULAR[name]
    with pytest.raises(hc.InputError, match=said) as error:
        WAYS[way](plant)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["root", "turbulent flow", "root of a command"])
def test_a_trim_without_derivatives_is_found_and_not_linearised(name):
    plant, said = SINGULAR[name]
    trim = plant.trim(inputs={"q": 0.0})
    assert trim.states == {"h": 0.0}
    with pytest.raises(hc.InputError, match=said):
        trim.linearize()


def test_optimal_control_from_a_point_without_derivatives_is_refused():
    system = SINGULAR["root"][0].to_control(step=0.1)
    cost = control.optimal.quadratic_cost(system, [[1.0]], [[1.0]], x0=[1.0])
    with pytest.raises(hc.InputError, match="h' has no finite derivative by h at h = 0"):
        hc.solve_ocp(system, np.arange(5) * 0.1, [0.0], cost)


@pytest.mark.parametrize(
    ("law", "slope"), [(lambda h: -2 * h + abs(h), -2.0), (lambda h: -sp.Max(h, 0), -0.5)]
)
def test_a_kink_has_the_mean_of_both_slopes(law, slope):
    assert tank(lambda h, q: law(h) + q).linearize([0.0], [0.0]).A.item() == slope
