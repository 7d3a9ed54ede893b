"""Checks of numbers from the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hovercontrol.base.errors import check_known, shown
from hovercontrol.base.tables import finite
from hovercontrol.blocks.signals import Signal


def checked_number(signal: Signal, value: Any) -> float:
    """Return a checked value of a signal.

    Raises
    ------
    InputError
        If it is not a number within the signal's bounds.

    Examples
    --------
    >>> checked_number(Signal("surge_ref", "m/s", upper=1.5), 1)
    1.0
    """
    return signal.check(finite(f"{signal.name} ({signal.unit})", value))


def checked_numbers(
    what: str, known: Iterable[Signal], before: Mapping[str, float], given: Mapping[str, Any]
) -> dict[str, float]:
    """Return the values, updated by the given ones.

    Parameters
    ----------
    what : str
        Name in messages.
    before, given : mapping
        By signal's name.

    Raises
    ------
    InputError
        If a name is unknown or a value is wrong.
    """
    signals = {s.name: s for s in known}
    for name in given:
        check_known(name, signals, f"{what}: unknown value {shown(name)}")
    return {**before, **{name: checked_number(signals[name], value) for name, value in given.items()}}
