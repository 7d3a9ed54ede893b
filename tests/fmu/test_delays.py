"""Late inputs inside an FMU: what is under way is part of its state, and every arrival is an event."""

import fmpy.fmi1
import numpy as np
import pytest

from .blocks import BLOCKS
from .fmi_support import CS, ME

DELAY = 0.32


@pytest.fixture(params=[2, 3])
def built(fmu, request):
    return fmu("remembers", request.param)


def sends(instance, **values):
    instance.set(instance.built.vr("input", *values), list(values.values()))


def felt(instance):
    return instance.get(instance.built.vr("output", "felt"))[0]


def test_thousands_of_values_are_under_way_and_arrive_in_order(built):
    """More than any first guess of room; each is seen one delay after it was sent."""
    one = built.open(CS).start()
    step, n = 1e-4, 5000
    seen = []
    for k in range(n):
        sends(one, slow=float(k + 1))
        one.step(k * step, step)
        seen.append(felt(one))
    expected = [k + 2 - 3200 if k + 1 >= 3200 else 0.25 for k in range(n)]
    off = np.abs(np.subtract(seen, expected))
    assert off.max() <= 1.0 and (off > 0).mean() < 0.5  # a step beside, where k * step is rounded
    one.close()


def test_a_state_holds_what_is_under_way(built):
    one, other = built.open(CS).start(), built.open(CS).start()
    for k in range(20):
        sends(one, slow=0.1 * k, fast=0.05 * k)
        one.step(0.05 * k, 0.05)
    data = one.snapshot()
    other.restore(data)
    assert other.snapshot() == data
    for k in range(20, 40):
        for instance in (one, other):
            instance.step(0.05 * k, 0.05)
        assert (one.states(), felt(one)) == (other.states(), felt(other))
    assert felt(one) == pytest.approx(1.9)
    assert len(one.snapshot()) < len(data)  # nothing is under way any more
    one.restore(data)
    one.step(1.0, 0.05)
    other.close()
    one.close()


def test_a_state_is_overwritten_by_one_of_another_size(built):
    one = built.open(CS).start()
    state = one.getFMUState()
    for k in range(5):
        sends(one, slow=float(k))
        one.step(0.01 * k, 0.01)
    full = one.snapshot()
    one.setFMUState(state)
    assert len(one.snapshot()) < len(full)
    one.freeFMUState(state)
    one.close()


def test_states_of_the_other_kind_and_broken_ones_are_refused(built):
    one, other = built.open(CS).start(), built.open(ME).start()
    data = other.snapshot()
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.restore(data)
    assert "kind of instance" in one.last
    fresh = built.open(CS).start()
    with pytest.raises(fmpy.fmi1.FMICallException):
        fresh.restore(fresh.snapshot()[:-8])
    for instance in (one, other, fresh):
        instance.close()


def test_a_reset_instance_forgets(built):
    one = built.open(CS).start()
    sends(one, slow=9.0)
    one.step(0.0, 0.1)
    one.reset()
    one.start()
    one.step(0.0, 1.0)
    assert felt(one) == 0.25
    one.close()


def test_how_late_is_fixed_at_initialization(built):
    one = built.open(CS)
    late = built.vr("parameter", "late")
    one.set(late, [0.1])
    one.start()
    one.set(late, [0.1])  # nothing new
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.set(late, [0.2])
    assert "fixed at initialization" in one.last
    one.close()


@pytest.mark.parametrize("seconds", [-0.1, -1e-300])
def test_a_negative_delay_is_refused(built, seconds):
    one = built.open(CS)
    one.set(built.vr("parameter", "late"), [seconds])
    with pytest.raises(fmpy.fmi1.FMICallException):
        one.start()
    assert "delay of input slow is negative" in one.last
    one.close()


def test_what_is_set_now_has_no_influence_now(built):
    for seconds, expected in ((DELAY, 0.0), (0.0, 1.0)):
        one = built.open(CS)
        one.set(built.vr("parameter", "late"), [seconds])
        one.start()
        unknown, known = built.vr("output", "felt"), built.vr("input", "slow")
        assert one.getDirectionalDerivative(unknown, known, [1.0]) == [expected]
        if built.version == 3:
            assert one.getAdjointDerivative(unknown, known, [1.0]) == [expected]
        one.close()


def test_a_step_of_co_simulation_ends_at_an_arrival_if_asked(fmu):
    one = fmu("remembers", 3).open(CS, eventModeUsed=True, earlyReturnAllowed=True).start()
    one.enterEventMode()
    sends(one, slow=1.0)
    one.update()
    one.enterStepMode()
    assert one.step(0.0, 1.0) == (True, True, pytest.approx(DELAY))
    assert felt(one) == 1.0
    one.enterEventMode()
    one.update()
    one.enterStepMode()
    assert one.step(DELAY, 1.0 - DELAY)[:2] == (False, False)
    x = 0.125 * (1 - np.exp(-2 * DELAY))
    assert one.states()[0] == pytest.approx(0.5 + (x - 0.5) * np.exp(-2 * (1 - DELAY)), rel=1e-5)
    one.close()


def test_model_exchange_announces_the_arrival_as_its_next_event(built):
    one = built.open(ME)
    one.enter_initialization()
    sends(one, slow=3.0)
    one.exitInitializationMode()
    *_, defined, at = one.update()
    assert defined and at == DELAY
    one.enterContinuousTimeMode()
    one.setTime(at)
    assert felt(one) == 0.25  # until the event
    one.enterEventMode()
    *_, defined, _ = one.update()
    assert felt(one) == 3.0 and not defined
    one.close()


def test_a_late_input_that_jumps_between_events_waits_for_one_that_is_called(built):
    one = built.open(ME).start()
    one.setTime(0.1)
    sends(one, slow=3.0)
    enter, _ = one.completedIntegratorStep()
    assert enter
    one.enterEventMode()
    *_, defined, at = one.update()
    assert defined and at == pytest.approx(0.1 + DELAY)
    one.close()


def test_the_block_is_as_late_as_its_fmu():
    assert {p.name: p.start for p in BLOCKS["remembers"]().parameters}["late"] == DELAY
