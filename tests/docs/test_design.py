"""The pages on control design run as they stand."""

import contextlib
import io
import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

from hovercontrol.base.errors import InputError

DESIGN = Path(__file__).parents[2] / "docs" / "design"
CELL = re.compile(r"^```python (run[^\n]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted(DESIGN.glob("*.md")), ids=lambda path: path.stem)
def test_the_cells_of_a_page_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["cell"])
    cells = CELL.findall(page.read_text(encoding="utf-8"))
    assert cells or page.stem == "index"
    names, said = {}, io.StringIO()
    for words, code in cells:
        refused = pytest.raises(InputError) if "fails" in words else contextlib.nullcontext()
        with refused, contextlib.redirect_stdout(said):
            exec(compile(code, f"{page.name}", "exec"), names)
    plt.close("all")
    assert "nan" not in said.getvalue()


def test_every_page_is_in_the_chapter():
    listed = re.findall(r"\]\((\w+)\.md\)", (DESIGN / "index.md").read_text(encoding="utf-8"))
    assert set(listed) >= {path.stem for path in DESIGN.glob("*.md")} - {"index"}


@pytest.mark.parametrize(
    "word", ["LQR", "PID", "Bode", "trim", "observer", "Kalman filter", "anti-windup", "waypoints"]
)
def test_a_word_that_people_search_for_is_in_a_title_or_first_sentence(word):
    texts = [path.read_text(encoding="utf-8") for path in DESIGN.glob("*.md")]
    begins = [re.search(r"^# .*?\n\n.*?\n\n", text, re.MULTILINE | re.DOTALL)[0] for text in texts]
    assert any(word.lower() in begin.lower() for begin in begins)
