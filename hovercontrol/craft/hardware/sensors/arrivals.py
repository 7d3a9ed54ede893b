"""Flags of a slow sensor as single pulses for a faster reader."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.hardware.sensors._parts import IMU_TICK, tick

_END = "_valid"


@checked
def arrivals(
    flags: Sequence[str] = ("fix_valid", "heading_fix_valid"),
    *,
    period: float = IMU_TICK,
    name: str = "arrivals",
) -> Block:
    """Return a converter of flags held by a slower Block into pulses of one tick.

    A Cricket's ``fix_valid`` is 1 for a whole slot of 100 ms; a filter that ticks every 6.5536 ms must not
    use that fix fifteen times.

    Parameters
    ----------
    flags : sequence of str, optional
        Names of the inputs, 0 or 1, that end in ``_valid``. Each must fall between two arrivals.
    period : float, optional
        Of the reader [s].
    name : str, optional

    Returns
    -------
    Block
        For each flag an output whose name ends in ``_arrived``, 1 at the first tick after the flag has risen.

    Raises
    ------
    InputError
        If there are no flags, one is listed twice or does not end in ``_valid``, or the period is not
        positive.

    Examples
    --------
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> once = Ticking(arrivals(["fix_valid"]))
    >>> [once.tick(0.0, {"fix_valid": held})["fix_arrived"] for held in (0, 1, 1, 1, 0, 1)]
    [0, 1, 0, 0, 0, 1]
    """
    if isinstance(flags, str) or not flags or len(set(flags)) < len(flags):
        raise InputError(f"{name}: expected different flags, found {flags!r}")
    for flag in flags:
        if not flag.endswith(_END):
            raise InputError(f"{name}: a flag's name ends in {_END!r}, found {flag!r}")
    inputs = [Signal(flag, "1", "1 while the measurement is valid") for flag in flags]
    outputs = [
        Signal(f"{flag.removesuffix(_END)}_arrived", "1", "1 at the first tick of a measurement")
        for flag in flags
    ]
    last = [Signal(f"{flag}_last", "1", "the flag at the last tick") for flag in flags]
    return Block(
        name,
        states=tuple(last),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        derivatives={old.name: flag.symbol for old, flag in zip(last, inputs, strict=True)},
        output_expressions={
            told.name: sp.Piecewise((1, sp.And(flag.symbol > 0, old.symbol <= 0)), (0, True))
            for told, flag, old in zip(outputs, inputs, last, strict=True)
        },
        period=tick(name, period).start,
    )
