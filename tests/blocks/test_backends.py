"""A Block's backends by name: those of the package, and those that other packages add."""

import sys

import numpy as np
import pytest

import hovercontrol as hc

MODULE = """
def rows(block, *, scale=1.0):
    return [scale * len(block.states), block.name]

number = 3
"""
ENTRIES = """
[hovercontrol.backends]
rows = stranger_backend:rows
gone = stranger_that_is_not_installed:rows
number = stranger_backend:number
numpy = stranger_backend:rows
"""


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    """Another package, as a package manager installs it."""
    (tmp_path / "stranger_backend.py").write_text(MODULE)
    metadata = tmp_path / "stranger_backend-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger-backend\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("stranger_backend", None)


@pytest.fixture
def decay():
    v, k = hc.Signal("v", "m/s", start=1.0), hc.Signal("k", "1/s", start=2.0)
    return hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})


def test_another_package_adds_a_backend(stranger, decay):
    assert decay.to("rows") == [1.0, "decay"]
    assert decay.to("rows", scale=3.0) == [3.0, "decay"]


def test_the_packages_own_backends_by_name(stranger, decay):
    assert decay.to("numpy").derivatives(0.0, [3.0], []) == pytest.approx([-6.0])  # -k v
    assert decay.to("control", step=0.5).linearize([1.0]).A.item() == pytest.approx(np.exp(-1.0))
    assert decay.to("compiled").derivatives(0.0, [3.0], []) == pytest.approx([-6.0])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (
            "row",
            "Block.to: unknown backend 'row'; did you mean 'rows'? "
            "known: c, casadi, compiled, control, fmu, gone, gym, jax, number, numpy, rows",
        ),
        (
            "zzz",
            "unknown backend 'zzz'; known: c, casadi, compiled, control, fmu, gone, gym, jax, number, numpy",
        ),
        ("gone", "'gone' .* cannot be loaded: No module named 'stranger_that_is_not_installed'"),
        ("number", "'number' .stranger_backend:number. is not a function"),
    ],
)
def test_a_backend_that_cannot_be_called_is_refused_in_one_line(stranger, decay, name, said):
    with pytest.raises(hc.InputError, match=said.replace("?", r"\?")) as error:
        decay.to(name)
    assert "\n" not in str(error.value)


def test_a_wrong_option_is_the_backends_own_error(stranger, decay):
    with pytest.raises(TypeError, match="unexpected keyword argument 'speed'"):
        decay.to("rows", speed=1)
    with pytest.raises(hc.InputError, match="step"):
        decay.to("control", step=-1.0)
