"""Commands as they arrive: exact means, exact lags, zero before the beginning; and when they changed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.vehicles import c17_simulation
from hovercontrol.identification.engine.commands import Arrival, command_times, divided, input_states
from hovercontrol.identification.engine.data import gather
from hovercontrol.identification.engine.fit import first_noise
from hovercontrol.identification.engine.measure import measure
from hovercontrol.identification.engine.noise import augment
from hovercontrol.identification.engine.problem import Problem
from hovercontrol.logs import Log
from tests.identification.diagnose.generator import Conditions, make

TIME = np.array([0.0, 0.1, 0.25, 0.3])
COMMANDS = np.array([[1.0, 3.0, -2.0, 0.5], [0.0, 0.1, 0.2, 0.3]])


def arrival(*effects):
    model = c17_simulation().with_effects(effects)
    block = model.plant()
    return block, Arrival(block, TIME, COMMANDS, model.motion)


def mean(commands, begin, end, delay=0.0):
    return (commands.integral(end, delay) - commands.integral(begin, delay))[0] / (end - begin)


def test_integrals_are_those_of_held_values():
    _, commands = arrival()
    begin, end = np.array([0.05, 0.0, 0.24]), np.array([0.15, 0.3, 0.5])
    expected = [2.0, (0.1 * 1 + 0.15 * 3 - 0.05 * 2) / 0.3, (0.01 * 3 - 0.05 * 2 + 0.2 * 0.5) / 0.26]
    np.testing.assert_allclose(mean(commands, begin, end), expected)


def test_late_commands_are_zero_before_the_beginning():
    _, commands = arrival()
    begin = np.array([0.0, 0.1, 0.9])
    np.testing.assert_allclose(mean(commands, begin, begin + 0.02, 0.1), [0.0, 1.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(mean(commands, begin, begin + 0.02, -0.1), [3.0, 3.0, 0.5])
    np.testing.assert_allclose(commands.at(begin, delay=0.1)[0], [0.0, 1.0, 0.5])


@pytest.mark.parametrize("delay", [0.0, 0.04])
@pytest.mark.parametrize(
    "e",
    [
        effect("thrust_lag", seconds=0.07),
        effect("thrust_backlash", width=0.6),
        effect("thrust_rate_limit", limit=30.0),
    ],
    ids=lambda e: e.name,
)
def test_integrals_of_what_follows_are_those_of_its_equation(e, delay):
    block, commands = arrival(e)
    parameters = block.parameter_values()
    when = np.array([0.0, 0.05, 0.103 + delay, 0.16, 0.27, 0.3])
    found = commands.lagged_integral(when, parameters, delay)[6]
    rate = block.to_numpy().array_derivatives
    t, value, area, areas = 0.0, 0.0, 0.0, [0.0]
    for end in when[1:]:  # by small steps of Euler's method that meet where commands change
        changes = [c for c in (*(TIME + delay), end) if t + 1e-12 < c <= end]
        for goal in changes:
            now = np.searchsorted(TIME, t - delay + 1e-9, side="right") - 1
            u = COMMANDS[:, now] if now >= 0 else np.zeros(2)
            count = max(1, round((goal - t) / 1e-5))
            h = (goal - t) / count
            for _ in range(count):
                slope = float(rate(t, np.append(np.zeros(6), value), u, parameters)[6])
                area += h * (value + 0.5 * h * slope)
                value += h * slope
            t = goal
        areas.append(area)
    np.testing.assert_allclose(found, areas, atol=1.5e-4)


def test_states_that_follow_from_more_than_inputs_are_none():
    model = c17_simulation()
    lagging = model.with_effects([effect("thrust_lag", seconds=0.1), effect("rudder_lag", seconds=0.1)])
    assert input_states(model.plant(), model.motion) == ()
    assert input_states(lagging.plant(), model.motion) == (6, 7)


def test_motion_is_no_part_of_the_commands_way(cart):
    assert input_states(cart, ()) == (1, 0)  # a cart goes where its force pushes it
    assert input_states(cart, ("p", "v")) == ()


def test_a_command_that_changed_in_a_gap_did_so_at_any_time_within(cart):
    t = 0.05 * np.arange(100)
    kept = np.setdiff1d(np.arange(100), [30, 31, 32, 60, 61])
    force = np.where(np.arange(100) < 32, 0.5, -0.5)  # new behind the first gap, the same behind the second
    p = np.cumsum(np.random.default_rng(0).normal(size=100))
    log = measure(cart, Log("gaps", t[kept], {"p": p[kept], "F": force[kept]}))
    time, std = command_times(log)
    row = int(np.flatnonzero(kept == 33)[0])
    assert np.flatnonzero(std).tolist() == [row]
    assert std[row] == pytest.approx(0.2 / np.sqrt(12.0))
    assert time[row] == pytest.approx(t[33] - 0.1)
    np.testing.assert_array_equal(np.delete(time, row), np.delete(log.time, row))


def test_a_rejected_sample_does_not_make_its_command_sure():
    """A row is lost, the command is new in the next, whose pose is an outlier: it changed in either."""
    case = make(3, [], Conditions(duration=6.0, logs=1))
    log = case.logs[0]
    changed = np.flatnonzero((np.diff(log["rudder"]) != 0) & (log.time[1:] > 2.0))
    row = int(changed[0]) + 1
    columns = {k: v.copy() for k, v in log.columns.items()}
    columns["x"][row] += 0.2
    kept = np.arange(len(log)) != row - 1
    hit = Log("hit", log.time[kept], {k: v[kept] for k, v in columns.items()})
    seen = measure(case.model.plant(), hit)
    time, std = command_times(seen)
    step = log.time[row] - log.time[row - 2]
    assert np.isnan(seen.values[:, row - 1]).all()
    assert seen.sampled.all()
    assert np.flatnonzero(std).tolist() == [row - 1]
    assert std[row - 1] == pytest.approx(step / np.sqrt(12.0), rel=1e-3)
    assert time[row - 1] == pytest.approx(log.time[row] - 0.5 * step, abs=1e-4)


def test_a_command_that_came_late_is_late_for_as_long_as_it_lags(monkeypatch):
    """What is not known of a change is one number: its marks in later steps add up, they are no new draws."""
    monkeypatch.setattr("hovercontrol.identification.engine.data.SHARE", 0.0)  # noise alone looks like motion
    model = c17_simulation().with_effects([effect("thrust_lag", seconds=0.15)])
    t = 0.02 * np.arange(320)
    thrust = np.where(t < 1.74, 1.0, 3.0)
    kept = np.abs(t - 1.72) > 0.03  # rows before the new command are lost
    rng = np.random.default_rng(0)
    seen = {c: 1e-3 * rng.normal(size=t.size)[kept] for c in ("x", "y", "psi", "u", "v", "r")}
    log = Log("lost", t[kept], {**seen, "thrust": thrust[kept], "rudder": 0.0 * t[kept]})
    problem = Problem(model, gather(model, [log]), pieces=4)
    x, p = problem.guess.copy(), problem.start
    u = [s.name for s in problem.block.states].index("u")
    x[..., u] = 1.0
    linear = problem.linearise(x, p)
    (new,) = np.argwhere(linear.fresh)
    first, w = int(new[0]), int(new[1])
    assert problem.rows.time[first, w] < 1.72 + 1e-9 < problem.rows.time[first + 1, w] + 2e-9
    noise = first_noise(problem)
    system = augment(problem, linear, replace(noise, process=0.0 * noise.process), unknowns=False)
    P = np.zeros(system.P0.shape[1:])
    P[-1, -1] = 1.0
    marks = 0.0
    at = problem.free.index(u)
    for k in range(first, first + 12):  # within one stretch: 0.24 s of a lag of 0.15 s
        P = system.A[k, w] @ P @ system.A[k, w].T + system.Q[k, w]
        marks = linear.A[k, w, at, at] * marks + linear.jolt[k, w, at]
    assert np.sqrt(P[at, at]) == pytest.approx(abs(marks), rel=0.05)
    alone = np.sqrt((linear.jolt[first : first + 12, w, at] ** 2).sum())
    assert abs(marks) > 2.5 * alone  # as draws of each step they would be far too small


@pytest.mark.parametrize("pieces", [1, 2, 3, 7])
def test_pieces_fill_a_step_and_two_meet_where_they_are_told(pieces):
    part = np.array([1e-6, 0.2, 0.5, 0.99, np.nan])
    begin, length = divided(pieces, part)
    np.testing.assert_allclose(begin, np.cumsum(length, axis=0) - length, atol=1e-15)
    np.testing.assert_allclose(length.sum(axis=0), 1.0)
    assert (length > 0).all()
    np.testing.assert_allclose(length[:, -1], 1.0 / pieces)
    if pieces > 1:
        assert np.abs(begin - part)[:, :-1].min(axis=0).max() < 1e-15


def test_the_largest_change_within_a_step_is_found():
    _, commands = arrival()
    begin, length = np.array([0.0, 0.05, 0.05, 0.2, 0.3]), np.array([0.1, 0.1, 0.3, 0.05, 0.5])
    nan = np.nan
    np.testing.assert_allclose(commands.largest_change(begin, length, 0.0, 4), [nan, 0.5, 2 / 3, nan, nan])
    np.testing.assert_allclose(
        commands.largest_change(begin, length, 0.03, 4), [0.3, 0.8, 2.3 / 3, nan, 0.06]
    )
    np.testing.assert_allclose(commands.largest_change(begin, length, 0.0, 2), [nan, 0.5, nan, nan, nan])


def test_only_rows_with_another_command_are_changes():
    model = c17_simulation()
    held = np.where(np.arange(50) < 23, 1.0, -1.0)
    commands = Arrival(model.plant(), 0.01 * np.arange(50), np.array([held, 0 * held]), model.motion)
    begin, length = np.array([0.1, 0.2, 0.3]), np.full(3, 0.1)  # ten rows of commands in each
    np.testing.assert_allclose(commands.largest_change(begin, length, 0.0, 2), [np.nan, 0.3, np.nan])


def test_late_commands_held_between_rows_are_exact_in_two_pieces():
    """Both where a row leads and its slopes, against SciPy with the commands switched within the step."""
    case = make(3, ["input_delay"], Conditions(duration=4.0, logs=1))
    model = case.truth
    problem = Problem(model, gather(model, case.logs), pieces=2)
    p, x = problem.start, problem.guess.copy()
    velocities = [i for i, s in enumerate(problem.block.states) if s.name in ("u", "v", "r")]
    x[..., velocities] = 1.0 + np.abs(x[..., velocities])  # away from where dry friction is steep
    at = problem.names.index("input_delay_seconds")
    F, _, B = problem.advance(x, p)
    derivatives = problem.block.to_numpy().derivatives
    names, log = list(problem.block.default_parameters), problem.logs[0]

    def exact(row, block, delay):
        values = p.copy()
        values[at] = delay
        params = dict(zip(names, problem.parameters(values), strict=True))
        begin, end = problem.rows.time[row : row + 2, block]
        switches = log.time - log.origin + delay
        edges = [begin, *switches[(switches > begin) & (switches < end)], end]
        state = x[row, block]
        for a, b in pairwise(edges):
            u = log.inputs[:, np.searchsorted(switches, 0.5 * (a + b)) - 1]
            state = solve_ivp(
                lambda t, z, u=u: derivatives(t, z, u, params), (a, b), state, rtol=1e-10, atol=1e-12
            ).y[:, -1]
        return state[list(problem.free)]

    moving = np.argwhere((problem.dt > 0) & (problem.rows.time[:-1] > p[at] + 0.1))
    for row, block in moving[:: len(moving) // 10]:
        here, later = (exact(row, block, p[at] + d) for d in (0.0, 1e-5))
        np.testing.assert_allclose(F[row, block], here, rtol=0, atol=1e-7)
        slope = (later - here) / 1e-5
        np.testing.assert_allclose(
            B[row, block, :, at], slope, rtol=0, atol=2e-3 * np.abs(slope).max() + 1e-6
        )
