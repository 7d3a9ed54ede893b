"""Argument checks that an annotation cannot express: least values, lengths, shapes that broadcast."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, shown


def at_least(where: str, value: int, least: int = 0) -> int:
    """Return a count, or the seed of random numbers, if it is at least `least`.

    Raises
    ------
    InputError
        If it is smaller than `least`.

    Examples
    --------
    >>> at_least("sweep: runs", 3, least=1)
    3
    """
    if value < least:
        raise InputError(f"{where}: expected {least} or more, found {shown(value)}")
    return value


def whole_periods(where: str, given: float, period: float) -> int:
    """Return how many periods of a sampled plant a time is.

    Parameters
    ----------
    given, period : float
        [s]

    Raises
    ------
    InputError
        If it is not a whole number of periods; the nearest one is named.

    Examples
    --------
    >>> whole_periods("lqr: period", 0.15, 0.05)
    3
    """
    count = round(given / period)
    if count < 1 or abs(given - count * period) > 1e-9 * given:
        nearest = max(count, 1) * period
        raise InputError(
            f"{where}: expected a multiple of the plant's period, {period:g} s, found {given:g} s; "
            f"the nearest is {nearest:g} s"
        )
    return count


def as_row(where: str, value: ArrayLike, length: int | None = None) -> Array:
    """Return numbers as an array of shape (n,).

    Parameters
    ----------
    where : str
        Function and argument, for the error message.
    value : array_like, shape (n,)
    length : int, optional
        Required n.

    Raises
    ------
    InputError
        If the shape is different.

    Examples
    --------
    >>> as_row("bench: rows", [1, 2])
    array([1., 2.])
    """
    found = np.asarray(value, dtype=float)
    if found.ndim != 1 or length not in (None, found.size):
        wanted = "a row of numbers" if length is None else f"{length} numbers"
        raise InputError(f"{where}: expected {wanted}, found shape {found.shape}")
    return found


def broadcastable(function: str, **arrays: ArrayLike) -> list[Array]:
    """Return arguments as arrays whose shapes broadcast.

    Raises
    ------
    InputError
        If they do not broadcast; the message lists all shapes.

    Examples
    --------
    >>> [a.shape for a in broadcastable("fan_force", speed=[1.0, 2.0], rudder=0.0)]
    [(2,), ()]
    """
    found = {name: np.asarray(value, dtype=float) for name, value in arrays.items()}
    try:
        np.broadcast_shapes(*(a.shape for a in found.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in found.items())
        raise InputError(f"{function}: expected shapes that go together, found {shapes}") from None
    return list(found.values())
