"""FMI 2 and FMI 3 alike in Model Exchange: events of friction and of the clock under other solvers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .fmi_support import CS, ME, WARNING, integrate, march, sticking, vector
from .test_friction import exact

VERSIONS = pytest.mark.parametrize("version", [2, 3])
GRID = np.linspace(0.0, 20.0, 2001)


@pytest.mark.slow("2")
@VERSIONS
def test_dry_friction_under_cvode(fmu, version):
    model = fmu("driven", version).open(ME)
    found, events = integrate(model, GRID, 1e-10)
    assert np.abs(found[:, 0] - exact(0.7, GRID)).max() < 1e-6
    assert events < 40
    model.close()


@VERSIONS
def test_axes_stick_and_slip_under_cvode_as_in_co_simulation(fmu, version):
    times = np.linspace(0.0, 5.0, 501)
    model, slave = fmu("axes", version).open(ME), fmu("axes", version).open(CS)
    found, events = integrate(model, times, 1e-9)
    expected = march(slave.start(tolerance=1e-10), times)
    assert np.abs(found - expected).max() < 1e-5
    sticking = (expected[:, 3:] == 0.0).mean(axis=0)
    assert ((sticking > 0.01) & (sticking < 0.98)).all()  # each of them does both
    assert events < 500
    model.close()
    slave.close()


@VERSIONS
def test_an_importer_that_skips_the_first_event_update_gets_a_warning(fmu, version):
    """FMI wants the discrete states updated after initialization; pathsim-fmi 0.1.1 does not."""
    model, proper = fmu("driven", version).open(ME), fmu("driven", version).open(ME).start()
    model.enter_initialization()
    model.exitInitializationMode()
    model.enterContinuousTimeMode()
    assert model.messages[-1][:2] == (WARNING, "logStatusWarning") and "updated" in model.last
    found, expected = np.zeros(1), np.zeros(1)
    model.derivatives(vector(found), 1)
    proper.derivatives(vector(expected), 1)
    assert found == expected
    model.close()
    proper.close()


@VERSIONS
def test_scipy_with_event_functions(fmu, version):
    """An explicit method with events of its own, and no knowledge of FMI."""
    model = fmu("driven", version).open(ME).start()
    x, dx, z = np.zeros(1), np.zeros(1), np.zeros(1)

    def at(t, y):
        model.setTime(t)
        x[:] = y
        model.setContinuousStates(vector(x), 1)

    def rhs(t, y):
        at(t, y)
        model.derivatives(vector(dx), 1)
        return dx.copy()

    def indicator(t, y):
        at(t, y)
        model.getEventIndicators(vector(z), 1)
        return z[0]

    indicator.terminal = True
    t, y, events = 0.0, np.zeros(1), 0
    while t < 20.0:
        options = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.1, "events": indicator}
        solution = solve_ivp(rhs, (t, 20.0), y, method="DOP853", **options)
        t, y = solution.t[-1], solution.y[:, -1]
        assert np.abs(solution.y[0] - exact(0.7, solution.t)).max() < 1e-6
        if solution.status == 1:
            events += 1
            at(t, y)
            model.enterEventMode()
            model.update()
            model.enterContinuousTimeMode()
            y = model.states()
            assert indicator(t, y) > 0.0  # never zero at a restart
    assert 10 < events < 40
    model.close()


@VERSIONS
def test_time_events_under_cvode(fmu, version):
    times = np.linspace(0.0, 4.0, 41)
    model = fmu("follower", version).open(ME)
    found, events = integrate(model, times, 1e-10)
    block = fmu("follower", version).interface.block
    expected = sticking(block).simulate(times, np.zeros((1, 41)), rtol=1e-11, atol=1e-12).states.T
    assert events == 2
    assert np.abs(found - expected).max() < 1e-6
    model.close()


@VERSIONS
def test_until_the_next_event_the_model_stays_on_this_side_of_it(fmu, version):
    """Integrators look past the time at which they stop."""
    built = fmu("follower", version)
    model = built.open(ME)
    model.enter_initialization(start=0.9)
    model.exitInitializationMode()
    *_, defined, at = model.update()
    assert (defined, at) == (True, 1.0)
    model.enterContinuousTimeMode()
    seen = []
    for t in (0.99, 1.0, 1.2):
        model.setTime(t)
        seen.append(model.get(built.vr("derivative"))[0])
    assert seen[0] == pytest.approx(seen[1], rel=0.1)
    assert seen[1] == seen[2]
    model.setTime(1.0)
    model.enterEventMode()
    *_, defined, at = model.update()
    assert (defined, at) == (True, 2.5)
    model.close()


@VERSIONS
def test_a_sticking_velocity_that_the_importer_moves_slips(fmu, version):
    built = fmu("driven", version)
    model = built.open(ME).start()
    mode = built.vr("mode")
    assert model.modes(mode) == [0]
    model.setContinuousStates(vector(np.array([-0.3])), 1)
    assert model.completedIntegratorStep()[0]  # asks for Event Mode
    model.enterEventMode()
    model.update()
    assert model.modes(mode) == [-1]
    assert model.states() == [-0.3]
    model.close()


@VERSIONS
def test_a_velocity_past_zero_is_tried_at_zero(fmu, version):
    built = fmu("driven", version)
    for t, v, mode, after in ((0.1, -1e-9, 0, 0.0), (5.0, -1e-9, -1, -1e-9), (2.0, -1e-9, 1, 0.0)):
        model = built.open(ME)
        model.set(built.vr("state"), [1.0])
        model.start()
        assert model.modes(built.vr("mode")) == [1]
        model.setTime(t)
        model.setContinuousStates(vector(np.array([v])), 1)
        assert model.get(built.vr("event"))[0] <= 0.0
        model.enterEventMode()
        changed = model.update()[3]
        assert model.modes(built.vr("mode")) == [mode]
        assert model.states() == [after]
        assert changed == (after != v)
        assert model.get(built.vr("event"))[0] > 0.0
        model.close()


@VERSIONS
def test_an_input_set_while_it_sticks_is_felt_in_event_mode(fmu, version):
    built = fmu("plant", version)
    model = built.open(ME)
    model.set(built.vr("state"), [0.0] * 6)
    model.start()
    surge, _, yaw = built.vr("mode")  # sway has no dry friction in this craft
    assert model.modes([surge, yaw]) == [0, 0]
    model.enterEventMode()
    model.set(built.vr("input"), [20.0, 0.0])
    model.update()
    assert model.modes([surge, yaw]) == [1, 0]
    assert model.get(built.vr("derivative", "u"))[0] > 0.0
    model.close()
