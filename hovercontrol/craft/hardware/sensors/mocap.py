"""A motion capture system: the pose, and velocities by backward difference (C17 section VIII-B)."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import offset, rounded, size, tick, turned
from hovercontrol.craft.models.motion import MOTION


@checked
def mocap(
    *,
    period: float = 0.01,
    position_noise: float = 0.0,
    heading_noise: float = 0.0,
    position_step: float = 0.0,
    heading_step: float = 0.0,
    first_velocity: Sequence[float] = (0.0, 0.0, 0.0),
    seed: int = 1,
    name: str = "mocap",
) -> Block:
    """Return a motion capture system.

    Parameters
    ----------
    period : float, optional
        [s]; C17 measures at 100 Hz.
    position_noise : float, optional
        Standard deviation of each coordinate [m].
    heading_noise : float, optional
        Standard deviation of the heading [rad].
    position_step, heading_step : float, optional
        Poses are rounded to multiples of these [m], [rad]; 0 is no rounding.
    first_velocity : (float, float, float), optional
        Output ``u, v, r`` at the first tick, before there is a difference.
    seed : int, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``x, y, psi``; outputs ``x_measured, y_measured`` [m], ``psi_measured`` [rad] and, by backward
        difference, turned by the measured heading, ``u_measured, v_measured`` [m/s], ``r_measured`` [rad/s].

    Raises
    ------
    InputError
        If the period is not positive, or a noise or step negative.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> camera = Ticking(mocap(period=0.5))
    >>> [camera.tick(0.5 * k, {"x": 1.0 * k, "y": 0.0, "psi": 0.0})["u_measured"] for k in range(3)]
    [0.0, 2.0, 2.0]
    """
    if not hasattr(first_velocity, "__len__") or len(first_velocity) != 3:
        raise InputError(f"{name}: first_velocity: expected three numbers, found {first_velocity!r}")
    every = tick(name, period)
    noise = random_numbers(3, salt=name, seed=seed)
    started = Signal("started", "1", "1 after the first tick", lower=0.0, upper=1.0)
    sigma = {
        kind: size(f"{kind}_noise", unit, f"standard deviation of the {kind}", name, value)
        for kind, unit, value in (("position", "m", position_noise), ("heading", "rad", heading_noise))
    }
    steps = {
        kind: size(f"{kind}_step", unit, f"rounding step of the {kind}; 0: no rounding", name, value)
        for kind, unit, value in (("position", "m", position_step), ("heading", "rad", heading_step))
    }
    first = [
        offset(f"first_{s.name}", s.unit, f"{s.description} at the first tick", name, value)
        for s, value in zip(MOTION[3:], first_velocity, strict=True)
    ]
    pose = MOTION[:3]
    before = [s.replace(name=f"{s.name}_before", description=f"{s.description}, last reading") for s in pose]
    told = [s.replace(name=f"{s.name}_measured") for s in MOTION]
    definitions = dict(noise.definitions)
    for s, reading, n in zip(pose, told[:3], noise.values, strict=True):
        kind = "heading" if s.name == "psi" else "position"
        noisy = s.symbol + sigma[kind].symbol * n
        definitions[reading.name] = rounded(noisy, steps[kind].symbol)
    rates = [(now.symbol - old.symbol) / every.symbol for now, old in zip(told[:3], before, strict=True)]
    slopes = [Signal(f"{s.name}_rate", f"{s.unit}/s") for s in pose]
    definitions |= {s.name: rate for s, rate in zip(slopes, rates, strict=True)}
    velocity = (*turned(-told[2].symbol, slopes[0].symbol, slopes[1].symbol), slopes[2].symbol)
    return Block(
        name,
        states=(started, *before, *noise.states),
        inputs=pose,
        outputs=tuple(told),
        parameters=(every, *sigma.values(), *steps.values(), *first, *noise.parameters),
        derivatives={
            "started": sp.S.One,
            **{old.name: now.symbol for old, now in zip(before, told[:3], strict=True)},
            **noise.next_values,
        },
        output_expressions={
            s.name: sp.Piecewise((e, started.symbol > 0), (start.symbol, True))
            for s, e, start in zip(told[3:], velocity, first, strict=True)
        },
        definitions=definitions,
        definition_signals=(*told[:3], *slopes),
        period=every.start,
    )


@checked
def noisy_motion(
    *,
    period: float = 0.01,
    position_noise: float = 0.0,
    heading_noise: float = 0.0,
    velocity_noise: float = 0.0,
    rate_noise: float = 0.0,
    seed: int = 1,
    name: str = "noisy_motion",
) -> Block:
    """Return a sensor of pose and velocities with white noise only, for craft that measure both.

    Parameters
    ----------
    period : float, optional
        [s]
    position_noise, heading_noise, velocity_noise, rate_noise : float, optional
        Standard deviations of x and y [m], psi [rad], u and v [m/s], r [rad/s].
    seed : int, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``x, y, psi, u, v, r``; outputs as of :func:`mocap`.

    Raises
    ------
    InputError
        If the period is not positive or a noise negative.

    Examples
    --------
    >>> [s.name for s in noisy_motion().outputs][3:]
    ['u_measured', 'v_measured', 'r_measured']
    """
    seconds = tick(name, period).start
    noise = random_numbers(len(MOTION), salt=name, seed=seed)
    position, heading, velocity, rate = sigmas = tuple(
        size(f"{kind}_noise", unit, f"standard deviation of the {kind}", name, value)
        for kind, unit, value in (
            ("position", "m", position_noise),
            ("heading", "rad", heading_noise),
            ("velocity", "m/s", velocity_noise),
            ("rate", "rad/s", rate_noise),
        )
    )
    of = (position, position, heading, velocity, velocity, rate)
    return Block(
        name,
        states=noise.states,
        inputs=MOTION,
        outputs=tuple(s.replace(name=f"{s.name}_measured") for s in MOTION),
        parameters=(*sigmas, *noise.parameters),
        derivatives=noise.next_values,
        output_expressions={
            f"{s.name}_measured": s.symbol + sigma.symbol * n
            for s, sigma, n in zip(MOTION, of, noise.values, strict=True)
        },
        definitions=noise.definitions,
        period=seconds,
    )
