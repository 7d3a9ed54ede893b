"""Failsafe of a craft whose commands are lost."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.tables import positive
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import passed_through
from hovercontrol.blocks.signals import Signal


@checked
def failsafe(
    signals: Sequence[Signal],
    age: str,
    *,
    timeout: float = 0.4,
    incoming: str = "_heard",
    suffix: str = "_received",
    name: str = "failsafe",
) -> Block:
    """Return a switch that passes fresh commands, and replaces old ones by their start values (at rest).

    K06's craft has a second receiver for a safety pilot (section 5.2); K06 prints no timeout.

    Parameters
    ----------
    signals : sequence of Signal
        Commands; their start values are the commands at rest.
    age : str
        Name of the link's output with the age of the commands [s].
    timeout : float, optional
        Age at which commands count as lost [s]; a parameter.
    incoming, suffix : str, optional
        Suffixes of the names of inputs and outputs.
    name : str, optional

    Returns
    -------
    Block
        Without states. Inputs: the received commands and their age. Outputs: the commands to apply and
        ``<name>_on``, 1 while they are the commands at rest. Nonzero values at rest are parameters.

    Raises
    ------
    InputError
        If the timeout is not positive, or there are no signals or two of one name.

    Examples
    --------
    >>> block = failsafe([Signal("thrust", "N")], "link_age")
    >>> [block.to_numpy().outputs(0.0, (), [1.5, old]).tolist() for old in (0.1, 0.5)]
    [[1.5, 0.0], [0.0, 1.0]]
    """
    signals = passed_through(name, signals, suffix)
    old = Signal(age, "s", "age of the commands")
    longest = Signal(
        "timeout",
        "s",
        "age at which commands count as lost",
        start=positive(f"{name}: timeout", timeout),
        lower=0.0,
    )
    fresh = old.symbol < longest.symbol
    on = Signal(f"{name}_on", "1", "1 while the commands are those at rest", lower=0.0, upper=1.0)
    heard = [s.replace(name=s.name + incoming) for s in signals]
    rest = {
        s.name: s.replace(name=f"rest_{s.name}", description=f"{s.name} at rest") for s in signals if s.start
    }
    told: dict[str, sp.Expr] = {
        s.name + suffix: sp.Piecewise(
            (h.symbol, fresh), (rest[s.name].symbol if s.start else sp.S.Zero, True)
        )
        for s, h in zip(signals, heard, strict=True)
    }
    return Block(
        name,
        inputs=(*heard, old),
        outputs=(*(s.replace(name=s.name + suffix) for s in signals), on),
        parameters=(longest, *rest.values()),
        output_expressions={**told, on.name: sp.Piecewise((0, fresh), (1, True))},
    )
