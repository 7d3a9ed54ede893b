"""Logs of craft that lack effects which nobody is told: what the search for missing effects is tested on.

A case is made of a seed and what is hidden. The search gets the model (its coefficients up to 3 % off, its
friction width its own) and the logs, never what was hidden; motion comes from the adaptive solver of the
compiled Block, commands that are late are shifted exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal, time
from hovercontrol.craft.effects import Effect, effect
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.benchmark.cases import gust, steps, with_rates
from hovercontrol.identification.benchmark.machines import MACHINES, rudder_craft
from hovercontrol.logs import Log

from .closed import tracked

Array = NDArray[np.float64]
Random = np.random.Generator

#: Standard deviations of measurements: pose by cameras [m, rad], velocities by sensors [m/s, rad/s]; and of
#: gusts [m/s^2, m/s^2, rad/s^2].
NOISE, GUST = dict(MACHINES["rudder"].noise), MACHINES["rudder"].gusts


def craft(rng: Random) -> Model:
    """Return a rudder craft with random coefficients and one random width of friction."""
    width = rng.uniform(2e-3, 1e-2)
    typical = {e.name: e.values["value"] for e in rudder_craft().effects}
    shape = {name: {"width": width} if name.endswith("coulomb") else {} for name in typical}
    return Model(
        "craft",
        [effect(name, value * rng.uniform(0.8, 1.25), **shape[name]) for name, value in typical.items()],
    )


def given(model: Model, rng: Random) -> Model:
    """Return the model that the search is given: coefficients up to 3 % off, the usual width."""
    off = {
        k: 0.01 if k.endswith("_width") else v * rng.uniform(0.97, 1.03)
        for k, v in model.coefficients().items()
    }
    return model.with_coefficients(off)


def _either(low: float, high: float) -> Callable[[Random], float]:
    return lambda rng: float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))


def _from(low: float, high: float) -> Callable[[Random], float]:
    return lambda rng: float(rng.uniform(low, high))


#: How large hidden effects are, number by number.
SIZES: dict[str, dict[str, Callable[[Random], float]]] = {
    "surge_quadratic_drag": {"value": _from(0.2, 0.5)},
    "sway_quadratic_drag": {"value": _from(0.4, 1.0)},
    "yaw_quadratic_drag": {"value": _from(0.1, 0.3)},
    "surge_stribeck": {"value": _from(0.2, 0.4), "speed": _from(0.1, 0.4)},
    "sway_stribeck": {"value": _from(0.2, 0.4), "speed": _from(0.1, 0.4)},
    "yaw_stribeck": {"value": _from(0.3, 0.6), "speed": _from(0.2, 0.6)},
    "body_surge_force": {"value": _either(0.05, 0.15)},
    "body_side_force": {"value": _either(0.05, 0.15)},
    "slope": {"x": _either(0.05, 0.15), "y": _either(0.0, 0.15)},
    "wind": {"x": _either(0.2, 0.5), "y": _either(0.0, 0.5)},
    "thrust_yaw_torque": {"value": _either(0.1, 0.3)},
    "thrust_rudder_loss": {"value": _from(0.5, 1.5)},
    "reverse_thrust_loss": {"value": _from(0.2, 0.5)},
    "sway_yaw_coupling": {"value": _either(0.3, 1.0)},
    "munk_moment": {"value": _either(0.3, 1.0)},
    "added_mass_coriolis": {"value": _either(0.1, 0.3)},
    "rudder_damping": {"value": _from(0.1, 0.3)},
    "input_delay": {"seconds": _from(0.05, 0.15)},
    "thrust_lag": {"seconds": _from(0.1, 0.3)},
    "rudder_lag": {"seconds": _from(0.08, 0.25)},
    "thrust_deadzone": {"width": _from(0.2, 0.5)},
    "thrust_saturation": {"limit": _from(2.0, 3.0)},
    "battery_sag": {"value": _from(0.002, 0.005)},
    "rudder_offset": {"value": _either(0.03, 0.1)},
    "gyro_bias": {"value": _either(0.03, 0.1)},
    "gyro_scale": {"value": _either(0.03, 0.1)},
    "velocity_misalignment": {"value": _either(0.03, 0.1)},
    "sensor_lever_arm": {"value": _either(0.03, 0.1)},
    "time_offset": {"seconds": _either(0.03, 0.1)},
    "parameter_jump": {"factor": _from(1.2, 1.6), "seconds": _from(15.0, 45.0)},
}
#: The same of effects that a search names only where it is asked for them.
BEYOND: dict[str, dict[str, Callable[[Random], float]]] = {
    "mass_drift": {"value": _either(0.002, 0.006)},
    "air_drag": {"value": _from(0.2, 0.4)},
    "gyro_drift": {"value": _either(0.001, 0.004)},
    "surge_cubic_drag": {"value": _from(0.1, 0.3)},
    "sway_cubic_drag": {"value": _from(0.1, 0.3)},
    "yaw_cubic_drag": {"value": _from(0.1, 0.3)},
}
#: The same of effects that the blind table does not have.
REST: dict[str, dict[str, Callable[[Random], float]]] = {
    "thrust_backlash": {"width": _from(0.2, 0.5)},
    "rudder_backlash": {"width": _from(0.05, 0.15)},
    "thrust_rate_limit": {"limit": _from(2.0, 6.0)},
    "rudder_rate_limit": {"limit": _from(0.5, 2.0)},
    "thrust_curve": {"value": _either(0.1, 0.3), "scale": _from(3.5, 3.5)},
    "load_friction": {"value": _from(0.05, 0.2)},
    "pose_lever_arm": {"x": _either(0.03, 0.1), "y": _either(0.0, 0.05)},
    **{
        f"lugre_{axis}": {
            "stiffness": _from(200.0, 500.0),
            "damping": _from(5.0, 15.0),
            "coulomb": _from(0.1, 0.2),
            "static": _from(0.25, 0.4),
            "speed": _from(0.03, 0.1),
        }
        for axis in ("surge", "sway", "yaw")
    },
}
#: Of a light craft of fans.
FANS: dict[str, dict[str, Callable[[Random], float]]] = {
    "fan_lag": {"seconds": _from(0.02, 0.05)},
    "fan_delay": {"seconds": _from(0.01, 0.04)},
    "fan_misalignment": {"value": _either(0.03, 0.1)},
    "thrust_curve": {"value": _either(0.1, 0.3), "scale": _from(0.15, 0.15)},
    "pose_lever_arm": {"x": _either(0.005, 0.02), "y": _either(0.0, 0.02)},
}
#: Effects that measurements of other quantities are needed for.
VELOCITY_ONLY = {"gyro_bias", "gyro_scale", "velocity_misalignment", "sensor_lever_arm"}


def hidden(name: str, rng: Random, model: Model, scale: float = 1.0) -> Effect:
    """Return an effect of random size; `scale` makes it smaller."""
    values = {key: size(rng) for key, size in {**SIZES, **BEYOND, **REST}[name].items()}
    cls = type(effect(name, **values))
    for key in values:
        neutral = cls.numbers[key].neutral
        if not np.isnan(neutral):
            values[key] = neutral + scale * (values[key] - neutral)
    if name == "thrust_saturation":
        values["limit"] = 3.4 - scale * (3.4 - values["limit"])  # the largest command is about 3.5
    if name.endswith("stribeck"):
        values["width"] = model.effects[0].values["width"]
    return cls(**values)


def rich(rng: Random, duration: float, dt: float) -> dict[str, Array]:
    """Return commands that excite all there is: random steps, thrust backward as well."""
    return {
        "thrust": steps(rng, round(duration / dt), dt, (0.4, 2.0), (-1.5, 3.5)),
        "rudder": steps(rng, round(duration / dt), dt, (0.3, 1.5), (-0.45, 0.45)),
    }


def mild(rng: Random, duration: float, dt: float) -> dict[str, Array]:
    """Return commands of laps: thrust forward, slow waves, turns to one side."""
    t = np.arange(0.0, duration, dt)
    w = 2 * np.pi / rng.uniform(6.0, 12.0)
    a, b, c, d = rng.uniform(0.0, 2 * np.pi, 4)
    return {
        "thrust": 1.2 + 0.5 * np.sin(w * t + a) + 0.2 * np.sin(2.3 * w * t + b),
        "rudder": 0.12 + 0.12 * np.sin(0.7 * w * t + c) + 0.05 * np.sin(1.9 * w * t + d),
    }


@dataclass(frozen=True)
class Conditions:
    """How logs are made."""

    commands: Callable[[Random, float, float], dict[str, Array]] = rich
    noise: float = 1.0
    duration: float = 60.0
    dt: float = 0.02
    logs: int = 2
    scale: float = 1.0
    gusts: bool = False
    channels: Sequence[str] = tuple(NOISE)
    faults: bool = False  # outliers, dropped rows, jittered stamps
    laps: bool = False  # commands of the tracking controller


@dataclass(frozen=True)
class Case:
    """What the search gets, and what it must not see."""

    model: Model
    logs: list[Log]
    holdout: Log
    truth: Model = field(repr=False)
    names: tuple[str, ...] = field(repr=False)


def make(seed: int, names: Sequence[str], conditions: Conditions | None = None) -> Case:
    """Return a case with these effects hidden."""
    conditions = conditions or Conditions()
    rng = np.random.default_rng(seed)
    model = craft(rng)
    truth = model.with_effects([hidden(name, rng, model, conditions.scale) for name in names])
    believed = given(model, np.random.default_rng([seed, 1]))
    if conditions.laps:
        conditions = replace(conditions, commands=partial(tracked, believed, truth))
    runs = [simulated(truth, rng, conditions, f"log {k + 1}") for k in range(conditions.logs)]
    clean = replace(conditions, faults=False)
    return Case(believed, runs, simulated(truth, rng, clean, "hold-out"), truth, tuple(names))


def simulated(model: Model, rng: Random, conditions: Conditions, name: str) -> Log:
    """Return one log of a craft."""
    plant = model.plant(late=True)
    block = with_gusts(plant) if conditions.gusts else plant
    commands = conditions.commands(rng, conditions.duration, conditions.dt)
    t = np.arange(0.0, conditions.duration, conditions.dt)[: len(commands["thrust"])]
    late = sum(e.values["seconds"] for e in model.effects if e.name in ("input_delay", "time_offset"))
    gusts = {f"gust_{axis}": gust(rng, t.size, conditions.dt, size) for axis, size in GUST.items()}
    grid = np.unique(np.round(np.concatenate([t, t + late, [min(0.0, late)]]), 9)) if late else t
    held = np.searchsorted(t, grid - late + 1e-9, side="right") - 1
    held_gust = np.clip(np.searchsorted(t, grid + 1e-9, side="right") - 1, 0, t.size - 1)
    rows = [
        gusts[s.name][held_gust]
        if s.name in gusts
        else np.where(held >= 0, commands[s.name][np.clip(held, 0, t.size - 1)], 0.0)
        for s in block.inputs
    ]
    run = block.compile(friction="smooth").simulate(grid, rows, rtol=1e-7, atol=1e-9)
    y = dict(zip(run.output_labels, np.atleast_2d(run.outputs), strict=True))
    at = np.searchsorted(grid, t - 1e-9)
    seen = {
        c: y.get(f"{c}_measured", y[c])[at] + conditions.noise * NOISE[c] * rng.normal(size=t.size)
        for c in conditions.channels
    }
    log = Log(name, t, {**seen, **commands})
    return faulty(log, rng, conditions) if conditions.faults else log


def faulty(log: Log, rng: Random, conditions: Conditions) -> Log:
    """Return the log with 2 % outliers, 5 % of its rows dropped, stamps off by up to 3 ms."""
    n = len(log)
    columns = dict(log.columns)
    for c in conditions.channels:
        hit = rng.random(n) < 0.02
        columns[c] = columns[c] + hit * 50.0 * NOISE[c] * rng.normal(size=n)
    stamps = log.time + rng.uniform(-3e-3, 3e-3, n)
    kept = rng.random(n) > 0.05
    return Log(log.name, stamps[kept], {k: v[kept] for k, v in columns.items()})


def with_gusts(block: Block) -> Block:
    gusts = {axis: Signal(f"gust_{axis}", "rad/s^2" if axis == "r" else "m/s^2") for axis in GUST}
    added = {axis: block.derivatives[axis] + signal.symbol for axis, signal in gusts.items()}
    return with_rates(block, {**block.derivatives, **added}, inputs=tuple(gusts.values()))


OUTSIDE = ("oscillator", "patch", "mass")


def outside(seed: int, kind: str, conditions: Conditions | None = None) -> Case:
    """Return a case with something hidden that no effect of the catalogue says."""
    conditions = conditions or Conditions()
    rng = np.random.default_rng(seed)
    model = craft(rng)
    block = model.plant()
    d = dict(block.derivatives)
    u, v, r, x = (sp.Symbol(n, real=True) for n in ("u", "v", "r", "x"))
    states: list[Signal] = []
    if kind == "oscillator":  # a load on a spring, shaken sideways
        w, k = sp.Float(rng.uniform(4.0, 12.0)), sp.Float(rng.uniform(0.3, 0.8))
        rate = Signal("swing_rate", "1/s", start=float(w))
        part = Signal("swing_part", "1", start=float(k))
        states = [Signal("load", "m"), Signal("load_rate", "m/s")]
        q, dq = (s.symbol for s in states)
        d["load"] = dq
        d["load_rate"] = -(rate.symbol**2) * q - 0.1 * rate.symbol * dq - part.symbol * d["v"]
        d["v"] = d["v"] + part.symbol * rate.symbol**2 * q
        parameters = [rate, part]
    elif kind == "patch":  # stripes of rough floor
        size = Signal("stripe", "m", start=rng.uniform(1.0, 3.0))
        rough = Signal("roughness", "1/s", start=rng.uniform(0.5, 1.5))
        inside = sp.Abs(sp.Mod(x, 4 * size.symbol) - 2 * size.symbol) < size.symbol
        drag = rough.symbol * sp.Piecewise((1, inside), (0, True))
        d["u"], d["v"] = d["u"] - drag * u, d["v"] - drag * v
        parameters = [size, rough]
    elif kind == "mass":  # the craft grows heavier or lighter
        rate = Signal("mass_rate", "1/s", start=float(rng.choice([-1.0, 1.0]) * rng.uniform(0.002, 0.006)))
        part = 1 + rate.symbol * time
        d["u"], d["v"] = r * v + (d["u"] - r * v) / part, -r * u + (d["v"] + r * u) / part
        d["r"] = d["r"] / part
        parameters = [rate]
    else:
        raise ValueError(kind)
    block = with_rates(block, d, states=states, parameters=parameters)
    logs = [_run(block, rng, conditions, f"log {k + 1}") for k in range(conditions.logs)]
    return Case(given(model, rng), logs, _run(block, rng, conditions, "hold-out"), model, (kind,))


def _run(block: Block, rng: Random, conditions: Conditions, name: str) -> Log:
    commands = conditions.commands(rng, conditions.duration, conditions.dt)
    t = np.arange(0.0, conditions.duration, conditions.dt)[: len(commands["thrust"])]
    run = block.compile(friction="smooth").simulate(t, commands, rtol=1e-7, atol=1e-9)
    y = dict(zip(run.output_labels, np.atleast_2d(run.outputs), strict=True))
    seen = {c: y[c] + conditions.noise * NOISE[c] * rng.normal(size=t.size) for c in conditions.channels}
    return Log(name, t, {**seen, **commands})
