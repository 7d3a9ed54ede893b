"""What a sweep's picture is drawn over: one number, a grid of two, or the runs; against closed solutions."""

import numpy as np
import pytest

from hovercontrol import Block, InputError, Signal
from hovercontrol.blocks.backends.sweep import units_of_runs

K, V0 = np.array([0.5, 1.0, 4.0]), np.array([1.0, 2.0])


def decay():
    v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0, lower=0.0)
    return Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})


def swept(params=None, x0=None, block=None):
    return (block or decay()).compile().sweep([0.0, 0.5, 1.0], params=params, x0=x0)


def grid():
    k, v0 = (m.ravel() for m in np.meshgrid(K, V0, indexing="ij"))
    return k, v0


@pytest.mark.parametrize("order", [np.arange(6), [5, 0, 3, 2, 4, 1]])
def test_a_grid_of_two_is_a_map_with_units_whatever_the_order_of_the_runs(order):
    k, v0 = (values[order] for values in grid())
    figure = swept({"decay.k": k}, {"v": v0}).plot("v", "final")
    axes, bar = figure.axes
    assert (axes.get_ylabel(), axes.get_xlabel()) == ("decay.k [1/s]", "v.start [m/s]")
    assert bar.get_ylabel() == "final of v [m/s]"
    (mesh,) = axes.collections
    expected = V0 * np.exp(-K[:, None])
    np.testing.assert_allclose(mesh.get_array().reshape(3, 2), expected, rtol=1e-5)
    across, up = mesh.get_coordinates()[0, :, 0], mesh.get_coordinates()[:, 0, 1]
    assert np.searchsorted(across, V0).tolist() == [1, 2] and np.searchsorted(up, K).tolist() == [1, 2, 3]


def test_one_number_is_a_curve_over_it():
    figure = swept({"decay.k": K[::-1]}).plot(figure="settling")
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("decay.k [1/s]", "settling of v [s]")
    (line,) = swept({"decay.k": K[::-1]}).plot().axes[0].lines
    np.testing.assert_array_equal(line.get_xdata(), K)
    np.testing.assert_allclose(line.get_ydata(), np.exp(-K), rtol=1e-5)


@pytest.mark.parametrize("kept", [slice(1, 6), [0, 1, 2, 3, 4, 4]])
def test_what_is_no_grid_is_drawn_over_the_runs(kept):
    k, v0 = (values[kept] for values in grid())
    (axes,) = swept({"decay.k": k}, {"v": v0}).plot().axes
    assert axes.get_xlabel() == "number of the run [1]"
    np.testing.assert_allclose(axes.lines[0].get_ydata(), v0 * np.exp(-k), rtol=1e-5)


def test_a_run_that_failed_has_no_colour_on_the_map():
    x, c, d = Signal("x", start=1.0), Signal("c", "1/s", start=1.0), Signal("d", "1/s", start=0.0)
    grows = Block("g", [x], [], [x], [c, d], {"x": c.symbol * x.symbol**2 - d.symbol * x.symbol})
    params = {"g.c": np.repeat([0.1, 5.0], 2), "g.d": np.tile([0.0, 0.1], 2)}
    result = swept(params, block=grows)  # 1/(1 - c t) is infinite at 0.2 s
    assert list(result.status != 0) == [False, False, True, True]
    shown = result.plot().axes[0].collections[0].get_array().reshape(2, 2)
    assert np.ma.getmaskarray(shown).tolist() == [[False, False], [True, True]]


def test_units_come_with_the_result():
    assert swept().units == units_of_runs(decay()) == {"v": "m/s", "decay.k": "1/s", "v.start": "m/s"}


def test_an_output_that_is_not_there_is_named():
    with pytest.raises(InputError, match="unknown output 'w'"):
        swept().plot("w")
