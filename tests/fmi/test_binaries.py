"""Binaries: the right kind for each platform, small, for old C libraries; clear words where there is none."""

import importlib.util
import struct
import sys

import pytest

from hovercontrol import InputError
from hovercontrol.fmi.exporter import binaries
from hovercontrol.fmi.exporter.binaries import (
    OLDEST_GLIBC,
    PLATFORMS,
    build_binary,
    chosen_platforms,
    folder_of,
    needed_glibc,
    this_platform,
)
from hovercontrol.fmi.exporter.sources import fmu_sources
from hovercontrol.fmi.exporter.variables import Interface

from .blocks import BLOCKS

needs_zig = pytest.mark.skipif(
    importlib.util.find_spec("ziglang") is None, reason="ziglang (the extra fmu) is not installed"
)


def built(name, platform, version=3):
    interface = Interface(BLOCKS[name], "events")  # as test_platforms.py exports it: built once for both
    return build_binary(
        interface.identifier, fmu_sources(interface, version, 1e-6, 1e-9), PLATFORMS[platform]
    )


def machine(binary):
    """Return file format and machine from the header's numbers."""
    if binary[:4] == b"\x7fELF":
        return "ELF", {62: "x86_64", 183: "aarch64"}[struct.unpack_from("<H", binary, 18)[0]]
    if binary[:2] == b"MZ":
        (at,) = struct.unpack_from("<I", binary, 60)
        assert binary[at : at + 4] == b"PE\0\0"
        return "PE", {0x8664: "x86_64"}[struct.unpack_from("<H", binary, at + 4)[0]]
    assert struct.unpack_from("<I", binary)[0] == 0xFEEDFACF
    return "Mach-O", {0x01000007: "x86_64", 0x0100000C: "aarch64"}[struct.unpack_from("<I", binary, 4)[0]]


@pytest.mark.slow("windows", "darwin", "aarch64")
@needs_zig
@pytest.mark.parametrize(("platform", "version"), [("x86_64-linux", 2), *((name, 3) for name in PLATFORMS)])
def test_the_plants_binary_is_for_its_machine_small_and_self_contained(platform, version):
    binary = built("plant", platform, version)
    arch, system = platform.split("-")
    assert machine(binary) == ({"linux": "ELF", "windows": "PE", "darwin": "Mach-O"}[system], arch)
    assert len(binary) <= 180_000  # Windows' holds a part of the C library
    assert needed_glibc(binary) <= OLDEST_GLIBC
    assert (needed_glibc(binary) != (0,)) == (system == "linux")
    for trace in (b"/tmp/", b"/home/", b".debug_info", b"hc_instance.c"):
        assert trace not in binary


@pytest.mark.slow
@needs_zig
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux's compilers join objects")
@pytest.mark.parametrize("platform", ["x86_64-linux", "aarch64-linux"])
def test_fmus_of_different_names_share_one_compiled_runtime(platform, tmp_path, monkeypatch):
    monkeypatch.setenv("HOVERCONTROL_CACHE", str(tmp_path))
    plant, reference = (built(name, platform) for name in ("plant", "reference"))
    assert plant != reference
    assert len(list(tmp_path.glob("compiled/*/runtime-*.o"))) == 1


def test_this_machines_binary_runs_with_old_c_libraries_whichever_compiler_made_it(monkeypatch):
    if not sys.platform.startswith("linux"):
        pytest.skip("glibc is Linux's")
    monkeypatch.setattr(binaries, "_zig", lambda: None)
    try:
        binary = built("controller", this_platform())
    except InputError as error:
        pytest.skip(str(error))
    assert needed_glibc(binary) <= OLDEST_GLIBC


def test_only_the_functions_of_fmi_are_exported():
    if not sys.platform.startswith("linux"):
        pytest.skip("reads ELF")
    import subprocess
    import tempfile
    from pathlib import Path
    from shutil import which

    if which("nm") is None:
        pytest.skip("no nm on this machine")
    for version in (2, 3):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "plant.so")
            file.write_bytes(built("plant", this_platform(), version))
            listed = subprocess.run(
                ["nm", "-D", "--defined-only", file], check=True, capture_output=True, text=True
            ).stdout
        found = {line.split()[-1] for line in listed.splitlines()}
        assert len(found) > 30 and all(name.startswith(f"fmi{version}") for name in found)


def test_platforms_are_chosen_by_name():
    assert [p.name for p in chosen_platforms(None)] == [this_platform()]
    assert len(chosen_platforms("all")) == len(PLATFORMS)
    assert [p.name for p in chosen_platforms(["x86_64-windows", "x86_64-linux"])] == [
        "x86_64-linux",
        "x86_64-windows",
    ]
    for wrong, said in (
        ("win64", "unknown platform 'win64'"),
        ("", "platforms: expected one or more names, found none"),
        ([], "platforms: expected one or more"),
    ):
        with pytest.raises(InputError, match=said):
            chosen_platforms(wrong)


def test_fmi_2_has_folders_of_its_own_for_x86_only():
    folders = {p.name: folder_of(p, 2) for p in PLATFORMS.values()}
    assert folders["x86_64-linux"] == "linux64" and folders["x86_64-windows"] == "win64"
    assert folders["x86_64-darwin"] == "darwin64"
    assert folders["aarch64-linux"] == "aarch64-linux" and folders["aarch64-darwin"] == "aarch64-darwin"
    assert all(folder_of(p, 3) == p.name for p in PLATFORMS.values())


def test_without_ziglang_other_platforms_say_what_to_install(monkeypatch):
    monkeypatch.setattr(binaries, "_zig", lambda: None)
    other = next(name for name in PLATFORMS if name != this_platform())
    with pytest.raises(InputError, match=rf"{other} need ziglang: pip install '\.\[fmu\]'"):
        built("plant", other)


def test_without_any_compiler_one_line_says_so(monkeypatch):
    monkeypatch.setattr(binaries, "_zig", lambda: None)
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setattr("hovercontrol.blocks.backends.compiler._candidates", lambda: iter([("cc",)]))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(InputError, match=r"no C compiler.*pip install"):
        built("plant", this_platform())


@pytest.mark.slow
@needs_zig
def test_ziglang_serves_where_the_system_has_no_compiler(monkeypatch):
    def none():
        raise binaries.NoCompilerError("none")

    zig = binaries._zig()
    monkeypatch.setattr(binaries, "find_compiler", lambda: zig)
    binary = built("plant", this_platform())
    assert machine(binary)[1] == this_platform().split("-")[0]
    if sys.platform.startswith("linux"):
        assert needed_glibc(binary) <= OLDEST_GLIBC


def test_a_machine_without_a_name_is_refused(monkeypatch):
    monkeypatch.setattr(binaries.platform, "machine", lambda: "riscv64")
    with pytest.raises(InputError, match="no FMU binaries for this machine, riscv64-"):
        this_platform()
    monkeypatch.setattr(binaries.platform, "machine", lambda: "ARM64")
    monkeypatch.setattr(binaries.sys, "platform", "darwin")
    assert this_platform() == "aarch64-darwin"
