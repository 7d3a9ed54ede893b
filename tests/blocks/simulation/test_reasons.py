"""A simulation that cannot go on says why, in which state, and which switch chatters."""

import pickle

import numpy as np
import pytest
import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends import library
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation import effort
from hovercontrol.blocks.simulation.reasons import StoppedError, switches, where_it_stops
from hovercontrol.blocks.simulation.runge_kutta import dormand_prince
from hovercontrol.blocks.simulation.trajectory import simulate

V, W = Signal("v", "m/s", start=1.0), Signal("w", "m/s", start=1.0)
TIMES = np.linspace(0.0, 10.0, 11)


def relay():
    """Return a cart that a relay brakes, v' = -2 sign(v), beside one that rolls out, w' = -w/10."""
    a, k = Signal("a", "m/s^2", start=2.0), Signal("k", "1/s", start=0.1)
    brake = sp.Piecewise((-a.symbol, V.symbol > 0), (a.symbol, True))
    return Block("relay", [V, W], [], [V], [a, k], {"v": brake, "w": -k.symbol * W.symbol})


WHERE = r"block 'relay': the .* at t = 0\.5\d* s.*: the state v = \S+ m/s .*the switch v > 0 in v' chatters"


def test_python_warns_and_then_ends_a_run_that_a_switch_stops(monkeypatch):
    monkeypatch.setattr(effort, "LOOKED_AFTER", 500)
    with pytest.warns(UserWarning, match=WHERE), pytest.raises(StoppedError, match=WHERE) as stopped:
        simulate(relay(), TIMES)
    assert "too many steps to reach 10 s" in str(stopped.value)
    assert "\n" not in str(stopped.value)


def test_machine_code_names_the_same_switch(monkeypatch):
    monkeypatch.setattr(library, "MAX_STEPS", 20_000)
    compiled = relay().compile()
    with pytest.raises(InputError, match=WHERE):
        compiled.simulate(TIMES)
    with pytest.raises(InputError, match="too many steps: the state v = "):
        compiled.advance(0.0, 10.0, [1.0, 1.0])
    run = compiled.start()
    with pytest.raises(InputError, match=r"run stops at t = 0\.5.*switch v > 0 in v' chatters"):
        run.step(None, 10.0)


def test_a_loop_with_parts_that_tick_names_the_same_switch(monkeypatch):
    monkeypatch.setattr(dormand_prince, "__defaults__", (2000,))
    n = Signal("n", "1")
    clock = Block("clock", [n], [], [n], [], {"n": n.symbol + 1}, period=0.25)
    loop = interconnect([relay(), clock])
    line = r"at t = 0\.5\d* s: too many steps: the state relay\.v = .*relay\.v > 0"
    with pytest.raises(StoppedError, match=line):
        simulate(loop, TIMES)
    run = loop.start()
    with pytest.raises(InputError, match=r"run stops at t = 0\.5.*switch relay\.v > 0 in relay\.v' chatters"):
        run.step(None, 1.0)
    assert run.time == pytest.approx(0.5, abs=1e-3)


def test_equations_that_are_too_stiff_name_the_state(monkeypatch):
    monkeypatch.setattr(effort, "LOOKED_AFTER", 500)
    k, slow = Signal("k", "1/s", start=1e9), Signal("slow", "1/s", start=1.0)
    slopes = {"w": -slow.symbol * W.symbol, "v": k.symbol * (W.symbol - V.symbol)}
    block = Block("stiff", [W, V], [], [V], [k, slow], slopes)
    with (
        pytest.warns(UserWarning),
        pytest.raises(StoppedError, match=r"the state v = \S+ m/s changes fastest$"),
    ):
        simulate(block, TIMES)


def test_a_derivative_that_is_not_a_number_is_named():
    k = Signal("k", "m^(1/2)/s^(3/2)", start=1.0)
    rooted = Block("rooted", [V.replace(start=-1.0)], [], [V], [k], {"v": -k.symbol * sp.sqrt(V.symbol)})
    line = r"at t = 0 s: a derivative .*: the state v = -1 m/s has the derivative nan"
    with pytest.raises(InputError, match=line):
        simulate(rooted, TIMES)
    with pytest.raises(InputError, match="the state v = -1 m/s has the derivative nan"):
        rooted.compile().simulate(TIMES)


def test_a_run_that_ends_within_the_limits_says_nothing(recwarn, monkeypatch):
    monkeypatch.setattr(effort, "LOOKED_AFTER", 500)
    k = Signal("k", "1/s", start=2.0)
    simulate(Block("decay", [V], [], [V], [k], {"v": -k.symbol * V.symbol}), np.linspace(0.0, 300.0, 5))
    assert not recwarn.list


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda v, w: sp.Max(v, w), "Max(v, w) in c"),
        (lambda v, w: sp.Abs(v - w), "Abs(v - w) in c"),
        (lambda v, w: sp.atan2(v, w), "atan2(v, w) in c"),
        (lambda v, w: sp.Heaviside(v / w - 1), "Heaviside(v/w - 1) in c"),
    ],
)
def test_what_switches_is_found_in_definitions(make, text):
    c = Signal("c")
    found = make(V.symbol, W.symbol)
    block = Block("b", [V, W], [], [], [], {"v": 0 * V.symbol, "w": 0 * V.symbol}, {}, {"c": found}, [])
    assert c.name in block.definitions
    assert [s.text for s in switches(block)] == [text]


def test_a_switch_that_is_passed_once_does_not_chatter():
    text = where_it_stops(relay(), 0.0, [1e-3, 1.0], [], relay().parameter_values(), span=10.0)
    assert "v > 0 in v' chatters" in text
    k = Signal("a", "m/s^2", start=2.0)
    once = Block("once", [V], [], [V], [k], {"v": -k.symbol * sp.Piecewise((1, V.symbol > 0), (2, True))})
    assert "chatters" not in where_it_stops(once, 0.0, [1e-3], [], [2.0], span=10.0)


def test_the_error_goes_through_files_names_and_pickles():
    first = StoppedError("block 'a': it stops", 3, ": the state v")
    again = pickle.loads(pickle.dumps(first))
    assert (str(again), again.status, again.where) == (str(first), 3, ": the state v")
    assert str(type(first)(f"a.toml: {first}")) == "a.toml: block 'a': it stops"
