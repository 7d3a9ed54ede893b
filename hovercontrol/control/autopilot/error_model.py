"""K06's model of its navigation's errors [K06 fig 6.2], in place of sensors and filters."""

from __future__ import annotations

import math

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import number, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.motion import MOTION

#: K06 simulates the IMU's 6.5536 ms as 6 ms.
SIMULATED_IMU = 0.006

#: Standard deviations of K06's random numbers. Section 6.1.1 prints *variances* of 2.5 cm/s^2, 1 deg/s and
#: 0.5 deg/s, and Simulink's block of random numbers takes variances, in SI units. Read as standard deviations
#: they move the yaw rate of figure 6.8c by 0.06 rad/s, where its axis ends at -0.5 rad/s.
ACCELERATION_BIAS = math.sqrt(0.025)  # m/s^2
GYRO_BIAS = math.sqrt(math.radians(1.0))  # rad/s
GYRO_NOISE = math.sqrt(math.radians(0.5))  # rad/s


@checked
def error_model(
    *,
    acceleration_bias: float = ACCELERATION_BIAS,
    gyro_bias: float = GYRO_BIAS,
    gyro_noise: float = GYRO_NOISE,
    interval: float = 1.0,
    period: float = SIMULATED_IMU,
    seed: int = 1,
    name: str = "navigation",
) -> Block:
    """Return K06's INS block: true motion plus errors that grow from fix to fix (section 6.1.1, figure 6.2).

    The biases that remain after the filters are integrated to errors of velocity and heading. A pulse every
    second, the rate of K06's fixes, resets these errors. K06 says that the biases vary in time, but not how
    fast; here new values are drawn at each pulse. The error of the position, which K06 omits, is the second
    integral of the accelerometers' biases.

    Parameters
    ----------
    acceleration_bias : float, optional
        Standard deviation of the accelerometers' remaining biases [m/s^2]; default 0.158, the root of the
        variance that K06 prints.
    gyro_bias, gyro_noise : float, optional
        Standard deviation of the gyro's remaining bias, and of its white noise [rad/s]; default 0.132 and
        0.093, likewise.
    interval : float, optional
        Time from pulse to pulse [s]; a pulse comes at the first tick that is not earlier.
    period : float, optional
        Time from tick to tick [s].
    seed : int, optional
        Seed of the random numbers.
    name : str, optional

    Returns
    -------
    Block
        Sampled. Inputs ``x, y, psi, u, v, r``; outputs ``x_hat`` ... ``r_hat``.

    Raises
    ------
    InputError
        If a standard deviation is negative or a time is not positive.

    Examples
    --------
    >>> [s.name for s in error_model().outputs]
    ['x_hat', 'y_hat', 'psi_hat', 'u_hat', 'v_hat', 'r_hat']
    """
    sizes = tuple(
        Signal(key, unit, text, start=number(f"{name}: {key}", value), lower=0.0)
        for key, unit, text, value in (
            ("acceleration_bias", "m/s^2", "standard deviation of either accelerometer's bias",
             acceleration_bias),
            ("gyro_bias", "rad/s", "standard deviation of the gyro's bias", gyro_bias),
            ("gyro_noise", "rad/s", "standard deviation of the gyro's white noise", gyro_noise),
        )
    )  # fmt: skip
    step = Signal("period", "s", "of the ticks, fixed", start=positive(f"{name}: period", period),
                  lower=period, upper=period)  # fmt: skip
    pulse = Signal("interval", "s", "from pulse to pulse", start=positive(f"{name}: interval", interval))
    noise = random_numbers(4, salt=name, seed=seed)
    since = Signal("since", "s", "time since the pulse")
    last_since = since.replace(
        name="last_since", description="time since the pulse, at the last tick", start=1e9
    )
    biases = [
        Signal(f"bias_{key}", unit, "remaining fraction of a bias")
        for key, unit in (("x", "m/s^2"), ("y", "m/s^2"), ("g", "rad/s"))
    ]
    last = [b.replace(name=f"last_{b.name}") for b in biases]
    spreads = (sizes[0], sizes[0], sizes[1])
    definitions = dict(noise.definitions)
    definitions[since.name] = sp.Piecewise(
        (last_since.symbol + step.symbol, last_since.symbol + step.symbol < pulse.symbol), (0, True)
    )
    for b, old, spread, drawn in zip(biases, last, spreads, noise.values, strict=False):
        definitions[b.name] = sp.Piecewise((old.symbol, since.symbol > 0), (spread.symbol * drawn, True))
    # A time t after the pulse, with B(psi) the rotation to earth axes and b the biases:
    # p_hat = p + t^2/2 B(psi) [b_x, b_y],  psi_hat = psi + t b_g,  [u, v]_hat = [u, v] + t [b_x, b_y],
    # r_hat = r + b_g + white noise.
    x, y, psi, u, v, r = (s.symbol for s in MOTION)
    b_x, b_y, b_g = (b.symbol for b in biases)
    t, cos, sin = since.symbol, sp.cos(psi), sp.sin(psi)
    told = {
        "x_hat": x + t**2 / 2 * (cos * b_x - sin * b_y),
        "y_hat": y + t**2 / 2 * (sin * b_x + cos * b_y),
        "psi_hat": psi + t * b_g,
        "u_hat": u + t * b_x,
        "v_hat": v + t * b_y,
        "r_hat": r + b_g + sizes[2].symbol * noise.values[3],
    }
    return Block(
        name,
        states=(last_since, *last, *noise.states),
        inputs=MOTION,
        outputs=tuple(
            s.replace(name=f"{s.name}_hat", description=f"{s.description}, by the INS") for s in MOTION
        ),
        parameters=(*sizes, pulse, step, *noise.parameters),
        derivatives={
            last_since.name: since.symbol,
            **{old.name: b.symbol for old, b in zip(last, biases, strict=True)},
            **noise.next_values,
        },
        output_expressions=told,
        definitions=definitions,
        definition_signals=(since, *biases),
        period=period,
    )  # fmt: skip
