"""What all tests share: repeatable random numbers, figures without a screen, the command line."""

import os
import signal
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from threadpoolctl import threadpool_limits

from hovercontrol.app.cli import main
from hovercontrol.base import endings

if "PYTEST_XDIST_WORKER" in os.environ:  # one of as many processes as cores: BLAS takes no further ones
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    threadpool_limits(1, "blas")  # of libraries that are loaded

matplotlib.use("Agg")
settings.register_profile(
    "hovercraft",
    max_examples=10,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("hovercraft")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """A test marked ``slow("loop", "mass")`` is slow for parameters with one of these in their ids."""
    for item in items:
        item.own_markers[:] = [
            mark
            for mark in item.own_markers
            if mark.name != "slow" or not mark.args or any(part in item.name for part in mark.args)
        ]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20170917)


@pytest.fixture
def call(monkeypatch, capsys, request):
    """Return a function that runs ``hovercontrol WORDS`` here: a process takes seconds to start."""

    for number in endings.STOPS:  # a command listens to them until its process ends
        before = signal.getsignal(number)
        request.addfinalizer(lambda number=number, before=before: signal.signal(number, before))
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)

    def run(*words, cwd=None):
        if cwd:
            monkeypatch.chdir(cwd)
        monkeypatch.setattr(sys, "argv", ["hovercontrol", *words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        return subprocess.CompletedProcess(words, end.value.code, *capsys.readouterr())

    return run


@pytest.fixture(autouse=True)
def _no_open_figures():
    yield
    import matplotlib.pyplot as plt

    plt.close("all")
