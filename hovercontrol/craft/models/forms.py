"""Forms of few numbers that an unknown function may have: sums of terms with a coefficient each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from hovercontrol.craft.effects.coefficient import TINY
from hovercontrol.craft.effects.law import OPERATIONS

#: Smallest and largest exponent of a form.
EXPONENTS = (0.1, 8.0)


@dataclass(frozen=True)
class Term:
    """A term of a form per coefficient.

    Attributes
    ----------
    of : callable
        Its expression, of the argument a, of the symbols of its own numbers, and of a unit of the argument.
    power : int
        Power of the argument's unit.
    text : str
        How it is written, with the argument as ``{0}``.
    numbers : tuple of str
        Its own numbers, in the argument's unit; one called n is an exponent.
    signed : bool
        Whether these may be negative.
    """

    of: Callable[[Any, Any, Any], Any]
    power: int
    text: str
    numbers: tuple[str, ...] = ()
    signed: bool = False


def _law(name: str) -> Term:
    """Return a function of one signal that laws have, too."""
    o = OPERATIONS[name]
    return Term(lambda a, c, one: o.of(a, c), o.power, o.text.replace("{}", "{0}"), o.numbers, o.signed)


def _power(ratio: Any, n: Any) -> Any:
    """Return abs(ratio)^n, with slopes that are finite at zero."""
    return (ratio**2 + 1e-12) ** (n / 2)


#: Terms by name.
TERMS: Mapping[str, Term] = {
    "1": Term(lambda a, c, one: sp.S.One, 0, ""),
    "a": _law(""),
    "abs": _law("abs"),
    "sqr": _law("sqr"),
    "odd": Term(lambda a, c, one: sp.Abs(a) * a, 2, "abs({0}) {0}"),
    "cub": _law("cub"),
    "saturating": _law("saturating"),
    "inhibited": _law("inhibited"),
    "decaying": _law("decaying"),
    "logistic": _law("logistic"),
    "over": _law("over"),
    "under": _law("under"),
    "beyond": _law("beyond"),
    "power": Term(lambda a, c, one: _power(a / one, c.n), 0, "abs({0})^n", ("n",)),
    "hill": Term(
        lambda a, c, one: _power(a / c.at, c.n) / (1 + _power(a / c.at, c.n)),
        0,
        "abs({0})^n/(at^n + abs({0})^n)",
        ("at", "n"),
    ),
    "approaching": Term(
        lambda a, c, one: 1 - sp.exp(-sp.Abs(a) / c.at), 0, "(1 - exp(-abs({0})/at))", ("at",)
    ),
}

#: The forms: names of the terms of each.
FORMS: Mapping[str, tuple[str, ...]] = {
    "constant": ("1",),
    "proportional": ("a",),
    "affine": ("1", "a"),
    "square": ("sqr",),
    "signed square": ("odd",),
    "cubic": ("cub",),
    "quadratic": ("a", "sqr"),
    "signed quadratic": ("a", "odd"),
    "odd cubic": ("a", "cub"),
    "parabola": ("1", "a", "sqr"),
    "power": ("power",),
    "saturating": ("saturating",),
    "inhibited": ("inhibited",),
    "hill": ("hill",),
    "exponential decay": ("decaying",),
    "exponential approach": ("approaching",),
    "logistic": ("logistic",),
    "hinge": ("over",),
    "hinge below": ("under",),
    "dead zone": ("beyond",),
    "saturating with offset": ("1", "saturating"),
    "exponential with offset": ("1", "decaying"),
    "power with offset": ("1", "power"),
    "hinge with offset": ("1", "over"),
    "hinge on a line": ("a", "over"),
    "magnitude with offset": ("1", "abs"),
}


def bounds(number: str, term: Term) -> tuple[float, float]:
    """Return the bounds of a term's own number."""
    if number == "n":
        return EXPONENTS
    return (-math.inf if term.signed else TINY), math.inf
