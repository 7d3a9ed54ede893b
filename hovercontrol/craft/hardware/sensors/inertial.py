"""An inertial measurement unit: two accelerometers and a gyro with their errors [K06 eq 3.28, 3.29]."""

from __future__ import annotations

import math
from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import IMU_TICK, limited, offset, pair, size, tick

#: Channel, true signal, unit of the reading and of its random walk.
_CHANNELS = (
    ("acceleration_x", "specific_force_x", "m/s^2", "m/s^2.5"),
    ("acceleration_y", "specific_force_y", "m/s^2", "m/s^2.5"),
    ("yaw_rate", "r", "rad/s", "rad/s^1.5"),
)


@checked
def imu(
    *,
    period: float = IMU_TICK,
    acceleration_bias: Sequence[float] = (0.0, 0.0),
    acceleration_bias_spread: float = 0.0,
    acceleration_walk: float = 0.0,
    acceleration_noise: float = 0.0,
    acceleration_limit: float = 0.0,
    yaw_rate_bias: float = 0.0,
    yaw_rate_bias_spread: float = 0.0,
    yaw_rate_walk: float = 0.0,
    yaw_rate_noise: float = 0.0,
    yaw_rate_limit: float = 0.0,
    rate: str = "r",
    seed: int = 1,
    name: str = "imu",
) -> Block:
    """Return an inertial measurement unit: true value plus bias plus white noise, limited to full scale.

    Each number is a parameter of the Block with the same name; 0, the default, switches the error off.

    Parameters
    ----------
    period : float, optional
        [s]
    acceleration_bias : (float, float), optional
        Constant part of the accelerometers' biases [m/s^2], ``acceleration_x_bias`` and ``..._y_bias``.
    acceleration_bias_spread : float, optional
        Standard deviation of a random part of the bias, drawn at the first tick [m/s^2].
    acceleration_walk : float, optional
        Random walk of the biases [m/s^2/sqrt(s)].
    acceleration_noise : float, optional
        Standard deviation of each reading's white noise [m/s^2].
    acceleration_limit : float, optional
        Full scale [m/s^2].
    yaw_rate_bias, yaw_rate_bias_spread, yaw_rate_walk, yaw_rate_noise, yaw_rate_limit : float, optional
        The same for the gyro [rad/s].
    rate : str, optional
        Name of the input with the yaw rate; ``"gyro_rate"`` behind
        :func:`~hovercontrol.craft.hardware.sensors.gyro.gyro_dynamics`.
    seed : int, optional
    name : str, optional

    Returns
    -------
    Block
        Inputs ``specific_force_x, specific_force_y`` [m/s^2]
        (:func:`~hovercontrol.craft.hardware.sensors.motion.with_specific_force`) and `rate` [rad/s]; outputs
        ``acceleration_x, acceleration_y`` [m/s^2], forward and left, and ``yaw_rate`` [rad/s].

    Raises
    ------
    InputError
        If the period is not positive, or a noise, walk, spread or limit is negative.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> off = Ticking(imu(yaw_rate_bias=0.5, yaw_rate_limit=2.0))
    >>> off.tick(0.0, {"specific_force_x": 1.0, "specific_force_y": 0.0, "r": 1.8})
    {'acceleration_x': 1.0, 'acceleration_y': 0.0, 'yaw_rate': 2.0}
    """
    bias = (*pair(f"{name}: acceleration_bias", acceleration_bias), yaw_rate_bias)
    sizes = {
        "acceleration": (acceleration_bias_spread, acceleration_walk, acceleration_noise, acceleration_limit),
        "yaw_rate": (yaw_rate_bias_spread, yaw_rate_walk, yaw_rate_noise, yaw_rate_limit),
    }
    every = tick(name, period)
    noise = random_numbers(2 * len(_CHANNELS), salt=name, seed=seed)
    started = Signal("started", "1", "1 after the first tick", upper=1.0, lower=0.0)
    inputs, outputs, states = [], [], [started]
    parameters: dict[str, Signal] = {every.name: every}
    definitions = dict(noise.definitions)
    told: dict[str, sp.Expr] = {}
    following: dict[str, sp.Expr] = {"started": sp.S.One}
    for k, (channel, truth, unit, walk_unit) in enumerate(_CHANNELS):
        seen = Signal(rate if channel == "yaw_rate" else truth, unit, f"true {channel}")
        kind = "yaw_rate" if channel == "yaw_rate" else "acceleration"
        constant = offset(f"{channel}_bias", unit, "constant part of the bias", name, bias[k])
        spread, walk, white, limit = own = tuple(
            size(f"{kind}_{what}", walk_unit if what == "walk" else unit, text, name, value)
            for (what, text), value in zip(
                (
                    ("bias_spread", "standard deviation of the bias drawn at the start"),
                    ("walk", "random walk of the bias"),
                    ("noise", "standard deviation of the white noise"),
                    ("limit", "full scale; 0: no limit"),
                ),
                sizes[kind],
                strict=True,
            )
        )
        parameters |= {s.name: s for s in (constant, *own)}
        drift = Signal(f"{channel}_drift", unit, "random walk part of the bias")
        drawn, stepped = noise.values[2 * k : 2 * k + 2]
        now = Signal(f"{channel}_drift_now", unit)
        definitions[now.name] = sp.Piecewise(
            (drift.symbol, started.symbol > 0), (spread.symbol * stepped, True)
        )
        # The first step of the walk would share its random number with the start: it is left out.
        following[drift.name] = now.symbol + sp.Piecewise(
            (walk.symbol * sp.sqrt(every.symbol) * stepped, started.symbol > 0), (0, True)
        )
        whole = Signal(f"{channel}_unlimited", unit)
        definitions[whole.name] = seen.symbol + constant.symbol + now.symbol + white.symbol * drawn
        told[channel] = limited(whole.symbol, limit.symbol)
        inputs.append(seen)
        states.append(drift)
        outputs.append(Signal(channel, unit, "measured by the inertial sensors"))
    return Block(
        name,
        states=(*states, *noise.states),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        parameters=(*parameters.values(), *noise.parameters),
        derivatives=following | noise.next_values,
        output_expressions=told,
        definitions=definitions,
        period=every.start,
    )


@checked
def k06_imu(*, period: float = IMU_TICK, rate: str = "r", seed: int = 1, name: str = "imu") -> Block:
    """Return an inertial measurement unit with error sizes from K06 and the full scales of its hardware.

    Biases of 2.5 cm/s^2 and 1 deg/s, drawn from the seed, and gyro noise of 0.5 deg/s, all standard
    deviations; full scales 1.7 g and 300 deg/s (section 5.4.1).

    K06 does not print these errors of the sensor. The three values are those of section 6.1.1, where they are
    variances of the errors that a simulated navigation leaves;
    :func:`~hovercontrol.control.autopilot.error_model` takes them as variances. Those of the sensor itself
    they cannot be: gyro noise would be 5.4 deg/s, but the yaw rate of table 6.7 is accurate to 3.7 deg/s.
    White noise of the sensor at rest is in Q1 and Q2 of section 5.4.5: 1.27 deg/s, 0.18 and 0.16 m/s^2.

    Parameters
    ----------
    period : float, optional
        [s]; the hardware's by default, K06 simulates 6 ms.
    rate, seed, name
        As for :func:`imu`.

    Examples
    --------
    >>> k06_imu().default_parameters["imu.acceleration_bias_spread"]
    0.025
    """
    return imu(
        period=period,
        acceleration_bias_spread=0.025,
        acceleration_limit=1.7 * 9.80665,
        yaw_rate_bias_spread=math.radians(1.0),
        yaw_rate_noise=math.radians(0.5),
        yaw_rate_limit=math.radians(300.0),
        rate=rate,
        seed=seed,
        name=name,
    )
