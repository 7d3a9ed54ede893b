"""A picture that a user asks for appears, once; one that is computed for a file is not pyplot's."""

import ast
import os
import subprocess
import sys
import types
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

import hovercontrol
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.control.observers.ins.consistency import consistency

PACKAGE = Path(hovercontrol.__file__).parent

#: A backend of Matplotlib that prints what plt.show() is asked to show.
BACKEND = """
from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg

class FigureManager(FigureManagerBase):
    def show(self):
        self.canvas.draw()
        print("shown:", [axes.get_xlabel() for axes in self.canvas.figure.axes])

class FigureCanvas(FigureCanvasAgg):
    manager_class = FigureManager
"""

#: A region of two numbers, and a log.
REGION = """
import numpy as np
from hovercontrol.control.analysis import Axis, Region
x, y = (Axis(name, "m", np.linspace(-1.0, 1.0, 9)) for name in "xy")
region = Region("a disc", x, y, {"disc": np.hypot(x.values, y.values[:, None]) < 0.7})
"""
LOG = """
from hovercontrol.logs import Log
log = Log("a", [0.0, 1.0, 2.0], {"x": [0.0, 1.0, 4.0]})
"""


def plots():
    """Every public plot of the package: file and function."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and (node.name == "plot" or node.name.startswith("plot_")):
                yield pytest.param(node, id=f"{path.relative_to(PACKAGE)}:{node.lineno}")


@pytest.mark.parametrize("function", list(plots()))
def test_every_plot_opens_its_figure_in_pyplot(function):
    called = {call.func.id for call in ast.walk(function) if isinstance(getattr(call, "func", 0), ast.Name)}
    assert called & {"open_in_pyplot", "super"}, "python-control opens those that it draws itself"


def test_nothing_else_in_the_package_knows_pyplot():
    users = [p for p in PACKAGE.rglob("*.py") if "matplotlib.pyplot" in p.read_text(encoding="utf-8")]
    assert [str(p.relative_to(PACKAGE)) for p in users] == [os.path.join("base", "pyplot.py")]


def test_a_figure_keeps_its_size_and_is_closed_as_any_other():
    figure = open_in_pyplot(Figure(figsize=(3.0, 2.0)))
    other = open_in_pyplot(Figure())
    assert plt.get_fignums() == [1, 2] and plt.gcf() is other
    assert tuple(figure.get_size_inches()) == (3.0, 2.0)
    plt.close(figure)
    assert plt.get_fignums() == [2]


def test_the_value_of_a_cell_is_shown_after_what_was_opened_before_it_and_closed(monkeypatch):
    shown: list = []
    display = types.SimpleNamespace(display=shown.append)
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(display=display))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    first, own, value = open_in_pyplot(Figure()), plt.figure(), open_in_pyplot(Figure())
    value._ipython_display_()
    assert not shown, "this backend shows nothing"
    monkeypatch.setattr(plt, "get_backend", lambda: "module://matplotlib_inline.backend_inline")
    value._ipython_display_()
    assert shown == [first, value]
    assert [plt.figure(n) for n in plt.get_fignums()] == [own]
    value._ipython_display_()
    assert shown == [first, value, value], "a closed one is shown whenever it is a value"


def test_axes_that_are_given_stay_their_owners(rng):
    own = Figure()
    space: dict = {}
    exec(REGION, space)
    assert space["region"].plot(axes=own.subplots()) is own
    assert not plt.get_fignums()
    consistency(rng.normal(size=(1, 20, 5)), np.ones((1, 1, 20, 5))).plot()
    assert len(plt.get_fignums()) == 1


@pytest.mark.slow
def test_plt_show_in_a_script_shows_every_picture(tmp_path):
    (tmp_path / "recording.py").write_text(BACKEND)
    script = f"{REGION}{LOG}region.plot()\nlog.plot()\nimport matplotlib.pyplot as plt\nplt.show()\n"
    (tmp_path / "script.py").write_text(script)
    env = os.environ | {"MPLBACKEND": "module://recording", "PYTHONPATH": f"{PACKAGE.parent}"}
    found = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.splitlines() == ["shown: ['x [m]']", "shown: ['time [s]']"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(("simulate", "k06-turn", "--out", "out"), marks=pytest.mark.slow),
        ("sweep", "k06-turn", "--vary", "controller.k2=0.5:6:3", "--out", "out"),
        ("check", "log.csv", "--out", "out"),
    ],
)
def test_commands_write_pictures_without_pyplot(words, call, tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("a command opened a figure in pyplot")

    monkeypatch.setattr(plt, "figure", refuse)
    sample = PACKAGE / "documents" / "samples" / "rudder_craft.csv"
    (tmp_path / "log.csv").write_bytes(sample.read_bytes())
    done = call(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert list((tmp_path / "out").rglob("*.png"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["c17_gain_region", "k06_forward_region", "k06_reverse_region"])
def test_analyses_write_pictures_without_pyplot(name, tmp_path, monkeypatch):
    import importlib.util

    spec = importlib.util.spec_from_file_location(name, PACKAGE.parent / "analyses" / f"{name}.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    files = script.main(tmp_path, points=4)
    assert tmp_path / f"{name}.png" in files
    assert not plt.get_fignums()


def notebook(*cells):
    """Return the number of pictures below each cell of a fresh notebook."""
    reason = "notebooks run where Jupyter is installed (the extra 'docs')"
    pytest.importorskip("ipykernel", reason=reason)
    nbformat, nbclient = (pytest.importorskip(m, reason=reason) for m in ("nbformat", "nbclient"))
    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    nbclient.NotebookClient(made, timeout=120, kernel_name="python3").execute()
    return [sum("image/png" in o.get("data", {}) for o in cell.outputs) for cell in made.cells]


@pytest.mark.slow
def test_a_fresh_notebook_shows_each_picture_once(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(PACKAGE.parent))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    cells = {
        REGION + "region.plot()": 1,  # the value of the cell, before anything else drew
        LOG + "log.plot();": 1,
        "figure = log.plot()": 1,
        "figure": 1,  # again, as its user asks
        "log.plot()\nlog.plot()": 2,
        "log.plot()\n1": 1,
        "figure = log.plot()\nfigure.savefig('/dev/null', format='png')\nfigure": 1,
        "import matplotlib.pyplot as plt\naxes = plt.subplots()[1]\nregion.plot(axes=axes)": 1,
        "plt.plot([1, 2])\nlog.plot()": 2,
        "plt.get_fignums()": 0,
    }
    assert dict(zip(cells, notebook(*cells), strict=True)) == cells
