"""FMI 3.0: the standard's prototypes and states, event mode of Co-Simulation, and what is not supported."""

from __future__ import annotations

import shutil
from ctypes import byref, c_bool, c_double, c_size_t

import numpy as np
import pytest

from .blocks import plant
from .fmi_support import (
    CS,
    ME,
    STRICT,
    allowed_states,
    check_official_headers,
    official_functions,
    refused,
    run,
    symbols,
    vector,
    write_sources,
)


@pytest.fixture
def built(fmu):
    return fmu("follower", 3)


def test_the_prototypes_are_those_of_the_standard(compiler, tmp_path):
    check_official_headers(compiler, 3, tmp_path)


@pytest.mark.skipif(not shutil.which("nm"), reason="nm, which lists symbols, is not on this machine")
def test_the_library_exports_the_functions_of_the_standard_and_nothing_else(built):
    assert symbols(built.library, "-D") - {"_init", "_fini"} == official_functions(3)


@pytest.mark.skipif(not shutil.which("nm"), reason="nm, which lists symbols, is not on this machine")
def test_source_code_fmus_have_a_prefix(compiler, tmp_path):
    write_sources(plant(), 3, tmp_path)
    found = set()
    for source in tmp_path.glob("hc_fmi3*.c"):
        target = source.with_suffix(".o")
        run([compiler, *STRICT, "-DFMI3_FUNCTION_PREFIX=craft_", "-c", source, "-o", target])
        found |= symbols(target)
    assert found == {f"craft_{name}" for name in official_functions(3)}


X, Z = vector(np.zeros(1)), vector(np.zeros(9))


def raw(name, *arguments):
    return lambda i: i._call(name, i.component, *arguments)


#: Call, states in which FMI 3.0 allows it: in Model Exchange, in Co-Simulation with event mode.
CALLS = {
    "fmi3SetDebugLogging": (lambda i: i.setDebugLogging(True, ["logEvents"]), "INECTX", "INESTX"),
    "fmi3EnterInitializationMode": (lambda i: i.enterInitializationMode(), "I", "I"),
    "fmi3ExitInitializationMode": (lambda i: i.exitInitializationMode(), "N", "N"),
    "fmi3EnterEventMode": (lambda i: i.enterEventMode(), "C", "S"),
    "fmi3Terminate": (lambda i: i.terminate(), "EC", "ES"),
    "fmi3Reset": (lambda i: i.reset(), "INECTX", "INESTX"),
    "fmi3GetFloat64": (lambda i: i.getFloat64([0, 1, 2]), "INECTX", "INESTX"),
    "fmi3SetFloat64": (lambda i: i.setFloat64(i.built.vr("input"), [0.5]), "INEC", "INES"),
    "fmi3GetInt32": (lambda i: i.getInt32([]), "INECTX", "INESTX"),
    "fmi3SetInt32": (lambda i: i.setInt32([], []), "INE", "INES"),
    "fmi3GetFMUState": (lambda i: i.freeFMUState(i.getFMUState()), "INECTX", "INESTX"),
    "fmi3SetFMUState": (lambda i: i.restore(i.snapshot()), "INECTX", "INESTX"),
    "fmi3GetDirectionalDerivative": (lambda i: i.getDirectionalDerivative([2], [1], [1.0]), "NECTX", "NESTX"),
    "fmi3GetAdjointDerivative": (lambda i: i.getAdjointDerivative([2], [1], [1.0]), "NECTX", "NESTX"),
    "fmi3UpdateDiscreteStates": (lambda i: i.updateDiscreteStates(), "E", "E"),
    "fmi3EvaluateDiscreteStates": (
        lambda i: i._call("fmi3EvaluateDiscreteStates", i.component), "E", "E"),
    "fmi3EnterContinuousTimeMode": (lambda i: i._call("fmi3EnterContinuousTimeMode", i.component), "E", ""),
    "fmi3CompletedIntegratorStep": (
        raw("fmi3CompletedIntegratorStep", True, byref(c_bool()), byref(c_bool())), "C", ""),
    "fmi3SetTime": (lambda i: i._call("fmi3SetTime", i.component, 0.0), "C", ""),
    "fmi3SetContinuousStates": (lambda i: i._call("fmi3SetContinuousStates", i.component, X, 1), "C", ""),
    "fmi3GetContinuousStateDerivatives": (
        lambda i: i._call("fmi3GetContinuousStateDerivatives", i.component, X, 1), "NECTX", ""),
    "fmi3GetEventIndicators": (lambda i: i._call("fmi3GetEventIndicators", i.component, Z, 0), "NECTX", ""),
    "fmi3GetContinuousStates": (lambda i: i._call("fmi3GetContinuousStates", i.component, X, 1), "NECTX", ""),
    "fmi3GetNominalsOfContinuousStates": (
        lambda i: i._call("fmi3GetNominalsOfContinuousStates", i.component, X, 1), "NECTX", ""),
    "fmi3GetNumberOfEventIndicators": (
        lambda i: i._call("fmi3GetNumberOfEventIndicators", i.component, byref(c_size_t())), "INECTX", ""),
    "fmi3GetNumberOfContinuousStates": (
        lambda i: i._call("fmi3GetNumberOfContinuousStates", i.component, byref(c_size_t())), "INECTX", ""),
    "fmi3EnterStepMode": (lambda i: i._call("fmi3EnterStepMode", i.component), "", "E"),
    "fmi3DoStep": (
        raw("fmi3DoStep", 0.0, 0.1, True, *(byref(c_bool()) for _ in range(3)), byref(c_double())), "", "S"),
}  # fmt: skip


@pytest.fixture
def reachable(monkeypatch):
    """FMPy binds one kind's functions to each of its classes; here an instance of either may call all."""
    from fmpy.fmi3 import FMU3Model, FMU3Slave

    for name in dir(FMU3Model):
        if name.startswith("fmi3") and not hasattr(FMU3Slave, name):
            monkeypatch.setattr(FMU3Slave, name, getattr(FMU3Model, name), raising=False)
    for name in dir(FMU3Slave):
        if name.startswith("fmi3") and not hasattr(FMU3Model, name):
            monkeypatch.setattr(FMU3Model, name, getattr(FMU3Slave, name), raising=False)


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("kind", [ME, CS])
def test_calls_are_allowed_where_the_standard_allows_them(built, reachable, kind, name):
    call, of_me, of_cs = CALLS[name]
    assert allowed_states(built, kind, call) == (of_me if kind == ME else of_cs)


NOT_SUPPORTED = {
    "fmi3GetOutputDerivatives": (lambda i: i.getOutputDerivatives([1], [2]), "order 2"),
    "fmi3EnterConfigurationMode": (lambda i: i.enterConfigurationMode(), "structural"),
    "fmi3GetNumberOfVariableDependencies": (
        lambda i: i.fmi3GetNumberOfVariableDependencies(i.component, 1, None),
        "dependencies",
    ),
    "fmi3GetClock": (lambda i: i.getClock([1]), "no clocks"),
    "fmi3SetClock": (lambda i: i.setClock([1], [True]), "no clocks"),
    "fmi3GetFloat32": (lambda i: i.getFloat32([1]), "state lag.q (value reference 1) is no Float32"),
    "fmi3GetInt32": (lambda i: i.getInt32([1]), "is a real number"),
    "fmi3GetInt64": (lambda i: i.getInt64([1]), "no Int64"),
    "fmi3SetBoolean": (lambda i: i.setBoolean([1], [True]), "no Boolean"),
    "fmi3SetString": (lambda i: i.setString([1], ["x"]), "no String"),
    "fmi3GetBinary": (lambda i: i.getBinary([1]), "no Binary"),
    "fmi3GetUInt8": (lambda i: i.getUInt8([77]), "unknown value reference 77"),
}


@pytest.mark.parametrize("name", NOT_SUPPORTED)
def test_what_is_not_supported_says_so(built, name):
    call, words = NOT_SUPPORTED[name]
    instance = built.open(CS).start()
    assert refused(lambda: call(instance))
    assert words in instance.last
    assert instance.last.startswith(name)
    instance.close()


def test_scheduled_execution_is_refused_with_a_message(built):
    from fmpy.fmi3 import FMU3ScheduledExecution

    messages = []
    fmu = FMU3ScheduledExecution(
        guid=built.token, unzipDirectory=str(built.folder), modelIdentifier="follower"
    )
    with pytest.raises(Exception, match="instantiate"):
        fmu.instantiate(logMessage=lambda *m: messages.append(m[3]))
    assert b"not supported" in messages[0]


@pytest.mark.parametrize(
    ("time", "length", "words"),
    [
        (0.0, 0.0, "step size is 0"),
        (0.0, -1.0, "step size is -1"),
        (0.0, float("nan"), "must be positive"),
        (0.0, float("inf"), "must be positive"),
        (0.0, 1e-300, None),
        (0.5, 0.1, "begins at time 0.5, but the FMU is at time 0"),
        (float("nan"), 0.1, "but the FMU is at time 0"),
        (0.0, 2.5, "after the stop time 2"),
    ],
)
def test_steps_that_cannot_be(built, time, length, words):
    instance = built.open(CS).start(stop=2.0)
    if words is None:
        instance.step(time, length)
    else:
        assert refused(lambda: instance.step(time, length))
        assert words in instance.last
    instance.close()


def test_a_step_that_does_not_change_the_time(built):
    instance = built.open(CS).start()
    instance.step(0.0, 1.0)
    assert refused(lambda: instance.step(1.0, 1e-20))
    assert "does not change the time" in instance.last
    instance.close()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda i: i.enter_initialization(tolerance=0.0), "tolerance is 0"),
        (lambda i: i.enter_initialization(tolerance=float("nan")), "tolerance is"),
        (lambda i: i.enter_initialization(start=float("inf")), "start time"),
        (lambda i: i.enter_initialization(start=1.0, stop=0.5), "before the start"),
        (lambda i: i.setDebugLogging(True, ["loggers"]), 'unknown log category "loggers"'),
        (lambda i: i.fmi3SetDebugLogging(i.component, True, 1, None), "categories is NULL"),
        (lambda i: i.fmi3GetFloat64(i.component, None, 1, X, 1), "NULL"),
        (lambda i: i.fmi3SetFloat64(i.component, None, 1, X, 1), "NULL"),
        (lambda i: i.fmi3GetFloat64(i.component, None, 1, X, 2), "1 value references but 2 values"),
        (lambda i: i.fmi3GetFMUState(i.component, None), "NULL"),
        (lambda i: i.fmi3SetFMUState(i.component, None), "NULL"),
        (lambda i: i.fmi3SerializedFMUStateSize(i.component, None, None), "NULL"),
        (lambda i: i.getFloat64([0, 4_000_000_000]), "unknown value reference 4000000000"),
    ],
)
def test_arguments_that_cannot_be(built, call, words):
    instance = built.open(CS)
    assert refused(lambda: call(instance))
    assert words in instance.last
    assert refused(lambda: instance.enter_initialization())
    assert "after an error" in instance.last
    instance.reset()
    instance.start().step(0.0, 0.1)
    instance.close()


def test_null_is_no_instance(built):
    instance = built.open(CS)
    for name in ("fmi3Terminate", "fmi3Reset", "fmi3ExitInitializationMode"):
        assert refused(lambda: getattr(instance.fmu, name)(None))  # noqa: B023
    instance.fmi3FreeInstance(None)
    instance.close()


@pytest.mark.parametrize(
    ("token", "name", "words"),
    [
        ("{wrong}", "one", "token"),
        ("", "one", "token"),
        (None, "", "needs a name"),
        (None, " \t", "needs a name"),
    ],
)
def test_an_instance_needs_the_token_and_a_name(built, token, name, words):
    import dataclasses

    other = dataclasses.replace(built, token=built.token if token is None else token)
    with pytest.raises(RuntimeError, match=words):
        other.open(CS, name=name)


#: States in which a kind may be set: Model Exchange, Co-Simulation, Co-Simulation with event mode
SETTABLE = {
    "state": ("INC", "IN", "IN"),
    "input": ("INEC", "INS", "INES"),
    "parameter": ("INE", "INS", "INE"),
    "derivative": ("", "", ""),
    "output": ("", "", ""),
}


@pytest.mark.parametrize("kind", SETTABLE)
def test_what_may_be_set_when(built, kind):
    reference = built.vr(kind)[-1]

    def call(instance):
        instance.set([reference], [1.0])

    assert allowed_states(built, ME, call) == SETTABLE[kind][0]
    assert allowed_states(built, CS, call) == SETTABLE[kind][2]
    plain = built.open(CS).start()
    assert refused(lambda: call(plain)) == ("S" not in SETTABLE[kind][1])
    plain.close()
