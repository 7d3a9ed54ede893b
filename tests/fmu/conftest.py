"""The C runtime with hand-written models, built once in a session by the system's C compiler."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import pytest

from .blocks import BLOCKS
from .fmi_support import Built, build_fmu
from .support import MODELS, Runtime, compile_c, runtime_objects


@pytest.fixture(scope="session")
def compiler() -> str:
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return path
    pytest.skip("no C compiler (cc, gcc or clang) on this machine: the C runtime cannot be built")


@pytest.fixture(scope="session")
def build(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Runtime]:
    """Return a function that compiles tests/fmu/models/NAME.c with the runtime, once each."""
    folder = tmp_path_factory.mktemp("runtime")
    built: dict[tuple[str, ...], Runtime] = {}

    def make(name: str, *flags: str) -> Runtime:
        key = (name, *flags)
        if key not in built:
            path = folder / f"{'_'.join(key)}.so"
            how = ["-O1", "-fPIC", *flags]
            parts = [MODELS / f"{name}.c", *runtime_objects(compiler, how)]
            compile_c(compiler, parts, path, [*how, "-shared"])
            built[key] = Runtime(path)
        return built[key]

    return make


@pytest.fixture(scope="session")
def fmu(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Built]:
    """Return a function that builds the FMU of a Block of blocks.py, once for each version of FMI."""
    folder = tmp_path_factory.mktemp("fmus")
    built: dict[tuple[str, int], Built] = {}

    def make(name: str, version: int) -> Built:
        if (name, version) not in built:
            built[name, version] = build_fmu(compiler, BLOCKS[name](), version, folder / f"{name}{version}")
        return built[name, version]

    return make
