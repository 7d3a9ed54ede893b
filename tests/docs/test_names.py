"""The page "Which name for what" has each public name once."""

import re
from pathlib import Path

import hovercontrol

PAGE = (Path(__file__).parents[2] / "docs" / "names.md").read_text(encoding="utf-8")


def test_each_public_name_has_one_line():
    rows = re.findall(r"^\| `hc\.(\w+)` \| .+ \|$", PAGE, re.MULTILINE)
    assert sorted(rows) == sorted(hovercontrol.__all__)
