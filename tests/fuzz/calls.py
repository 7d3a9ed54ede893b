"""Public functions called with arguments of which one or two are of a wrong type, shape or size."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from random import Random
from typing import Any

import numpy as np

import hovercontrol as hc
from hovercontrol.blocks.units import conversion_factor, dimension
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.grid import vary
from hovercontrol.identification.engine.frame_check import check_frame
from hovercontrol.logs import Log, read_log
from hovercontrol.logs.frames import in_z_up
from tests.fuzz import mutate
from tests.fuzz.sound import CALLABLES, Call, sound_calls
from tests.fuzz.walk import probes

Sound = Mapping[str, Any]


@cache
def cart() -> hc.Block:
    v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    k = hc.Signal("k", "1/s", start=1.0, lower=0.0)
    return hc.Block("cart", [v], [a], [v], [k], {"v": a.symbol - k.symbol * v.symbol})


@cache
def targets() -> list[tuple[Callable[..., Any], Sound]]:
    """Return the functions with arguments that are right."""
    block, craft = cart(), hc.vehicle("c17_simulation")
    times = np.linspace(0.0, 0.2, 5)
    ready = block.compile()
    log = Log("a", times, {"u": times, "v": times, "r": times, "thrust": times, "rudder": times})
    return [
        (
            hc.Signal,
            {
                "name": "v",
                "unit": "m/s",
                "start": 0.0,
                "nominal": 1.0,
                "lower": -1.0,
                "upper": 1.0,
                "modes": (),
            },
        ),
        (
            hc.Block,
            {
                "name": "b",
                "states": block.states,
                "inputs": block.inputs,
                "outputs": block.outputs,
                "parameters": block.parameters,
                "derivatives": block.derivatives,
            },
        ),
        (
            hc.interconnect,
            {"blocks": [craft.plant(), hc.tracking_controller(craft), hc.circle(1.0)], "name": "loop"},
        ),
        (hc.rename, {"block": block, "signals": {"v": "w"}}),
        (hc.prefix, {"block": block, "name": "left"}),
        (hc.Model, {"name": "m", "effects": craft.effects, "fans": ()}),
        (hc.Fan, {"name": "left", "x": 0.0, "y": 0.1, "direction": 0.0, "curve": [0.1, 0.2], "gain": 1.0}),
        (hc.effect, {"name": "yaw_coulomb", "value": 0.3, "width": 0.01}),
        (hc.vehicle, {"name": "hoverdemon"}),
        (hc.load_model, {"path": "none.toml"}),
        (hc.tracking_controller, {"model": craft, "control_point": 0.2, "k1": 1.0, "k2": 1.0}),
        (hc.ellipse, {"semi_x": 1.0, "semi_y": 2.0, "rate": 1.0}),
        (hc.circle, {"radius": 1.0, "rate": 1.0, "phase": 0.0, "name": "r"}),
        (hc.figure_eight, {"length": 1.0, "width": 1.0, "rate": 1.0}),
        (hc.waypoints, {"points": [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]], "times": [0.0, 1.0, 2.0]}),
        (hc.kalman_bucy, {"block": craft.plant(), "R": 1.0, "Q": 1.0, "P0": 1.0}),
        (hc.regression, {"block": craft.plant(), "coefficients": ["thrust"]}),
        (
            hc.simulate,
            {
                "block": block,
                "time": times,
                "inputs": {"a": 1.0},
                "x0": [0.0],
                "params": {"cart.k": 1.0},
                "hold": "zero",
                "method": "RK45",
                "rtol": 1e-6,
                "atol": 1e-9,
                "max_step": 1.0,
            },
        ),
        (
            ready.simulate,
            {
                "time": times,
                "inputs": {"a": 1.0},
                "x0": [0.0],
                "params": {"cart.k": 1.0},
                "method": "rk4",
                "step": 0.1,
                "rtol": 1e-6,
                "atol": 1e-9,
            },
        ),
        (
            ready.sweep,
            {
                "time": times,
                "params": {"cart.k": [0.0, 1.0]},
                "x0": {"v": [0.0, 1.0]},
                "start": 0.1,
                "band": 0.02,
                "threads": 1,
                "method": "rk4",
                "step": 0.1,
            },
        ),
        (
            ready.advance,
            {"t": 0.0, "until": 0.1, "x": [0.0], "u": [1.0], "params": {"cart.k": 1.0}, "rtol": 1e-6},
        ),
        (block.with_values, {"values": {"v": 1.0}}),
        (block.parameter_values, {"params": {"cart.k": 1.0}}),
        (block.signal, {"name": "v"}),
        (craft.with_coefficients, {"values": {"thrust": 1.0}}),
        (craft.with_effects, {"effects": [hc.effect("slope", 0.1)]}),
        (craft.effect, {"name": "thrust"}),
        (Log, {"name": "a", "time": times, "columns": {"u": times}}),
        (log.select, {"rows": slice(0, 2)}),
        (log.between, {"start": 0.0, "stop": 1.0}),
        (log.with_columns, {"columns": {"u": times}}),
        (log.stack, {"names": "u"}),
        (read_log, {"path": "none.csv", "columns": {"x": "y"}, "inputs": ["thrust"], "motion": True}),
        (in_z_up, {"log": log, "frame": "ned"}),
        (check_frame, {"model": craft, "log": log}),
        (load_scenario, {"name": "table1"}),
        (
            vary,
            {
                "scenario": load_scenario("k06-forward"),
                "ranges": {"controller.k1": np.array([1.0, 2.0])},
                "of": "u",
                "figure": "final",
            },
        ),
        (dimension, {"unit": "m/s"}),
        (conversion_factor, {"unit": "deg", "target": "rad"}),
    ]


def some_call(rng: Random) -> Callable[[], object]:
    """Return a call of which one argument or two are hostile."""
    function, sound = rng.choice(targets())
    given = dict(sound)
    for name in rng.sample(list(given), min(len(given), rng.choice((1, 1, 2)))):
        given[name] = _hostile(rng, given[name])
    if function.__name__ == "stack":
        return lambda: function(given["names"])

    return lambda: function(**given)


@cache
def _sound() -> dict[str, Call]:
    return {name: sound for name, sound in sound_calls(0.3).items() if any(True for _ in probes(sound))}


def some_wrong_call(rng: Random) -> Callable[[], object]:
    """Return a call of anything public of which one argument is a wrong thing of the walk's.

    Which depends on the seed alone, but for those whose examples a slow machine does not come to.
    """
    calls, names, part = _sound(), sorted(CALLABLES), rng.random()
    first = rng.randrange(len(names))
    sound = next(calls[name] for name in names[first:] + names[:first] if name in calls)
    found = list(probes(sound))
    return found[int(part * len(found))][1]


def _hostile(rng: Random, sound: Any) -> Any:
    kind = rng.randrange(4)
    if kind == 0 and isinstance(sound, dict) and sound:
        changed = dict(sound)
        changed[rng.choice([*changed, "nonsense", 1])] = rng.choice(mutate.VALUES)
        return changed
    if kind == 1 and isinstance(sound, list | tuple | np.ndarray) and len(sound):
        changed = list(sound)
        changed[rng.randrange(len(changed))] = rng.choice(mutate.VALUES)
        return changed
    if kind == 2:
        return rng.choice(
            [np.zeros((2, 3)), np.zeros(0), np.array(["a"]), np.array([1j]), np.nan, cart(), sound]
        )
    return rng.choice(mutate.VALUES)
