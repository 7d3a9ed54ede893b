"""What the package says of itself: one version everywhere, bounds and pins that fit each other."""

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import hovercontrol

PROJECT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
PINS = dict(
    line.split("==")
    for line in (PROJECT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    if not line.startswith("#")
)


def test_the_version_is_in_one_place_and_the_citation_has_it():
    assert PYPROJECT["project"]["dynamic"] == ["version"]
    assert PYPROJECT["tool"]["hatch"]["version"]["path"] == "hovercontrol/__init__.py"
    citation = (PROJECT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", citation, flags=re.MULTILINE)[1] == hovercontrol.__version__


def test_every_dependency_has_a_lower_bound_and_a_pin_above_it():
    project = PYPROJECT["project"]
    pins = {canonicalize_name(name): Version(pin) for name, pin in PINS.items()}
    extras = (text for extra in project["optional-dependencies"].values() for text in extra)
    for text in (*project["dependencies"], *extras):
        wanted = Requirement(text)
        if wanted.name == project["name"]:  # an extra that contains another one
            assert wanted.extras <= set(project["optional-dependencies"]), text
            continue
        (bound,) = wanted.specifier
        assert bound.operator == ">=", text
        assert pins[canonicalize_name(wanted.name)] in wanted.specifier, text


def test_pins_are_names_and_versions_only_in_order():
    assert all(re.fullmatch(r"[\w.-]+", name) and Version(pin) for name, pin in PINS.items())
    assert list(PINS) == sorted(PINS, key=str.lower)
