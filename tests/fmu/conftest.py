"""The C runtime with hand-written models, built once in a session by the system's C compiler."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import pytest

from .support import MODELS, SOURCES, Runtime, compile_c


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
            compile_c(compiler, [MODELS / f"{name}.c", *SOURCES], path, ["-O3", "-shared", "-fPIC", *flags])
            built[key] = Runtime(path)
        return built[key]

    return make
