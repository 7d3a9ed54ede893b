"""ARCHITECTURE.md draws the package as it is: its layers, its folders, its links."""

import importlib.util
import re
from pathlib import Path

import hovercontrol

PROJECT = Path(__file__).parents[1]
TEXT = (PROJECT / "ARCHITECTURE.md").read_text(encoding="utf-8")
DRAWING = re.search(r"```\n(.*?)```", TEXT, flags=re.DOTALL)[1]


def layers():
    """The layers that the imports are checked by, from bottom to top."""
    spec = importlib.util.spec_from_file_location("imports", Path(__file__).with_name("test_imports.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.LAYERS


def packages():
    """What lies in the package: folders and modules, without those that are not for import."""
    root = Path(hovercontrol.__file__).parent
    for path in root.iterdir():
        if (path / "__init__.py").exists() or (path.suffix == ".py" and not path.stem.startswith("_")):
            yield path.stem


def drawn():
    """The drawing's layers from bottom to top: the words before the gap."""
    return [set(re.split(r"\s{3,}", line)[0].split()) for line in reversed(DRAWING.strip().splitlines())]


def test_the_drawing_has_every_package_and_no_other():
    assert set().union(*drawn()) == set(packages())


def test_the_drawing_is_the_one_that_imports_are_checked_by():
    there = set(packages())
    assert drawn() == [layer & there for layer in layers() if layer & there]


def test_every_folder_and_link_it_names_is_there():
    prose = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    folders = re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", prose)
    assert len(folders) > 15
    assert not [
        name
        for name in folders
        if not any((top / name).exists() for top in (PROJECT, PROJECT / "hovercontrol"))
    ]
    for file, anchor in re.findall(r"\]\((\w+\.md)#([\w-]+)\)", TEXT):
        titles = re.findall(r"^#+ (.*)$", (PROJECT / file).read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert anchor in {title.lower().replace(" ", "-") for title in titles}
