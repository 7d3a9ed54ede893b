"""The C compiler and the libraries it makes: found, built, kept in the user's cache.

Libraries are cached by the content of all that goes into them. A file's name holds the digest of its bytes,
so that a truncated one is seen before it is loaded; files are written atomically, and two processes may build
at once.
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

from hovercontrol.core.block import Block
from hovercontrol.errors import InputError
from hovercontrol.io.files import write_quietly
from hovercontrol.io.trusted import distrust, private_folder_made, trusted_bytes

#: The same numbers on every machine: no fast-math, no fused multiply-add, nothing of this processor alone.
#: (Measured: -flto and -march=native gain less than 10 %.)
FLAGS = (
    "-O3 -std=c99 -fno-math-errno -ffp-contract=off -fPIC -shared -fvisibility=hidden".split()  # noqa: SIM905
)
#: What lets a compiler use vectors for several lanes; nobody asks for the processor's exception flags.
_LANES = ("-fno-trapping-math", "-fopenmp-simd", "-DHC_SIMD")
#: Seconds after which a compiler that says nothing counts as broken: asked for its version, and at work. Zig
#: first builds the C library of each machine it compiles for: on a busy computer that took two minutes.
VERSION_SECONDS, COMPILE_SECONDS = 20.0, 300.0

_stalled: dict[tuple[str, ...], str] = {}
_MACH = (b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
#: Packages whose code decides what a Block's generated text says; the text itself holds the Block.
_GENERATORS = ("core", "targets")
_MAGIC = {  # how libraries and objects begin
    ".so": (b"\x7fELF", *_MACH),
    ".dll": (b"MZ",),
    ".dylib": _MACH,
    ".o": (b"\x7fELF", *_MACH, b"\x64\x86"),
}
_SUFFIX = ".dll" if os.name == "nt" else ".so"


class NoCompilerError(RuntimeError):
    """There is no C compiler; the text says what was looked for."""


class CompilerFailedError(NoCompilerError):
    """There is a C compiler, but it does not do its work: as good as none; the text says how it fails."""


class NotCachedError(LookupError):
    """What was looked for in the cache only is not there."""


def find_compiler() -> tuple[str, ...]:
    """Return the command of a C compiler: ``$CC``, else cc, gcc, clang, else the package ziglang.

    Raises
    ------
    NoCompilerError
        If there is none that answers.
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
    raise NoCompilerError("no C compiler: neither cc, gcc nor clang, nor ziglang of hovercontrol[fmu]")


def _candidates() -> Iterator[tuple[str, ...]]:
    yield from (("cc",), ("gcc",), ("clang",))
    if importlib.util.find_spec("ziglang"):
        yield sys.executable, "-m", "ziglang", "cc"


@cache
def version(command: tuple[str, ...]) -> str:
    """Return what a compiler says of its version, empty if it does not run (Apple's stub, a broken link)."""
    try:
        status, out, _ = _answer([*command, "--version"], None, VERSION_SECONDS)
    except (OSError, ValueError, subprocess.SubprocessError):
        return ""
    return out.strip() if status == 0 else ""


def _answer(call: Sequence[str], folder: str | None, seconds: float) -> tuple[int, str, str]:
    """Run a compiler and all that it starts; return its status, output and errors.

    Raises
    ------
    subprocess.TimeoutExpired
        If it has not ended by then; it is ended.
    """
    with subprocess.Popen(
        call, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        errors="replace", start_new_session=True,
    ) as process:  # fmt: skip
        try:
            out, said = process.communicate(timeout=seconds)
        except BaseException:  # the time is up, or Ctrl-C
            with contextlib.suppress(OSError, AttributeError):
                os.killpg(process.pid, signal.SIGKILL)
            process.kill()
            raise
    return process.returncode, out, said


def cache_folder() -> Path:
    """Return the folder of cached libraries: ``$HOVERCONTROL_CACHE``, else the user's cache directory.

    Where that cannot be written, or where others may put a library, a private temporary folder that ends with
    this process; of others a warning tells.
    """
    own = os.environ.get("HOVERCONTROL_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or "~/.cache"
    try:
        place = Path(own or os.path.join(base, "hovercontrol")).expanduser()
        private_folder_made(place)
        folder = place.resolve() / "compiled"  # the user may have links, below them there are none
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
    """Tell once that a cache is not used."""
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
    """Return the flags for a library that stays on this machine, with the vectors of its processor.

    These change the last digits of Runge-Kutta sweeps and nothing else. They are in the names of the cached
    libraries, so that another machine with the same home directory does not load what it cannot run.
    """
    info = Path("/proc/cpuinfo")
    with contextlib.suppress(OSError):
        if platform.machine() == "x86_64" and " avx2 " in info.read_text(encoding="utf-8"):
            return (*FLAGS, *_LANES, "-mavx2")
    return (*FLAGS, *_LANES)


def load_library(name: str, files: Mapping[str, str], *, build: bool = True) -> ctypes.CDLL:
    """Return a shared library of C sources, from the cache or built now.

    Parameters
    ----------
    name : str
        Begins the file's name; an identifier.
    files : mapping of str to str
        Sources (``.c``) and headers by file name.
    build : bool, optional
        Whether to build a library that is not in the cache.

    Raises
    ------
    NoCompilerError
        If there is no C compiler, or it fails, or does not end in time.
    NotCachedError
        Without `build`, if there is none.
    """
    command = find_compiler()
    for place in (cache_folder, _private_folder):
        folder, flags = place(), local_flags()
        if not (build or _cached(folder, f"{name}-{_key(command, flags, files)}", _SUFFIX)):
            raise NotCachedError
        try:
            return ctypes.CDLL(str(with_runtime(folder, name, files, command, flags, _SUFFIX)))
        except OSError as error:  # of another system that shares this home; no exec there; a full disk
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
    """Return a library from the cache or built now; its C runtime is an object that all libraries share.

    The runtime's sources (``hc_*.c``) are the same for every Block and take most of the compiler's time.
    Arguments and errors are those of :func:`built_file`.
    """
    stem = f"{name}-{_key(command, flags, files)}"
    found = _cached(folder, stem, suffix)
    if found:
        return found
    runtime = {file: text for file, text in files.items() if file.startswith("hc_")}
    if any(file.endswith(".c") for file in runtime):
        compiling = [flag for flag in flags if flag not in ("-shared", "-s") and not flag.startswith("-Wl,")]
        with contextlib.suppress(CompilerFailedError):  # one that cannot join objects compiles all at once
            joined = built_file(folder, "runtime", runtime, command, (*compiling, "-r", "-nostdlib"), ".o")
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
    """Return the binary that a compiler makes of C sources, from a cache folder or built now.

    Parameters
    ----------
    folder : Path
        See :func:`cache_folder`.
    name, files
        As for :func:`load_library`.
    command : tuple of str
        The compiler; its version counts, too.
    flags : sequence of str
    suffix : str
        Of the binary's file name, with the dot.

    Raises
    ------
    CompilerFailedError
        If the compiler refuses the sources (the line names its log) or does not end in time.
    """
    stem = f"{name}-{_key(command, flags, files)}"
    return _cached(folder, stem, suffix) or _build(folder, stem, files, command, flags, suffix)


def _key(command: tuple[str, ...], flags: Sequence[str], files: Mapping[str, str]) -> str:
    parts = [*flags, *command, version(command), sys.platform, platform.machine()]
    for name in sorted(files):
        parts += [name, files[name]]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]


def _cached(folder: Path, stem: str, suffix: str) -> Path | None:
    """Return the library of that name whose bytes are those its name promises; remove any other.

    It is the user's own, and others cannot have written it; the same holds for the folders that it lies in.
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
    """Return the part of a cache folder for names that end in a key: to look through all takes time."""
    return folder / stem[-2:]


def _made_shelf(folder: Path, stem: str) -> Path:
    """Return a part of a cache folder, made for the user alone; earlier versions followed the umask."""
    shelf = _shelf(folder, stem)
    shelf.mkdir(mode=0o700, exist_ok=True)
    if shelf.is_symlink():
        raise NotADirectoryError(f"{shelf} is a symbolic link")
    if distrust(shelf, within=folder):
        shelf.chmod(0o700)
    return shelf


def cached_text(stem: str, suffix: str, make: Callable[[], str]) -> str:
    """Return a generated text that is slow to make, from the cache or made now.

    Parameters
    ----------
    stem : str
        Begins the file's name; ends in a hexadecimal key of all that the text depends on.
    suffix : str
        Of the file, with the dot.
    make : callable
    """
    folder = cache_folder()
    found = _cached(folder, stem, suffix)
    if found is not None:
        with contextlib.suppress(OSError):  # another process removed it
            return found.read_text(encoding="utf-8")
    text = make()
    digest = _digest(text.encode())
    with contextlib.suppress(InputError, OSError):  # a full disk: it is made again next time
        target = _made_shelf(folder, stem) / f"{stem}-{digest}{suffix}"
        write_quietly(target, lambda path: path.write_bytes(text.encode()), mode=0o600)
    return text


def generated(block: Block, kind: str, make: Callable[[], str]) -> str:
    """Return a text that is generated from a Block, made once for each version of the code that makes it.

    Parameters
    ----------
    block : Block
    kind : str
        Which text, with all options.
    make : callable
    """
    parts = (block.content_hash, kind, _generator())
    key = hashlib.sha256("\0".join(parts).encode()).hexdigest()[:24]
    return cached_text(f"{block.name}-{key}", ".c", make)


@cache
def _generator() -> str:
    """Return a digest of all code that a generated text depends on: that of Blocks, and that of backends."""
    digest = hashlib.sha256(f"{sp.__version__} {sys.version}".encode())
    package = Path(__file__).parents[1]
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
        except OSError:  # Windows: the same file, built by another process, is in use
            if not target.exists():
                raise
        return target
