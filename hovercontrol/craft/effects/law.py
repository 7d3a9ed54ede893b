"""Laws: effects that are a product of powers of signals, whose form stands in their name.

A law adds ``c f1 f2`` to one equation. Its name is ``law_``, the state, and the factors, each behind two
underscores: ``law_r__abs_v__r`` is ``c abs(v) r`` in the equation of ``r``. A factor is a signal, or a
function of one:

========= ============= ========== =================
``v``     v             ``sin_v``  sin(v)
``abs_v`` abs(v)        ``cos_v``  cos(v)
``sqr_v`` v^2           ``sin2_v`` sin(2 v)
``cub_v`` v^3           ``cos2_v`` cos(2 v)
========= ============= ========== =================

So a model file needs nothing else to hold one (``law_r__abs_v__r = -0.64``), and the unit of its coefficient
follows from the signals. One factor may remember its signal: ``filtered_a``, written a_f, is a behind a
filter of first order, ``tau a_f' = a - a_f``, from rest, with a time constant of its own.

One factor may be a curve with numbers of its own, by which a law acts in one regime only:

================ ==================================== ==============================================
``over_a``       max(a - at, 0)                       ``saturating_a``  a/(at + abs(a))
``under_a``      min(a - at, 0)                       ``inhibited_a``   a/(at + abs(a) + a^2/top)
``beyond_a``     sgn(a) max(abs(a) - at, 0)           ``decaying_a``    exp(-abs(a)/at)
``logistic_a``   1/(1 + exp((at - a)/wide))           ``bell_a``        exp(-((a - at)/wide)^2)
================ ==================================== ==============================================

Or it is a table, f(a): straight lines through the values y1 to y5 at evenly spaced a, of which ``hump_a`` is
zero below `low` and above `high`, ``rise_a`` is zero below `low` and stays y5 from `high` on, and ``fall_a``
is y1 up to `low` and zero above `high`. Or it is one within a range of a and zero elsewhere: ``above_a``,
``below_a`` and ``between_a``; between the two rows of a log next to its limit it is a straight line. Each may
be a function of abs(a): ``rise_abs_a``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import DIMENSIONLESS, dimension, unit_text
from hovercontrol.craft.effects.base import Effect
from hovercontrol.craft.effects.coefficient import TINY, Coefficient, Shape
from hovercontrol.craft.effects.generic_classes import make_class, remembered, word
from hovercontrol.craft.effects.law_causes import cause

#: What the names of laws begin with.
PREFIX = "law_"

#: Names of commands of a craft.
COMMANDS = ("thrust", "rudder", "fan_x", "fan_y", "fan_torque")

#: Time constants from which the fit of a memory starts, in steps between rows of a log.
TAUS = (4.0, 12.0, 40.0, 120.0)

#: What stands between the parts of a name.
BETWEEN = "__"


@dataclass(frozen=True)
class Operation:
    """A function of one signal.

    Attributes
    ----------
    of : callable
        Its expression, of the signal and of the symbols of its own numbers.
    power : int
        Power of the signal's unit.
    text : str
        How it is written.
    numbers : tuple of str
        Its own numbers, in the signal's unit.
    signed : bool
        Whether its `at` may be negative.
    """

    of: Callable[..., Any]
    power: int
    text: str
    numbers: tuple[str, ...] = ()
    signed: bool = False


#: The functions of one signal, by the word in front of its name.
OPERATIONS: Mapping[str, Operation] = {
    "": Operation(lambda a, c: a, 1, "{}"),
    "abs": Operation(lambda a, c: sp.Abs(a), 1, "abs({})"),
    "sqr": Operation(lambda a, c: a**2, 2, "{}^2"),
    "cub": Operation(lambda a, c: a**3, 3, "{}^3"),
    "sin": Operation(lambda a, c: sp.sin(a), 0, "sin({})"),
    "cos": Operation(lambda a, c: sp.cos(a), 0, "cos({})"),
    "sin2": Operation(lambda a, c: sp.sin(2 * a), 0, "sin(2 {})"),
    "cos2": Operation(lambda a, c: sp.cos(2 * a), 0, "cos(2 {})"),
    "filtered": Operation(lambda a, c: a, 1, "{}_f"),  # of the state that holds the filtered signal
    "over": Operation(lambda a, c: sp.Max(a - c.at, 0), 1, "max({} - at, 0)", ("at",), signed=True),
    "under": Operation(lambda a, c: sp.Min(a - c.at, 0), 1, "min({} - at, 0)", ("at",), signed=True),
    "beyond": Operation(
        lambda a, c: sp.Max(a - c.at, 0) + sp.Min(a + c.at, 0), 1, "sgn({0}) max(abs({0}) - at, 0)", ("at",)
    ),
    "saturating": Operation(lambda a, c: a / (c.at + sp.Abs(a)), 0, "{0}/(at + abs({0}))", ("at",)),
    "inhibited": Operation(
        lambda a, c: a / (c.at + sp.Abs(a) + a**2 / c.top),
        0,
        "{0}/(at + abs({0}) + {0}^2/top)",
        ("at", "top"),
    ),
    "decaying": Operation(lambda a, c: sp.exp(-sp.Abs(a) / c.at), 0, "exp(-abs({})/at)", ("at",)),
    "logistic": Operation(
        lambda a, c: 1 / (1 + sp.exp((c.at - a) / c.wide)),
        0,
        "1/(1 + exp((at - {})/wide))",
        ("at", "wide"),
        signed=True,
    ),
    "bell": Operation(
        lambda a, c: sp.exp(-(((a - c.at) / c.wide) ** 2)),
        0,
        "exp(-(({} - at)/wide)^2)",
        ("at", "wide"),
        signed=True,
    ),
    "above": Operation(lambda a, c: _step(a, c.low, c.high), 0, "[{} > high]", ("low", "high")),
    "below": Operation(lambda a, c: 1 - _step(a, c.low, c.high), 0, "[{} < low]", ("low", "high")),
    "between": Operation(
        lambda a, c: _step(a, c.low, c.rises) - _step(a, c.falls, c.high),
        0,
        "[low < {} < high]",
        ("low", "rises", "falls", "high"),
    ),
    "hump": Operation(lambda a, c: _table(a, c, 0, 0), 0, "f({})", ("low", "high")),
    "rise": Operation(lambda a, c: _table(a, c, 0, None), 0, "f({})", ("low", "high")),
    "fall": Operation(lambda a, c: _table(a, c, None, 0), 0, "f({})", ("low", "high")),
}

#: The operations that are tables, and their values.
TABLES, VALUES = ("hump", "rise", "fall"), ("y1", "y2", "y3", "y4", "y5")

#: The operations that are one within a range and zero elsewhere.
WINDOWS = ("above", "below", "between")

#: The operations that are curves with numbers of their own, which a fit estimates.
CURVES = tuple(n for n, o in OPERATIONS.items() if o.numbers and n not in (*TABLES, *WINDOWS))

#: The operations that need an angle.
TRIGONOMETRIC = ("sin", "cos", "sin2", "cos2")

#: Parts of the rows below which a fit of a curve starts with its number.
LEVELS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)


def knots(operation: str, low: float, high: float) -> list[float]:
    """Return the places of the values y1 to y5 of a table, evenly spaced.

    Examples
    --------
    >>> knots("hump", 0.0, 6.0), knots("rise", 0.0, 5.0), knots("fall", 0.0, 5.0)
    ([1.0, 2.0, 3.0, 4.0, 5.0], [1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 1.0, 2.0, 3.0, 4.0])
    """
    n, first = (6 if operation == "hump" else 5), (0 if operation == "fall" else 1)
    return [low + (high - low) * (first + k) / n for k in range(5)]


def _step(a: Any, low: Any, high: Any) -> Any:
    """Return zero below `low`, one above `high`, and a straight line between."""
    return sp.Min(sp.Max((a - low) / (high - low), 0), 1)


def _table(a: Any, c: Any, before: int | None, after: int | None) -> Any:
    """Return straight lines through a table's values; zero before or after them, or as the nearest one."""
    # with t = n (a - low)/(high - low), values v_k at t = k: v_0 + sum (v_(k+1) - v_k) min(max(t - k, 0), 1)
    ends = [[] if end is None else [sp.Integer(end)] for end in (before, after)]
    v = [*ends[0], *(getattr(c, name) for name in VALUES), *ends[1]]
    t = (len(v) - 1) * (a - c.low) / (c.high - c.low)
    rises = (v[k + 1] - v[k] for k in range(len(v) - 1))
    return v[0] + sp.Add(*(rise * sp.Min(sp.Max(t - k, 0), 1) for k, rise in enumerate(rises)))


#: The function of a signal that has a memory.
FILTERED = "filtered"


@dataclass(frozen=True)
class Factor:
    """One factor of a law: a function (a key of :data:`OPERATIONS`) of a signal, or of its absolute value.

    Examples
    --------
    >>> Factor("abs", "v").text, Factor("", "r").word, Factor("rise", "r", of_abs=True).word
    ('abs(v)', 'r', 'rise_abs_r')
    """

    operation: str
    signal: str
    of_abs: bool = False

    @property
    def word(self) -> str:
        """The factor in a name."""
        of = f"abs_{self.signal}" if self.of_abs else self.signal
        return f"{self.operation}_{of}" if self.operation else of

    @property
    def argument(self) -> str:
        """What it is a function of: a signal, or its absolute value."""
        return f"abs({self.signal})" if self.of_abs else self.signal

    @property
    def text(self) -> str:
        """The factor as a reader writes it."""
        return OPERATIONS[self.operation].text.format(self.argument)

    def expression(self, value: Any, c: Any) -> Any:
        """Return the factor as an expression of the signal's and of the symbols of the law's numbers."""
        return OPERATIONS[self.operation].of(sp.Abs(value) if self.of_abs else value, c)


class Law(Effect):
    """A term of one equation that is a product of functions of signals.

    Attributes
    ----------
    product : tuple of Factor
    """

    product: ClassVar[tuple[Factor, ...]] = ()

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.equation: c.value * self.form(c, s)}

    def form(self, c: Any, s: Any) -> sp.Expr:
        """Return the term per coefficient.

        Parameters
        ----------
        c, s : namespace
            Symbols of the law's numbers, and of the motion and the commands, as for :meth:`.Effect.terms`.
        """
        return sp.Mul(*(f.expression(getattr(s, f.signal), c) for f in self.product))

    @classmethod
    def curve(cls) -> Factor | None:
        """Return the factor that has numbers of its own, a curve or a table; None without one."""
        return next((f for f in cls.product if OPERATIONS[f.operation].numbers), None)

    @classmethod
    def complexity(cls) -> int:
        """Return the number of factors, powers and memories: 2 for ``abs(v) v``, 3 for ``v^3``."""
        own = (OPERATIONS[f.operation] for f in cls.product)
        remembers = any(f.operation == FILTERED for f in cls.product)
        return sum(max(o.power, 1) + len(o.numbers) for o in own) + remembers

    @classmethod
    def text(cls) -> str:
        """Return the form as a reader writes it, ``"abs(v) r"``."""
        return " ".join(f.text for f in cls.product)


class MemoryLaw(Law):
    """A law with one factor that is a signal behind a filter: ``tau memory' = signal - memory``."""

    memory: ClassVar[Signal]

    def form(self, c: Any, s: Any) -> sp.Expr:
        held = {
            f: self.memory.symbol if f.operation == FILTERED else getattr(s, f.signal) for f in self.product
        }
        return sp.Mul(*(f.expression(value, c) for f, value in held.items()))

    def states(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        (signal,) = (f.signal for f in self.product if f.operation == FILTERED)
        return {self.memory: (getattr(s, signal) - self.memory.symbol) / c.tau}


class TableLaw(Law):
    """A law with one factor that is a table of values, which stand for its coefficient."""

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.equation: self.form(c, s)}

    def table(self) -> tuple[str, list[float], list[float]]:
        """Return what the function depends on, and its corners: places and values, with the zeros."""
        own = self.curve()
        assert own is not None
        low, high = self.values["low"], self.values["high"]
        at, values = knots(own.operation, low, high), [self.values[y] for y in VALUES]
        if own.operation != "fall":
            at, values = [low, *at], [0.0, *values]
        if own.operation != "rise":
            at, values = [*at, high], [*values, 0.0]
        return own.argument, at, values


def is_law(name: str) -> bool:
    """Return whether a name is that of a law.

    Examples
    --------
    >>> is_law("law_r__abs_v__r"), is_law("yaw_coulomb")
    (True, False)
    """
    return name.startswith(PREFIX) and BETWEEN in name


def law_name(equation: str, factors: tuple[Factor, ...]) -> str:
    """Return the name of a law.

    Examples
    --------
    >>> law_name("r", (Factor("abs", "v"), Factor("", "r")))
    'law_r__abs_v__r'
    """
    return law_in(equation, BETWEEN.join(f.word for f in factors))


def form_of(name: str) -> str:
    """Return the factors of a law as they stand in its name, without its equation.

    Examples
    --------
    >>> form_of("law_r__abs_v__r"), law_in("v", form_of("law_r__abs_v__r"))
    ('abs_v__r', 'law_v__abs_v__r')
    """
    return name.removeprefix(PREFIX).split(BETWEEN, 1)[1]


def law_in(equation: str, form: str) -> str:
    """Return the name of the law of a form (:func:`form_of`) in an equation."""
    return f"{PREFIX}{equation}{BETWEEN}{form}"


def law_text(name: str) -> str:
    """Return the form of a law and its equation as a reader writes them.

    Examples
    --------
    >>> law_text("law_r__abs_v__r")
    "abs(v) r in r'"
    """
    equation, *words = name.removeprefix(PREFIX).split(BETWEEN)
    return f"{' '.join(_as_written(w) for w in words)} in {equation}'"


def _as_written(word: str) -> str:
    operation, _, signal = word.partition("_")
    known = operation in OPERATIONS and operation and signal
    of_abs = bool(known) and bool(OPERATIONS[operation].numbers) and signal.startswith("abs_")
    return (
        Factor(operation, signal.removeprefix("abs_") if of_abs else signal, of_abs).text if known else word
    )


def law_class(name: str, units: Mapping[str, str]) -> type[Law]:
    """Return the class of a law by its name.

    Parameters
    ----------
    name : str
        ``"law_r__abs_v__r"``.
    units : mapping of str to str
        Unit of each signal that a law may use, by name.

    Raises
    ------
    InputError
        If the name has no factors, or names a signal or a function that does not exist.

    Examples
    --------
    >>> cls = law_class("law_r__abs_v__r", {"v": "m/s", "r": "rad/s"})
    >>> cls.text(), cls.numbers["value"].unit
    ('abs(v) r', '1/m')
    """
    equation, *words = name.removeprefix(PREFIX).split(BETWEEN)
    if equation not in units or not words:
        hint = did_you_mean(equation, units)
        raise InputError(f"law {name!r}: no equation of {equation!r}{hint}; expected law_r__abs_v__r")
    factors = tuple(_factor(name, w, units) for w in words)
    if sum(f.operation == FILTERED or bool(OPERATIONS[f.operation].numbers) for f in factors) > 1:
        raise InputError(f"law {name!r}: two factors with numbers of their own; one is the most")
    used = {s: units[s] for s in (equation, *(f.signal for f in factors))}
    made: type[Law] = _law(name, equation, factors, tuple(used.items()))  # type: ignore[assignment]
    return made


def _factor(name: str, word: str, units: Mapping[str, str]) -> Factor:
    if word in units:
        return Factor("", word)
    operation, _, signal = word.partition("_")
    if (
        operation in (*CURVES, *TABLES, *WINDOWS)
        and signal.removeprefix("abs_") in units
        and signal not in units
    ):
        return Factor(operation, signal.removeprefix("abs_"), of_abs=True)
    if operation not in OPERATIONS or not operation or signal not in units:
        known = [*units, *(f"{o}_{s}" for o in OPERATIONS if o for s in units)]
        raise InputError(f"law {name!r}: unknown factor {word!r}{did_you_mean(word, known)}")
    return Factor(operation, signal)


@remembered
def _law(
    name: str, equation: str, factors: tuple[Factor, ...], units: tuple[tuple[str, str], ...]
) -> type[Effect]:
    of = dict(units)
    text = " ".join(f.text for f in factors)
    known = cause(equation, [f.word for f in factors], COMMANDS)
    signal = next((f.signal for f in factors if f.operation == FILTERED), "")
    local = next((f for f in factors if OPERATIONS[f.operation].numbers), None)
    is_table = local is not None and local.operation in TABLES
    sentence = f"A term {'' if is_table else 'c '}{text} in {equation}'"
    if signal:
        sentence += f", where tau {signal}_f' = {signal} - {signal}_f, from rest"
    kind = MemoryLaw if signal else TableLaw if is_table else Law
    unit = unit_of(of[equation], factors, of)
    own: dict[str, Any] = {"value": Coefficient(unit)}
    if local is not None:
        own = _own_numbers(local, of[local.signal], unit)
    return make_class(
        name,
        (kind,),
        f"{sentence}." + (f" Of this form is {known}." if known else ""),
        "found in measured logs",
        equation=equation,
        product=factors,
        axis=equation,
        **own,
        **(_memory(name, signal, of[signal]) if signal else {}),
    )


def _own_numbers(local: Factor, signal_unit: str, unit: str) -> dict[str, Any]:
    """Return the numbers of a law with a curve or a table."""
    names = OPERATIONS[local.operation].numbers
    if local.operation in TABLES:
        ends = {n: Shape(signal_unit, fixed=True) for n in names}
        return ends | {y: Coefficient(unit, default=0.0) for y in VALUES}
    if local.operation in WINDOWS:
        return {"value": Coefficient(unit), **{n: Shape(signal_unit, fixed=True) for n in names}}
    signed = OPERATIONS[local.operation].signed and not local.of_abs
    lower = {n: -math.inf if signed and n == "at" else TINY for n in names}
    shapes = {n: Shape(signal_unit, lower=lower[n], search=LEVELS, of="signal") for n in names}
    return {"value": Coefficient(unit), **shapes}


def _memory(name: str, signal: str, unit: str) -> dict[str, Any]:
    """Return what a law with a memory declares: its state and its time constant."""
    state = Signal(f"{word(name)}_memory", unit, f"{signal} behind a filter of first order")
    return {"memory": state, "tau": Shape("s", lower=TINY, search=TAUS, of="step")}


def unit_of(unit: str, factors: tuple[Factor, ...], units: Mapping[str, str]) -> str:
    """Return the unit of a law's coefficient: that of the state per second and per unit of the factors.

    Examples
    --------
    >>> unit_of("m/s", (Factor("sqr", "v"),), {"v": "m/s"})
    '1/m'
    """
    found = list(dimension(unit))
    found[_SECOND] -= 1
    for f in factors:
        own = dimension(units[f.signal])
        if f.operation in TRIGONOMETRIC and own != DIMENSIONLESS:
            raise InputError(f"law: {f.text} needs an angle, and {f.signal} is in {units[f.signal]}")
        found = [a - OPERATIONS[f.operation].power * b for a, b in zip(found, own, strict=True)]
    return unit_text(tuple(found))


_SECOND = 2  # of BASE
