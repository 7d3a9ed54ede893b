"""The C runtime is found in a checkout, in an editable install and in an installed wheel."""

import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import hovercontrol
from hovercontrol.blocks.backends import runtime
from hovercontrol.blocks.backends.runtime import (
    AROUND,
    AROUND_FMI,
    DELAYS,
    FMI,
    FOLLOWING,
    INSTANCE,
    SHOOTING,
    SIMULATION,
    runtime_files,
    runtime_folder,
)

GROUPS = {
    "simulation": SIMULATION,
    "shooting": SHOOTING,
    "following": FOLLOWING,
    "FMI 2": (*INSTANCE, *FMI[2]),
    "FMI 3": (*INSTANCE, *FMI[3], *DELAYS),
    "FMI 2 around an FMU": (*AROUND, *AROUND_FMI[2]),
    "FMI 3 around an FMU": (*AROUND, *AROUND_FMI[3]),
}
CHECKOUT = Path(hovercontrol.__file__).parents[1]
needs_checkout = pytest.mark.skipif(not (CHECKOUT / "pyproject.toml").is_file(), reason="no checkout")
#: Exports an FMU and simulates: both need the runtime.
USE = """
import sys, hovercontrol
from hovercontrol.blocks.backends.runtime import runtime_folder
block = hovercontrol.vehicle("hoverdemon").plant()
assert block.compile().native
block.to_fmu(sys.argv[1])
print(hovercontrol.__file__, runtime_folder(), sep="\\n")
"""


@pytest.mark.parametrize("group", GROUPS)
def test_a_program_gets_all_files_that_its_files_include(group):
    """The lists say what `#include` says, and nothing more."""
    files = runtime_files(GROUPS[group])
    included = {name for text in files.values() for name in re.findall(r'#include "(.*?)"', text)}
    generated = {"hc_lanes_math.h", "hc_math.h"} & files.keys()  # generated files include them
    assert {name for name in files if name.endswith(".h")} == included | generated


def test_every_file_of_the_runtime_belongs_to_a_program():
    found = {path.name for path in runtime_folder().iterdir()} - {"README.md"}
    assert found == set().union(*GROUPS.values())


def test_no_file_is_long():
    lengths = {path.name: len(path.read_text().splitlines()) for path in runtime_folder().glob("*.[ch]")}
    assert max(lengths.values()) <= 400, lengths


def test_what_is_looked_for_is_said_where_it_is_missing(monkeypatch, tmp_path):
    monkeypatch.setattr(runtime, "_PLACES", (tmp_path / "one", tmp_path / "two"))
    with pytest.raises(FileNotFoundError, match=r"neither in .*one nor in .*two"):
        runtime_folder()


def bare_environment(folder: Path) -> tuple[Path, Path]:
    """Return the Python and the site-packages of a new environment with our dependencies, without us."""
    venv.create(folder, with_pip=False)
    names = {"base": str(folder), "platbase": str(folder)}
    site = Path(sysconfig.get_path("purelib", "venv", names))
    ours = sysconfig.get_path("purelib")  # its own .pth files, an editable install among them, are not read
    (site / "dependencies.pth").write_text(f"{ours}\n")
    return folder / ("Scripts" if sys.platform == "win32" else "bin") / "python", site


def used(python: Path, folder: Path) -> list[Path]:
    """Return where an environment has the package and the runtime, after both were put to use."""
    done = subprocess.run(
        [python, "-c", USE, "plant.fmu"], cwd=folder, capture_output=True, text=True,
        env={"HOVERCONTROL_CACHE": str(folder / "cache"), "PATH": "/usr/bin:/bin", "HOME": str(folder)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert zipfile.is_zipfile(folder / "plant.fmu")
    return [Path(line) for line in done.stdout.splitlines()]


@pytest.mark.slow
@needs_checkout
def test_an_editable_install_finds_it_in_the_checkout(tmp_path):
    python, site = bare_environment(tmp_path / "env")
    (site / "_hovercontrol.pth").write_text(f"{CHECKOUT}\n")  # what an editable install leaves: a path,
    old = site / "hovercontrol" / "fmu"  # and a copy of what is forced into the wheel
    old.mkdir(parents=True)
    (old / "hc_model.h").write_text("#error old\n")
    package, found = used(python, tmp_path)
    assert package.parents[1] == CHECKOUT
    assert found == CHECKOUT / "fmu"


@pytest.mark.slow
@needs_checkout
def test_an_installed_wheel_has_it_inside_the_package(tmp_path):
    """As hatch lays a wheel out by pyproject.toml; where hatchling is here, hatch itself does it."""
    python, site = bare_environment(tmp_path / "env")
    try:
        from hatchling.builders.wheel import WheelBuilder
    except ImportError:
        lay_out(site)
    else:
        (wheel,) = WheelBuilder(str(CHECKOUT)).build(directory=str(tmp_path), versions=["standard"])
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(site)
    package, found = used(python, tmp_path)
    assert package.parents[1] == site
    assert found == site / "hovercontrol" / "fmu"


def lay_out(site: Path) -> None:
    """Copy what the wheel's section of pyproject.toml names to where it says."""
    build = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    wheel = build["targets"]["wheel"]
    moved = {name: name for name in wheel["packages"]} | wheel["force-include"]
    for source, target in moved.items():
        for path in (CHECKOUT / source).rglob("*"):
            if path.is_file() and path.suffix != ".pyc":
                place = site / target / path.relative_to(CHECKOUT / source)
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(path.read_bytes())
