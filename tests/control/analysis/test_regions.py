"""Maps over two parameters: shares, counter-examples, tables, pictures, and sweeps that are too large."""

import csv
import re

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.analysis.experiment_design import ellipse_errors
from hovercontrol.control.analysis.output import save
from hovercontrol.control.analysis.regions import Region, axis, mesh, refuse_large, sweep_map
from hovercontrol.documents.c17.beta_region import beta_region
from hovercontrol.documents.c17.gain_region import gain_region
from hovercontrol.documents.c17.interconnection import region_of_attraction
from hovercontrol.documents.c17.zero_dynamics import arm_region
from hovercontrol.documents.k06.law_regions import forward_region, reverse_region
from hovercontrol.documents.k06.turn_basins import turn_basins


def decaying():
    v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=2.0, lower=0.0)
    return Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})


def disc(**more):
    x, y = axis("x", "m", (-1.0, 1.0), 21), axis("y", "m", (-2.0, 2.0), 41)
    X, Y = np.meshgrid(x.values, y.values)
    maps = {"disc": X**2 + Y**2 < 1, "half": (X**2 + Y**2 < 1) & (X > 0), "height": X + Y, "none": X > 9}
    return Region("a disc", x, y, maps, units={"height": "m"}, **more)


def test_share_and_counter_examples_count_points():
    region = disc()
    assert region.share("half", "disc") == pytest.approx(region["half"].sum() / region["disc"].sum())
    assert region.outside("half", "disc") == []
    left = region.outside("disc", "half")
    assert len(left) == region["disc"].sum() - region["half"].sum()
    assert all(x <= 0 and x**2 + y**2 < 1 for x, y in left)
    assert np.isnan(region.share("disc", "none"))


def test_the_table_has_every_point_with_units(tmp_path):
    path = disc(labels={"disc": "inside"}).save(tmp_path / "disc.csv")
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 21 * 41
    assert list(rows[0]) == ["x [m]", "y [m]", "inside", "half", "height [m]", "none"]
    for row in rows[::37]:
        x, y = float(row["x [m]"]), float(row["y [m]"])
        assert int(row["inside"]) == (x**2 + y**2 < 1)
        assert float(row["height [m]"]) == pytest.approx(x + y)


def test_a_picture_names_its_axes_with_units_and_every_map_and_line():
    region = disc(lines={"edge": (np.array([0.0, 1.0]), np.array([0.0, 1.0]))})
    figure = region.plot()
    drawn = figure.axes[0]
    assert (drawn.get_xlabel(), drawn.get_ylabel()) == ("x [m]", "y [m]")
    assert [t.get_text() for t in drawn.get_legend().get_texts()] == ["disc", "half", "none", "edge"]
    assert figure.axes[1].get_ylabel() == "height [m]"
    few = disc(lines=region.lines, marks={"here": (0.5, 0.5)}).plot("half")
    assert [t.get_text() for t in few.axes[0].get_legend().get_texts()] == ["half", "edge", "here"]


def test_areas_of_a_picture_differ_without_colour_too():
    figure = disc(lines={"edge": (np.array([0.0, 1.0]), np.array([0.0, 1.0]))}).plot("disc", "half", "none")
    looks = [
        (bool(handle.get_facecolor()[3]), handle.get_hatch(), handle.get_linestyle())
        for handle in figure.axes[0].get_legend().get_patches()
    ]
    assert len(set(looks)) == 3


def test_each_part_of_a_picture_says_what_holds_there():
    region = disc(labels={"disc": "inside"})
    drawn = region.plot("disc", "half").axes[0]
    FigureCanvasAgg(drawn.figure).draw()
    said = {text.get_text().replace("\n", " "): text.get_position() for text in drawn.texts}
    assert set(said) == {"inside and half", "only: inside", "neither"}
    for words, (x, y) in said.items():
        assert (x**2 + y**2 < 1) == ("inside" in words), words
        assert (x > 0) == ("half" in words) or words == "neither"


def test_two_parts_of_a_picture_have_no_words_on_each_other():
    figure = disc(marks={"here": (0.5, 0.0)}).plot("disc", "half")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    boxes = [text.get_window_extent(canvas.get_renderer()) for text in figure.axes[0].texts]
    assert len(boxes) >= 3
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])


def test_a_map_sweeps_its_points_x_fastest():
    x, y = axis("k", "1/s", (0.5, 2.0), 4), axis("more", "1/s", (0.0, 1.0), 3)
    runs = sweep_map(decaying().compile(), x, y, lambda a, b: {"decay.k": a + b}, [0.0, 1.0])
    a, b = mesh(x, y)
    np.testing.assert_allclose(runs["v"].final, np.exp(-(a + b)), rtol=1e-5)
    assert runs["v"].final.reshape(3, 4)[0, 1] == pytest.approx(np.exp(-1.0), rel=1e-5)


def test_a_grid_of_a_thousand_million_points_is_refused_with_time_and_memory():
    side = 31623
    x, y = axis("k", "1/s", (0.5, 2.0), side), axis("more", "1/s", (0.0, 1.0), side)
    with pytest.raises(
        InputError, match=r"1e\+09 runs would take .* (h|s) and .* GiB of memory.*fewer points"
    ):
        sweep_map(decaying().compile(), x, y, lambda a, b: {"decay.k": a + b}, [0.0, 1.0])


@pytest.mark.parametrize("region", [gain_region, arm_region, forward_region, reverse_region, turn_basins])
def test_every_simulated_map_refuses_a_thousand_million_points(region):
    with pytest.raises(InputError, match=r"e\+\d+ runs would take .* and .* GiB of memory"):
        region(points=31623)


def test_a_map_without_simulations_refuses_them_too():
    with pytest.raises(InputError, match=r"1e\+09 points would take 149 GiB"):
        beta_region(points=31623)


def test_a_sweep_of_hours_is_refused_though_it_fits_in_memory():
    with pytest.raises(InputError, match=r"27\.8 h"):
        refuse_large(decaying().compile(), 1000, 100.0)
    refuse_large(decaying().compile(), 1000, 1.0)


@pytest.mark.parametrize(
    ("span", "points", "text"),
    [
        ((1.0, 1.0), 5, "is empty"),
        ((2.0, 1.0), 5, "is reversed"),
        ((0.0, np.inf), 5, "expected a range within 1e+100"),
        ((0.0, np.nan), 5, "must be a number"),
        ((0.0,), 5, ": expected 2 values, each a number"),
        ((0.0, 1.0), 1, "2 or more points"),
        ((0.0, 1.0), 2.5, ": points: expected a whole number"),
    ],
)
def test_a_range_that_is_none_is_refused(span, points, text):
    with pytest.raises(InputError, match=rf"^a.*{re.escape(text)}"):
        axis("a", "m", span, points)


RANGES = (
    (beta_region, "k2"),
    (gain_region, "k1"),
    (gain_region, "k2"),
    (arm_region, "arm"),
    (arm_region, "control_point"),
    (forward_region, "speed"),
    (forward_region, "k2"),
    (reverse_region, "speed"),
    (reverse_region, "alpha"),
    (region_of_attraction, "tracking_error"),
    (region_of_attraction, "coefficient_error"),
    (ellipse_errors, "semi_x"),
)


@pytest.mark.parametrize(
    "span", [3.0, None, "ab", (), (1.0,), ("a", "b"), (1.0, None), (1.0, 1.0), (2.0, 1.0)]
)
@pytest.mark.parametrize(("region", "name"), RANGES)
def test_every_map_refuses_what_is_no_range_in_one_line(region, name, span):
    with pytest.raises(InputError, match=rf"^(\w+: )?{name}.*(range|number)") as refused:
        region(**{name: span})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: gain_region(k2=(0.0, 1.0)), "^k2 must be positive, found 0$"),
        (lambda: gain_region(k1=(-2.0, 1.0)), "^k1 must be positive, found -2$"),
        (lambda: reverse_region(speed=(0.5, 1.0)), "^reverse law: u_ref must be negative, found 1 m/s$"),
        (lambda: reverse_region(speed=(-1.0, 0.0)), "^reverse law: u_ref must be negative"),
        (lambda: arm_region(inertia=0.0), "^inertia must be positive"),
        (lambda: arm_region(heading=np.inf), "^heading must be a finite number"),
        (lambda: arm_region((0.1, 0.2), (0.01 / 0.585 / 0.1, 0.5), 3), r"arm = 0\.1 m .* gives a dx = J/m"),
        (lambda: turn_basins(yaw_rate=np.inf), "^yaw_rate must be a finite number"),
        (lambda: turn_basins(3.0), "^turn_basins: plane: expected names, each with 2 values"),
    ],
)
def test_gains_signs_and_the_singular_line_are_refused_in_one_line(call, line):
    with pytest.raises(InputError, match=line) as refused:
        call()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("region", [gain_region, arm_region, forward_region, reverse_region, turn_basins])
@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf, "x"])
def test_every_simulation_takes_a_positive_time(region, duration):
    with pytest.raises(InputError, match=r"duration(: expected a number| must be (positive|a number))"):
        region(points=2, duration=duration)


def test_unknown_maps_and_wrong_shapes_are_refused():
    with pytest.raises(InputError, match="did you mean 'disc'"):
        disc().share("dics", "half")
    with pytest.raises(InputError, match=r"expected a map of shape \(2, 2\), found \(3,\)"):
        a = axis("a", "m", (0.0, 1.0), 2)
        Region("bad", a, a, {"m": np.zeros(3)})


def test_progress_is_told_up_to_the_last_run():
    told = []
    gain_region(points=4, progress=told.append)
    assert told[-1] == 16


def test_results_appear_whole_or_not_at_all(tmp_path):
    figure = disc().plot()
    files = save(tmp_path / "out", "disc", figure, {"disc": disc().save}, ["found."])
    assert [f.name for f in files] == ["disc.csv", "disc.png", "disc.svg", "disc.txt"]

    def fail(path):
        raise InputError("no table")

    with pytest.raises(InputError, match="no table"):
        save(tmp_path / "other", "disc", figure, {"disc": fail}, [])
    assert not list((tmp_path / "other").glob("*"))
