"""Find the C compiler, build libraries with it, and keep them in the user's cache.

The cache key of a library is a digest of everything that it is built from. A file's name contains the digest
of its bytes, so that a truncated file is detected before it is loaded. Files are written atomically, and two
processes can build at the same time.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import write_quietly
from hovercontrol.base.trusted import distrust, make_private_folder, trusted_bytes
from hovercontrol.blocks.block import Block

#: Flags for the same numerical results on every machine: no fast-math, no fused multiply-add, no instructions
#: of a particular processor. (Measured: -flto and -march=native gain less than 10 %.)
FLAGS = (
    "-O3 -std=c99 -fno-math-errno -ffp-contract=off -fPIC -shared -fvisibility=hidden".split()  # noqa: SIM905
)
#: Flags that allow vector instructions for several lanes; the processor's exception flags are not used.
_LANES = ("-fno-trapping-math", "-fopenmp-simd", "-DHC_SIMD")
#: Flags by what the processor has, the best first. The last two are for the code of lanes, hc_lanes_math.h.
_PROCESSORS = {
    ("-mavx2", "-DHC_FMA", "-DHC_AVX512"): {"avx2", "fma", "avx512f", "avx512dq", "avx512vl"},
    ("-mavx2", "-DHC_FMA"): {"avx2", "fma"},
    ("-mavx2",): {"avx2"},
}
#: Time limits [s] after which a compiler counts as broken: for printing its version, and for compiling. Zig
#: first builds the C library of each target machine, which took two minutes on a busy computer.
VERSION_SECONDS, COMPILE_SECONDS = 20.0, 300.0

_stalled: dict[tuple[str, ...], str] = {}
_MACH = (b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
#: Rooms whose code determines the text generated from a Block.
_GENERATORS = ("blocks",)
_MAGIC = {  # first bytes of libraries and object files
    ".so": (b"\x7fELF", *_MACH),
    ".dll": (b"MZ",),
    ".dylib": _MACH,
    ".o": (b"\x7fELF", *_MACH, b"\x64\x86"),
}
_SUFFIX = ".dll" if os.name == "nt" else ".so"


class NoCompilerError(RuntimeError):
    """No C compiler was found; the message lists the ones tried."""


class CompilerFailedError(NoCompilerError):
    """A C compiler was found but does not work; the message gives the reason."""


class NotCachedError(LookupError):
    """The library is not in the cache and was not to be built."""


def find_compiler() -> tuple[str, ...]:
    """Return the command of a C compiler: ``$CC``, else cc, gcc, clang, else the package ziglang.

    Raises
    ------
    NoCompilerError
        If no working compiler is found.
    """
    try:
        chosen = shlex.split(os.environ.get("CC", ""))
    except ValueError as error:
        raise NoCompilerError(f"the C compiler of $CC, {os.environ['CC']!r}, does not run: {error}") from None
    for command in [tuple(chosen)] if chosen else _candidates():
        path = shutil.which(command[0])
        if path and version((path, *command[1:])):
            return (os.path.abspath(path), *command[1:])
    if chosen:
        raise NoCompilerError(f"the C compiler of $CC, {shlex.join(chosen)!r}, does not run")
    raise NoCompilerError("no C compiler: neither cc, gcc nor clang, nor ziglang (pip install '.[fmu]')")


def _candidates() -> Iterator[tuple[str, ...]]:
    yield from (("cc",), ("gcc",), ("clang",))
    if importlib.util.find_spec("ziglang"):
        yield sys.executable, "-m", "ziglang", "cc"


@cache
def version(command: tuple[str, ...]) -> str:
    """Return a compiler's version text, empty if it does not run (Apple's stub, a broken link)."""
    try:
        status, out, _ = _answer([*command, "--version"], None, VERSION_SECONDS)
    except (OSError, ValueError, subprocess.SubprocessError):
        return ""
    return out.strip() if status == 0 else ""


def _answer(call: Sequence[str], folder: str | None, seconds: float) -> tuple[int, str, str]:
    """Run a compiler; return its exit status, output and error output.

    Raises
    ------
    subprocess.TimeoutExpired
        If it takes longer than `seconds`; the compiler and its child processes are then killed.
    """
    with subprocess.Popen(
        call, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            out, said = process.communicate(timeout=seconds)
        except BaseException:  # timeout or Ctrl-C
            with contextlib.suppress(OSError, AttributeError):
                os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            raise
    return process.returncode, out, said


def cache_folder() -> Path:
    """Return the folder of cached libraries: ``$HOVERCONTROL_CACHE``, else the user's cache directory.

    If that folder is not writable, or if other users could put a library there, a temporary folder is used
    that is deleted at the end of this process. In the second case a warning says so.
    """
    own = os.environ.get("HOVERCONTROL_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or "~/.cache"
    try:
        place = Path(own or os.path.join(base, "hovercontrol")).expanduser()
        make_private_folder(place)
        folder = place.resolve() / "compiled"  # links are allowed above this folder, not below
        folder.mkdir(mode=0o700, exist_ok=True)
        reason = distrust(folder)
        if reason:
            _tell_distrust(str(folder), reason)
            return _private_folder()
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):  # read-only, full, no home
        return _private_folder()


@cache
def _tell_distrust(folder: str, reason: str) -> None:
    """Warn once that a cache folder is not used."""
    text = (
        f"compiled code is not kept in {folder}: {reason}; chmod go-w, or another $HOVERCONTROL_CACHE, helps"
    )
    warnings.warn(text, stacklevel=3)


@cache
def _private_folder() -> Path:
    folder = tempfile.mkdtemp(prefix="hovercontrol-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


@cache
def local_flags() -> tuple[str, ...]:
    """Return the flags for a library used only on this machine, with vector instructions of its processor.

    These flags only change the last digits of Runge-Kutta sweeps. They are part of the cache key, so that
    another machine with the same home directory does not load a library that it cannot run.
    """
    info = Path("/proc/cpuinfo")
    with contextlib.suppress(OSError):
        known = info.read_text(encoding="utf-8").split() if platform.machine() == "x86_64" else []
        for flags, needed in _PROCESSORS.items():
            if needed <= {*known}:
                return (*FLAGS, *_LANES, *flags)
    return (*FLAGS, *_LANES)


def load_library(name: str, files: Mapping[str, str], *, build: bool = True) -> ctypes.CDLL:
    """Return a shared library of C sources, from the cache or newly built.

    Parameters
    ----------
    name : str
        Start of the file's name; an identifier.
    files : mapping of str to str
        Sources (``.c``) and headers by file name.
    build : bool, optional
        Whether to build a library that is not in the cache.

    Raises
    ------
    NoCompilerError
        If there is no C compiler, or it fails or takes too long.
    NotCachedError
        If the library is not in the cache and `build` is false.
    """
    command = find_compiler()
    for place in (cache_folder, _private_folder):
        folder, flags = place(), local_flags()
        if not (build or _cached(folder, f"{name}-{_key(command, flags, files)}", _SUFFIX)):
            raise NotCachedError
        try:
            return ctypes.CDLL(str(with_runtime(folder, name, files, command, flags, _SUFFIX)))
        except OSError as error:  # a foreign system's file, noexec, or a full disk
            reason = error
    raise CompilerFailedError(f"a compiled library cannot be used: {reason}")


def with_runtime(
    folder: Path,
    name: str,
    files: Mapping[str, str],
    command: tuple[str, ...],
    flags: Sequence[str],
    suffix: str,
) -> Path:
    """Return a library, cached or newly built; all libraries share the object file of their C runtime.

    The sources of the runtime (``hc_*.c``) are the same for every Block and take most of the compile time.
    Arguments and errors are those of :func:`built_file`.
    """
    stem = f"{name}-{_key(command, flags, files)}"
    found = _cached(folder, stem, suffix)
    if found:
        return found
    runtime = {file: text for file, text in files.items() if file.startswith("hc_")}
    if any(file.endswith(".c") for file in runtime):
        linking = ("-shared", "-s"), ("-Wl,", "-l")
        compiling = [flag for flag in flags if flag not in linking[0] and not flag.startswith(linking[1])]
        alone = ("-r",) if "ziglang" in command else ("-r", "-nostdlib")  # zig's has no headers then
        with contextlib.suppress(CompilerFailedError):  # if it cannot join objects, compile all at once
            joined = built_file(folder, "runtime", runtime, command, (*compiling, *alone), ".o")
            own = {file: text for file, text in files.items() if file not in runtime or file.endswith(".h")}
            return _build(folder, stem, own, command, (*flags, str(joined)), suffix)
    return _build(folder, stem, files, command, flags, suffix)


def built_file(
    folder: Path,
    name: str,
    files: Mapping[str, str],
    command: tuple[str, ...],
    flags: Sequence[str],
    suffix: str,
) -> Path:
    """Return the binary of C sources, from a cache folder or newly built.

    Parameters
    ----------
    folder : Path
        See :func:`cache_folder`.
    name, files
        As for :func:`load_library`.
    command : tuple of str
        The compiler; its version is part of the cache key.
    suffix : str
        Suffix of the binary's file name, with the dot.

    Raises
    ------
    CompilerFailedError
        If the compiler fails (the message gives its log file) or takes too long.
    """
    stem = f"{name}-{_key(command, flags, files)}"
    return _cached(folder, stem, suffix) or _build(folder, stem, files, command, flags, suffix)


def _key(command: tuple[str, ...], flags: Sequence[str], files: Mapping[str, str]) -> str:
    parts = [*flags, *command, version(command), sys.platform, platform.machine()]
    for name in sorted(files):
        parts += [name, files[name]]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _cached(folder: Path, stem: str, suffix: str) -> Path | None:
    """Return the library of that name whose bytes match the digest in its name; remove any other.

    The file and its folders must belong to the user and must not be writable by others.
    """
    shelf = _shelf(folder, stem)
    if not shelf.exists() or distrust(shelf, within=folder):
        return None
    for path in sorted(shelf.glob(f"{stem}-*{suffix}")):
        content = trusted_bytes(path)
        if content is not None and _digest(content) == path.stem.rpartition("-")[2]:
            return path
        with contextlib.suppress(OSError):  # another process removed it, or it is a folder
            path.unlink()
    return None


def _shelf(folder: Path, stem: str) -> Path:
    """Return the subfolder of a cache folder for a key; subfolders keep the search short."""
    return folder / stem[-2:]


def _made_shelf(folder: Path, stem: str) -> Path:
    """Return the subfolder for a key, created for this user only; earlier versions followed the umask."""
    shelf = _shelf(folder, stem)
    shelf.mkdir(mode=0o700, exist_ok=True)
    if shelf.is_symlink():
        raise NotADirectoryError(f"{shelf} is a symbolic link")
    if distrust(shelf, within=folder):
        shelf.chmod(0o700)
    return shelf


def cached_text(stem: str, suffix: str, make: Callable[[], str]) -> str:
    """Return a generated text that takes long to generate, from the cache or newly generated.

    Parameters
    ----------
    stem : str
        Start of the file's name; ends in a hexadecimal key of everything that the text depends on.
    suffix : str
        Suffix of the file, with the dot.
    make : callable
        Generates the text.
    """
    folder = cache_folder()
    found = _cached(folder, stem, suffix)
    if found is not None:
        with contextlib.suppress(OSError):  # another process removed it
            return found.read_text(encoding="utf-8")
    text = make()
    digest = _digest(text.encode())
    with contextlib.suppress(InputError, OSError):  # full disk: the text is generated again next time
        target = _made_shelf(folder, stem) / f"{stem}-{digest}{suffix}"
        write_quietly(target, lambda path: path.write_bytes(text.encode()), mode=0o600)
    return text


def generated(block: Block, kind: str, make: Callable[[], str]) -> str:
    """Return a text generated from a Block, generated once for each version of the generating code.

    Parameters
    ----------
    kind : str
        Kind of the text, with all options.
    make : callable
        Generates the text.
    """
    parts = (block.content_hash, kind, _generator())
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]
    return cached_text(f"{block.name}-{key}", ".c", make)


@cache
def _generator() -> str:
    """Return a digest of all code that a generated text depends on: that of Blocks and of backends."""
    digest = hashlib.sha256(f"{sp.__version__} {sys.version}".encode())
    package = Path(__file__).parents[2]
    for folder in _GENERATORS:
        for file in sorted((package / folder).rglob("*.py")):
            digest.update(f"\0{file.relative_to(package).as_posix()}\0".encode() + file.read_bytes())
    return digest.hexdigest()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _build(
    folder: Path,
    stem: str,
    files: Mapping[str, str],
    command: tuple[str, ...],
    flags: Sequence[str],
    suffix: str,
) -> Path:
    with tempfile.TemporaryDirectory(prefix=".build-", dir=folder, ignore_cleanup_errors=True) as work:
        for name, text in files.items():
            Path(work, name).write_text(text, encoding="utf-8")
        made = Path(work, f"library{suffix}")
        sources = [name for name in sorted(files) if name.endswith(".c")]
        call = [*command, *flags, *sources, "-o", made.name, *(["-lm"] if suffix != ".o" else [])]
        if command in _stalled:
            raise CompilerFailedError(_stalled[command])
        try:
            status, out, said = _answer(call, work, COMPILE_SECONDS)
        except subprocess.TimeoutExpired:
            _stalled[command] = f"the C compiler {command[0]} did not end within {COMPILE_SECONDS:g} s"
            raise CompilerFailedError(_stalled[command]) from None
        except (OSError, ValueError) as error:
            raise CompilerFailedError(f"the C compiler {command[0]} does not run: {error}") from None
        if status != 0 or not made.is_file():
            log = folder / f"{stem}.log"
            log.write_text(f"{shlex.join(call)}\n{out}{said}", encoding="utf-8")
            first = next((x for x in said.splitlines() if "error" in x), f"status {status}")
            raise CompilerFailedError(f"the C compiler {command[0]} failed: {first.strip()}; its log: {log}")
        content = made.read_bytes()
        if not content[:4].startswith(_MAGIC[suffix]):
            raise CompilerFailedError(f"the C compiler {command[0]} failed: what it wrote is no library")
        target = _made_shelf(folder, stem) / f"{stem}-{_digest(content)}{suffix}"
        made.chmod(0o700)
        try:
            os.replace(made, target)
        except OSError:  # Windows: another process built the same file and uses it
            if not target.exists():
                raise
        return target
