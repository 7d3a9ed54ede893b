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
"""

from __future__ import annotations

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
    """A function of one signal: its expression, the power of the signal's unit, and how it is written."""

    of: Callable[[Any], Any]
    power: int
    text: str


#: The functions of one signal, by the word in front of its name.
OPERATIONS: Mapping[str, Operation] = {
    "": Operation(lambda a: a, 1, "{}"),
    "abs": Operation(sp.Abs, 1, "abs({})"),
    "sqr": Operation(lambda a: a**2, 2, "{}^2"),
    "cub": Operation(lambda a: a**3, 3, "{}^3"),
    "sin": Operation(sp.sin, 0, "sin({})"),
    "cos": Operation(sp.cos, 0, "cos({})"),
    "sin2": Operation(lambda a: sp.sin(2 * a), 0, "sin(2 {})"),
    "cos2": Operation(lambda a: sp.cos(2 * a), 0, "cos(2 {})"),
    "filtered": Operation(lambda a: a, 1, "{}_f"),  # of the state that holds the filtered signal
}

#: The function of a signal that has a memory.
FILTERED = "filtered"


@dataclass(frozen=True)
class Factor:
    """One factor of a law: a function (a key of :data:`OPERATIONS`) of a signal.

    Examples
    --------
    >>> Factor("abs", "v").text, Factor("", "r").word
    ('abs(v)', 'r')
    """

    operation: str
    signal: str

    @property
    def word(self) -> str:
        """The factor in a name."""
        return f"{self.operation}_{self.signal}" if self.operation else self.signal

    @property
    def text(self) -> str:
        """The factor as a reader writes it."""
        return OPERATIONS[self.operation].text.format(self.signal)

    def expression(self, value: Any) -> Any:
        """Return the factor as an expression of the signal's."""
        return OPERATIONS[self.operation].of(value)


class Law(Effect):
    """A term of one equation that is a product of functions of signals.

    Attributes
    ----------
    product : tuple of Factor
    """

    product: ClassVar[tuple[Factor, ...]] = ()

    def terms(self, c: Any, s: Any) -> dict[str, sp.Expr]:
        return {self.equation: c.value * self.form(s)}

    def form(self, s: Any) -> sp.Expr:
        """Return the term per coefficient.

        Parameters
        ----------
        s : namespace
            Symbols of the motion and the commands, as for :meth:`.Effect.terms`.
        """
        return sp.Mul(*(f.expression(getattr(s, f.signal)) for f in self.product))

    @classmethod
    def complexity(cls) -> int:
        """Return the number of factors, powers and memories: 2 for ``abs(v) v``, 3 for ``v^3``."""
        return sum(max(OPERATIONS[f.operation].power, 1) + (f.operation == FILTERED) for f in cls.product)

    @classmethod
    def text(cls) -> str:
        """Return the form as a reader writes it, ``"abs(v) r"``."""
        return " ".join(f.text for f in cls.product)


class MemoryLaw(Law):
    """A law with one factor that is a signal behind a filter: ``tau memory' = signal - memory``."""

    memory: ClassVar[Signal]

    def form(self, s: Any) -> sp.Expr:
        held = self.memory.symbol
        return sp.Mul(
            *(f.expression(held if f.operation == FILTERED else getattr(s, f.signal)) for f in self.product)
        )

    def states(self, c: Any, s: Any) -> dict[Signal, sp.Expr]:
        (signal,) = (f.signal for f in self.product if f.operation == FILTERED)
        return {self.memory: (getattr(s, signal) - self.memory.symbol) / c.tau}


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
    return Factor(operation, signal).text if known else word


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
    if sum(f.operation == FILTERED for f in factors) > 1:
        raise InputError(f"law {name!r}: two filtered factors; one is the most")
    used = {s: units[s] for s in (equation, *(f.signal for f in factors))}
    made: type[Law] = _law(name, equation, factors, tuple(used.items()))  # type: ignore[assignment]
    return made


def _factor(name: str, word: str, units: Mapping[str, str]) -> Factor:
    if word in units:
        return Factor("", word)
    operation, _, signal = word.partition("_")
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
    sentence = f"A term c {text} in {equation}'"
    if signal:
        sentence += f", where tau {signal}_f' = {signal} - {signal}_f, from rest"
    return make_class(
        name,
        (MemoryLaw if signal else Law,),
        f"{sentence}." + (f" Of this form is {known}." if known else ""),
        "found in measured logs",
        equation=equation,
        product=factors,
        value=Coefficient(unit_of(of[equation], factors, of)),
        axis=equation,
        **(_memory(name, signal, of[signal]) if signal else {}),
    )


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
        if OPERATIONS[f.operation].power == 0 and own != DIMENSIONLESS:
            raise InputError(f"law: {f.text} needs an angle, and {f.signal} is in {units[f.signal]}")
        found = [a - OPERATIONS[f.operation].power * b for a, b in zip(found, own, strict=True)]
    return unit_text(tuple(found))


_SECOND = 2  # of BASE
