"""FMI 2.0: the standard's prototypes and states, its status functions, and what is not supported."""

from __future__ import annotations

import dataclasses
import shutil
from ctypes import byref, c_int

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2EventInfo

from .blocks import plant
from .fmi_support import (
    CS,
    ME,
    STRICT,
    allowed_states,
    check_official_headers,
    in_state,
    official_functions,
    refused,
    run,
    symbols,
    vector,
    write_sources,
)


@pytest.fixture
def built(fmu):
    return fmu("follower", 2)


def test_the_prototypes_are_those_of_the_standard(compiler, tmp_path):
    check_official_headers(compiler, 2, tmp_path)


@pytest.mark.skipif(not shutil.which("nm"), reason="nm, which lists symbols, is not on this machine")
def test_the_library_exports_the_functions_of_the_standard_and_nothing_else(built):
    assert symbols(built.library, "-D") - {"_init", "_fini"} == official_functions(2)


@pytest.mark.skipif(not shutil.which("nm"), reason="nm, which lists symbols, is not on this machine")
def test_source_code_fmus_have_a_prefix(compiler, tmp_path):
    write_sources(plant(), 2, tmp_path)
    target = tmp_path / "binding.o"
    run([compiler, *STRICT, "-DFMI2_FUNCTION_PREFIX=craft_", "-c", tmp_path / "hc_fmi2.c", "-o", target])
    assert symbols(target) == {f"craft_{name}" for name in official_functions(2)}


def test_versions(built):
    instance = built.open(CS)
    assert instance.getVersion() == "2.0"
    assert instance.getTypesPlatform() == "default"
    instance.close()


X, Z = vector(np.zeros(1)), vector(np.zeros(9))


def raw(name, *arguments):
    return lambda i: i._call(name, i.component, *arguments)


#: Call, states in which FMI 2.0 allows it: of a Model Exchange instance, of a Co-Simulation instance.
CALLS = {
    "fmi2SetDebugLogging": (lambda i: i.setDebugLogging(True, ["logEvents"]), "INECTX", "INSTX"),
    "fmi2SetupExperiment": (lambda i: i.setupExperiment(), "I", "I"),
    "fmi2EnterInitializationMode": (lambda i: i.enterInitializationMode(), "I", "I"),
    "fmi2ExitInitializationMode": (lambda i: i.exitInitializationMode(), "N", "N"),
    "fmi2Terminate": (lambda i: i.terminate(), "EC", "S"),
    "fmi2Reset": (lambda i: i.reset(), "INECTX", "INSTX"),
    "fmi2GetReal": (lambda i: i.getReal([0, 1, 2]), "NECTX", "NSTX"),
    "fmi2GetInteger": (lambda i: i.getInteger([]), "NECTX", "NSTX"),
    "fmi2GetBoolean": (lambda i: i.getBoolean([]), "NECTX", "NSTX"),
    "fmi2GetString": (lambda i: i.getString([]), "NECTX", "NSTX"),
    "fmi2SetReal": (lambda i: i.setReal(i.built.vr("input"), [0.5]), "INEC", "INS"),
    "fmi2SetInteger": (lambda i: i.setInteger([], []), "INE", "INS"),
    "fmi2SetBoolean": (lambda i: i.setBoolean([], []), "INE", "INS"),
    "fmi2SetString": (lambda i: i.setString([], []), "INE", "INS"),
    "fmi2GetFMUstate": (lambda i: i.freeFMUstate(i.getFMUstate()), "INECTX", "INSTX"),
    "fmi2SetFMUstate": (lambda i: i.restore(i.snapshot()), "INECTX", "INSTX"),
    "fmi2GetDirectionalDerivative": (lambda i: i.getDirectionalDerivative([2], [1], [1.0]), "NECTX", "NSTX"),
    "fmi2EnterEventMode": (raw("fmi2EnterEventMode"), "EC", ""),
    "fmi2NewDiscreteStates": (raw("fmi2NewDiscreteStates", byref(fmi2EventInfo())), "E", ""),
    "fmi2EnterContinuousTimeMode": (raw("fmi2EnterContinuousTimeMode"), "E", ""),
    "fmi2CompletedIntegratorStep": (
        raw("fmi2CompletedIntegratorStep", 1, byref(c_int()), byref(c_int())), "C", ""),
    "fmi2SetTime": (raw("fmi2SetTime", 0.0), "EC", ""),  # in Event Mode as FMI 2.0.0 has it
    "fmi2SetContinuousStates": (raw("fmi2SetContinuousStates", X, 1), "C", ""),
    "fmi2GetDerivatives": (raw("fmi2GetDerivatives", X, 1), "NECTX", ""),
    "fmi2GetEventIndicators": (raw("fmi2GetEventIndicators", Z, 0), "NECTX", ""),
    "fmi2GetContinuousStates": (raw("fmi2GetContinuousStates", X, 1), "NECTX", ""),
    "fmi2GetNominalsOfContinuousStates": (raw("fmi2GetNominalsOfContinuousStates", X, 1), "INECTX", ""),
    "fmi2DoStep": (raw("fmi2DoStep", 0.0, 0.1, 1), "", "S"),
    "fmi2CancelStep": (raw("fmi2CancelStep"), "", ""),
    "fmi2GetStatus": (raw("fmi2GetStatus", 0, byref(c_int())), "", "ST"),
    "fmi2GetIntegerStatus": (raw("fmi2GetIntegerStatus", 0, byref(c_int())), "", "ST"),
    "fmi2GetBooleanStatus": (raw("fmi2GetBooleanStatus", 3, byref(c_int())), "", "ST"),
    "fmi2GetRealStatus": (raw("fmi2GetRealStatus", 2, X), "", "ST"),
}  # fmt: skip


@pytest.fixture
def reachable(monkeypatch):
    """FMPy binds one kind's functions to each of its classes; here an instance of either may call all."""
    for one, other in ((FMU2Model, FMU2Slave), (FMU2Slave, FMU2Model)):
        for name in dir(one):
            if name.startswith("fmi2") and not hasattr(other, name):
                monkeypatch.setattr(other, name, getattr(one, name), raising=False)


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("kind", [ME, CS])
def test_calls_are_allowed_where_the_standard_allows_them(built, reachable, kind, name):
    call, of_me, of_cs = CALLS[name]
    assert allowed_states(built, kind, call) == (of_me if kind == ME else of_cs)


#: kind of variable, states in which it may be set; inputs also before initialization, to their start values
SETTABLE = {"state": ("INC", "IN"), "input": ("INEC", "INS"), "parameter": ("INE", "INS"),
            "derivative": ("", ""), "output": ("", "")}  # fmt: skip


@pytest.mark.parametrize("kind", SETTABLE)
def test_what_may_be_set_when(built, kind):
    reference = built.vr(kind)[-1]
    for of, expected in zip((ME, CS), SETTABLE[kind], strict=True):
        assert allowed_states(built, of, lambda i: i.set([reference], [1.0])) == expected


def test_status_after_a_step(built):
    instance = built.open(CS).start()
    instance.step(0.0, 0.5)
    assert instance.getRealStatus(2) == 0.5
    assert instance.getBooleanStatus(3) == 0
    for call in (
        lambda: instance.getRealStatus(0),
        lambda: instance.getIntegerStatus(0),
        lambda: instance.getStatus(0),
    ):
        with pytest.raises(FMICallException) as caught:
            call()
        assert caught.value.status == 2  # fmi2Discard, as the standard asks
    instance.step(0.5, 0.5)
    instance.close()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda i: i.fmi2SetRealInputDerivatives(i.component, None, 0, None, None), "derivatives of inputs"),
        (lambda i: i.getRealOutputDerivatives([1], [2]), "order 2"),
        (lambda i: i.getBoolean([1]), "state lag.q (value reference 1) is no Boolean"),
        (lambda i: i.setInteger([1], [1]), "no Integer"),
        (lambda i: i.getString([88]), "unknown value reference 88"),
        (lambda i: i.fmi2GetReal(i.component, None, 2, X), "NULL"),
        (lambda i: i.fmi2GetReal(i.component, None, 2, None), "NULL"),
        (lambda i: i.fmi2SetReal(i.component, None, 1, X), "NULL"),
        (lambda i: i.fmi2GetFMUstate(i.component, None), "NULL"),
        (lambda i: i.fmi2DeSerializeFMUstate(i.component, None, 10, None), "NULL"),
        (lambda i: i.setDebugLogging(True, ["loggers"]), 'unknown log category "loggers"'),
        (lambda i: i.doStep(0.0, -0.1), "step size is -0.1"),
        (lambda i: i.doStep(3.0, 0.1), "begins at time 3"),
        (lambda i: i.doStep(0.0, 5.5), "after the stop time 5"),
    ],
)
def test_misuse_is_an_error_with_a_message(built, call, words):
    instance = built.open(CS).start(stop=5.0)
    data = instance.snapshot()
    assert refused(lambda: call(instance))
    assert instance.messages[-1][1] == "logStatusError"
    assert words in instance.last
    assert refused(lambda: instance.step(0.0, 0.1))
    instance.restore(data)
    instance.step(0.0, 0.1)
    instance.close()


@pytest.mark.parametrize(
    ("token", "name", "words"), [("{wrong}", "one", "token is"), (None, "", "needs a name")]
)
def test_an_instance_needs_the_guid_and_a_name(built, token, name, words):
    other = dataclasses.replace(built, token=token or built.token)
    with pytest.raises(RuntimeError, match=words):
        other.open(CS, name=name)


def test_no_logger_and_no_callbacks_at_all(built):
    instance = built.open(CS)
    without = instance.fmi2Instantiate(b"quiet", 1, built.token.encode(), None, None, 0, 1)
    assert without
    assert refused(lambda: instance.fmi2Terminate(without))
    instance.fmi2FreeInstance(without)
    assert instance.fmi2Instantiate(b"", 1, None, None, None, 0, 1) is None
    instance.close()


def test_signs_of_formats_are_doubled_in_messages(built):
    instance = built.open(CS)
    assert refused(lambda: instance.setDebugLogging(True, ["100%#"]))
    assert '"100%%##"' in instance.last
    instance.close()


def test_the_categories_given_are_the_only_ones(fmu):
    instance = fmu("driven", 2).open(CS)
    instance.setDebugLogging(True, ["logStatusError"])
    instance.start()
    instance.step(0.0, 2.0)
    assert not instance.messages
    instance.setDebugLogging(True, [])
    instance.step(2.0, 2.0)
    assert instance.messages[0][1] == "logEvents"
    instance.close()


def test_event_mode_is_left_after_an_update(built):
    instance = in_state(built, ME, "C")
    instance.enterEventMode()
    assert refused(instance.enterContinuousTimeMode)
    instance.close()
