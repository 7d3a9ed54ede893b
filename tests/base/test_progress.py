"""Long work shows how far it is, wherever it runs."""

import sys
import types

import pytest

from hovercontrol.base import progress
from hovercontrol.base.progress import progress_bar


class Shown:
    """What a notebook has below a cell."""

    def __init__(self):
        self.texts = []

    def display(self, text, display_id):
        assert display_id
        self.texts.append(text)
        return self

    def update(self, text):
        self.texts.append(text)


@pytest.fixture
def notebook(monkeypatch):
    shown = Shown()
    package, display = types.ModuleType("IPython"), types.ModuleType("IPython.display")
    package.get_ipython = lambda: types.SimpleNamespace(kernel=object())
    display.HTML, display.display = str, shown.display
    monkeypatch.setitem(sys.modules, "IPython", package)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(progress, "PAUSE", 0.0)
    return shown


def test_a_notebook_has_a_bar_below_the_cell_and_then_one_line(notebook):
    with progress_bar("fit <of>", 4.0) as report:
        report(1.0)
        report(3.0, "a & b")
    assert [text.partition(" done")[0] for text in notebook.texts] == [
        "<progress value='0.000' max='1'></progress> 0 % fit &lt;of&gt;",
        "<progress value='0.250' max='1'></progress> 25 % fit &lt;of&gt;",
        "<progress value='0.750' max='1'></progress> 75 % fit &lt;of&gt;: a &amp; b",
        "fit &lt;of&gt;:",
    ]


def test_a_bar_is_not_changed_more_often_than_one_sees(notebook, monkeypatch):
    monkeypatch.setattr(progress, "PAUSE", 60.0)
    with progress_bar("fit", 1000) as report:
        for k in range(1000):
            report(k)
    assert len(notebook.texts) <= 3


def test_work_that_fails_says_so(notebook):
    with pytest.raises(ValueError, match="no"), progress_bar("fit") as report:
        report(0.5)
        raise ValueError("no")
    assert notebook.texts[-1].startswith("fit: stopped after")


def test_a_pipe_gets_one_line(capsys):
    with progress_bar("fit") as report:
        report(0.5, "step")
    assert capsys.readouterr().err.startswith("fit: done in ")
