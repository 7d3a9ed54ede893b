"""The page "Which name for what" has each public name once."""

import re
from pathlib import Path

import hovercontrol

PAGE = (Path(__file__).parents[2] / "docs" / "names.md").read_text(encoding="utf-8")


def test_each_public_name_has_one_line_with_the_link_to_its_page():
    row = r"^\| \[`hc\.(\w+)`\]\(reference/api/hovercontrol\.(\w+)\.md\) \| (.+) \|$"
    rows = re.findall(row, PAGE, re.MULTILINE)
    assert sorted(name for name, _, _ in rows) == sorted(hovercontrol.__all__)
    assert all(name == page for name, page, _ in rows)
