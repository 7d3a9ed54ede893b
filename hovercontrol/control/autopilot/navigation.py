"""The navigation of a loop: K06's error model, or the full sensors and filters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot.error_model import SIMULATED_IMU, error_model
from hovercontrol.control.observers.ins import IMU_PERIOD, K06_NOISE, InsNoise, aided_ins
from hovercontrol.craft.hardware.sensors import (
    Beacons,
    arrivals,
    gyro_dynamics,
    k06_cricket,
    k06_imu,
    k06_magnetometer,
)
from hovercontrol.craft.models.motion import MOTION

#: Names of the navigation's estimates of the motion.
HATS = tuple(f"{s.name}_hat" for s in MOTION)


def position_fix(
    *,
    noise: float = math.sqrt(K06_NOISE.R2[0]),
    interval: float = 1.0,
    period: float = IMU_PERIOD,
    seed: int = 1,
    name: str = "position_fix",
) -> Block:
    """Return position fixes once a second, at any place, with the noise assumed by K06's filter (R2, 5.4.5).

    It replaces Cricket in trials that leave the room in which the beacons are heard. Forward at 1.1 m/s the
    craft is 15 m away at the end of K06's plots.

    Parameters
    ----------
    noise : float, optional
        Standard deviation of each coordinate [m].
    interval : float, optional
        Time from fix to fix [s], rounded to a whole number of ticks.
    period : float, optional
        Time from tick to tick [s].
    seed : int, optional
        Seed of the random numbers.

    Returns
    -------
    Block
        Sampled. Inputs ``x, y`` [m]; outputs ``fix_x, fix_y`` [m] and ``fix_valid``, 1 at the tick of a fix.

    Examples
    --------
    >>> position_fix().period
    0.0065536
    """
    every = max(1, round(positive(f"{name}: interval", interval) / positive(f"{name}: period", period)))
    size = Signal("noise", "m", "standard deviation of each coordinate", start=noise, lower=0.0)
    count = Signal("count", "1", "ticks since the last fix")
    drawn = random_numbers(2, salt=name, seed=seed)
    x, y = MOTION[:2]
    outputs = (
        Signal("fix_x", "m", "position by a fix"),
        Signal("fix_y", "m", "position by a fix"),
        Signal("fix_valid", "1", "1 at the tick of a fix", lower=0.0, upper=1.0),
    )
    return Block(
        name,
        states=(count, *drawn.states),
        inputs=(x, y),
        outputs=outputs,
        parameters=(size, *drawn.parameters),
        derivatives={
            count.name: sp.Piecewise((0, count.symbol > every - sp.Rational(3, 2)), (count.symbol + 1, True)),
            **drawn.next_values,
        },
        output_expressions={
            "fix_x": x.symbol + size.symbol * drawn.values[0],
            "fix_y": y.symbol + size.symbol * drawn.values[1],
            "fix_valid": sp.Piecewise((1, count.symbol < sp.Rational(1, 2)), (0, True)),
        },
        definitions=drawn.definitions,
        period=period,
    )


def _modelled(start: Mapping[str, float], noise: InsNoise, seed: int, beacons: Beacons | None) -> list[Block]:
    errors = rename(error_model(seed=seed), {"r": "gyro_rate"})
    return [gyro_dynamics(period=SIMULATED_IMU), errors]


def _by_magnetometer(
    start: Mapping[str, float], noise: InsNoise, seed: int, beacons: Beacons | None
) -> list[Block]:
    always = Signal("heading_aid_valid", "1", "a magnetometer always measures")
    return [
        gyro_dynamics(),
        k06_imu(rate="gyro_rate", seed=seed),
        rename(k06_magnetometer(seed=seed), {"heading_magnetic": "heading_aid"}),
        Block("always", outputs=(always,), output_expressions={always.name: sp.S.One}),
        position_fix(seed=seed),
        _filters(start, noise),
    ]


def _by_cricket(
    start: Mapping[str, float], noise: InsNoise, seed: int, beacons: Beacons | None
) -> list[Block]:
    aids = {
        "heading_aid": "heading_fix",
        "heading_aid_valid": "heading_fix_arrived",
        "fix_valid": "fix_arrived",
    }
    return [
        gyro_dynamics(),
        k06_imu(rate="gyro_rate", seed=seed),
        k06_cricket(beacons, side=_side(start, beacons), assisted=True, seed=seed),
        arrivals(),
        rename(_filters(start, noise), aids),
    ]


def _side(start: Mapping[str, float], beacons: Beacons | None) -> float:
    """Return the side of the line from the first to the second beacon where the craft starts: 1 left, -1."""
    # Sign of the cross product (p_2 - p_1) x (p - p_1).
    if beacons is None:
        return 1.0
    (x1, y1), (x2, y2) = beacons.positions[:2]
    x, y = (start.get(name, 0.0) for name in "xy")
    return 1.0 if (x2 - x1) * (y - y1) >= (y2 - y1) * (x - x1) else -1.0


def _filters(start: Mapping[str, float], noise: InsNoise) -> Block:
    pose = [start.get(name, 0.0) for name in ("x", "y", "psi")]
    u, v = (start.get(name, 0.0) for name in "uv")
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    filters = aided_ins(
        noise=noise, pose=pose, velocity=(cos * u - sin * v, sin * u + cos * v), name="filters"
    )
    # Only outputs are held from tick to tick, so unneeded ones are left out.
    return interconnect([filters], "ins", outputs=[*HATS, "v_x_hat", "v_y_hat"])


#: By name: a function that makes the Blocks, and the period at which they output the motion.
NAVIGATION: dict[
    str, tuple[Callable[[Mapping[str, float], InsNoise, int, Beacons | None], list[Block]], float]
] = {
    "error_model": (_modelled, SIMULATED_IMU),
    "magnetometer": (_by_magnetometer, IMU_PERIOD),
    "cricket": (_by_cricket, IMU_PERIOD),
}


#: The kinds of navigation that use beacons.
BY_BEACONS = ("cricket",)


def check_beacons(where: str, beacons: Beacons, navigation: str) -> None:
    """Raise if `beacons` are not Beacons, or if the navigation does not use them."""
    if not isinstance(beacons, Beacons):
        raise InputError(f"{where}: beacons: expected Beacons, found {beacons!r}")
    if navigation not in BY_BEACONS:
        raise InputError(
            f"{where}: beacons belong to navigation {' or '.join(map(repr, BY_BEACONS))}, "
            f"found {navigation!r}"
        )


def sampled_motion(period: float, name: str = "ins_sampling") -> Block:
    """Return a Block that samples the true motion at the navigation's ticks: ``x_sampled`` ..."""
    told = tuple(s.replace(name=f"{s.name}_sampled") for s in MOTION)
    return Block(
        name,
        inputs=MOTION,
        outputs=told,
        output_expressions={t.name: s.symbol for t, s in zip(told, MOTION, strict=True)},
        period=period,
    )
