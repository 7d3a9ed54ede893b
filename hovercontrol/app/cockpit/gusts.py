"""Gusts: a random wind, drawn at each tick."""

from __future__ import annotations

from functools import cache

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal

GUST = (
    Signal("gust_x", "m/s", "gust, earth frame"),
    Signal("gust_y", "m/s", "gust, earth frame"),
)


@cache
def gusts(*, period: float = 0.02, name: str = "gusts") -> Block:
    """Return a wind of mean zero with a correlation time of one second along x and y.

    A Gauss-Markov process of first order, exact at its ticks: ``g' = a g + sqrt(1 - a^2) s n`` with
    ``a = exp(-1/ticks)`` and n of variance 1.

    Parameters
    ----------
    period : float, optional
        [s]

    Returns
    -------
    Block
        Sampled. Outputs ``gust_x, gust_y`` [m/s]; parameters ``speed``, their standard deviation s [m/s],
        ``ticks``, the correlation time in ticks (one second), and ``seed``.

    Examples
    --------
    >>> sorted(gusts().default_parameters)
    ['gusts.seed', 'gusts.speed', 'gusts.ticks']
    """
    noise = random_numbers(2, salt=name)
    speed = Signal("speed", "m/s", "standard deviation of the gusts", start=1.0, lower=0.0)
    ticks = Signal("ticks", "1", "correlation time in ticks", start=1.0 / period, lower=1.0)
    states = tuple(s.replace(name=f"{s.name}_held") for s in GUST)
    kept = sp.exp(-1 / ticks.symbol)
    fresh = speed.symbol * sp.sqrt(1 - kept**2)
    following = {s.name: kept * s.symbol + fresh * n for s, n in zip(states, noise.values, strict=True)}
    return Block(
        name,
        states=(*states, *noise.states),
        outputs=GUST,
        parameters=(speed, ticks, *noise.parameters),
        derivatives={**following, **noise.next_values},
        definitions=noise.definitions,
        output_expressions={g.name: s.symbol for g, s in zip(GUST, states, strict=True)},
        period=period,
    )
