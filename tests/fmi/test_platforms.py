"""The binaries for other platforms run, where an emulator is installed, and compute the same numbers."""

import importlib.util
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

from hovercontrol.blocks.backends.compiler import find_compiler

HOST = Path(__file__).parent / "platforms" / "host.c"
ARM = Path("/usr/aarch64-linux-gnu")  # where Debian's libc6-arm64-cross puts the C library
if importlib.util.find_spec("ziglang") is None:
    pytest.skip("ziglang (the extra fmu) is not installed", allow_module_level=True)


def run(folder, platform, target, before=(), more=None):
    """Return what a host program prints that loads the FMU's binary; an empty target is this machine."""
    host = folder / f"host-{platform}.exe"
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", target]
    # optimised as the FMU's library is, for which zig has built what all programs need
    compiler = [*(zig if target else find_compiler()), "-O2", "-std=c99", str(HOST)]
    libraries = [] if "windows" in target else ["-ldl"]
    subprocess.run([*compiler, "-o", str(host), *libraries], check=True, cwd=folder)
    (library,) = (folder / "binaries" / platform).iterdir()
    token = fmpy.read_model_description(folder).instantiationToken
    done = subprocess.run(
        [*before, str(host), str(library), token],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, **(more or {})},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return np.array(done.stdout.split(), dtype=float)


def emulators(tmp_path):
    """Return what runs binaries of other platforms: platform, target, words before, environment."""
    arm = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
    if arm and (ARM / "lib").is_dir():
        yield "aarch64-linux", "aarch64-linux-gnu.2.17", [arm, "-L", str(ARM)], {}
    wine = shutil.which("wine64") or shutil.which("wine")
    if wine:
        quiet = {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all"}
        quiet["WINEDLLOVERRIDES"] = "mscoree,mshtml="  # no .NET and no browser in its new folder
        yield "x86_64-windows", "x86_64-windows-gnu", [wine], quiet


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or os.uname().machine != "x86_64",
    reason="the numbers to compare with are those of x86_64 Linux",
)
def test_other_platforms_compute_the_same(call, tmp_path):
    """One test: what two processes build side by side takes each of them a minute."""
    wanted = "x86_64-linux,aarch64-linux,x86_64-windows"
    done = call(
        "export", "table1:plant", "-o", "x.fmu", "--friction", "events", "--platforms", wanted, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert f"for {wanted.replace(',', ', ')};" in done.stdout
    assert set(fmpy.supported_platforms(str(tmp_path / "x.fmu"))) >= {"linux64", "win64", "c-code"}
    folder = tmp_path / "unzipped"
    with zipfile.ZipFile(tmp_path / "x.fmu") as archive:
        archive.extractall(folder)
    native = run(folder, "x86_64-linux", "")
    last = native[:-3].reshape(-1, 6)
    assert abs(last[0, 3]) > 0.05 and (last[-1, 3:] == 0.0).any()  # it moves, and it sticks
    there = list(emulators(tmp_path))
    for platform, target, before, more in there:
        found = run(folder, platform, target, before, more)
        np.testing.assert_allclose(found, native, rtol=1e-12, atol=1e-13, err_msg=platform)
    if len(there) < 2:
        pytest.skip(f"needs wine, and qemu-user with libc6-arm64-cross; ran: {[one[0] for one in there]}")
