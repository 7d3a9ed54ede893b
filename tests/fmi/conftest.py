"""The test FMU, compiled once, written and loaded as a test wants it."""

import os
import sys
import tempfile

import pytest

from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.fmi import load

from .probe import compile_probe, write_fmu
from .written import written_fmu


@pytest.fixture(scope="session")
def compiler():
    if os.name == "nt" or sys.platform == "darwin":
        pytest.skip("the test FMU is built for Linux only")
    try:
        return find_compiler()
    except NoCompilerError as error:
        pytest.skip(f"{error}: the test FMU cannot be built")


@pytest.fixture(scope="session")
def library(compiler, tmp_path_factory):
    return compile_probe(compiler, tmp_path_factory.mktemp("probe"))


@pytest.fixture(scope="session")
def once_library(compiler, tmp_path_factory):
    return compile_probe(compiler, tmp_path_factory.mktemp("once"), "-DONCE")


@pytest.fixture
def fmu(library, tmp_path):
    """Return a function that writes an FMU and returns its path."""

    def make(fmi=2, **described):
        return write_fmu(tmp_path / f"probe{len(list(tmp_path.iterdir()))}.fmu", library, fmi, **described)

    return make


@pytest.fixture(scope="session")
def written(compiler, tmp_path_factory):
    """Return a function that gives the file of an FMU written by hand in C."""
    made = {}

    def get(name):
        if name not in made:
            made[name] = written_fmu(name, tmp_path_factory.mktemp(name))
        return made[name]

    return get


@pytest.fixture
def probe(fmu):
    """Return a function that writes and loads an FMU; all are closed afterwards."""
    made = []

    def make(fmi=2, *, step=None, name=None, params=None, isolated=False, timeout=60.0, **described):
        path = fmu(fmi, **described)
        made.append(load(path, step=step, name=name, params=params, isolated=isolated, timeout=timeout))
        return made[-1]

    yield make
    for system in made:
        system.close()


@pytest.fixture
def calls(tmp_path, monkeypatch):
    """Return a function that gives the calls the FMU got since it was asked last."""
    path = tmp_path / "calls.log"
    monkeypatch.setenv("PROBE_LOG", str(path))

    def read():
        lines = path.read_text().splitlines() if path.exists() else []
        path.unlink(missing_ok=True)
        return lines

    return read


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Return the folder where FMUs are unpacked."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder
