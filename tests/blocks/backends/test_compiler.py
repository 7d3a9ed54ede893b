"""The C compiler is found or its lack said; libraries are built once, whole, and never loaded broken."""

import hashlib
import os
import platform
import shutil
import stat
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from hovercontrol import Block, Signal
from hovercontrol.blocks.backends import compiler, library, runtime
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.blocks.backends.compiler import (
    NoCompilerError,
    NotCachedError,
    cache_folder,
    find_compiler,
    load_library,
)
from hovercontrol.blocks.backends.library import Library, Solver
from hovercontrol.blocks.backends.runtime import SIMULATION, runtime_files, runtime_folder

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
TWO = {
    "two.c": '#include "two.h"\nEXPORT int two(void) { return TWO; }\n',
    "two.h": '#define EXPORT __attribute__((visibility("default")))\n#define TWO 2\n',
}


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HOVERCONTROL_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    compiler.version.cache_clear()
    return tmp_path / "cache" / "compiled"


def libraries(cache):
    return sorted(cache.glob("*/two-*.so"))


def script(path, text):
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@needs_cc
def test_a_library_is_built_once_and_then_found(cache, monkeypatch):
    assert load_library("two", TWO).two() == 2
    (first,) = libraries(cache)
    monkeypatch.setattr(compiler, "_build", None)  # would not be callable
    assert load_library("two", TWO).two() == 2
    assert libraries(cache) == [first]
    assert [p for p in cache.rglob("*") if p.is_file()] == [first]  # nothing temporary is left


@needs_cc
def test_other_sources_make_another_library(cache):
    load_library("two", TWO)
    assert load_library("two", TWO | {"two.h": TWO["two.h"].replace("TWO 2", "TWO 3")}).two() == 3
    assert len(libraries(cache)) == 2


@needs_cc
@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b[:-1] + b"?"])
def test_a_damaged_library_is_rebuilt_and_not_loaded(cache, damage):
    load_library("two", TWO)
    (path,) = libraries(cache)
    whole = path.read_bytes()
    path.unlink()  # the loaded one keeps its own bytes
    path.write_bytes(damage(whole))
    assert load_library("two", TWO).two() == 2
    assert [p.read_bytes() for p in libraries(cache)] == [whole]


@needs_cc
def test_a_warm_start_generates_nothing_unless_the_generator_changed(cache, cold, monkeypatch):
    cold(cache.parent)
    v, k = Signal("v", start=1.0), Signal("k", "1/s", start=2.0)
    two = Block("two", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    made = []

    def source(block, **options):
        made.append(block.name)
        return c_source(block, **options)

    monkeypatch.setattr(library, "c_source", source)
    for _ in range(2):
        Library(two, "events")
    assert made == ["two"]
    monkeypatch.setattr(compiler, "_generator", lambda: "another")
    Library(two, "events")
    assert made == ["two"] * 2
    (text, *_) = cache.glob("*/two-*.c")
    text.write_text(text.read_text().replace("-k*v", "0"))  # damaged
    monkeypatch.undo()
    monkeypatch.setenv("HOVERCONTROL_CACHE", str(cache.parent))
    assert Library(two, "events").point("derivatives", (2.0,))(0.0, [3.0]).tolist() == [-6.0]


def test_whatever_goes_into_a_library_is_in_its_name():
    """Each C file and header by name and content, the compiler, its version, the flags."""
    files = runtime_files(SIMULATION) | {"model.c": "int one;"}
    variants = [files]
    for name, text in files.items():
        others = {k: v for k, v in files.items() if k != name}
        variants += [others, others | {name: text + "\n"}, others | {"x": text}]
    made = {compiler._key(("cc",), ("-O3",), variant) for variant in variants}
    made |= {compiler._key(("cc", "-m32"), ("-O3",), files), compiler._key(("cc",), ("-O2",), files)}
    assert len(made) == 3 + 3 * len(files)
    assert compiler._key(("cc",), ("-O3",), dict(reversed(files.items()))) in made


def end_of(block):
    """Where a run of one second ends, by machine code."""
    times, solver = np.array([0.0, 1.0]), Solver("dormand-prince", 0.0, 1e-6, 1e-9)
    ready = Library(block, "events")
    return ready.simulate(solver, times, np.empty((0, 2)), np.ones(1), np.full(1, 2.0))[2][-1, 0]


def decays(count):
    v, k = Signal("v", start=1.0), Signal("k", "1/s", start=2.0)
    return [Block(f"n{n}", [v], [], [v], [k], {"v": -n * k.symbol * v.symbol}) for n in range(1, count + 1)]


@pytest.mark.slow
@needs_cc
def test_the_runtime_is_compiled_once_for_all_blocks(cache, monkeypatch):
    one, two = decays(2)
    made, build = [], compiler._build
    monkeypatch.setattr(
        compiler,
        "_build",
        lambda *given: (made.append(sorted(n for n in given[2] if n[-1] == "c")), build(*given))[1],
    )
    assert end_of(one) == pytest.approx(np.exp(-2.0), rel=1e-5)
    assert end_of(two) == pytest.approx(np.exp(-4.0), rel=1e-5)
    runtime_sources, *own = made
    assert runtime_sources == sorted(n for n in SIMULATION if n.endswith(".c"))
    assert own == [["exports.c", "lanes.c", "model.c"]] * 2
    (joined,) = cache.glob("*/runtime-*.o")
    joined.write_bytes(joined.read_bytes()[:-9])  # a damaged one is made anew
    assert end_of(decays(3)[2]) == pytest.approx(np.exp(-6.0), rel=1e-5)
    assert len(made) == 5


@pytest.mark.slow
@needs_cc
def test_a_compiler_that_joins_no_objects_compiles_all_at_once(cache, tmp_path, monkeypatch):
    script(tmp_path / "bin" / "own", 'case "$*" in *" -r "*) echo no -r >&2; exit 1;; esac; exec cc "$@"')
    monkeypatch.setenv("CC", str(tmp_path / "bin" / "own"))
    (one,) = decays(1)
    apart = end_of(one)
    assert not list(cache.glob("*/runtime-*.o"))
    monkeypatch.delenv("CC")
    assert end_of(one) == apart  # to the bit
    assert list(cache.glob("*/runtime-*.o"))


@pytest.mark.slow("hc_numbers")
@needs_cc
@pytest.mark.parametrize(
    ("name", "part", "changed"),
    [
        ("hc_methods.c", "35.0 / 384.0 * k1[i]", "36.0 / 384.0 * k1[i]"),
        ("hc_numbers.h", "fabs(value) <= DBL_MAX", "fabs(value) < 0.0"),
    ],
)
def test_a_changed_file_of_the_runtime_makes_a_new_library(
    cache, cold, monkeypatch, tmp_path, name, part, changed
):
    cold(cache.parent)
    v, k = Signal("v", start=1.0), Signal("k", "1/s", start=2.0)
    two = Block("two", [v], [], [v], [k], {"v": -k.symbol * v.symbol})

    def run():
        times, solver = np.array([0.0, 1.0]), Solver("dormand-prince", 0.0, 1e-6, 1e-9)
        status, _, states, *_ = Library(two, "events").simulate(
            solver, times, np.empty((0, 2)), np.ones(1), np.full(1, 2.0)
        )
        return status, states[-1, 0]

    first = run()
    assert first == (0, pytest.approx(np.exp(-2.0), rel=1e-5))
    other = shutil.copytree(runtime_folder(), tmp_path / "fmu")
    text = (other / name).read_text()
    assert part in text
    (other / name).write_text(text.replace(part, changed))
    monkeypatch.setattr(runtime, "_PLACES", (other,))
    assert run() != first
    assert len(libraries(cache)) == 2
    monkeypatch.undo()
    monkeypatch.setenv("HOVERCONTROL_CACHE", str(cache.parent))
    assert run() == first
    assert len(libraries(cache)) == 2


def test_all_code_that_writes_c_is_in_the_name_of_what_it_wrote():
    code = (
        "import sys, hovercontrol.blocks.backends.c_lanes, hovercontrol.blocks.backends.c_delays;"
        "print(*(n for n in sys.modules if n.startswith('hovercontrol.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    packages = {name.split(".")[1] for name in done.stdout.split()}
    harmless = {"base"}  # it writes messages and files
    assert set(compiler._GENERATORS) <= packages <= {*compiler._GENERATORS, *harmless}


@needs_cc
def test_a_library_that_may_not_be_built_is_not(cache):
    with pytest.raises(NotCachedError):
        load_library("two", TWO, build=False)
    load_library("two", TWO)
    assert load_library("two", TWO, build=False).two() == 2


@pytest.mark.skipif(sys.platform != "linux" or platform.machine() != "x86_64", reason="Linux on x86_64")
def test_the_processors_vectors_are_in_the_flags():
    assert ("-mavx2" in compiler.local_flags()) == (" avx2 " in Path("/proc/cpuinfo").read_text())


@pytest.mark.slow
@needs_cc
def test_processes_that_build_at_once_all_succeed(cache):
    code = (
        "from hovercontrol.blocks.backends.compiler import load_library\n"
        f"assert load_library('two', {TWO!r}).two() == 2"
    )
    running = [subprocess.Popen([sys.executable, "-c", code], env=os.environ.copy()) for _ in range(3)]
    assert [p.wait() for p in running] == [0, 0, 0]
    assert len([p for p in cache.rglob("*") if p.is_file()]) == 1


@needs_cc
def test_without_a_writable_cache_a_temporary_folder_does(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HOVERCONTROL_CACHE", str(tmp_path / "file"))
    assert cache_folder() == compiler._private_folder()
    assert load_library("two", TWO).two() == 2


def test_the_cache_is_where_the_user_keeps_caches(tmp_path, monkeypatch):
    monkeypatch.delenv("HOVERCONTROL_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "hovercontrol" / "compiled"


@needs_cc
def test_a_refused_source_is_one_line_that_names_the_log(cache):
    with pytest.raises(RuntimeError, match=r"two\.c:1.*error.*its log: .*\.log$") as caught:
        load_library("two", {"two.c": "int two(void) { return nothing; }"})
    assert "\n" not in str(caught.value)
    (log,) = cache.glob("*.log")
    assert str(log) in str(caught.value)
    assert "-ffp-contract=off" in log.read_text()
    assert not list(cache.glob(".build-*"))


def test_no_compiler_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(NoCompilerError, match="neither cc, gcc nor clang, nor ziglang"):
        find_compiler()


def test_a_compiler_of_the_users_choice_that_is_not_there_is_named(monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc -m64")
    with pytest.raises(NoCompilerError, match="'/nowhere/cc -m64', does not run"):
        find_compiler()


@pytest.mark.skipif(os.name == "nt", reason="needs a shell script as compiler")
def test_a_stub_that_does_not_answer_is_passed_over(tmp_path, monkeypatch):
    script(tmp_path / "bin" / "cc", "exit 1")
    script(tmp_path / "bin" / "gcc", "echo gcc 99")
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    assert find_compiler() == (str(tmp_path / "bin" / "gcc"),)


@pytest.mark.skipif(os.name == "nt", reason="needs a shell script as compiler")
def test_zig_comes_last_and_with_its_arguments(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: object())
    monkeypatch.setattr(compiler, "version", lambda command: "zig")
    assert find_compiler()[1:] == ("-m", "ziglang", "cc")


@needs_cc
def test_a_new_version_of_the_compiler_builds_anew(cache, monkeypatch):
    load_library("two", TWO)
    monkeypatch.setattr(compiler, "version", lambda command: "another")
    load_library("two", TWO)
    keys = {p.name.split("-")[1] for p in libraries(cache)}
    assert len(keys) == 2


# ---- compilers that are broken ------------------------------------------------------------------------


@pytest.mark.skipif(os.name == "nt", reason="needs a shell script as compiler")
@pytest.mark.parametrize(
    ("work", "said"),
    [
        ("sleep 60", "did not end within 0.3 s"),
        ("sleep 60 & wait", "did not end within 0.3 s"),
        ("echo 'fatal error: no headers' >&2; exit 1", "failed: fatal error: no headers"),
        ("exit 0", "failed: status 0"),
        ('while [ "$1" != -o ]; do shift; done; echo garbage > "$2"', "what it wrote is no library"),
        ('while [ "$1" != -o ]; do shift; done; cp /bin/sh "$2"', "cannot be used"),
        ('while [ "$1" != -o ]; do shift; done; mkdir "$2"', "failed: status 0"),
        ("kill -9 $$", "failed: status -9"),
    ],
)
def test_a_broken_compiler_leaves_the_work_to_numpy(tmp_path, monkeypatch, cache, work, said):
    from hovercontrol.blocks.backends.engines import _warn_once, engine_of
    from hovercontrol.blocks.block import Block
    from hovercontrol.blocks.signals import Signal

    script(tmp_path / "bin" / "cc", f'[ "$1" = --version ] && echo cc 1 && exit\n{work}')
    monkeypatch.setenv("CC", str(tmp_path / "bin" / "cc"))
    monkeypatch.setattr(compiler, "COMPILE_SECONDS", 0.3)
    monkeypatch.setattr(compiler, "_stalled", {})
    engine_of.cache_clear()
    _warn_once.cache_clear()
    v, k = Signal("v", "m/s", start=1.0), Signal("k", "1/s", start=1.0)
    with pytest.warns(UserWarning, match=said):
        decay = Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}).compile()
        assert decay.simulate([0.0, 1.0]).outputs[0, -1] == pytest.approx(0.36788, abs=1e-5)
    engine_of.cache_clear()


@pytest.mark.parametrize("text", ["gcc '", "'"])
def test_a_command_that_is_none_is_no_compiler(monkeypatch, text):
    monkeypatch.setenv("CC", text)
    with pytest.raises(NoCompilerError, match="does not run"):
        find_compiler()


def test_a_folder_in_the_place_of_a_library_is_passed_by(cache):
    load_library("two", TWO)
    (there,) = libraries(cache)
    there.unlink()
    there.mkdir()
    assert load_library("two", TWO).two() == 2


# ---- what others may have put there ------------------------------------------------------------------------

THREE = {**TWO, "two.h": TWO["two.h"].replace("TWO 2", "TWO 3")}
posix = pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")


def planted(cache, folder):
    """Put a library that returns 3 where the one that returns 2 is looked for; its name fits its bytes."""
    load_library("two", TWO)
    (right,) = libraries(cache)
    load_library("two", THREE)
    (wrong,) = (p for p in libraries(cache) if p != right)
    content = wrong.read_bytes()
    name = f"{right.stem.rpartition('-')[0]}-{hashlib.sha256(content).hexdigest()[:16]}.so"
    shutil.rmtree(cache)
    place = folder / name.split("-")[1][-2:] / name
    place.parent.mkdir(parents=True)
    place.write_bytes(content)
    for path in (cache.parent, cache, place.parent, place):
        path.chmod(0o700)
    return place


@pytest.fixture
def fresh(monkeypatch):
    """The temporary folder of a process that has loaded nothing, and told nothing."""
    for function in (compiler._private_folder, compiler._tell_distrust):
        function.cache_clear()
    yield
    for function in (compiler._private_folder, compiler._tell_distrust):
        function.cache_clear()


@needs_cc
@posix
def test_a_library_of_the_users_own_in_folders_of_the_users_own_is_taken(cache):
    planted(cache, cache)
    assert load_library("two", TWO).two() == 3, "so that the tests below show something"


@needs_cc
@posix
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o702])
@pytest.mark.parametrize("level", ["cache", "compiled"])
def test_a_cache_into_which_others_may_write_is_not_used(cache, mode, level, fresh):
    planted(cache, cache)
    {"cache": cache.parent, "compiled": cache}[level].chmod(mode)
    with pytest.warns(UserWarning, match="compiled code is not kept in .*: others may write to ") as said:
        assert load_library("two", TWO).two() == 2
        assert load_library("two", TWO).two() == 2
    assert len(said) == 1 and "\n" not in str(said[0].message)
    assert compiler._private_folder().stat().st_mode & 0o777 == 0o700


@needs_cc
@posix
@pytest.mark.parametrize("level", ["folder", "file"])
def test_a_part_of_the_cache_that_others_may_write_is_not_taken(cache, level):
    place = planted(cache, cache)
    {"folder": place.parent, "file": place}[level].chmod(0o766)
    assert load_library("two", TWO).two() == 2


@needs_cc
@posix
@pytest.mark.parametrize("level", ["compiled", "folder", "file"])
def test_a_link_in_the_cache_is_not_followed(cache, level, tmp_path, fresh):
    place = planted(cache, cache)
    path = {"compiled": cache, "folder": place.parent, "file": place}[level]
    path.rename(tmp_path / "far")
    path.symlink_to(tmp_path / "far")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert load_library("two", TWO).two() == 2


@needs_cc
@posix
@pytest.mark.skipif(getattr(os, "getuid", int)() != 0, reason="only root can give a file to another user")
@pytest.mark.parametrize("level", ["cache", "compiled", "folder", "file"])
def test_what_belongs_to_another_user_is_not_taken(cache, level, fresh):
    place = planted(cache, cache)
    os.chown(
        {"cache": cache.parent, "compiled": cache, "folder": place.parent, "file": place}[level], 1234, -1
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert load_library("two", TWO).two() == 2


@posix
def test_a_generated_text_that_others_may_write_is_made_again(cache):
    compiler.cached_text("text-0123456789abcdef01234567", ".c", lambda: "right")
    (path,) = cache.glob("*/text-*.c")
    path.chmod(0o666)
    assert compiler.cached_text("text-0123456789abcdef01234567", ".c", lambda: "again") == "again"


@needs_cc
@posix
@pytest.mark.parametrize("umask", [0o000, 0o002])
def test_a_cache_is_the_users_alone_whatever_the_umask(cache, umask, monkeypatch):
    before = os.umask(umask)
    try:
        load_library("two", TWO)
    finally:
        os.umask(before)
    monkeypatch.setattr(compiler, "_build", None)  # would not be callable
    assert load_library("two", TWO).two() == 2
    assert {p.stat().st_mode & 0o077 for p in (cache.parent, *cache.parent.rglob("*"))} == {0}
