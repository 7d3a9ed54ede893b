"""FMI 2 and FMI 3 alike: simulation, dry friction, the clock, values, snapshots, partial derivatives."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from .fmi_support import CS, ME, integrate, march, sticking
from .test_friction import exact

VERSIONS = pytest.mark.parametrize("version", [2, 3])
GRID = np.linspace(0.0, 20.0, 2001)


def inputs_of(rng, n):
    return np.column_stack([rng.uniform(0.0, 6.0, n), rng.uniform(-0.6, 0.6, n)])


# ---- Co-Simulation ----


@VERSIONS
def test_dry_friction_is_exact(fmu, version):
    instance = fmu("driven", version).open(CS).start(tolerance=1e-8)
    found = march(instance, GRID)[:, 0]
    expected = exact(0.7, GRID)
    assert np.abs(found - expected).max() < 1e-6
    assert (found[expected == 0.0] == 0.0).mean() > 0.99  # it sticks at exactly zero
    instance.close()


@VERSIONS
def test_co_simulation_is_the_compiled_simulation(fmu, version):
    """The same solver, read inside the same steps: to the last bit, but for the last step."""
    built, times = fmu("axes", version), np.linspace(0.0, 5.0, 501)
    instance = built.open(CS).start(tolerance=1e-6)
    found = march(instance, times)
    expected = sticking(built.interface.block).simulate(times, rtol=1e-6, atol=1e-9).states.T
    np.testing.assert_array_equal(found[:480], np.asarray(expected)[:480])
    instance.close()


@VERSIONS
def test_constant_inputs(fmu, version):
    built = fmu("plant", version)
    block, times = built.interface.block, np.linspace(0.0, 3.0, 301)
    instance = built.open(CS)
    instance.set(built.vr("input"), [3.0, 0.4])
    instance.start(tolerance=1e-10)
    found = march(instance, times)
    inputs = np.tile([[3.0], [0.4]], 301)
    expected = sticking(block).simulate(times, inputs, rtol=1e-11, atol=1e-13).states.T
    assert np.abs(found - np.asarray(expected)).max() < 1e-8
    instance.close()


@VERSIONS
@pytest.mark.parametrize(
    ("length", "tolerance", "gap"), [(1e-2, 1e-9, 1e-8), (1e-3, 1e-6, 1e-6), (1e-3, 1e-9, 1e-8)]
)
def test_inputs_that_jump_at_every_step(fmu, version, length, tolerance, gap):
    """Also steps so short that a method of order 3 does; the craft starts at rest and sticks on its way."""
    built = fmu("plant", version)
    times = np.arange(801) * length
    u = inputs_of(np.random.default_rng(1), len(times))
    u[300:600] = 0.1 * u[300:600]
    instance = built.open(CS)
    x0 = [0.0, 0.0, 0.0, 0.3, 0.0, 0.02]
    instance.set([*built.vr("state"), *built.vr("input")], [*x0, *u[0]])
    instance.start(tolerance=tolerance)
    rows = [instance.states()]
    for k in range(800):
        instance.set(built.vr("input"), u[k])
        instance.step(times[k], times[k + 1] - times[k])
        rows.append(instance.states())
    found, options = np.array(rows), {"rtol": 1e-12, "atol": 1e-13, "x0": x0}
    expected = sticking(built.interface.block).simulate(times, u.T, **options).states.T
    assert np.abs(found - expected).max() < gap
    assert ((found[:, [3, 5]] == 0.0) == (np.asarray(expected)[:, [3, 5]] == 0.0)).mean() > 0.99
    instance.close()


@VERSIONS
def test_outputs_follow_inputs_at_a_communication_point(fmu, version):
    built = fmu("follower", version)
    instance = built.open(CS).start()
    (power,), (push,) = built.vr("output", "power"), built.vr("input", "push")
    instance.step(0.0, 0.5)
    (q,) = instance.states()
    for value in (1.0, -2.0):
        instance.set([push], [value])
        assert instance.get([power]) == pytest.approx([3.0 * q**2 + value * q])
    instance.close()


@VERSIONS
def test_the_length_of_the_communication_step_does_not_matter(fmu, version):
    coarse, fine = fmu("follower", version).open(CS).start(), fmu("follower", version).open(CS).start()
    a, b = march(coarse, np.linspace(0, 4, 5)), march(fine, np.linspace(0, 4, 1001))[::250]
    assert np.abs(a - b).max() < 1e-12
    coarse.close()
    fine.close()


@VERSIONS
def test_conditions_on_time_are_not_smeared(fmu, version):
    """The reference jumps at 1 s and 2.5 s; in between the lag is an exponential."""
    instance = fmu("follower", version).open(CS).start(tolerance=1e-9)
    times = np.linspace(0, 4, 41)
    found = march(instance, times)[:, 0]
    instance.close()

    compiled = sticking(fmu("follower", version).interface.block)
    expected = compiled.simulate(times, np.zeros((1, 41)), rtol=1e-11, atol=1e-12).states[0]
    assert np.abs(found - expected).max() < 1e-8


@VERSIONS
def test_what_fails_beyond_a_communication_point_does_not_fail_before_it(fmu, version):
    instance = fmu("fails_late", version).open(CS).start()
    for k in range(99):
        instance.step(0.01 * k, 0.01)
    assert instance.states() == pytest.approx([2 / 3 * (0.01**1.5 - 1)], abs=1e-6)
    with pytest.raises(FMICallException):
        instance.step(0.99, 0.02)
    assert re.search(r"not finite; the state x = -0\.6\d* is the hardest to integrate", instance.last)
    assert 0.99 <= instance.get([0])[0] <= 1.0
    instance.close()


@VERSIONS
def test_tolerance_is_obeyed(fmu, version):
    errors = []
    for tolerance in (1e-3, 1e-6, 1e-9):
        instance = fmu("axes", version).open(CS).start(tolerance=tolerance)
        errors.append(march(instance, np.linspace(0, 2, 21))[-1])
        instance.close()
    assert np.abs(errors[0] - errors[2]).max() > 10 * np.abs(errors[1] - errors[2]).max()


# ---- snapshots ----


@VERSIONS
@pytest.mark.parametrize("name", ["plant", "driven", "follower"])
def test_a_snapshot_goes_on_to_the_bit_in_another_instance(fmu, version, name):
    built = fmu(name, version)
    u = inputs_of(np.random.default_rng(2), 400)[:, : len(built.vr("input"))] / 2.0
    first, second = built.open(CS, name="first").start(), built.open(CS, name="second")

    def go(instance, steps):
        rows = []
        for k in steps:
            if k % 7 == 0:
                instance.set(built.vr("input"), u[k])
            instance.step(0.05 * k, 0.05)
            rows.append(instance.get([*built.vr("state"), *built.vr("output"), *built.vr("derivative")]))
        return np.array(rows)

    go(first, range(103))
    data = first.snapshot()
    expected = go(first, range(103, 206))
    second.restore(data)
    np.testing.assert_array_equal(go(second, range(103, 206)), expected)
    first.restore(data)  # and back in time, in the same instance
    np.testing.assert_array_equal(go(first, range(103, 206)), expected)
    first.close()
    second.close()


@VERSIONS
def test_a_snapshot_of_model_exchange(fmu, version):
    built = fmu("axes", version)
    model = built.open(ME)
    integrate(model, np.linspace(0.0, 1.0, 11), 1e-6)
    everything = range(built.vr("mode")[0])
    before, modes, data = model.get(everything), model.modes(built.vr("mode")), model.snapshot()
    other = built.open(ME)
    other.restore(data)
    assert other.get(everything) == before
    assert other.modes(built.vr("mode")) == modes
    assert other.snapshot() == data
    model.close()
    other.close()


@VERSIONS
def test_bytes_that_are_no_snapshot_are_refused(fmu, version):
    built = fmu("plant", version)
    instance = built.open(CS).start()
    good = instance.snapshot()
    other = fmu("driven", version).open(CS).start()
    model = built.open(ME).start()

    def flipped(k):
        return good[:k] + bytes([good[k] ^ 4]) + good[k + 1 :]

    cases = {
        "no state": b"",
        "no state of": b"x" * 500,
        "has 40 bytes": good[:40],
        "bytes": good[:-1],
        "one of this kind": good + b"\0" * 8,
        "no state of such": flipped(3),
        "format": flipped(8),
        "token": flipped(16),
        "checksum": flipped(60),
        "checksum differs": flipped(len(good) - 1),
        "another FMU": other.snapshot(),
        "of this kind of instance": model.snapshot(),
    }
    for words, data in cases.items():
        with pytest.raises(FMICallException):
            instance.restore(data)
        assert words in instance.last, words
        instance.restore(good)  # also gets it out of the error
    instance.step(0.0, 0.1)
    for each in (instance, other, model):
        each.close()


@VERSIONS
def test_reset_is_a_new_instance(fmu, version):
    built = fmu("follower", version)
    used, fresh = built.open(CS), built.open(CS)
    used.set(built.vr("parameter"), [2.0] * len(built.vr("parameter")))
    march(used.start(tolerance=1e-3), np.linspace(0, 2, 9))
    used.reset()
    assert used.snapshot() == fresh.snapshot()
    np.testing.assert_array_equal(*(march(i.start(), np.linspace(0, 3, 9)) for i in (used, fresh)))
    used.close()
    fresh.close()


# ---- partial derivatives ----


@VERSIONS
@pytest.mark.parametrize(("name", "kind"), [("plant", CS), ("follower", ME), ("axes", ME)])
def test_directional_derivatives_are_finite_differences(fmu, version, name, kind):
    built, rng = fmu(name, version), np.random.default_rng(3)
    known = [*built.vr("state"), *built.vr("input"), *built.vr("parameter")]
    unknown = [*built.vr("derivative"), *built.vr("output")]
    instance = built.open(kind)
    base = np.array(instance.built.interface.block.parameter_values())
    point = np.concatenate([rng.uniform(0.2, 0.9, len(known) - len(base)), base + 0.01])
    instance.set(known, point)
    instance.enter_initialization(start=0.3)
    step = 1e-6
    for j in range(len(known)):
        seed = np.zeros(len(known))
        seed[j] = 1.0
        columns = []
        for sign in (1, -1):
            instance.set(known, point + sign * step * seed)
            columns.append(instance.get(unknown))
        instance.set(known, point)
        expected = (np.array(columns[0]) - columns[1]) / (2 * step)
        found = instance.getDirectionalDerivative(unknown, known, seed)
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)
    instance.close()


@VERSIONS
def test_derivatives_of_a_sticking_velocity_are_zero(fmu, version):
    built = fmu("plant", version)
    instance = built.open(CS)
    instance.set(built.vr("state"), [0.0] * 6)
    instance.start()
    known = [*built.vr("state"), *built.vr("input")]
    slopes = instance.getDirectionalDerivative(built.vr("derivative", "u", "r"), known, [1.0] * len(known))
    assert slopes == [0.0, 0.0]
    instance.close()


@VERSIONS
def test_a_model_that_only_ticks_says_that_it_gives_no_partial_derivatives(fmu, version):
    built = fmu("counts", version)
    instance = built.open(CS).start()
    with pytest.raises(FMICallException):
        instance.getDirectionalDerivative(built.vr("output"), built.vr("state")[:1], [1.0])
    assert "not supported: partial derivatives of a model that only ticks" in instance.last
    instance.close()


@VERSIONS
def test_a_state_among_the_unknowns_is_the_output_that_shows_it(fmu, version):
    built = fmu("plant", version)
    instance = built.open(CS).start()
    state, parts = built.vr("state"), [*built.vr("input"), *built.vr("state")]
    seed = np.arange(1.0, len(parts) + 1)
    assert instance.getDirectionalDerivative(state, parts, seed) == list(seed[len(built.vr("input")) :])
    instance.close()


# ---- values ----


@VERSIONS
def test_every_value_of_the_plant(fmu, version):
    """At a point, against the NumPy functions."""
    built, rng = fmu("plant", version), np.random.default_rng(4)
    x, u = rng.uniform(0.3, 1.0, 6), [2.0, 0.3]
    instance = built.open(CS)
    instance.set([*built.vr("state"), *built.vr("input")], [*x, *u])
    instance.start()
    functions = built.interface.block.to_numpy()
    np.testing.assert_allclose(
        instance.get(built.vr("derivative")), functions.derivatives(0.0, x, u), rtol=1e-9, atol=1e-9
    )
    assert instance.get(built.vr("output")) == list(functions.outputs(0.0, x, u))
    assert instance.get([0, *built.vr("input")]) == [0.0, *u]
    assert instance.modes(built.vr("mode")) == [1, 1, 1]
    instance.close()


@VERSIONS
@pytest.mark.parametrize(
    ("kind", "value", "words"),
    [
        ("input", float("nan"), "input push is set to NaN"),
        ("input", float("inf"), "input push is set to an infinite value"),
        ("input", 7.5, "input push is set to 7.5, outside its bounds [-5, 5]"),
        ("parameter", -1.0, "is set to -1, outside its bounds [0.1"),
        ("state", float("nan"), "state q is set to NaN"),
        ("derivative", 1.0, "derivative der(q)"),
        ("output", 1.0, "cannot be set"),
    ],
)
def test_values_that_cannot_be(fmu, version, kind, value, words):
    built = fmu("follower", version)
    instance = built.open(CS)
    reference = built.vr(kind)[-1 if kind == "parameter" else 0]
    kept = [*built.vr("state"), *built.vr("input"), *built.vr("parameter")]
    good = built.vr("state")[0]
    instance.enter_initialization()
    before = instance.get(kept)
    with pytest.raises(FMICallException):
        instance.set([good, reference], [3.0, value])
    assert instance.messages[-1][:2] == (3, "logStatusError")
    assert words in instance.last.replace("lag.", ""), instance.last
    assert instance.get(kept) == before  # none of them
    instance.close()


# ---- bounds ------------------------------------------------------------------------------------------------


@VERSIONS
@pytest.mark.parametrize("kind", [CS, ME])
@pytest.mark.parametrize(
    ("name", "variable", "value", "acts_as"),
    [
        ("follower", "input", 5.0 + 1e-9, 5.0),
        ("follower", "input", -5.0 - 9e-7, -5.0),
        ("pushed", "parameter", 0.5 - 1e-9, 0.5),
    ],
)
def test_a_value_a_hair_outside_its_bounds_is_the_bound_and_told_once(
    fmu, version, kind, name, variable, value, acts_as
):
    built = fmu(name, version)
    instance = built.open(kind)
    reference = built.vr(variable)[0]
    instance.enter_initialization()
    for _ in range(3):
        instance.set([reference], [value])
        assert instance.get([reference]) == [acts_as]
    told = [m for m in instance.messages if m[1] == "logStatusWarning"]
    assert len(told) == 1
    assert told[0][0] == 1
    assert "outside its bounds" in told[0][2]
    instance.close()


@VERSIONS
def test_an_input_that_saturates_takes_any_value_and_acts_as_its_bound(fmu, version):
    built = fmu("pushed", version)
    instance = built.open(CS).start()
    push = built.vr("input")[0]
    times, commands = np.linspace(0.0, 1.0, 21), [9.0] * 7 + [-1e6] * 7 + [4.0 + 1e-9] * 6
    rows = [instance.states()]
    for (begin, end), command in zip(pairwise(times), commands, strict=True):
        instance.set([push], [command])
        instance.step(begin, end - begin)
        rows.append(instance.states())
    assert len([m for m in instance.messages if m[1] == "logStatusWarning"]) == 1
    found = built.interface.block.compile().simulate(times, {"F": [*np.clip(commands, -1.0, 4.0), 0.0]})
    np.testing.assert_allclose(np.transpose(rows), found.states, atol=2e-5)
    instance.close()


@VERSIONS
@pytest.mark.slow  # ten million steps
def test_a_step_that_cannot_be_done_names_the_state(fmu, version):
    instance = fmu("relay", version).open(CS).start()
    with pytest.raises(FMICallException):
        instance.step(0.0, 10.0)
    assert re.search(
        r"stopped at time 1\.0\d*: too many steps; the state v = \S+ is the hardest to integrate",
        instance.last,
    )
    instance.close()
