"""Angles that a sensor gives within one turn, 0 to 2 pi or -pi to pi: the turns are added again.

A wrap is told from a true jump by three facts: all values lie within one turn, the value jumps by almost a
turn, and without that turn the change is like those beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.logs.log import Floats, Log

TURN = 2.0 * np.pi


@dataclass(frozen=True)
class WrapCriteria:
    """When a jump of an angle is a wrap.

    No published source: set by hand, exercised by tests/logs/test_angles.py.

    Attributes
    ----------
    beyond : float
        By which the range of the values may exceed a turn, relative to a turn: noise at the ends.
    usual : float
        Quantile of the changes that do not jump. What is left of a wrap is at most twice that change.
    """

    beyond: float = 0.02
    usual: float = 0.99


#: The values in use.
WRAP = WrapCriteria()


def unwrapped(log: Log, names: Sequence[str]) -> tuple[Log, list[str]]:
    """Return a log whose angles run on over full turns, and one line on each that did not.

    Parameters
    ----------
    names : sequence of str
        Measured columns in rad.

    Examples
    --------
    >>> t = 0.01 * np.arange(1000)
    >>> found, said = unwrapped(Log("a", t, {"q": (3.0 * t) % TURN}), ["q"])
    >>> said, bool(np.allclose(found["q"], 3.0 * t))
    (["a: column 'q' wraps at 6.28 rad (4 times): its turns are added"], True)
    >>> unwrapped(Log("a", t, {"q": np.where(t < 5.0, 0.0, 6.0)}), ["q"])[1]
    []
    """
    columns, said = dict[str, Floats](), []
    for name in names:
        parts, count = [], 0
        for part in log.each_trial():
            row, wraps = _unwrapped(part[name])
            parts.append(row)
            count += wraps
        if count:
            columns[name] = np.concatenate(parts)
            end = float(np.nanmax(log[name]))
            times = f"{count} time{'s' * (count > 1)}"
            at = f"{TURN:.3g}" if end > 1.2 * np.pi else f"{np.pi:.3g}"
            said.append(f"{log.name}: column {name!r} wraps at {at} rad ({times}): its turns are added")
    return (log.with_columns(columns) if columns else log), said


def _unwrapped(values: Floats) -> tuple[Floats, int]:
    """Return an angle with its turns, and the number of wraps; unchanged if there is none."""
    seen = np.flatnonzero(np.isfinite(values))
    own = values[seen]
    change = np.diff(own)
    jumps = np.abs(change) > np.pi
    if not jumps.any() or jumps.all() or np.ptp(own) > (1.0 + WRAP.beyond) * TURN:
        return values, 0
    usual = float(np.quantile(np.abs(change[~jumps]), WRAP.usual))
    back = np.rint(change / TURN)
    wraps = jumps & (np.abs(change - back * TURN) <= 2.0 * usual)
    if not wraps.any():
        return values, 0
    found = values.copy()
    found[seen[1:]] -= TURN * np.cumsum(np.where(wraps, back, 0.0))
    return found, int(wraps.sum())
