"""The diagonal of a covariance, as users give it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import simplified


def diagonal(name: str, value: ArrayLike, size: int, positive: bool = False) -> list[float]:
    """Return the diagonal of a covariance, given as one number or as `size` numbers."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected one number or {size} of them, found {value!r}") from None
    if array.ndim > 1 or (array.ndim == 1 and array.shape != (size,)):
        raise InputError(f"{name}: expected one number or {size} of them, found shape {array.shape}")
    full = np.broadcast_to(array, size)
    if not np.isfinite(full).all() or (full < 0).any() or (positive and (full == 0).any()):
        sign = "positive" if positive else "not negative"
        raise InputError(f"{name} must be finite and {sign}, found {full.min():g}")
    return [float(v) for v in full]


def intensities(
    states: Sequence[Signal], estimated: Sequence[Signal], R: ArrayLike, Q: ArrayLike
) -> tuple[list[Signal], list[Signal]]:
    """Return the diagonals of R, of measured states, and of Q, of the estimated quantities, as parameters."""
    noise = [
        Signal(
            f"R[{i},{i}]", simplified(f"({s.unit})^2*s"), f"noise intensity of {s.name}", start=r, lower=0.0
        )
        for i, (s, r) in enumerate(zip(states, diagonal("R", R, len(states), positive=True), strict=True))
    ]
    drift = [
        Signal(
            f"Q[{i},{i}]",
            simplified(f"({s.unit})^2/s"),
            f"disturbance intensity of {s.name}",
            start=q,
            lower=0.0,
        )
        for i, (s, q) in enumerate(zip(estimated, diagonal("Q", Q, len(estimated)), strict=True))
    ]
    return noise, drift
