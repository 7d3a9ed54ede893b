"""Syntax of units: unit names, ``*``, ``/`` and powers with small exponents, but no arithmetic.

Pint supplies the names but would evaluate ``1/s*9**9**9``; this parser passes only names to Pint.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any

import pint

#: Maximum length of a unit's text, and maximum depth of parentheses.
LONGEST, DEEPEST = 120, 8

_TOKEN = re.compile(r"\s*(\*\*|[*/^()·.]|-?\d+(?:\.\d+)?|[^\W\d]\w*|[°%µμΩ][^\W\d]*)|(\s+$)")
_WRITTEN = str.maketrans({"²": "^2", "³": "^3", "⁻": "-", "¹": "1"})


@cache
def registry() -> Any:
    """Return the process-wide Pint registry, created on first use because that takes 0.1 s.

    Pint reads ``Nm`` as the number of a yarn, m/g; logs of machines write their torques so.
    """
    found = pint.UnitRegistry(on_redefinition="ignore")
    found.define("newton_meter = newton * meter = Nm")
    return found


@lru_cache(maxsize=4096)
def parse_unit(text: str) -> Any:
    """Return the Pint unit of a text.

    Parameters
    ----------
    text : str
        ``"m/s^2"``, ``"kg*m^2"``, ``"m^(1/2)"``, ``"deg/s**2/(rad/s)"``; ``"1"`` or an empty
        text is dimensionless.

    Raises
    ------
    ValueError
        If the syntax is wrong, or a name is unknown.

    Examples
    --------
    >>> str(parse_unit("N*m/rad^2"))
    'meter * newton / radian ** 2'
    """
    if not isinstance(text, str) or len(text) > LONGEST:
        raise ValueError(f"expected a text of {LONGEST} characters at most")
    found = registry().dimensionless
    for name, power in factors(text).items():
        found = found * registry().parse_units(name) ** (
            int(power) if power.denominator == 1 else float(power)
        )
    return found


def factors(text: str) -> dict[str, Fraction]:
    """Return the names of a unit's text with their powers.

    Examples
    --------
    >>> {name: int(power) for name, power in factors("N*m/(rad/s)^2").items()}
    {'N': 1, 'm': 1, 'rad': -2, 's': 2}
    """
    reader = _Reader(_tokens(text.translate(_WRITTEN)))
    found = reader.product(0) if reader.rest else {}
    if reader.rest:
        raise ValueError(f"unexpected {reader.rest[0]!r}")
    return found


def _times(a: dict[str, Fraction], b: dict[str, Fraction], power: Fraction) -> dict[str, Fraction]:
    """Return the factors of ``a b^power``."""
    whole = {name: a.get(name, Fraction(0)) + power * b.get(name, Fraction(0)) for name in {**a, **b}}
    return {name: power for name, power in whole.items() if power}


def _tokens(text: str) -> list[str]:
    found, at = [], 0
    text = text.strip()
    while at < len(text):
        match = _TOKEN.match(text, at)
        if not match or match.end() == at:
            raise ValueError(f"unexpected {text[at]!r}")
        found.append(match[1])
        at = match.end()
    return found


class _Reader:
    """Recursive-descent parser of the tokens of a unit."""

    def __init__(self, tokens: list[str]) -> None:
        self.rest = tokens

    def product(self, depth: int) -> dict[str, Fraction]:
        """Read factors separated by ``*``, ``/`` or nothing, which also means a product."""
        if depth > DEEPEST:
            raise ValueError("parentheses are too deep")
        found = self.power(depth)
        while self.rest and self.rest[0] != ")":
            sign = self.rest.pop(0) if self.rest[0] in "*·./" else "*"
            factor = self.power(depth)
            found = _times(found, factor, Fraction(-1 if sign == "/" else 1))
        return found

    def power(self, depth: int) -> dict[str, Fraction]:
        base = self.atom(depth)
        if self.rest and self.rest[0] in ("^", "**"):
            self.rest.pop(0)
            return _times({}, base, self.exponent())
        return base

    def atom(self, depth: int) -> dict[str, Fraction]:
        token = self.next()
        if token == "(":
            found = self.product(depth + 1)
            self.need(")")
            return found
        if token == "1":
            return {}
        if not (token[0].isalpha() or token[0] in "_°%"):
            raise ValueError(f"expected the name of a unit, found {token!r}")
        registry().parse_units(token)  # raises if it is unknown
        return {token: Fraction(1)}

    def exponent(self) -> Fraction:
        token = self.next()
        if token == "(":
            found = self.number(self.next())
            if self.rest and self.rest[0] == "/":
                self.rest.pop(0)
                found /= self.number(self.next())
            self.need(")")
        else:
            found = self.number(token)
        return found

    def number(self, token: str) -> Fraction:
        if not re.fullmatch(r"-?\d{1,2}(\.\d{1,9})?", token) or not Fraction(token):
            raise ValueError(f"expected a small number as an exponent, found {token!r}")
        return Fraction(token)

    def next(self) -> str:
        if not self.rest:
            raise ValueError("unexpected end")
        return self.rest.pop(0)

    def need(self, token: str) -> None:
        if self.next() != token:
            raise ValueError(f"expected {token!r}")
