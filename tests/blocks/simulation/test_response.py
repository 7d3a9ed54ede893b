"""The plot of a run: what python-control draws, with units, in a figure of its own."""

import pickle

import control
import matplotlib.pyplot as plt
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.logs import Log

T = np.array([0.0, 1.0, 2.0, 3.0])
GIVEN = {"thrust": [2.0, 2.0, 3.0, 3.0], "rudder": [0.1, 0.1, -0.1, -0.1]}
LABELS = ["x [m]", "y [m]", "psi [rad]", "u [m/s]", "v [m/s]", "r [rad/s]", "thrust [A]", "rudder [rad]"]


@pytest.fixture(scope="module")
def run():
    return hc.simulate(hc.vehicle("c17_experiment").plant(), T, GIVEN)


def test_axes_have_names_and_units(run):
    drawn = run.plot()
    assert isinstance(drawn, control.ControlPlot)
    assert [a.get_ylabel() for a in drawn.axes.ravel()] == LABELS
    assert drawn.axes[-1, 0].get_xlabel() == "Time [s]"


@pytest.mark.parametrize(
    "how",
    [{}, {"plot_inputs": False}, {"transpose": True}, {"overlay_signals": True}, {"plot_inputs": "overlay"}],
)
def test_lines_are_those_of_python_control(run, how):
    plain = control.TimeResponseData(
        run.time,
        run.y,
        run.x,
        run.u,
        input_labels=run.input_labels,
        output_labels=run.output_labels,
        plot_inputs=True,
    )
    drawn = []
    for response in (run, plain):
        plt.figure()
        drawn.append([line.get_ydata() for row in response.plot(**how).lines.ravel() for line in row])
    np.testing.assert_array_equal(*drawn)


def test_held_inputs_are_steps_and_interpolated_ones_are_not(run):
    rows = run.plot().lines[:, 0]
    assert [row[0].get_drawstyle() for row in rows] == ["default"] * 6 + ["steps-post"] * 2
    between = hc.simulate(hc.vehicle("c17_experiment").plant(), T, GIVEN, hold="linear")
    assert between.plot(ax=plt.figure().subplots(8, 1)).lines[-1, 0][0].get_drawstyle() == "default"


def test_a_run_is_not_drawn_into_the_picture_of_something_else(run):
    log = Log("eight", T, {f"c{k}": T for k in range(8)}).plot()
    assert len(log.axes) == len(LABELS)
    figure = run.plot().figure
    assert figure is not log and plt.gcf() is figure
    assert all(len(a.lines) == 1 for a in log.axes)


def test_runs_alike_share_a_figure_and_others_do_not(run):
    first, second = run.plot().figure, run.plot().figure
    assert first is second and len(first.axes[0].lines) == 2
    assert run.plot(plot_inputs=False).figure is not first


@pytest.mark.slow
def test_a_tall_picture_has_room_for_each_axis(run):
    wide = hc.interconnect([hc.vehicle("c17_simulation").plant(), hc.ellipse(1.0, 1.0)])
    figure = hc.simulate(wide, [0.0, 0.1]).plot().figure
    figure.canvas.draw()
    heights = [a.get_window_extent().height / figure.dpi for a in figure.axes]
    assert len(heights) == 14 and min(heights) > 0.6  # inches


def test_units_survive_copies_and_pickle_and_compiled_runs(run):
    for other in (run(squeeze=False), pickle.loads(pickle.dumps(run))):
        assert other.units == run.units and other.units["r"] == "rad/s"
    compiled = hc.vehicle("c17_experiment").plant().compile().simulate(T, GIVEN)
    assert compiled.units == run.units
    assert [a.get_ylabel() for a in compiled.plot().figure.axes] == LABELS
