"""Fractions as percentages without powers of ten."""

from __future__ import annotations

import math


def percent(part: float, digits: int = 2) -> str:
    """Return a fraction in per cent with some significant digits; whole numbers are not rounded.

    Examples
    --------
    >>> percent(0.034), percent(0.9972), percent(50.71), percent(0.00021), percent(0.9987, 3), percent(-0.5)
    ('3.4 %', '100 %', '5071 %', '0.021 %', '99.9 %', '-50 %')
    >>> percent(1e-7), percent(1e9), percent(math.inf)
    ('below 0.001 %', 'over 100000 %', 'unknown')
    """
    value = 100.0 * part
    if not math.isfinite(value):
        return "unknown"
    if abs(value) > 1e5:
        return f"over {1e5:.0f} %"
    number = float(f"{value:.{digits}g}") if abs(value) < 10**digits else float(round(value))
    return f"{number:g} %" if number == 0.0 or abs(number) >= 1e-3 else "below 0.001 %"
