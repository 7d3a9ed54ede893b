"""Outputs that are not asked for are not computed: in runs, in sweeps and in the generated C."""

import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
from hovercontrol.blocks.backends.c import c_source
from tests.blocks.backends.sampled_by_hand import sampled_loop

# x'' = -x from x = 1:  x = cos t, v = -sin t
X, V, W = hc.Signal("x", "m", start=1.0), hc.Signal("v", "m/s"), hc.Signal("w", "1/s", start=1.0)
ENERGY, ANGLE = hc.Signal("energy", "m^2/s^2"), hc.Signal("angle", "rad")
SWING = hc.Block(
    "swing", [X, V], [], [X, ENERGY, ANGLE], [W],
    {"x": V.symbol, "v": -(W.symbol**2) * X.symbol},
    {"energy": sp.Symbol("twice", real=True) / 2,
     "angle": sp.atan2(-V.symbol / W.symbol, X.symbol)},
    {"twice": V.symbol**2 + (W.symbol * X.symbol) ** 2},
)  # fmt: skip
GRID = np.linspace(0.0, 2.0, 9)
EXACT = {"x": np.cos(GRID), "energy": np.full(9, 0.5), "angle": GRID}
TIGHT = {"rtol": 1e-9, "atol": 1e-12}


def runs_of(block):
    yield lambda *a, **k: hc.simulate(block, *a, **k)
    yield block.compile().simulate


@pytest.mark.parametrize("names", [["angle"], ["angle", "x"], ["energy"], []])
def test_a_run_has_the_outputs_asked_for_in_their_order(names):
    for run in runs_of(SWING):
        found = run(GRID, outputs=names, **TIGHT)
        assert list(found.output_labels or ()) == names
        rows = np.reshape(found.outputs, (len(names), len(GRID)))
        for name, row in zip(names, rows, strict=True):
            np.testing.assert_allclose(row, EXACT[name], atol=1e-8)
        np.testing.assert_allclose(found.states, [np.cos(GRID), -np.sin(GRID)], atol=1e-8)


def test_a_sampled_loop_and_its_delay_are_the_same_with_one_output():
    block, grid = sampled_loop(), np.linspace(0.0, 1.0, 21)
    push = np.where(grid > 0.3, 0.3, 0.0)
    chosen = block.outputs[-1].name
    for run in runs_of(block):
        every, one = run(grid, {"push": push}), run(grid, {"push": push}, outputs=[chosen])
        assert np.array_equal(one.outputs, np.atleast_2d(every.outputs)[-1])
        assert np.array_equal(one.states, every.states)


def test_a_sweep_has_the_figures_of_the_outputs_asked_for():
    compiled = SWING.compile()
    options = {"params": {"swing.w": [0.5, 1.0, 1.5]}, "band": {"angle": 0.1}, **TIGHT}
    found = compiled.sweep(GRID, outputs=["angle"], **options)
    assert found.outputs == ("angle",) and found.final.shape == (3, 1)
    np.testing.assert_allclose(found["angle"].final, [1.0, 2.0, 3.0], atol=1e-8)
    last = found.states_final[:, 0]
    np.testing.assert_allclose(last, np.cos([1.0, 2.0, 3.0]), atol=1e-8)


def test_the_generated_c_has_no_trace_of_the_others():
    text = c_source(SWING.with_outputs(["x"]))
    assert "atan2" in c_source(SWING) and "atan2" not in text
    assert "twice" in c_source(SWING) and "twice" not in text


@pytest.mark.slow
def test_jax_computes_the_outputs_asked_for():
    pytest.importorskip("jax")
    functions = SWING.to_jax()
    run = functions.run_function(GRID, step=0.01, outputs=["angle"])()
    assert set(run) == {"x", "v", "angle"}
    np.testing.assert_allclose(run["angle"], GRID, atol=1e-8)
    found = functions.simulate(GRID, method="rk4", step=0.01, outputs=["energy"])
    np.testing.assert_allclose(found.outputs, 0.5, atol=1e-8)
    swept = functions.sweep(GRID, params={"swing.w": [0.5, 1.5]}, step=0.01, outputs=["angle"])
    np.testing.assert_allclose(swept["angle"].final, [1.0, 3.0], atol=1e-8)
    with pytest.raises(hc.InputError, match="unknown output 'x'"):
        swept["x"]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["angel"], "block 'swing': unknown output 'angel'; did you mean 'angle'?"),
        (["x", "x"], "block 'swing': the output 'x' is listed twice"),
        ("x", "outputs: expected .*, found 'x'"),
    ],
)
def test_a_wrong_name_is_refused_in_one_line(names, said):
    for run in runs_of(SWING):
        with pytest.raises(hc.InputError, match=said.replace("?", r"\?")) as error:
            run(GRID, outputs=names)
        assert "\n" not in str(error.value)
