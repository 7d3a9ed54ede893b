"""The page "Which name for what" has each public name once."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import hovercontrol

PAGE = (Path(__file__).parents[2] / "docs" / "names.md").read_text(encoding="utf-8")


def test_each_public_name_has_one_line():
    rows = re.findall(r"^\| `hc\.(\w+)` \| .+ \|$", PAGE, re.MULTILINE)
    assert sorted(rows) == sorted(hovercontrol.__all__)


DOCS = Path(__file__).parents[2] / "docs"
NAMES = {f"hc.{name}" for name in hovercontrol.__all__}
PAGES = [DOCS.parent / "README.md", *sorted(DOCS.rglob("*.md"))]


def calls(page):
    """Return the calls ``hc.NAME(...)`` that a page's sentences and tables show; code blocks are run."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for code in re.findall(r"`(hc\.\w+\([^`]*\))`", text):
        call = ast.parse(code, mode="eval").body
        if isinstance(call, ast.Call) and ast.unparse(call.func) in NAMES:
            yield code, call, inspect.signature(getattr(hovercontrol, call.func.attr))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_call_in_a_sentence_fits_its_function(page):
    for code, call, signature in calls(page):
        given = [] if "..." in map(ast.unparse, call.args) else call.args
        words = {one.arg: one.value for one in call.keywords}
        bound = signature.bind_partial(*given, **words).arguments
        for name, value in bound.items():
            shown = ast.unparse(value).strip("[]") if isinstance(value, ast.AST) else ""
            others = {one for one in signature.parameters if one not in bound or one != name}
            assert not {shown, f"{shown}s"} & others - {name}, f"{code}: {shown} stands for {name}"
