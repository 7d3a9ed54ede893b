"""The shared libraries of an FMU: one for each platform, by the system's compiler or a cross-compiler."""

from __future__ import annotations

import importlib.util
import platform
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from hovercontrol.base.errors import InputError, check_known, did_you_mean
from hovercontrol.blocks.backends.compiler import (
    NoCompilerError,
    built_file,
    cache_folder,
    find_compiler,
    with_runtime,
)
from hovercontrol.fmi.exporter.sources import Version, without_prefix


@dataclass(frozen=True)
class Platform:
    """A machine that an FMU can run on.

    Parameters
    ----------
    name : str
        FMI 3's platform tuple, the folder in ``binaries``.
    fmi2 : str
        FMI 2's folder. FMI 2.0 names x86 only; since 2.0.4 the others have FMI 3's names.
    suffix : str
        Of shared libraries.
    target : str
        ziglang's target name; on Linux with the oldest supported C library.
    """

    name: str
    fmi2: str
    suffix: str
    target: str


PLATFORMS = {
    p.name: p
    for p in (
        Platform("x86_64-linux", "linux64", ".so", "x86_64-linux-gnu.2.17"),
        Platform("aarch64-linux", "aarch64-linux", ".so", "aarch64-linux-gnu.2.17"),
        Platform("x86_64-windows", "win64", ".dll", "x86_64-windows-gnu"),
        Platform("x86_64-darwin", "darwin64", ".dylib", "x86_64-macos"),
        Platform("aarch64-darwin", "aarch64-darwin", ".dylib", "aarch64-macos"),
    )
}

#: The oldest glibc of a distribution still in use when FMI 3 appeared (CentOS 7).
OLDEST_GLIBC = (2, 17)

#: Functions of the mathematics library that got a second version after glibc 2.17: the first is asked for,
#: so that the system's compiler, too, makes files that run with older C libraries.
_OLD_NAMES = ("exp", "exp2", "log", "log2", "pow", "fmod", "hypot")
_OLD_HEADER = "hc_old_glibc.h"


#: The version of their first form: glibc's first on that machine.
_FIRST_GLIBC = {"x86_64-linux": "2.2.5", "aarch64-linux": "2.17"}


def _old_glibc(version: str) -> str:
    lines = (f'__asm__(".symver {name},{name}@GLIBC_{version}");' for name in _OLD_NAMES)
    return "#include <features.h>\n#ifdef __GLIBC__\n" + "\n".join(lines) + "\n#endif\n"


#: As for the local library: the same numbers everywhere. No path, date or build id goes into the file.
_FLAGS = (
    "-O2 -std=c99 -fno-math-errno -ffp-contract=off -shared -fvisibility=hidden -s -g0".split()  # noqa: SIM905
)
_NO_UNWINDING = ("-fno-asynchronous-unwind-tables", "-fno-unwind-tables")
_FLAGS_OF = {
    ".so": ("-fPIC", *_NO_UNWINDING, "-Wl,--build-id=none", "-Wl,-z,defs"),
    ".dll": ("-falign-loops=1",),  # a kilobyte less
    ".dylib": ("-fPIC", *_NO_UNWINDING),
}


def this_platform() -> str:
    """Return this machine's platform tuple.

    Raises
    ------
    InputError
        If FMUs for it cannot be built here.
    """
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    name = f"{machine}-{system}"
    if name not in PLATFORMS:
        raise InputError(f"no FMU binaries for this machine, {name}; known platforms: {', '.join(PLATFORMS)}")
    return name


def chosen_platforms(names: str | Iterable[str] | None) -> tuple[Platform, ...]:
    """Return platforms by name: None for this machine's, "all" for all known platforms.

    Raises
    ------
    InputError
        If a name is unknown; the message names the nearest one.

    Examples
    --------
    >>> [p.fmi2 for p in chosen_platforms("x86_64-linux,x86_64-windows")]
    ['linux64', 'win64']
    """
    if names is None:
        names = this_platform()
    wanted = [n.strip() for n in names.split(",") if n.strip()] if isinstance(names, str) else list(names)
    if not wanted:
        raise InputError(
            "platforms: expected one or more names, found none" + did_you_mean("", [*PLATFORMS, "all"])
        )
    known = [*PLATFORMS, "all"]
    for name in wanted:
        check_known(name, known, f"unknown platform {name!r}")
    every = "all" in wanted
    return tuple(p for p in PLATFORMS.values() if every or p.name in wanted)  # once each, in one order


def build_binary(
    name: str, files: Mapping[str, str], wanted: Platform, libraries: tuple[str, ...] = ()
) -> bytes:
    """Return the shared library for a platform, from the user's cache or built now.

    This machine's library is made by the system's compiler, or by ziglang (if installed) where the file would
    need a newer C library than :data:`OLDEST_GLIBC`. Those of other machines are made by ziglang.

    Parameters
    ----------
    name : str
        An identifier, prefix of the cached file's name.
    files : mapping of str to str
        C sources and headers by file name.
    libraries : tuple of str, optional
        Libraries that the file needs on Linux, as linkers name them: ``-ldl``.

    Raises
    ------
    InputError
        If there is no compiler for that platform (the message says what to install), or it fails.
    """
    zig, files = _zig(), without_prefix(files)
    own = _is_this_machine(wanted)
    if own:
        try:
            system = find_compiler()
        except NoCompilerError as error:
            raise InputError(f"{error}; pip install '.[fmu]' brings one") from None
        if system != zig:
            try:
                made = _built(name, files, system, (), wanted, libraries)
                if zig is None or needed_glibc(made) <= OLDEST_GLIBC:
                    return made
            except NoCompilerError as error:
                if zig is None:
                    raise InputError(str(error)) from None
    if zig is None:
        raise InputError(f"binaries for {wanted.name} need ziglang: pip install '.[fmu]'")
    try:
        return _built(name, files, zig, ("-target", wanted.target), wanted, libraries)
    except NoCompilerError as error:
        raise InputError(str(error)) from None


def _built(
    name: str,
    files: Mapping[str, str],
    command: tuple[str, ...],
    target: tuple[str, ...],
    wanted: Platform,
    libraries: tuple[str, ...],
) -> bytes:
    flags = (*target, *_FLAGS, *_FLAGS_OF[wanted.suffix])
    if not target and wanted.suffix == ".dylib":  # Apple's linker has no -s for libraries
        flags = (*(f for f in flags if f != "-s"), "-Wl,-x")
    if not target and wanted.name in _FIRST_GLIBC:
        flags = (*flags, "-Wl,-z,noseparate-code", "-include", _OLD_HEADER)
        files = {**files, _OLD_HEADER: _old_glibc(_FIRST_GLIBC[wanted.name])}
    if wanted.suffix == ".so":  # for the linker alone, wherever the sources stand in the command
        needed = (f"-Wl,--no-as-needed,{library}" for library in libraries)
        flags = (*flags, *(libraries if target else needed))
    label = f"{name}-{wanted.name}"
    built = with_runtime if not target or wanted.suffix == ".so" else built_file  # zig joins objects of ELF
    return built(cache_folder(), label, files, command, flags, wanted.suffix).read_bytes()


def _zig() -> tuple[str, ...] | None:
    return (sys.executable, "-m", "ziglang", "cc") if importlib.util.find_spec("ziglang") else None


def _is_this_machine(wanted: Platform) -> bool:
    try:
        return wanted.name == this_platform()
    except InputError:
        return False


def needed_glibc(binary: bytes) -> tuple[int, ...]:
    """Return the highest version of glibc symbols in a binary; (0,) if there are none.

    Examples
    --------
    >>> needed_glibc(b"..GLIBC_2.2.5..GLIBC_2.17..")
    (2, 17)
    """
    found = re.findall(rb"GLIBC_(\d+(?:\.\d+)+)", binary)
    return max((tuple(map(int, v.split(b"."))) for v in found), default=(0,))


def folder_of(wanted: Platform, version: Version) -> str:
    """Return the folder in ``binaries`` for a platform."""
    return wanted.fmi2 if version == 2 else wanted.name
