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

from .blocks import exported

HOST = Path(__file__).parent / "platforms" / "host.c"
ARM = Path("/usr/aarch64-linux-gnu")  # where Debian's libc6-arm64-cross puts the C library
if importlib.util.find_spec("ziglang") is None:
    pytest.skip("ziglang (hovercontrol[fmu]) is not installed", allow_module_level=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return an unzipped FMU with binaries for three platforms."""
    folder = tmp_path_factory.mktemp("platforms")
    path = exported("plant", 3, platforms=("x86_64-linux", "aarch64-linux", "x86_64-windows"))
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    return folder


def run(folder, platform, target, before=(), more=None):
    host = folder / f"host-{platform}.exe"
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-O1", "-std=c99", str(HOST)]
    libraries = [] if "windows" in target else ["-ldl"]
    subprocess.run([*zig, "-o", str(host), *libraries], check=True, cwd=folder)
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


@pytest.fixture(scope="module")
def native(folder):
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        pytest.skip("the native numbers are those of x86_64 Linux")
    return run(folder, "x86_64-linux", "x86_64-linux-gnu.2.17")


@pytest.mark.slow
def test_the_native_run_moves_and_sticks(native):
    last = native[:-3].reshape(-1, 6)
    assert abs(last[0, 3]) > 0.05 and (last[-1, 3:] == 0.0).any()


@pytest.mark.slow
def test_aarch64_linux_computes_the_same(folder, native):
    emulator = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
    if emulator is None or not (ARM / "lib").is_dir():
        pytest.skip("needs qemu-user and libc6-arm64-cross")
    found = run(folder, "aarch64-linux", "aarch64-linux-gnu.2.17", [emulator, "-L", str(ARM)])
    np.testing.assert_allclose(found, native, rtol=1e-12, atol=1e-13)


@pytest.mark.slow
def test_windows_computes_the_same(folder, native, tmp_path):
    wine = shutil.which("wine64") or shutil.which("wine")
    if wine is None:
        pytest.skip("needs wine")
    quiet = {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all"}
    found = run(folder, "x86_64-windows", "x86_64-windows-gnu", [wine], quiet)
    np.testing.assert_allclose(found, native, rtol=1e-12, atol=1e-13)
