"""The C runtime is clean: strict warnings, the sanitisers, and nothing but C99 and libm."""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest

from hovercontrol import interconnect
from hovercontrol.blocks.backends import shoot
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.blocks.backends.c_lanes import lanes_source, slopes_source
from hovercontrol.blocks.backends.runtime import AROUND, AROUND_FMI, FOLLOWING, SHOOTING
from hovercontrol.blocks.backends.shoot import Columns
from hovercontrol.control.controllers import tracking_controller
from hovercontrol.control.controllers.references import circle
from hovercontrol.craft.models.vehicles import c17_simulation

from .support import MODELS, OK, RUNTIME, SOURCES, STRICT, compile_c, runtime_objects

HERE = MODELS.parent
PARAMETERS = {
    "oscillator": [3.0, 0.4],
    "driven": [0.7, 0.1, 0.25, 1.0, 3.0, 0.5],
    "axes": [30.0, 5.0, 5.0, 2.0, 1.0, 0.5],
    "linked": [0.6, 0.5, 0.4],
    "smooth": [1.0, 1e-2, 50.0],
    "contradiction": [],
}


OTHERS = dict.fromkeys((*SHOOTING, *FOLLOWING, *AROUND))
ALL_SOURCES = list(dict.fromkeys([*SOURCES, *(RUNTIME / name for name in OTHERS if name.endswith(".c"))]))
#: They define the functions of the standard.
STANDARD = [RUNTIME / name for names in AROUND_FMI.values() for name in names if name.endswith(".c")]
#: How a system loads the library of an FMU inside another one.
LOADING = {"hc_inner_library.c": {"dlfcn.h", "windows.h"}}


@pytest.mark.parametrize("level", ["-O0", "-O3"])
@pytest.mark.parametrize("source", [*ALL_SOURCES, *STANDARD], ids=lambda path: path.name)
def test_strict_warnings_find_nothing(compiler, source, level, tmp_path):
    flags = [*STRICT, "-Wshadow", "-Wstrict-prototypes", "-Wmissing-prototypes", level, "-c", f"-I{RUNTIME}"]
    command = [compiler, *flags, str(source), "-o", str(tmp_path / "out.o")]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("source", [*ALL_SOURCES, *RUNTIME.glob("hc_*.h")], ids=lambda path: path.name)
def test_only_the_standard_library_is_used(source):
    included = set(re.findall(r"#include <(.*?)>", source.read_text()))
    allowed = "float math stdarg stdbool stddef stdint stdio stdlib string"
    assert included - LOADING.get(source.name, set()) <= {f"{name}.h" for name in allowed.split()}


def test_only_names_with_the_prefix_are_exported(compiler, tmp_path):
    names = set()
    for source in ALL_SOURCES:
        definition = r"^(?!static|typedef|struct|enum)\w[\w \*]*?(\w+)\("
        names |= set(re.findall(definition, source.read_text(), re.MULTILINE))
    assert names
    assert all(name.startswith("hc_") for name in names)


@pytest.mark.slow
@pytest.mark.parametrize("name", PARAMETERS)
def test_sanitisers_find_nothing(compiler, name, tmp_path):
    lines = run_sanitised(compiler, [MODELS / f"{name}.c"], PARAMETERS[name], tmp_path)
    if name != "contradiction":
        assert all(set(line.rsplit(" ", 1)[0]) <= {str(OK), " "} for line in lines), lines


@pytest.mark.slow
@pytest.mark.parametrize("closed", [True, False])
def test_sanitisers_find_nothing_in_lanes(compiler, closed, tmp_path):
    """C17's craft, generated, so that runs ride in lanes and get off at events, rows and jumps."""
    craft = c17_simulation()
    parts = [circle(1.0), tracking_controller(craft), craft.plant()]
    block = interconnect(parts, "loop") if closed else craft.plant()
    sources = {"model.c": c_source(block), "lanes.c": lanes_source(block)}
    for name, text in sources.items():
        (tmp_path / name).write_text(text)
    models = [tmp_path / name for name in sources]
    lines = run_sanitised(compiler, models, block.parameter_values(), tmp_path, "-DLANES=hc_model_lanes")
    assert all(set(line.rsplit(" ", 1)[0]) <= {str(OK), " "} for line in lines), lines


@pytest.mark.slow
def test_sanitisers_find_nothing_in_windows_and_their_slopes(compiler, tmp_path):
    """Windows of C17's craft, beside the same by NumPy."""
    block = c17_simulation().plant()
    lanes, slopes = (make(block, friction="smooth") for make in (lanes_source, slopes_source))
    models = [tmp_path / "lanes.c", tmp_path / "slopes.c"]
    for path, text in zip(models, (lanes, slopes), strict=True):
        path.write_text(text)
    program, flags = tmp_path / "sanitised", sanitising(compiler, tmp_path)
    compile_c(compiler, [HERE / "shooting.c", *models, RUNTIME / "hc_shoot.c"], program, flags)
    p = block.parameter_values()
    arguments = [str(v) for v in (len(block.states), len(block.inputs), *p)]
    result = subprocess.run([program, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    numbers = np.array(result.stdout.split(), dtype=float)
    if not numbers.size:
        pytest.skip("vectors gain nothing here")
    n, windows, steps = len(block.states), 11, (2, 2, 11)
    i = np.arange(np.prod(steps)).reshape(steps)
    u = 0.1 * (np.arange(len(block.inputs) * i.size) % 9).reshape(-1, *steps)
    start = (0.1 * (np.arange(n * windows) % 8) - 0.3).reshape(n, windows)
    columns = Columns(range(n), [n if k < 2 else -1 for k in range(len(p))])
    states, found = windows_by_numpy(
        block, np.zeros(steps), 0.01 + 0.001 * (i % 5), u, {3: 0.05 * (i % 7)}, p, start, columns
    )
    theirs = np.concatenate([states[-1].ravel(), found.ravel()])
    np.testing.assert_allclose(numbers, theirs, rtol=1e-10, atol=1e-12)


def windows_by_numpy(block, *arguments):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shoot, "_compiled", lambda block: None)
        return shoot.shoot_with_slopes(block, *arguments)


def sanitising(compiler, tmp_path):
    """Return the sanitisers' flags, or skip where the compiler has none."""
    flags = ["-g", "-O1", "-fsanitize=address,undefined,float-divide-by-zero", "-fno-sanitize-recover=all"]
    probe = tmp_path / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    call = [compiler, *flags, str(probe), "-o", str(tmp_path / "probe")]
    if subprocess.run(call, capture_output=True).returncode:
        pytest.skip(f"{compiler} cannot build with the address and undefined-behaviour sanitisers here")
    return flags


def run_sanitised(compiler, models, parameters, tmp_path, *more):
    """Return the lines that sanitised.c prints, one for each method."""
    program = tmp_path / "sanitised"
    flags = sanitising(compiler, tmp_path)
    runtime = runtime_objects(compiler, flags)
    compile_c(compiler, [HERE / "sanitised.c", *models, *runtime], program, [*flags, *more])
    arguments = [str(value) for value in parameters]
    result = subprocess.run([program, *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout.split("\n")[:2]
