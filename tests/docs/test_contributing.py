"""The worked diffs in CONTRIBUTING.md apply to the package as it is, and what they add works."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
TEXT = (PROJECT / "CONTRIBUTING.md").read_text(encoding="utf-8")
DIFFS = re.findall(r"```diff\n(.*?)```", TEXT, flags=re.DOTALL)
TRIED = re.findall(r"Try it:\n\n```python\n(.*?)```", TEXT, flags=re.DOTALL)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("git") is None, reason="no git on this machine")
def test_an_effect_a_controller_a_scenario_and_a_backend_are_added_by_one_file_each(tmp_path):
    shutil.copytree(PROJECT / "hovercontrol", tmp_path / "hovercontrol")
    here = {**os.environ, "PYTHONPATH": str(tmp_path), "GIT_CEILING_DIRECTORIES": str(tmp_path.parent)}
    added = []
    for diff in DIFFS:
        subprocess.run(["git", "apply", "-"], input=diff, text=True, check=True, cwd=tmp_path, env=here)
        added += re.findall(r"^\+\+\+ b/(.*)$", diff, flags=re.MULTILINE)
    assert [Path(a).parts[1] for a in added] == ["craft", "control", "documents", "blocks"]

    modules = [a.removesuffix(".py").replace("/", ".") for a in added if a.endswith(".py")]
    examples = "import doctest, importlib\n" + "".join(
        f"assert doctest.testmod(importlib.import_module({m!r}), raise_on_error=True).failed == 0\n"
        for m in modules
    )
    assert len(TRIED) == len(DIFFS)
    script = tmp_path / "tried.py"
    script.write_text("\n".join([*TRIED, examples]), encoding="utf-8")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, env=here)
    assert done.returncode == 0, done.stderr


def test_what_it_says_make_does_is_in_the_makefile():
    made = (PROJECT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^([a-z-]+):", made, flags=re.MULTILINE)
    named = re.findall(r"^    make ([a-z-]+)", TEXT, flags=re.MULTILINE)
    assert named and set(named) <= set(targets)


def test_the_files_it_names_are_there():
    prose = re.sub(r"```.*?```", "", TEXT, flags=re.DOTALL)
    links = re.findall(r"\]\(([^)#]+)(?:#[\w-]+)?\)", prose)
    paths = re.findall(r"`((?:hovercontrol|tests|fmu)/[\w/.]*)`", prose)
    assert links and paths
    assert not [name for name in (*links, *paths) if not (PROJECT / name).exists()]


def test_the_backend_of_another_package_agrees_with_numpy():
    import hovercontrol as hc

    (code,) = (b for b in re.findall(r"```python\n(.*?)```", TEXT, re.S) if "def to_mpmath" in b)
    package: dict = {}
    exec(code, package)
    plant = hc.vehicle("c17_simulation").plant()
    state, command = [0.1, 0.2, 0.3, 0.4, -0.5, 0.7], [1.0, 0.1]
    parameters = list(plant.default_parameters.values())
    found = package["to_mpmath"](plant)(0.0, state, command, parameters)
    expected = plant.to_numpy().derivatives(0.0, state, command)
    assert [float(f) for f in found] == pytest.approx(expected.tolist(), rel=1e-13)
