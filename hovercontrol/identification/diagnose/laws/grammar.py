"""The grammar of laws: which forms a search for laws tries in an equation."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.units import DIMENSIONLESS, dimension
from hovercontrol.craft.effects.law import FILTERED, Factor, form_of, law_in, law_name
from hovercontrol.identification.engine.subject import Subject, structure

#: Functions of one signal that stand alone.
ALONE = (("",), ("abs",), ("abs", ""), ("sqr",), ("cub",))

#: Functions of two signals a and b, each pair in both orders.
OF_TWO = (("", ""), ("abs", ""), ("", "abs"), ("sqr", ""), ("", "sqr"))

#: Functions of an angle, alone or times a signal.
OF_ANGLE = ("sin", "cos", "sin2", "cos2")


@dataclass(frozen=True)
class Signals:
    """The signals of a model that a law may use, by what they are.

    Attributes
    ----------
    moving : tuple of str
        Velocities, commands, and positions of a machine that is no craft: all their products are tried.
    angles : tuple of str
        Positions whose sine and cosine are tried.
    places : tuple of str
        Coordinates of a craft on its floor: tried alone and turned into the body frame.
    inputs : tuple of str
        Commands as they act: tried behind a filter of first order, too.
    """

    moving: tuple[str, ...]
    angles: tuple[str, ...]
    places: tuple[str, ...]
    inputs: tuple[str, ...]


def signals_of(model: Subject) -> Signals:
    """Return the signals of a model that a law may use.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> signals_of(hc.vehicle("c17_experiment"))  # doctest: +NORMALIZE_WHITESPACE
    Signals(moving=('u', 'v', 'r', 'thrust', 'rudder'), angles=('psi',), places=('x', 'y'),
            inputs=('thrust', 'rudder'))
    """
    units = model.law_units()
    if model.is_craft:
        driven = structure(model).inputs
        commands = [n for n in units if n not in model.motion and n != "time"]
        used = [n for n in commands if n.startswith("fan_") or n in {s.name for s in driven}]
        return Signals(("u", "v", "r", *used), ("psi",), ("x", "y"), tuple(used))
    block = structure(model)
    angles = [s.name for s in block.states if s.name in units and _is_angle(block, s.name)]
    inputs = tuple(s.name for s in block.inputs if s.name in units)
    return Signals(tuple(n for n in units if n != "time"), tuple(angles), (), inputs)


def _is_angle(block: Block, name: str) -> bool:
    """Return whether a state is in radians and the integral of another state."""
    unit = block.signal(name).unit
    states = {s.symbol for s in block.states}
    return unit in ("rad", "deg") and dimension(unit) == DIMENSIONLESS and block.derivatives[name] in states


def law_names(model: Subject) -> list[str]:
    """Return the names of all laws that a search tries, in each equation that may lack something.

    In each equation: one signal as ``a``, ``abs(a)``, ``abs(a) a``, ``a^2``, ``a^3``; products of two as ``a
    b``, ``abs(a) b``, ``a abs(b)``, ``a^2 b``, ``a b^2``; the sine and cosine of an angle and of its double,
    alone and times a signal; place, alone and turned into the body frame; the time since the log's start,
    alone and times a signal; a command behind a filter of first order. At most three powers, at most two
    signals.

    Parameters
    ----------
    model : Model or BlockModel

    Examples
    --------
    >>> import hovercontrol as hc
    >>> names = law_names(hc.vehicle("c17_experiment"))
    >>> "law_r__abs_v__r" in names, "law_v__abs_v__v" in names
    (True, True)
    """
    forms = list(_forms(signals_of(model)))
    return [law_name(equation, form) for equation in _equations(model) for form in forms]


def elsewhere(model: Subject, names: Sequence[str]) -> list[str]:
    """Return the laws of the same forms in the model's other equations.

    They differ from the given ones in their place only. A force off the centre of mass acts in both.

    Parameters
    ----------
    model : Model or BlockModel
    names : sequence of str
        Of laws.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> elsewhere(hc.vehicle("c17_experiment"), ["law_r__abs_v__r"])
    ['law_u__abs_v__r', 'law_v__abs_v__r']
    """
    products = dict.fromkeys(form_of(n) for n in names)
    every = (law_in(equation, form) for form in products for equation in _equations(model))
    return [n for n in every if n not in names]


def _equations(model: Subject) -> list[str]:
    """Return the states whose derivatives may lack a term: all that are not pure kinematics."""
    if model.pushed:
        return list(model.pushed)
    block = structure(model)
    causes = {s.symbol for s in (*block.inputs, *block.parameters)}
    laws = {s.name: block.expand(block.derivatives[s.name]) for s in block.states}
    own = [n for n, e in laws.items() if n in model.motion and e.free_symbols & causes]
    return own


def _forms(signals: Signals) -> Iterator[tuple[Factor, ...]]:
    for a in signals.moving:
        for operations in ALONE:
            yield tuple(Factor(operation, a) for operation in operations)
    for a, b in itertools.combinations(signals.moving, 2):
        for one, two in OF_TWO:
            yield Factor(one, a), Factor(two, b)
    for angle, operation in itertools.product(signals.angles, OF_ANGLE):
        yield (Factor(operation, angle),)
        for a in signals.moving:
            if a != angle:
                yield Factor(operation, angle), Factor("", a)
    for place in signals.places:
        yield (Factor("", place),)
        for angle, operation in itertools.product(signals.angles, ("sin", "cos")):
            yield Factor("", place), Factor(operation, angle)
    yield (Factor("", "time"),)
    for a in signals.moving:
        yield Factor("", "time"), Factor("", a)
    for command in signals.inputs:
        yield (Factor(FILTERED, command),)


def same_form(one: sp.Expr, other: sp.Expr) -> bool:
    """Return whether two expressions are equal up to a constant factor.

    Examples
    --------
    >>> x = sp.Symbol("x", real=True)
    >>> same_form(2 * x * sp.Abs(x), -x * sp.Abs(x)), same_form(x, x**2)
    (True, False)
    """
    if one == 0 or other == 0:
        return bool(one == other)
    ratio = sp.simplify(one / other)
    return bool(ratio.is_number)
