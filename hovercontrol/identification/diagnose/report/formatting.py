"""Formatting of numbers, units and effect names in a report."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from hovercontrol.craft.effects import Effect
from hovercontrol.craft.effects.law import is_law, law_text

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Found
    from hovercontrol.identification.diagnose.laws.regions import Range

#: Maximum number of intervals that are listed.
STRETCHES = 3

_RAISED = str.maketrans("23456789*", "²³⁴⁵⁶⁷⁸⁹ ", "^")
_AXES = ("surge", "sway", "yaw")
_KINDS = {"coulomb": "dry friction", "stribeck": "Stribeck friction"}


def unit(text: str) -> str:
    """Return a unit with superscript powers; empty for a dimensionless number.

    Examples
    --------
    >>> unit("rad/s^2"), unit("1")
    ('rad/s²', '')
    """
    return "" if text == "1" else text.translate(_RAISED)


def prime(text: str) -> str:
    """Return a sentence in typographic form: ``u'`` as u′, superscript powers, true minus signs.

    Examples
    --------
    >>> prime("in u', like r^2: about -0.5 m/rad^2 times r^2")
    'in u′, like r²: about −0.5 m/rad² times r²'
    """
    raised = re.sub(r"\^([2-9])", lambda m: m[1].translate(_RAISED), text.replace("'", "′"))
    return re.sub(r"(?<![\w-])-(?=[\d.])", "−", raised)


def effect_words(name: str) -> str:
    """Return the name of an effect as plain text.

    Examples
    --------
    >>> effect_words("yaw_coulomb"), effect_words("input_delay")
    ('dry friction in yaw', 'input delay')
    >>> effect_words("law_r__abs_v__r")
    "abs(v) r in r'"
    """
    if is_law(name):
        return law_text(name)
    axis, _, rest = name.partition("_")
    if axis in _AXES and rest and "_" not in rest.removesuffix("_drag"):
        return f"{_KINDS.get(rest, rest.replace('_', ' '))} in {axis}"
    words = name.replace("_", " ")
    return re.sub(r"\b(munk|coriolis)\b", lambda m: m[0].capitalize(), words)


def meaning(effect: Effect | type[Effect]) -> str:
    """Return the first paragraph of an effect's docstring."""
    return " ".join((effect.__doc__ or "").split("\n\n")[0].replace("``", "").split())


def plus_minus(value: float, half: float) -> str:
    """Return a value with its standard error, to two digits of the standard error.

    Examples
    --------
    >>> plus_minus(0.41987, 0.0123), plus_minus(1234.0, 56.0), plus_minus(0.1, 0.0)
    ('0.420 ± 0.012', '1234 ± 56', '0.1')
    """
    if not (half > 0 and math.isfinite(half)):
        return minus(f"{value:.4g}")
    digits = max(0, 1 - math.floor(math.log10(half)))
    return minus(f"{value:.{digits}f} ± {half:.{digits}f}")


def minus(text: str) -> str:
    """Return a number with a true minus sign (U+2212).

    Examples
    --------
    >>> minus("-0.5 m")
    '−0.5 m'
    """
    return text.replace("-", "−")


def number_of(found: Found) -> str:
    """Return a parameter of an effect with its standard error and unit, for a known mass also as a force."""
    said = f"{plus_minus(found.value, found.std)} {unit(found.unit)}".strip()
    force = f"{plus_minus(found.body * found.value, found.body * found.std)} {unit(found.force_unit)}".strip()
    return f"{said} ({force})" if found.force_unit else said


def rounded(value: float) -> str:
    """Return a large number to two digits, with separated thousands.

    Examples
    --------
    >>> rounded(3.26), rounded(818.0), rounded(-72160.0), rounded(8.1e9)
    ('3.3', '820', '-72\u202f000', 'more than a million')
    """
    if value >= 1e6:
        return "more than a million"
    number = float(f"{value:.2g}")
    return f"{number:.2g}" if abs(number) < 10 else f"{number:,.0f}".replace(",", "\u202f")


def small(value: float, digits: int = 2) -> str:
    """Return a number to `digits` digits, without an exponent; "0" below a millionth, empty from a million.

    Examples
    --------
    >>> small(-0.00066), small(6e-5, 1), small(5.3e13), small(1234.0)
    ('−0.00066', '0.00006', '', '1200')
    """
    if not abs(value) < 1e6:
        return ""
    number = float(f"{value:.{digits}g}")
    if abs(number) < 1e-6:
        return "0"
    places = max(0, digits - 1 - math.floor(math.log10(abs(number))))
    return minus(f"{number:.{places}f}")


def times(value: float) -> str:
    """Return a ratio to about three digits.

    Examples
    --------
    >>> times(0.9871), times(19.42), times(1234.0)
    ('0.99', '19.4', '1234')
    """
    return f"{value:.2f}" if value < 9.995 else f"{value:.1f}" if value < 99.95 else f"{value:.0f}"


def range_words(region: Sequence[Range], units: Mapping[str, str]) -> str:
    """Return ranges of signals as text.

    Examples
    --------
    >>> range_words([{"signal": "r", "low": None, "high": -1.5}], {"r": "rad/s"})
    'r below −1.5 rad/s'
    >>> range_words([{"signal": "x", "low": -0.25, "high": 1.0}], {"x": "m"})
    'x from −0.25 to 1 m'
    """
    said = []
    for r in region:
        low, high = (None if r[key] is None else minus(f"{r[key]:.3g}") for key in ("low", "high"))
        limits = f"from {low} to {high}" if low and high else f"above {low}" if low else f"below {high}"
        said.append(f"{r['signal']} {limits} {unit(units.get(str(r['signal']), '1'))}".strip())
    return listed(said, "or")


def listed(parts: Sequence[str], last: str = "and") -> str:
    """Return parts joined as a list in a sentence.

    Examples
    --------
    >>> listed(["a", "b", "c"]), listed(["a", "b"], "or")
    ('a, b and c', 'a or b')
    """
    return f" {last} ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


def stretches(segments: Sequence[tuple[float, float]]) -> str:
    """Return as text when a force is significant: the longest intervals and the number of others.

    Examples
    --------
    >>> stretches([(0.0, 2.5), (4.0, 9.26)])
    ', 0 to 2.5 s and 4 to 9.3 s'
    """
    longest = sorted(sorted(segments, key=lambda s: s[0] - s[1])[:STRETCHES])
    if not longest:
        return ""
    named = [f"{round(begin, 1):g} to {round(end, 1):g} s" for begin, end in longest]
    more = len(segments) - len(longest)
    return f", {listed(named)}{f', and {more} shorter' if more else ''}"
