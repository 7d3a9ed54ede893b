"""What notebooks show: whole HTML without scripts, signals with units, all that users write escaped."""

import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser

import matplotlib.pyplot as plt
import numpy as np
import pytest
import sympy as sp

import hovercontrol as hc
import hovercontrol.fmi
from hovercontrol.base.html import ROWS, table
from hovercontrol.base.svg import sparkline
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.logs import Log

CRAFT = hc.vehicle("c17_experiment")
EMPTY = {"circle", "line", "path"}


class Balanced(HTMLParser):
    """Refuses tags that are not closed in order."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], set()

    def handle_starttag(self, tag, attributes):
        self.open.append(tag)
        self.seen.add(tag)
        assert not any(name.startswith("on") for name, _ in attributes)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def checked_html(thing):
    """The HTML of a thing, after a look at its form."""
    text = thing._repr_html_()
    page = Balanced()
    page.feed(text)
    assert page.open == [] and not page.seen & {"script", "style", "link", "img", "iframe"}
    for math in re.findall(r"<math>.*?</math>", text, flags=re.DOTALL):
        ET.fromstring(math)
    return text


def test_a_block_shows_its_equations_and_signals_with_units():
    text = checked_html(CRAFT.plant())
    assert text.count("<math>") == 6 and "rad/s^2/A" in text and "plant.yaw_coulomb" in text
    assert "6 states, 2 inputs, 6 outputs, 11 parameters" in text


def test_a_hybrid_block_shows_what_ticks():
    v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    k, n = hc.Signal("k", "1/s", start=2.0), hc.Signal("n")
    cart = hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    law = hc.Block("law", [n], [v], [a], [k], {"n": n.symbol + 1}, {"a": -k.symbol * v.symbol}, period=0.1)
    text = checked_html(hc.interconnect([cart, law], "loop"))
    assert "ticks every 0.1 s" in text and "Every 0.1 s: law" in text
    assert "Next values" in checked_html(law) and "sampled every 0.1 s" in checked_html(law)


def test_models_show_their_effects_fans_and_what_may_be_missing():
    text = checked_html(CRAFT)
    assert "yaw_coulomb" in text and "0.83 rad/s^2" in text and "Dry friction against yaw" in text
    assert "rear_left" in checked_html(hc.vehicle("four_fan"))
    assert "what it may lack" in checked_html(BlockModel(CRAFT.plant(), ["slope"]))


def test_an_fmu_shows_its_signals(tmp_path):
    try:
        find_compiler()
    except NoCompilerError as error:
        pytest.skip(f"{error}: no FMU can be built")
    path = CRAFT.plant().to_fmu(tmp_path / "plant.fmu")
    with hovercontrol.fmi.load(path, step=0.01) as fmu:
        text = checked_html(fmu)
    assert "FMI 3" in text and "motor current" in text and "11 parameters" in text and "0.83" in text


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("log", ["300 rows", "<polyline", "rudder"]),
        ("run", ["k06-turn", "&#10003;", "the paper says"]),
        ("varied", ["controller.k2", "final of r"]),
        ("sweep", ["5 runs", "median"]),
        ("study", ["held out", "at constant velocity"]),
        ("identified", ["yaw_linear_drag", "±"]),
        ("diagnosis", ["slope_x", "m/s^2", "Missing"]),
        ("check", ["per second", "yes"]),
    ],
)
def test_results_show_their_numbers(results, name, said):
    text = checked_html(results[name])
    for word in said:
        assert word in text, word


@pytest.mark.parametrize(
    "name", ["log", "run", "sweep", "varied", "study", "identified", "free run", "diagnosis"]
)
def test_every_result_can_be_drawn(results, name):
    figure = results[name].plot()
    assert plt.gcf() is figure
    axes = figure.axes
    assert axes and all(len(a.lines) + len(a.patches) + len(a.collections) for a in axes)
    assert any(a.get_xlabel() for a in axes)


def test_tables_smoothed_logs_and_sliding_spectra_can_be_drawn(logs):
    from hovercontrol.control.analysis import observability_gramian
    from hovercontrol.craft.hardware.actuators import FanTable, ServoTable
    from hovercontrol.logs import BenchTable, smooth_pose

    t = np.linspace(0.0, 2.0, 101)
    blind = dict(logs[0].columns) | {
        k: np.where(abs(logs[0].time - 5) < 1, np.nan, logs[0][k]) for k in ("x", "y", "psi")
    }
    things = {
        "force [N]": FanTable(
            "demo", "force", [-5, 0, 5], [0.0, 0.5, 1.0], [[0, 5, 9], [0, 4, 8], [0, 5, 9]]
        ),
        "pulse [ms]": ServoTable("demo", [1.0, 1.5, 2.0], [-30.0, 0.0, 35.0]),
        "command [us]": BenchTable("demo", np.array([1100.0, 1200.0]), np.array([0.01, 0.03]), idle=1000.0),
        "time [s]": smooth_pose(Log("blind", logs[0].time, blind)),
        "end of the window [s]": observability_gramian(
            CRAFT.plant(), t, {"u": 1.0 + t}, ["surge_linear_drag"]
        ).sliding(1.0),
    }
    for label, thing in things.items():
        axes = thing.plot().axes
        assert label in [a.get_xlabel() for a in axes]
        assert all(a.lines or a.collections for a in axes)
    assert things["time [s]"].plot().axes[0].patches  # the span without a pose is marked


def test_a_picture_that_is_not_there_is_named(results):
    for thing, word, known in (("run", "paht", "path"), ("study", "run7", "run")):
        with pytest.raises(hc.InputError, match=f"'{word}'.*{known}"):
            results[thing].plot(word)


def test_what_users_write_is_escaped():
    evil = "<script>alert(1)</script>"
    log = Log(evil, [0.0, 1.0], {evil: [0.0, 1.0]})
    block = hc.Block("b", outputs=[hc.Signal("y", "s", evil)], output_expressions={"y": hc.time})
    for thing in (log, block.with_values({}), hc.Model(evil)):
        assert evil not in checked_html(thing)


def test_a_sparkline_has_gaps_few_points_and_the_extremes():
    t = np.linspace(0.0, 1.0, 5000)
    y = np.sin(20 * t)
    y[1234] = 5.0
    whole = sparkline(t, y)
    heights = [float(p.split()[1]) for p in re.findall(r"points='(.*?)'", whole)[0].split(",")]
    assert len(heights) < 300 and min(heights) == 2.0  # the single peak is there
    y[2000:2400] = np.nan
    assert sparkline(t, y).count("<polyline") == 2
    assert "<title>0 to 2</title>" in sparkline([0, 1], [0.0, 2.0], stairs=True)


def test_long_tables_fold():
    text = table(["n"], [[k] for k in range(ROWS + 5)])
    assert "<details>" in text and "5 more" in text and table(["n"], []) == ""


def test_a_case_has_a_space_before_its_condition():
    """MathML trims blanks at the ends of a text, not no-break spaces (MathML Core 2.1.5)."""
    x, y = hc.Signal("x"), hc.Signal("y")
    case = sp.Piecewise((x.symbol, x.symbol > 1), (0, True))
    text = checked_html(hc.Block("limit", inputs=[x], outputs=[y], output_expressions={"y": case}))
    assert "<mtext>if\u00a0</mtext>" in text or "<mtext>if&#160;</mtext>" in text
