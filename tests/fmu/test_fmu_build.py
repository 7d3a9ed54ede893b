"""The C of an FMU is clean: strict warnings, the sanitisers, and no data that instances share."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from hovercontrol.targets.runtime import DELAYS, FMI, INSTANCE

from .blocks import BLOCKS
from .fmi_support import STRICT, run, write_sources
from .support import MODELS, RUNTIME

HERE = MODELS.parent
BINDINGS = [name for name in (*INSTANCE, *FMI[2], *FMI[3], *DELAYS) if name.endswith(".c")]
MEMORY = "-fsanitize=address,undefined,float-divide-by-zero -fno-sanitize-recover=all"
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]


@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize("source", BINDINGS)
@pytest.mark.parametrize("name", COMPILERS)
def test_strict_warnings_find_nothing(name, source, level, tmp_path):
    more = ["-Wstrict-prototypes", "-Wmissing-prototypes", "-fvisibility=hidden"]
    run([name, *STRICT, *more, level, "-c", RUNTIME / source, "-o", tmp_path / "out.o"])


def drive(compiler, folder, version, name, flags, *arguments):
    sources = write_sources(BLOCKS[name](), version, folder)
    program = folder / "driver"
    probe = folder / "probe.txt"
    probe.write_text("int main(void) { return 0; }\n")
    command = [compiler, *flags.split(), "-x", "c", probe, "-o", program]
    if subprocess.run([str(c) for c in command], capture_output=True).returncode:
        pytest.skip(f"{compiler} cannot build with {flags} here")
    build = [compiler, *STRICT, "-D_POSIX_C_SOURCE=200809L", "-g", "-O1", *flags.split(), f"-I{folder}"]
    run([*build, *sources, HERE / f"fmi{version}_sanitised.c", "-o", program, "-lm", "-lpthread"])
    run([program, *arguments])


@pytest.mark.slow
@pytest.mark.parametrize("what", ["cycles", "run", "misuse"])
def test_memory_of_fmi3(compiler, tmp_path, what):
    drive(compiler, tmp_path, 3, "plant", MEMORY, what)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["axes", "follower", "controller", "remembers"])
def test_memory_of_other_models(compiler, tmp_path, name):
    for what in ("run", "misuse"):
        drive(compiler, tmp_path, 3, name, MEMORY, what)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plant", "remembers"])
def test_memory_of_fmi2(compiler, name, tmp_path):
    drive(compiler, tmp_path, 2, name, MEMORY)


@pytest.mark.slow
def test_eight_instances_on_eight_threads(compiler, tmp_path):
    drive(compiler, tmp_path, 3, "axes", "-fsanitize=thread", "threads")


@pytest.mark.skipif(not shutil.which("nm"), reason="nm, which lists symbols, is not on this machine")
@pytest.mark.parametrize("version", [2, 3])
def test_there_is_no_data_that_can_change(fmu, version, compiler, tmp_path):
    for source in write_sources(BLOCKS["plant"](), version, tmp_path):
        target = source.with_suffix(".o")
        run([compiler, *STRICT, "-fno-pie", "-c", source, "-o", target])
        changing = [line for line in run(["nm", target]).splitlines() if line.split()[-2] in "bBdDC"]
        assert not changing, changing
