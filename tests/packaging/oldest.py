"""Install the oldest versions that pyproject.toml allows and run the quick tests: ``make oldest``."""

import argparse
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

PROJECT = Path(__file__).parents[2]

#: The oldest Python that pyproject.toml allows.
OLDEST = (3, 11)


def lower_bounds(*extras: str) -> list[str]:
    """Return ``name==version`` of each dependency's lower bound."""
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = project["dependencies"] + [d for e in extras for d in project["optional-dependencies"][e]]
    return sorted({re.sub(r">=\s*", "==", d) for d in wanted})


def main() -> int:
    parser = argparse.ArgumentParser(description="Test with the oldest versions of the dependencies.")
    parser.add_argument("--folder", type=Path, default=PROJECT / "out" / "oldest", help="of the environment")
    parser.add_argument("tests", nargs="*", default=["tests"], help="what to run (default: tests)")
    given = parser.parse_args()
    if sys.version_info[:2] != OLDEST:
        found, wanted = (".".join(map(str, v)) for v in (sys.version_info[:2], OLDEST))
        sys.exit(
            f"oldest: expected Python {wanted}, found {found}: the oldest versions have no wheels for it"
        )
    python = given.folder / "bin" / "python"
    bounds = lower_bounds("test")
    print("\n".join(bounds))
    venv.create(given.folder, with_pip=True, clear=True)
    pinned = given.folder / "oldest.txt"
    pinned.write_text("\n".join(bounds) + "\n", encoding="utf-8")
    subprocess.run([python, "-m", "pip", "install", "-q", "-c", pinned, "-e", f"{PROJECT}[test]"], check=True)
    quick = ["-n", "2", "--dist", "worksteal", "-m", "not slow", *given.tests]
    return subprocess.run([python, "-m", "pytest", *quick], cwd=PROJECT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
