"""Source FMUs as C: several linked into one program, and nothing that a compiler warns of."""

import os
import shutil
import subprocess

import pytest

from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.parts import loop_parts
from hovercontrol.fmi.exporter.sources import fmu_sources
from hovercontrol.fmi.exporter.variables import Interface

try:
    CC = find_compiler()
except NoCompilerError as error:
    pytest.skip(str(error), allow_module_level=True)

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O0", "-fPIC", "-c"]


def objects(folder, interface, version):
    """Compile an FMU's sources as buildDescription.xml says, strictly."""
    folder.mkdir()
    for name, text in fmu_sources(interface, version, 1e-6, 1e-9).items():
        (folder / name).write_text(text)
    prefix = f"-DFMI{version}_FUNCTION_PREFIX={interface.identifier}_"
    files = sorted(file.name for file in folder.glob("*.c"))
    done = subprocess.run([*CC, *STRICT, prefix, *files], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:3000]
    return sorted(map(str, folder.glob("*.o")))


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt" or not shutil.which("nm"), reason="needs shared objects, and nm")
@pytest.mark.parametrize("version", [2, 3])
def test_two_fmus_are_linked_into_one_program(tmp_path, version):
    loop = load_scenario("k06-heading-bangbang")
    two = [vehicle("c17_simulation").plant(), loop_parts(loop)["controller"]]
    made = [objects(tmp_path / b.name, Interface(b, "events"), version) for b in two]
    done = subprocess.run(
        [*CC, "-shared", "-o", "both.so", *made[0], *made[1], "-lm"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[:2000]
    for block, files in zip(two, made, strict=True):
        listed = subprocess.run(["nm", "-g", "--defined-only", *files], capture_output=True, text=True)
        names = [line.split()[2] for line in listed.stdout.splitlines() if len(line.split()) == 3]
        assert len(names) > 100
        assert not [name for name in names if not name.startswith(f"{block.name}_")]


@pytest.mark.slow
def test_the_autopilot_with_all_its_conditions_compiles_without_a_warning(tmp_path):
    from hovercontrol.app.commands.exportable import choose

    assert objects(tmp_path / "loop", Interface(choose("k06-real-turn").block, "events"), 3)
