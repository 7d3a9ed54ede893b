"""A python-control system changes from Python to machine code when it pays, and its numbers stay."""

import pickle
import shutil
import warnings

import control as ct
import numpy as np
import pytest

from hovercontrol import interconnect
from hovercontrol.blocks.backends import compiler, points
from hovercontrol.blocks.backends.library import Library
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on this machine")
PARTS = loop_parts(load_scenario("table1"))
LOOP = interconnect(list(PARTS.values()), "loop")
X = np.array([s.start for s in LOOP.states])
GRID = np.linspace(0, 0.5, 6)
TIGHT = {"solve_ivp_kwargs": {"rtol": 1e-9, "atol": 1e-12}}


@pytest.fixture(autouse=True)
def fresh(cold, tmp_path, monkeypatch):
    """A cache without a library, and Blocks that have not been evaluated before."""
    cold(tmp_path)
    monkeypatch.setenv("HOVERCONTROL_CACHE", str(tmp_path))
    points.points.cache_clear()
    yield
    points.points.cache_clear()


@pytest.fixture
def soon(monkeypatch):
    """A library is loaded after the second evaluation, and built after the fourth."""
    size = points.Points(LOOP)._size["derivatives"]
    monkeypatch.setattr(points, "LOAD_AFTER", 2 * size)
    monkeypatch.setattr(points, "BUILD_AFTER", 4 * size)
    points.points.cache_clear()


def evaluate(system, times):
    for _ in range(times):
        system.dynamics(0.1, X, [])
    return system._native is not None


@needs_cc
def test_a_library_at_hand_is_loaded_soon(soon):
    Library(LOOP, "smooth")
    system = LOOP.to_control()
    assert not evaluate(system, 2)
    assert evaluate(system, 1)


@needs_cc
def test_a_library_is_built_only_when_as_much_time_was_spent(soon):
    system = LOOP.to_control()
    assert not evaluate(system, 4)
    assert evaluate(system, 1)
    assert evaluate(LOOP.to_control("another"), 1)  # equal Blocks share what they know


def test_a_short_script_waits_for_nothing(monkeypatch):
    monkeypatch.setattr(compiler, "find_compiler", None)  # would not be callable
    ct.input_output_response(LOOP.to_control(), GRID, 0, X)


def test_a_small_block_stays_in_python(soon, monkeypatch):
    monkeypatch.setattr(compiler, "find_compiler", None)
    system = PARTS["plant"].to_control()
    for _ in range(100):
        system.dynamics(0, np.zeros(6), [1.0, 0.1])
    assert system._native is None


def test_without_a_compiler_python_goes_on_and_nothing_is_said(soon, monkeypatch):
    monkeypatch.setenv("CC", "/nowhere/cc")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not evaluate(LOOP.to_control(), 20)


@needs_cc
def test_the_numbers_are_those_of_numpy_before_and_after(soon, rng):
    system, numpy = LOOP.to_control(), LOOP.to_numpy()
    key = "plant.yaw_coulomb"
    for k in range(12):
        x, params = rng.normal(size=83), {key: rng.uniform(0.5, 1.0)}
        expected = numpy.derivatives(0.1 * k, x, (), params)
        np.testing.assert_allclose(system.dynamics(0.1 * k, x, [], params=params), expected, 1e-12, 1e-12)
        expected = numpy.outputs(0.1 * k, x, (), params)
        np.testing.assert_allclose(system.output(0.1 * k, x, [], params=params), expected, 1e-12, 1e-12)
    assert system._native is not None
    assert system.dynamics(0, x, [])[5] != system.dynamics(0, x, [], params={key: 3.0})[5]


@pytest.mark.slow
@needs_cc
def test_a_simulation_is_the_same_and_so_is_one_inside_an_interconnection(soon, monkeypatch):
    before = ct.input_output_response(LOOP.to_control(), [0, 1e-9], 0, X, **TIGHT)  # changes over
    native = ct.input_output_response(LOOP.to_control(), GRID, 0, X, **TIGHT)
    points.points.cache_clear()
    monkeypatch.setenv("CC", "/nowhere/cc")
    python = ct.input_output_response(LOOP.to_control(), GRID, 0, X, **TIGHT)
    np.testing.assert_allclose(native.states, python.states, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(native.outputs, python.outputs, rtol=1e-9, atol=1e-9)
    assert before.state_labels == native.state_labels
    monkeypatch.delenv("CC")
    points.points.cache_clear()
    estimator = PARTS["estimator"].to_control()
    names = {"inputs": estimator.input_labels, "outputs": estimator.output_labels, "name": "wired"}
    wired = ct.interconnect([estimator], **names)
    state, u = X[6:], np.full(estimator.ninputs, 0.1)
    found = [wired.dynamics(0, state, u) for _ in range(8)]
    assert wired.syslist[0]._native is not None
    np.testing.assert_allclose(
        found, [PARTS["estimator"].to_numpy().derivatives(0, state, u)] * 8, 1e-12, 1e-12
    )


@needs_cc
def test_a_system_in_machine_code_is_pickled_and_copied(soon):
    system = LOOP.to_control()
    assert evaluate(system, 6)
    for twin in (pickle.loads(pickle.dumps(system)), system.copy(name="twin")):
        np.testing.assert_array_equal(twin.dynamics(0.1, X, []), system.dynamics(0.1, X, []))
