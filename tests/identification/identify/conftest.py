"""Logs of simulated craft whose coefficients are known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import c17_experiment, four_fan
from hovercontrol.logs import Log

POSE, VELOCITY = ("x", "y", "psi"), ("u", "v", "r")
NOISE = {"x": 1e-3, "y": 1e-3, "psi": 3e-3, "u": 5e-3, "v": 5e-3, "r": 2e-2}


def held(rng: np.random.Generator, t: np.ndarray, seconds: float, low: float, high: float) -> np.ndarray:
    """Random steps, each held for about so many seconds."""
    levels = rng.uniform(low, high, int(t[-1] / seconds) + 2)
    return levels[(t / seconds).astype(int)]


def measured_log(
    model: Model,
    t: np.ndarray,
    inputs: Mapping[str, np.ndarray],
    channels: tuple[str, ...],
    rng: np.random.Generator,
    noise: float = 1.0,
    x0: Mapping[str, float] | None = None,
) -> Log:
    states = dict(
        zip(
            (*POSE, *VELOCITY),
            simulate(model.plant(), t, inputs, x0, rtol=1e-8, atol=1e-10).states,
            strict=True,
        )
    )
    seen = {c: states[c] + noise * NOISE[c] * rng.standard_normal(t.size) for c in channels}
    return Log("simulated", t, {**seen, **inputs})


@pytest.fixture
def rudder_log() -> Callable[..., Log]:
    """A log of the C17 craft under rich thrust and rudder steps."""

    def make(
        channels: tuple[str, ...] = VELOCITY,
        *,
        seconds: float = 25.0,
        seed: int = 1,
        model: Model | None = None,
        rudder: float = 0.45,
        noise: float = 1.0,
        rate: float = 100.0,
    ) -> Log:
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, seconds, 1 / rate)
        inputs = {
            "thrust": held(rng, t, 0.7, 0.0, 6.0),
            "rudder": rudder * np.sign(held(rng, t, 0.9, -1, 1)) * held(rng, t, 0.5, 0.2, 1.0),
        }
        return measured_log(model or c17_experiment(), t, inputs, channels, rng, noise)

    return make


@pytest.fixture
def fan_truth() -> Model:
    """A four-fan craft whose coefficients differ from the starting point of the library's."""
    return four_fan().with_coefficients(
        {
            "surge_linear_drag": 0.4,
            "sway_linear_drag": 0.3,
            "yaw_linear_drag": 0.5,
            "fan_force": 4.5,
            "fan_torque": 900.0,
        }
    )


@pytest.fixture
def fan_log(fan_truth: Model) -> Callable[..., Log]:
    """A log of the four-fan craft with random fan forces of up to 0.05 N."""

    def make(channels: tuple[str, ...] = POSE, *, seconds: float = 30.0, seed: int = 1) -> Log:
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, seconds, 0.02)
        inputs = {
            name: held(rng, t, 0.8, 0.0, 0.05) * (held(rng, t, 0.8, 0, 1) > 0.4)
            for name in ("rear_left", "rear_right", "front_left", "front_right")
        }
        return measured_log(fan_truth, t, inputs, channels, rng)

    return make


@pytest.fixture
def cart() -> Block:
    """A cart on a rail: position measured, velocity not, force put in."""
    p, v, F = Signal("p", "m"), Signal("v", "m/s"), Signal("F", "N")
    drag = Signal("cart.drag", "1/s", start=1.0, lower=0.0)
    gain = Signal("cart.gain", "1/kg", start=1.0)
    return Block(
        "cart",
        [p, v],
        [F],
        [p],
        [drag, gain],
        {"p": v.symbol, "v": gain.symbol * F.symbol - drag.symbol * v.symbol},
    )


@pytest.fixture
def cart_log(cart: Block) -> Callable[..., Log]:
    def make(
        seed: int, drag: float = 0.6, gain: float = 1.7, noise: float = 0.01, seconds: float = 12.0
    ) -> Log:
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, seconds, 0.05)
        force = held(rng, t, 0.6, -1, 1)
        truth = {"cart.drag": drag, "cart.gain": gain}
        free = replace(cart, parameters=tuple(p.replace(lower=-np.inf) for p in cart.parameters))
        p = simulate(free, t, {"F": force}, params=truth, rtol=1e-7).states[0]
        return Log(f"cart {seed}", t, {"p": p + noise * rng.standard_normal(t.size), "F": force})

    return make
