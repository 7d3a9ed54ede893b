"""The C of an FMU is clean: strict warnings, the sanitisers, and no data that instances share."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import pytest

from hovercontrol.blocks.backends.runtime import DELAYS, FMI, INSTANCE

from .blocks import BLOCKS
from .fmi_support import STRICT, build, run, write_sources
from .support import MODELS, RUNTIME

HERE = MODELS.parent
BINDINGS = [name for name in (*INSTANCE, *FMI[2], *FMI[3], *DELAYS) if name.endswith(".c")]
MEMORY = "-fsanitize=address,undefined,float-divide-by-zero -fno-sanitize-recover=all"
FOLDER = tempfile.TemporaryDirectory(prefix="hovercontrol-drivers-")  # removed at the end of the process
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]


@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize("source", BINDINGS)
@pytest.mark.parametrize("name", COMPILERS)
def test_strict_warnings_find_nothing(name, source, level, tmp_path):
    more = ["-Wstrict-prototypes", "-Wmissing-prototypes", "-fvisibility=hidden"]
    run([name, *STRICT, *more, level, "-c", RUNTIME / source, "-o", tmp_path / "out.o"])


def drive(compiler, version, name, flags, *arguments):
    run([driver(compiler, version, name, flags), *arguments])


@cache
def driver(compiler, version, name, flags):
    """Build the program that drives an FMU, once in this process."""
    folder = Path(tempfile.mkdtemp(dir=FOLDER.name))
    sources = write_sources(BLOCKS[name](), version, folder, prefix=False)
    program = folder / "driver"
    probe = folder / "probe.txt"
    probe.write_text("int main(void) { return 0; }\n")
    command = [compiler, *flags.split(), "-x", "c", probe, "-o", program]
    if subprocess.run([str(c) for c in command], capture_output=True).returncode:
        pytest.skip(f"{compiler} cannot build with {flags} here")
    how = ["-D_POSIX_C_SOURCE=200809L", "-g", "-O1", *flags.split()]
    build(compiler, sources, how, [HERE / f"fmi{version}_sanitised.c", "-o", program, "-lpthread"])
    return program


@pytest.mark.slow
@pytest.mark.parametrize("what", ["cycles", "run", "misuse"])
def test_memory_of_fmi3(compiler, what):
    drive(compiler, 3, "plant", MEMORY, what)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["axes", "follower", "controller", "remembers"])
def test_memory_of_other_models(compiler, name):
    for what in ("run", "misuse"):
        drive(compiler, 3, name, MEMORY, what)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plant", "remembers"])
def test_memory_of_fmi2(compiler, name):
    drive(compiler, 2, name, MEMORY)


@pytest.mark.slow
def test_eight_instances_on_eight_threads(compiler):
    drive(compiler, 3, "axes", "-fsanitize=thread", "threads")


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("nm"), reason="nm, which lists symbols, is not on this machine")
@pytest.mark.parametrize("version", [2, 3])
def test_there_is_no_data_that_can_change(fmu, version, compiler, tmp_path):
    for source in write_sources(BLOCKS["plant"](), version, tmp_path):
        target = source.with_suffix(".o")
        run([compiler, *STRICT, "-fno-pie", "-c", source, "-o", target])
        changing = [line for line in run(["nm", target]).splitlines() if line.split()[-2] in "bBdDC"]
        assert not changing, changing
