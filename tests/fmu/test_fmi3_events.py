"""FMI 3.0: event mode and early return of Co-Simulation, logging, adjoint derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from .fmi_support import (
    CS,
    ME,
    in_state,
    refused,
    vector,
)
from .test_friction import exact, pieces


@pytest.fixture
def built(fmu):
    return fmu("follower", 3)


# ---- event mode and early return ----


def test_early_return_at_the_events_of_friction(fmu):
    built = fmu("driven", 3)
    instance = built.open(CS, eventModeUsed=True, earlyReturnAllowed=True).start(tolerance=1e-9)
    t, events = 0.0, []
    while t < 20.0:
        event, early, reached = instance.step(t, 1.0 if t <= 19.0 else 20.0 - t)
        assert early == event
        if event:
            events.append((reached, instance.modes(built.vr("mode"))[0]))
            instance.enterEventMode()
            instance.update()
            instance.enterStepMode()
        t = reached
    expected = [piece for piece in pieces(0.7, 20.0)[1:] if piece[0] <= 20.0]
    assert [mode for _, mode in events] == [mode for _, mode in expected]
    np.testing.assert_allclose([at for at, _ in events], [at for at, _ in expected], atol=1e-6)
    assert instance.states()[0] == pytest.approx(exact(0.7, np.array([0.0, 20.0]))[1], abs=1e-6)
    instance.close()


def test_early_return_at_the_switches_of_the_clock(built):
    """Before the discrete states are updated the values are those before the switch."""
    instance = built.open(CS, eventModeUsed=True, earlyReturnAllowed=True)
    instance.enter_initialization()
    instance.exitInitializationMode()
    *_, defined, at = instance.update()
    assert (defined, at) == (True, 1.0)
    instance.enterStepMode()
    assert instance.step(0.0, 0.75) == (False, False, 0.75)
    before = instance.get(built.vr("derivative"))[0]
    assert instance.step(0.75, 0.75) == (True, True, 1.0)
    assert abs(instance.get(built.vr("derivative"))[0]) < 3.0 * abs(before) + 1e-6
    instance.enterEventMode()
    *_, defined, at = instance.update()
    assert (defined, at) == (True, 2.5)
    assert abs(instance.get(built.vr("derivative"))[0]) > 0.5
    instance.enterStepMode()
    assert instance.step(1.0, 0.5) == (False, False, 1.5)
    assert instance.step(1.5, 1.0) == (True, False, 2.5)  # just at the end: no early return, but an event
    instance.close()


@pytest.mark.parametrize("options", [{}, {"eventModeUsed": True}, {"earlyReturnAllowed": True}])
def test_without_early_return_events_are_handled_inside(built, options):
    instance = built.open(CS, **options).start()
    assert instance.step(0.0, 1.3) == (False, False, 1.3)
    plain = built.open(CS).start()
    plain.step(0.0, 1.3)
    assert instance.states() == plain.states()
    instance.close()
    plain.close()


def test_event_mode_needs_to_be_asked_for(built):
    instance = built.open(CS).start()
    assert refused(lambda: instance.enterEventMode())
    assert "eventModeUsed" in instance.last
    instance.close()


def test_discrete_states_are_updated_before_event_mode_is_left(built):
    for kind in (ME, CS):
        instance = in_state(built, kind, "C" if kind == ME else "S")
        instance.enterEventMode()
        assert refused(instance.enterContinuousTimeMode if kind == ME else instance.enterStepMode)
        assert "updated" in instance.last
        instance.close()


# ---- logging ----


def test_events_are_logged_only_when_asked_for(fmu):
    for logging in (True, False):
        instance = fmu("driven", 3).open(CS, logging=logging).start()
        for k in range(30):
            instance.step(0.1 * k, 0.1)
        assert bool(instance.messages) == logging
        if logging:
            status, category, text = instance.messages[0]
            assert (status, category) == (0, "logEvents")
            assert text.startswith("v slips forwards from time 0.775")
        assert refused(lambda: instance.get([999]))  # noqa: B023
        assert instance.last.startswith(
            "fmi3GetFloat64: unknown value reference 999"
        )  # also with logging off
        instance.close()


def test_categories_are_switched_one_by_one(fmu):
    instance = fmu("driven", 3).open(CS, logging=False)
    instance.setDebugLogging(True, ["logEvents"])
    instance.setDebugLogging(False, ["logStatusError"])
    instance.start()
    instance.step(0.0, 2.0)
    assert instance.messages
    instance.messages.clear()
    assert refused(lambda: instance.get([999]))
    assert not instance.messages
    instance.setDebugLogging(True, ["logAll"])
    assert refused(lambda: instance.get([999]))
    assert instance.messages
    instance.close()


def test_a_derivative_that_is_no_number_is_discarded(fmu):
    built = fmu("fails_late", 3)
    model = built.open(ME).start()
    model.setTime(2.0)
    with pytest.raises(FMICallException) as caught:
        model.getContinuousStateDerivatives(vector(np.zeros(1)), 1)
    assert caught.value.status == 2
    assert model.messages[-1][:2] == (2, "logStatusDiscard")
    assert "derivative der(x) is not finite at time 2" in model.last
    model.setTime(0.5)
    model.getContinuousStateDerivatives(vector(np.zeros(1)), 1)
    with pytest.raises(FMICallException) as caught:
        model.setContinuousStates(vector(np.array([np.nan])), 1)
    assert caught.value.status == 2
    model.close()


# ---- adjoint derivatives ----


@pytest.mark.parametrize("name", ["plant", "follower"])
def test_adjoint_and_directional_derivatives_are_one_matrix(fmu, name):
    built, rng = fmu(name, 3), np.random.default_rng(5)
    known = [*built.vr("state"), *built.vr("input"), *built.vr("parameter"), built.vr("state")[0]]
    unknown = [
        *built.vr("derivative"),
        *built.vr("output"),
        *built.vr("state")[:1],
        built.vr("derivative")[0],
    ]
    instance = built.open(CS)
    inputs = [*built.vr("state"), *built.vr("input")]
    instance.set(inputs, rng.uniform(0.3, 1.0, len(inputs)))
    instance.start()
    for _ in range(10):
        u, v = rng.normal(size=len(known)), rng.normal(size=len(unknown))
        forward = instance.getDirectionalDerivative(unknown, known, u)
        backward = instance.getAdjointDerivative(unknown, known, v, len(known))
        assert np.dot(v, forward) == pytest.approx(np.dot(backward, u), rel=1e-12)
    assert refused(lambda: instance.getDirectionalDerivative([0], known, u))
    assert refused(lambda: instance.getAdjointDerivative(unknown, [0], v, 1))
    instance.close()
