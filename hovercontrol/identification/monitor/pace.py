"""Lengths of time of a monitor: in seconds for a craft, of another machine within numbers of ticks."""

from __future__ import annotations


def paced(seconds: float, tick: float, *, is_craft: bool) -> float:
    """Return a length of time [s]: as stated for a craft, else as many ticks as at periods of 5 to 100 ms.

    Parameters
    ----------
    seconds : float
        As stated for a craft.
    tick : float
        Period of the monitor [s].
    is_craft : bool

    Examples
    --------
    >>> [paced(2.0, tick, is_craft=False) for tick in (1e-5, 0.05, 86400.0)]
    [0.004, 2.0, 1728000.0]
    """
    if is_craft:
        return seconds
    return float(f"{min(max(seconds, seconds / 0.1 * tick), seconds / 0.005 * tick):.12g}")
