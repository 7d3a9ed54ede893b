"""What is peculiar to an effect stands in its class: the search names none."""

import ast
import re
from pathlib import Path

import pytest

import hovercontrol.identification.diagnose.search as search
from hovercontrol.craft.effects import Effect, effect_names

FILES = sorted(Path(search.__file__).parent.glob("*.py"))


def code_of(path: Path) -> str:
    """Return the code of a file without docstrings and comments."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [
                one for one in body if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))
            ] or [ast.Pass()]
    return ast.unparse(tree)


def test_there_is_a_search_and_there_are_effects():
    assert len(FILES) > 5 and len(effect_names()) > 40


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_no_effect_and_no_class_of_effects_is_named(path):
    code = code_of(path)
    assert not re.search(r"hovercontrol\.effects\.\w", code), "only the package itself is imported"
    words = set(re.findall(r"\w+", code))
    assert not words & set(effect_names())
    assert not words & {cls.__name__ for cls in Effect.known.values()}
