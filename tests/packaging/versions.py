"""Run quick tests with other versions: ``make oldest``, ``make newest``.

``oldest`` installs the oldest versions that pyproject.toml allows, on the oldest Python; ``newest`` the
newest of every dependency, on the newest Python of this machine, and takes a tenth of them: the first test
of each file and the first example of each module, so that each module is imported and used, and each package
that it calls. Options unknown here go to pytest. With ``--prepare`` only the environment is made, which the
next run takes.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).parents[2]
PREPARED = "prepared"
#: Options of pytest: a tenth of the tests, none of C code, which is the same for every Python.
TENTH = ["-p", "tests.packaging.tenth", "--ignore=tests/fmu"]

#: Says which Python this is, if it is a release that can make a virtual environment.
ASK = """
import ensurepip, sys
assert sys.version_info.releaselevel == "final"
print(*sys.version_info[:2])
"""

Version = tuple[int, int]


def project() -> dict:
    return tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def oldest_python() -> Version:
    """Return the oldest Python that pyproject.toml allows."""
    major, minor = re.findall(r"\d+", project()["requires-python"])
    return int(major), int(minor)


def lower_bounds(*extras: str) -> list[str]:
    """Return ``name==version`` of each dependency's lower bound."""
    about = project()
    wanted = about["dependencies"] + [d for e in extras for d in about["optional-dependencies"][e]]
    return sorted({re.sub(r">=\s*", "==", d) for d in wanted})


def pythons() -> dict[Version, str]:
    """Return the Pythons of this machine that the package allows, by version; this one first."""
    found: dict[Version, str] = {}
    for path in dict.fromkeys((sys.executable, *_candidates())):
        done = subprocess.run([path, "-c", ASK], capture_output=True, text=True, check=False)
        if done.returncode == 0:
            major, minor = map(int, done.stdout.split())
            found.setdefault((major, minor), path)
    return {version: path for version, path in found.items() if version >= oldest_python()}


def _candidates() -> Iterator[str]:
    """Yield Pythons that are on the path, and those that pyenv keeps."""
    for minor in range(11, 31):
        path = shutil.which(f"python3.{minor}")
        if path:
            yield path
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    yield from sorted(map(str, root.glob("versions/3.*/bin/python3")))


def chosen(which: str) -> tuple[Version, str]:
    """Return the Python to test on; ``oldest`` ends where there is none so old."""
    there = pythons()
    if which == "newest":
        return max(there.items())
    wanted = oldest_python()
    if wanted not in there:
        found, name = (", ".join(f"{a}.{b}" for a, b in versions) for versions in (there, [wanted]))
        sys.exit(f"oldest: expected Python {name}, found {found}: the oldest versions have no wheels for it")
    return wanted, there[wanted]


def environment(which: str, python: str, folder: Path) -> Path:
    """Make a fresh virtual environment with the package and its tests; return its Python."""
    subprocess.run([python, "-m", "venv", "--clear", folder], check=True)
    own = folder / "bin" / "python"
    install = [own, "-m", "pip", "install", "-q", "--disable-pip-version-check"]
    if which == "oldest":
        pinned = folder / "oldest.txt"
        pinned.write_text("\n".join(lower_bounds("test")) + "\n", encoding="utf-8")
        install += ["-c", pinned]
    subprocess.run([*install, "-e", f"{PROJECT}[test]"], check=True)
    return own


def prepared(folder: Path) -> Path | None:
    """Return the Python of an environment that ``--prepare`` made; it is taken once, as versions grow old."""
    mark = folder / PREPARED
    if not mark.exists():
        return None
    mark.unlink()
    return folder / "bin" / "python"


def main() -> int:
    parser = argparse.ArgumentParser(description="Run the quick tests with other versions.")
    parser.add_argument("which", choices=("oldest", "newest"))
    parser.add_argument("--folder", type=Path, help="of the environment (default: out/WHICH)")
    parser.add_argument("--prepare", action="store_true", help="only make the environment for the next run")
    given, passed = parser.parse_known_args()
    version, python = chosen(given.which)
    folder = given.folder or PROJECT / "out" / given.which
    if given.prepare:
        environment(given.which, python, folder)
        (folder / PREPARED).touch()
        return 0
    print(f"{given.which}: Python {version[0]}.{version[1]}, {python}", flush=True)
    own = prepared(folder) or environment(given.which, python, folder)
    subprocess.run([own, "-m", "pip", "list", "--disable-pip-version-check", "--format=freeze"], check=True)
    quick = [
        "-n",
        "2",
        "--dist",
        "worksteal",
        "-m",
        "not slow",
        *(TENTH if given.which == "newest" else []),
        *passed,
    ]
    return subprocess.run([own, "-m", "pytest", *quick], cwd=PROJECT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
