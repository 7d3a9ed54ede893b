"""Which Python and which versions ``make oldest`` and ``make newest`` take."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from tests.packaging import tenth, versions


def test_the_oldest_versions_are_the_lower_bounds_of_the_project():
    bounds = versions.lower_bounds("test")
    assert "numpy==2.1.3" in bounds and all(bound.count("==") == 1 for bound in bounds)
    assert versions.oldest_python() == (3, 11)


def test_the_newest_python_of_this_machine_is_found_and_is_what_it_is_taken_for():
    version, path = versions.chosen("newest")
    assert version >= sys.version_info[:2]
    said = subprocess.run([path, "--version"], capture_output=True, text=True, check=True).stdout
    assert said.startswith(f"Python {version[0]}.{version[1]}.")


def test_without_a_newer_python_the_present_one_is_taken(monkeypatch):
    monkeypatch.setattr(versions, "_candidates", lambda: iter(()))
    assert versions.chosen("newest") == (sys.version_info[:2], sys.executable)


def test_without_the_oldest_python_nothing_is_installed(monkeypatch):
    monkeypatch.setattr(versions, "pythons", lambda: {(3, 13): "python3.13"})
    with pytest.raises(SystemExit, match=r"expected Python 3\.11, found 3\.13"):
        versions.chosen("oldest")


def test_an_environment_that_was_prepared_is_taken_once(tmp_path, monkeypatch):
    made, called = [], []
    monkeypatch.setattr(versions, "chosen", lambda which: ((3, 13), "python3.13"))
    monkeypatch.setattr(
        versions, "environment", lambda *given: (given[2].mkdir(exist_ok=True), made.append(given))
    )

    def run(words, **options):
        called.append([str(word) for word in words])
        return subprocess.CompletedProcess(words, 0)

    monkeypatch.setattr(subprocess, "run", run)
    folder = tmp_path / "newest"
    for words, environments in ((["--prepare"], 1), ([], 1), ([], 2)):
        monkeypatch.setattr(sys, "argv", ["versions", "newest", "--folder", str(folder), *words])
        assert versions.main() == 0
        assert len(made) == environments
    assert made[0] == ("newest", "python3.13", folder)
    assert [words[2] for words in called] == ["pip", "pytest"] * 2
    assert called[1][0] == str(folder / "bin" / "python")


def test_of_each_file_the_newest_versions_take_the_first_test():
    items = [SimpleNamespace(path=path, name=name) for path, name in ("aw", "ax", "by", "az")]
    tenth.pytest_collection_modifyitems(items)
    assert sorted(item.name for item in items) == ["w", "y"]
