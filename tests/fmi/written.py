"""FMUs of FMI 3 that are written by hand in C: models/*.c with models/frame.h and models/*.xml."""

from __future__ import annotations

import re
import subprocess
import zipfile
from pathlib import Path

import fmpy

from hovercontrol.blocks.backends.compiler import find_compiler

MODELS = Path(__file__).parent / "models"
HEADERS = Path(fmpy.__file__).parent / "c-code"


def written_fmu(name: str, folder: Path) -> Path:
    """Return an FMU of models/`name`.c, compiled; what it does not implement returns fmi3Error.

    Parameters
    ----------
    name : {"van_der_pol", "bouncing_ball", "dahlquist", "faulty", "clocked"}
    folder : Path
        Where it is written.
    """
    own = "".join((MODELS / file).read_text() for file in (f"{name}.c", "frame.h"))
    declared = re.findall(r"(fmi3\w+)TYPE\s+\1;", (HEADERS / "fmi3Functions.h").read_text())
    missing = [call for call in declared if f" {call}(" not in own and f" *{call}(" not in own]
    stubs = [f"int {call}(void);\nint {call}(void) {{ return 3; }}" for call in missing]
    (folder / "stubs.c").write_text("\n".join(stubs) + "\n")
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(
        [*find_compiler(), *strict, "-O2", "-fPIC", "-shared", f"-I{HEADERS}", MODELS / f"{name}.c",
         folder / "stubs.c", "-o", library, "-lm"],
        check=True,
    )  # fmt: skip
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(MODELS / f"{name}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{fmpy.platform_tuple}/{name}{fmpy.sharedLibraryExtension}")
    return path
