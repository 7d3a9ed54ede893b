"""Cells of pages: their outputs are written below them, and a page is run where its cells changed."""

import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"

PAGE = """# A page

```python run
import matplotlib.pyplot as plt
plt.plot([0, 1])
print("two"); 1 + 1
```

```sh run fails
echo said; exit 3
```

<!-- run
print("| a |")
-->

```python from=own.py "def" "return" before
```

The end.
"""


@pytest.fixture
def cells(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(DOCS))
    from generate import cells

    monkeypatch.setattr(cells, "DOCS", tmp_path)
    monkeypatch.setattr(cells, "OUTPUTS", tmp_path / "outputs")
    (tmp_path / "outputs").mkdir()
    (tmp_path / "own.py").write_text("x = 1\n    def f(y):\n        z = y\n    return z\n", encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    main = sys.modules["__main__"]
    yield cells, page
    sys.modules["__main__"] = main


def test_outputs_stand_below_their_cells_and_a_second_run_changes_nothing(cells):
    cells, page = cells
    cells.run(page)
    text = page.read_text(encoding="utf-8")
    assert "1 + 1\n```\n\n<!-- output -->\n```text\ntwo\n2\n```\n\n![A page](outputs/page-1.png)\n<" in text
    assert "exit 3\n```\n\n<!-- output -->\n```text\nsaid\n```" in text
    assert "-->\n\n<!-- output -->\n| a |\n<!-- /output -->" in text
    assert "before\ndef f(y):\n    z = y\n```" in text
    assert (page.parent / "outputs" / "page-1.png").stat().st_size > 1000
    assert cells.up_to_date(page)
    cells.run(page)
    assert page.read_text(encoding="utf-8") == text


def test_prose_may_change_and_cells_may_not(cells):
    cells, page = cells
    cells.run(page)
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace("The end.", "The very end."), encoding="utf-8")
    assert cells.up_to_date(page)
    page.write_text(text.replace("1 + 1", "1 + 2"), encoding="utf-8")
    assert not cells.up_to_date(page)
    page.write_text(text, encoding="utf-8")
    (page.parent / "own.py").write_text("x = 1\n    def f(y):\n    return y\n", encoding="utf-8")
    assert not cells.up_to_date(page)


def test_every_page_shows_the_outputs_of_its_cells(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    from generate import cells

    assert [str(page) for page in cells.pages() if not cells.up_to_date(page)] == []
