"""Delay lines: chains of unit delays that delay signals by a whole number of ticks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import not_negative, positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal


@checked
def constant_delay(
    signals: Sequence[Signal],
    delay: float,
    period: float,
    *,
    suffix: str = "_received",
    name: str = "link",
) -> Block:
    """Return a chain of n = delay / period unit delays: y(k) = u(k - n).

    Parameters
    ----------
    signals : sequence of Signal
        Signals to delay.
    delay : float
        Delay [s], a multiple of the period; with 0 the outputs are the present inputs.
    period : float
        Time between two ticks [s].
    suffix : str, optional
        Suffix of the outputs' names.
    name : str, optional
        Name of the Block.

    Returns
    -------
    Block
        Sampled. The inputs are `signals`; the outputs are the same signals with the suffix, and their age
        ``<name>_age`` [s]. Until the first input has passed, the outputs have their start values, and their
        age is the time since the start.

    Raises
    ------
    InputError
        If the delay is negative or not a multiple of the period (the message gives the nearest ones), if the
        period is not positive, or if there are no signals or two of the same name.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> link = Ticking(constant_delay([Signal("thrust", "N")], 0.04, 0.02))
    >>> [link.tick(0.02 * k, {"thrust": 5.0 + k})["thrust_received"] for k in range(4)]
    [0.0, 0.0, 5.0, 6.0]
    """
    signals = passed_through(name, signals, suffix)
    positive(f"{name}: period", period)
    stages = _stages(name, not_negative(f"{name}: delay", delay), period)
    step = fixed("period", period, "time between ticks")
    chains = [
        [
            s.replace(name=f"{s.name}_stage{k}", description=f"{s.name}, {k} ticks old")
            for k in range(1, stages + 1)
        ]
        for s in signals
    ]
    # stage_1(k+1) = u(k),  stage_j(k+1) = stage_{j-1}(k),  y(k) = stage_n(k);  age(k) = min(k, n) * period
    ticks = Signal(f"{name}_ticks", "1", "number of ticks, limited to the number of stages")
    following, values = {ticks.name: sp.Min(ticks.symbol + 1, stages)}, {}
    for s, chain in zip(signals, chains, strict=True):
        line = [s, *chain]
        following |= {late.name: early.symbol for early, late in zip(line, chain, strict=False)}
        values[s.name + suffix] = line[-1].symbol
    age = Signal(f"{name}_age", "s", "age of the values received")
    return Block(
        name,
        states=(ticks, *(stage for chain in chains for stage in chain)),
        inputs=signals,
        outputs=(*(s.replace(name=s.name + suffix) for s in signals), age),
        parameters=(step,),
        derivatives=following,
        output_expressions={**values, age.name: ticks.symbol * step.symbol},
        period=period,
    )


def _stages(name: str, delay: float, period: float) -> int:
    """Return a delay as a number of periods; raise if it is not a whole number."""
    ratio = Fraction(str(delay)) / Fraction(str(period))
    if ratio.denominator != 1:
        below, above = (float(n * Fraction(str(period))) for n in (math.floor(ratio), math.ceil(ratio)))
        raise InputError(
            f"{name}: delay {delay:g} s is not a multiple of the period {period:g} s; "
            f"the nearest are {below:g} s and {above:g} s"
        )
    return int(ratio)


def fixed(name: str, value: float, description: str) -> Signal:
    """Return a parameter for a time [s] that determines a Block's structure and so has a fixed value."""
    return Signal(name, "s", f"{description}; fixed", start=value, lower=value, upper=value)


def passed_through(name: str, signals: Sequence[Signal], suffix: str) -> tuple[Signal, ...]:
    """Return the signals of a link, checked.

    Raises
    ------
    InputError
        If there are no signals, one is not a Signal, two have the same name, or the suffix is empty.
    """
    if isinstance(signals, str | Signal) or not all(isinstance(s, Signal) for s in signals):
        raise InputError(f"{name}: signals must be a sequence of Signal, found {signals!r}")
    names = [s.name for s in signals]
    if not names or len(set(names)) < len(names):
        raise InputError(f"{name}: expected signals of different names, found {names}")
    if not suffix:
        raise InputError(f"{name}: outputs cannot have the names of inputs: give a suffix")
    return tuple(signals)
