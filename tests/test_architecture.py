"""ARCHITECTURE.md draws the package as it is: its rooms, its folders, its links."""

import ast
import importlib.util
import re
from pathlib import Path

PROJECT = Path(__file__).parents[1]
TEXT = (PROJECT / "ARCHITECTURE.md").read_text(encoding="utf-8")
DRAWING = re.search(r"```\n(.*?)```", TEXT, flags=re.DOTALL)[1]


def rooms():
    """The rooms that imports are checked by, from bottom to top."""
    spec = importlib.util.spec_from_file_location("imports", Path(__file__).with_name("test_imports.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return list(module.ROOMS)


def test_the_drawing_is_the_one_that_imports_are_checked_by():
    assert [line.split()[0] for line in reversed(DRAWING.strip().splitlines())] == rooms()


def test_every_folder_and_link_it_names_is_there():
    prose = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    folders = re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", prose)
    assert len(folders) > 9
    assert not [
        name
        for name in folders
        if not any((top / name).exists() for top in (PROJECT, PROJECT / "hovercontrol"))
    ]
    for file, anchor in re.findall(r"\]\((\w+\.md)#([\w-]+)\)", TEXT):
        titles = re.findall(r"^#+ (.*)$", (PROJECT / file).read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert anchor in {title.lower().replace(" ", "-") for title in titles}


def test_each_errand_is_done_with_three_files_that_are_there():
    errands = (PROJECT / "ERRANDS.md").read_text(encoding="utf-8").split("\n## ")[1:]
    opened = [re.findall(r"^\d\. (?:`|.*\]\()([\w/.]+)", errand, flags=re.MULTILINE) for errand in errands]
    assert len(opened) == 6 and all(1 <= len(files) <= 3 for files in opened)
    assert not [name for files in opened for name in files if not (PROJECT / name).is_file()]


#: Most lines of a function without its docstring, and most decisions in it.
LINES, DECISIONS = 80, 20
DECIDING = (
    ast.If,
    ast.IfExp,
    ast.For,
    ast.While,
    ast.ExceptHandler,
    ast.BoolOp,
    ast.match_case,
    ast.comprehension,
)
#: Functions that only collect arrays or options, by comprehensions over one list each.
COLLECTING = {"engine/measure.py measure", "engine/problem.py __init__", "engine/unknowns.py __init__"}
#: A search tries law after law until none is better; a fit's steps are told one after the other.
IN_ONE_PIECE = {"laws/search.py with_laws", "diagnose/diagnose.py _diagnosed"}


def too_long(path):
    """The functions of a file that exceed the limits; a command's signature is its table of options."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            if not body:
                continue
            lines = node.end_lineno - body[0].lineno + 1
            if path.parent.name != "commands":
                lines += node.body[0].lineno - node.lineno
            decisions = sum(isinstance(inner, DECIDING) for part in body for inner in ast.walk(part))
            if lines >= LINES or decisions > DECISIONS:
                yield f"{path.parent.name}/{path.name} {node.name}"


def test_a_function_has_fewer_than_80_lines_and_at_most_20_decisions():
    found = {name for path in sorted((PROJECT / "hovercontrol").rglob("*.py")) for name in too_long(path)}
    assert not found - COLLECTING - IN_ONE_PIECE
