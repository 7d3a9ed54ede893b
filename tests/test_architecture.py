"""ARCHITECTURE.md draws the package as it is: its rooms, its folders, its links."""

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
