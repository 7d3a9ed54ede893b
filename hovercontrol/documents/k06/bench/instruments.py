"""Instruments of K06's rotating bench: encoder, tachometer, and a delay by ticks of the IMU."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.control.autopilot.turntable import ARM
from hovercontrol.control.observers.ins import IMU_PERIOD
from hovercontrol.craft.models.motion import MOTION

#: The spin axis, in the middle of the beacons [m]; K06 does not print where the bench stood.
CENTRE = (1.22, 1.22)
#: Positions of K06's encoder in a turn.
POSITIONS = 4096


def sample_delay(
    signals: Sequence[Signal], ending: str, *, most: int = 2, samples: int | None = None, name: str
) -> Block:
    """Return a delay of signals by some ticks of the IMU, such as the two of K06's gyro (6.2.1.3).

    Parameters
    ----------
    signals : sequence of Signal
        The inputs.
    ending : str
        Outputs are ``SIGNAL_ENDING``.
    most : int, optional
        Largest delay [ticks].
    samples : int, optional
        The delay, the start value of the parameter ``samples``; default: `most`.
    name : str

    Raises
    ------
    InputError
        If `most` is no positive whole number or the delay is beyond it.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> late = Ticking(sample_delay([Signal("a")], "late", name="line"))
    >>> [late.tick(0.0, {"a": a})["a_late"] for a in (1.0, 2.0, 3.0)]
    [0.0, 0.0, 1.0]
    """
    if not isinstance(most, int) or most < 1:
        raise InputError(f"{name}: most must be a positive whole number, found {most!r}")
    late = Signal(
        "samples",
        "1",
        "delay in ticks",
        start=most if samples is None else samples,
        lower=0.0,
        upper=most,
    )
    states: list[Signal] = []
    following: dict[str, sp.Expr] = {}
    told: dict[str, sp.Expr] = {}
    for signal in signals:
        line = [signal, *(signal.replace(name=f"{signal.name}_{k}_ago") for k in range(1, most + 1))]
        states += line[1:]
        following |= {old.name: new.symbol for new, old in pairwise(line)}
        cases = [(s.symbol, late.symbol < k + sp.Rational(1, 2)) for k, s in enumerate(line[:-1])]
        told[f"{signal.name}_{ending}"] = sp.Piecewise(*cases, (line[-1].symbol, True))
    outputs = tuple(signal.replace(name=n) for signal, n in zip(signals, told, strict=True))
    return Block(name, tuple(states), tuple(signals), outputs, (late,), following, told, period=IMU_PERIOD)


def encoder(*, positions: int = POSITIONS, interval: float = 1.0, name: str = "encoder") -> Block:
    """Return the platform's optical encoder: the heading in steps, and a fix of the place once an interval.

    Parameters
    ----------
    positions : int, optional
        In a turn.
    interval : float, optional
        From fix to fix [s], as the nearest whole number of ticks.
    name : str, optional

    Returns
    -------
    Block
        Sampled. Input ``psi`` [rad]; outputs ``encoder_psi`` [rad], ``encoder_x, encoder_y`` [m] of the
        sensors' place, and ``encoder_valid``, 1 at the tick of a fix. Parameters ``arm``, ``centre_x``,
        ``centre_y`` [m] as of the turntable.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> round(Ticking(encoder(positions=4)).tick(0.0, {"psi": 1.0})["encoder_psi"], 4)  # a quarter turn
    1.5708
    """
    every, step = max(1, round(interval / IMU_PERIOD)), 2 * sp.pi / positions
    psi, count = MOTION[2], Signal("count", "1", "ticks since the last fix")
    radius = Signal("arm", "m", "from the spin axis to the sensors", start=ARM, lower=0.0)
    cx, cy = (
        Signal(f"centre_{axis}", "m", "of the spin axis", start=at)
        for axis, at in zip("xy", CENTRE, strict=True)
    )
    read = Signal("encoder_psi", "rad", "heading by the encoder")
    place = tuple(Signal(f"encoder_{axis}", "m", "place by the encoder") for axis in "xy")
    fresh = Signal("encoder_valid", "1", "1 at the tick of a fix", lower=0.0, upper=1.0)
    more = count.symbol > every - sp.Rational(3, 2)
    return Block(
        name,
        states=(count,),
        inputs=(psi,),
        outputs=(read, *place, fresh),
        parameters=(radius, cx, cy),
        derivatives={"count": sp.Piecewise((0, more), (count.symbol + 1, True))},
        output_expressions={
            "encoder_x": cx.symbol + radius.symbol * sp.sin(read.symbol),
            "encoder_y": cy.symbol - radius.symbol * sp.cos(read.symbol),
            fresh.name: sp.Piecewise((1, count.symbol < sp.Rational(1, 2)), (0, True)),
        },
        definitions={read.name: step * sp.floor(psi.symbol / step + sp.Rational(1, 2))},
        definition_signals=(read,),
        period=IMU_PERIOD,
    )


def tachometer(*, noise: float = 0.0, name: str = "tachometer") -> Block:
    """Return K06's tachometer, its reference of the yaw rate and of the velocity; `noise` in rad/s."""
    size = Signal("noise", "rad/s", "standard deviation of a reading", start=noise, lower=0.0)
    told, r = Signal("tachometer_rate", "rad/s", "yaw rate by the tachometer"), MOTION[5]
    drawn = random_numbers(1, salt=name)
    return Block(
        name, drawn.states, (r,), (told,), (size, *drawn.parameters), drawn.next_values,
        {told.name: r.symbol + size.symbol * drawn.values[0]}, drawn.definitions, period=IMU_PERIOD,
    )  # fmt: skip
