"""Logs on the clock of a sampled model: each row is one of its ticks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.identification.engine.measure import Measured

#: Largest distance of a row from a tick after the row before it, in periods, and largest difference of the
#: log's clock from the model's over the whole log, as a fraction.
NEAR, DRIFT = 0.3, 5e-3


def on_ticks(log: Measured, period: float) -> Measured:
    """Return a log whose rows have the times of a sampled model's ticks, the first row at its own time.

    Raises
    ------
    InputError
        If rows are not whole periods apart.
    """
    steps = np.diff(log.time)
    ticks = np.rint(steps / period)
    inside = np.ones(steps.size, dtype=bool)
    inside[[start - 1 for start in log.starts]] = False  # pauses between trials may have any length
    ticks[~inside] = np.maximum(ticks[~inside], 1.0)
    off = np.abs(steps / period - ticks) * inside
    usual = float(np.median(steps[inside])) if inside.any() else period
    drift = (
        abs(steps[inside].sum() / max(period * ticks[inside].sum(), 1e-300) - 1.0) if inside.any() else 0.0
    )
    if (ticks < 1.0).any() or drift > DRIFT or np.median(off) > NEAR:
        raise InputError(
            f"{log.name}: expected rows whole periods of the model apart, {period:g} s, found {usual:.6g} s"
        )
    if (off > NEAR).any():
        k = int(np.argmax(off > NEAR))
        raise InputError(
            f"{log.name}: expected rows whole periods of the model apart, {period:g} s, found "
            f"{steps[k]:.6g} s at {log.time[k]:.6g} s"
        )
    return replace(log, time=log.time[0] + period * np.r_[0.0, np.cumsum(ticks)])
