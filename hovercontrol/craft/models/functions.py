"""Functions in the place of a model's unknown ones: tables, and forms of few numbers.

A form is a sum of terms with a coefficient each; at most one term has numbers of its own. In a file:

.. code-block:: toml

    [functions.mu]
    form = "saturating"     # a C_s/(b + C_s)
    a = 1.17e-4
    b = 4.39

    [functions.drag]
    grid = [0.0, 0.5, 1.0, 1.5]
    values = [0.0, 0.24, 1.02, 2.26]
"""

from __future__ import annotations

import itertools
import re
import string
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, Self

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.short_repr import short_repr
from hovercontrol.base.tables import check_keys, finite, text
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.lookup import cubic
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.units import DIMENSIONLESS, DimensionChecker, dimension, unit_text
from hovercontrol.blocks.unknown import fill, unknown_functions
from hovercontrol.blocks.unknown_function import UnknownFunction
from hovercontrol.craft.models.forms import FORMS, TERMS, Term, bounds

#: Fewest nodes of a table.
FEWEST = 4


@dataclass(frozen=True)
class Unknown:
    """An unknown function of a Block.

    Attributes
    ----------
    name, unit, argument_unit : str
    calls : tuple of UnknownFunction
        The function with each of its arguments.
    """

    name: str
    unit: str
    argument_unit: str
    calls: tuple[UnknownFunction, ...]

    @property
    def argument(self) -> str:
        """The argument as text."""
        return " or ".join(str(call.arguments[0]) for call in self.calls)


def unknowns_of(block: Block) -> tuple[Unknown, ...]:
    """Return the unknown functions of a Block.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> v = hc.Signal("v", "m/s")
    >>> drag = hc.unknown("drag", of=["v"], unit="m/s^2")
    >>> (one,) = unknowns_of(hc.Block("cart", [v], [], [v], [], {"v": -drag}))
    >>> one.name, one.argument, one.argument_unit
    ('drag', 'v', 'm/s')
    """
    every = (*block.states, *block.inputs, *block.parameters, *block.definition_signals)
    of = DimensionChecker({s.symbol: s.dimension for s in every})
    units = {s.symbol: s.unit for s in every}

    def unit(a: sp.Expr) -> str:
        return units.get(a) or unit_text(of(a) or DIMENSIONLESS)

    found = unknown_functions(block)
    return tuple(
        Unknown(name, calls[0].unit, unit(calls[0].arguments[0]), calls) for name, calls in found.items()
    )


@dataclass(frozen=True)
class TableFunction:
    """A cubic spline in place of an unknown function, constant beyond its nodes; a constant with one node.

    Attributes
    ----------
    of : Unknown
    grid, numbers : tuple of float
        Nodes, and the values there.
    """

    of: Unknown
    grid: tuple[float, ...]
    numbers: tuple[float, ...]

    __repr__ = short_repr

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the values at the nodes."""
        return tuple(f"{self.of.name}_{k}" for k in range(1, len(self.grid) + 1))

    @property
    def scales(self) -> tuple[str, ...]:
        """Names of its parameters that have one value: its ends."""
        return (f"{self.of.name}_low", f"{self.of.name}_high") if len(self.grid) > 1 else ()

    def values(self, at: Array) -> Array:
        """Return the function at places."""
        if len(self.grid) == 1:
            return np.full(at.shape, self.numbers[0])
        a = sp.Symbol("a", real=True)
        return np.asarray(sp.lambdify(a, cubic(a, self.grid, self.numbers), "numpy")(at))

    def with_numbers(self, values: Mapping[str, float]) -> Self:
        """Return the function with other values, by parameter."""
        return replace(self, numbers=tuple(values[name] for name in self.parameters))

    def filled(self, block: Block) -> Block:
        """Return a Block with the table in place of the function."""
        name, unit = self.of.name, self.of.argument_unit
        nodes = [
            Signal(p, self.of.unit, f"{name} at {a:.4g} {unit}", start=v)
            for p, a, v in zip(self.parameters, self.grid, self.numbers, strict=True)
        ]
        symbols = [s.symbol for s in nodes]
        if len(nodes) == 1:
            return fill(block, name, lambda a: symbols[0], nodes)
        low, high = self.grid[0], self.grid[-1]
        ends = [
            Signal(p, unit, "end of the table", v, 1.0, v, v)
            for p, v in zip(self.scales, (low, high), strict=True)
        ]
        first, last = (s.symbol for s in ends)
        places = (np.array(self.grid) - low) / (high - low)
        return fill(
            block, name, lambda a: cubic((a - first) / (last - first), places, symbols), [*nodes, *ends]
        )

    def lines(self) -> list[str]:
        """Return the lines of its section in a parameter file."""
        return [f"grid = {list(self.grid)!r}", f"values = {list(self.numbers)!r}"]


@dataclass(frozen=True)
class FormFunction:
    """A form of few numbers in place of an unknown function.

    Attributes
    ----------
    of : Unknown
    form : str
        A key of :data:`FORMS`.
    numbers : tuple of float
        Coefficients of its terms, then its own numbers, in the order of :attr:`keys`.

    Examples
    --------
    >>> mu = Unknown("mu", "1/s", "kg/m^3", (UnknownFunction(*map(sp.Symbol, ("mu", "s", "C_s"))),))
    >>> monod = FormFunction(mu, "saturating", (0.4, 4.0))
    >>> monod.keys, monod.text(), monod.values(np.array([4.0])).tolist()
    (('a', 'b'), 'a C_s/(b + abs(C_s))', [0.2])
    """

    of: Unknown
    form: str
    numbers: tuple[float, ...]

    __repr__ = short_repr

    @property
    def terms(self) -> list[Term]:
        """Its terms."""
        return [TERMS[t] for t in FORMS[self.form]]

    @property
    def own(self) -> list[tuple[str, Term]]:
        """The numbers beside coefficients, with their terms."""
        return [(n, t) for t in self.terms for n in t.numbers]

    @property
    def keys(self) -> tuple[str, ...]:
        """Letters of its numbers: a, b, c, and n for an exponent."""
        letters = iter(string.ascii_lowercase)
        coefficients = [next(letters) for _ in self.terms]
        return (*coefficients, *("n" if n == "n" else next(letters) for n, _ in self.own))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that are its numbers."""
        return tuple(f"{self.of.name}_{key}" for key in self.keys)

    @property
    def scales(self) -> tuple[str, ...]:
        """Names of its parameters that have one value: a unit of the argument, if it needs one."""
        return (f"{self.of.name}_one",) if any(t.numbers == ("n",) for t in self.terms) else ()

    def columns(self, at: Array) -> Callable[[Iterable[Any]], Array]:
        """Return the terms at m places as a function of the own numbers, shape (..., m, terms).

        The numbers may be arrays of one shape (...).
        """
        a, symbols = sp.Symbol("a", real=True), [sp.Symbol(n, real=True) for n, _ in self.own]
        c = SimpleNamespace(**{s.name: s for s in symbols})
        made = sp.lambdify([a, symbols], [t.of(a, c, sp.S.One) for t in self.terms], "numpy")

        def of(numbers: Iterable[Any]) -> Array:
            own = [np.asarray(n, dtype=float)[..., None] for n in numbers]
            shape = np.broadcast_shapes(at.shape, *(n.shape for n in own))
            with np.errstate(all="ignore"):
                found = np.stack([np.broadcast_to(v, shape) for v in made(at, own)], axis=-1)
            return np.where(np.isfinite(found), found, 0.0)

        return of

    def values(self, at: Array) -> Array:
        """Return the function at places."""
        count = len(self.terms)
        return np.asarray(self.columns(at)(self.numbers[count:]) @ np.array(self.numbers[:count]))

    def with_numbers(self, values: Mapping[str, float]) -> Self:
        """Return the function with other numbers, by parameter."""
        return replace(self, numbers=tuple(values[name] for name in self.parameters))

    def text(self, positive: bool = False) -> str:
        """Return the form as a reader writes it; without absolute values of an argument that is positive."""
        letters = dict(zip((n for n, _ in self.own), self.keys[len(self.terms) :], strict=True))
        parts = []
        for key, term in zip(self.keys, self.terms, strict=False):
            said = re.sub(r"(?<![\w{])[a-z]+(?!\w)", lambda m: letters.get(m[0], m[0]), term.text)
            said = said.replace("abs({0})", "{0}") if positive else said
            said = said.format(self.of.argument)
            parts.append(key + said[1:] if said.startswith("1/") else f"{key} {said}".strip())
        return " + ".join(parts)

    def filled(self, block: Block) -> Block:
        """Return a Block with the form in place of the function."""
        name, unit = self.of.name, self.of.argument_unit
        count, signals = len(self.terms), list[Signal]()
        for p, term, value in zip(self.parameters, self.terms, self.numbers, strict=False):
            pair = zip(dimension(self.of.unit), dimension(unit), strict=True)
            per = unit_text(tuple(a - term.power * b for a, b in pair))
            signals.append(Signal(p, per, start=value, nominal=abs(value) or 1.0))
        for p, (n, term), value in zip(self.parameters[count:], self.own, self.numbers[count:], strict=True):
            lower, upper = bounds(n, term)
            own = "1" if n == "n" else unit
            signals.append(Signal(p, own, "", value, abs(value) or 1.0, lower, upper))
        symbols, one = [s.symbol for s in signals], sp.S.One
        for p in self.scales:
            signals.append(Signal(p, unit, "a unit", 1.0, 1.0, 1.0, 1.0))
            one = signals[-1].symbol
        c = SimpleNamespace(**dict(zip((n for n, _ in self.own), symbols[count:], strict=True)))

        def value_of(a: sp.Expr) -> sp.Expr:
            return sp.Add(*(s * t.of(a, c, one) for s, t in zip(symbols, self.terms, strict=False)))

        return fill(block, name, value_of, signals)

    def lines(self) -> list[str]:
        """Return the lines of its section in a parameter file."""
        numbers = (f"{k} = {v!r}" for k, v in zip(self.keys, self.numbers, strict=True))
        return [f'form = "{self.form}"  # {self.text()}', *numbers]


#: What stands in the place of an unknown function.
KnownFunction = TableFunction | FormFunction


def known_function(block: Block, name: str, content: Mapping[str, Any]) -> KnownFunction:
    """Return a function of a parameter file.

    Parameters
    ----------
    block : Block
        With the unknown function.
    name : str
    content : mapping
        Its section.

    Raises
    ------
    InputError
        If the Block has no such unknown function, or the section is no table and no form.
    """
    unknowns, where = {u.name: u for u in unknowns_of(block)}, f"functions.{name}"
    check_known(name, unknowns, f"{where}: {block.name!r} has no unknown function {name!r}")
    of = unknowns[name]
    if "form" not in content:
        check_keys(f"key in {where}", content, ("grid", "values"))
        grid, values = (_numbers(f"{where}.{k}", content.get(k)) for k in ("grid", "values"))
        if len(grid) != len(values) or (len(grid) < FEWEST and len(grid) != 1):
            raise InputError(f"{where}: expected as many values as nodes, at least {FEWEST}")
        if any(b <= a for a, b in itertools.pairwise(grid)):
            raise InputError(f"{where}.grid must increase, found {list(grid)}")
        return TableFunction(of, grid, values)
    form = text(f"{where}.form", content["form"])
    check_known(form, FORMS, f"{where}.form: unknown form {form!r}")
    keys = FormFunction(of, form, ()).keys
    check_keys(f"key in {where}", content, ("form", *keys))
    check_keys(f"number of {form!r} missing in {where}:", dict.fromkeys(keys), content)
    return FormFunction(of, form, tuple(finite(f"{where}.{k}", content[k]) for k in keys))


def _numbers(where: str, value: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or not value:
        raise InputError(f"{where} must be a list of numbers, found {value!r}")
    return tuple(finite(where, one) for one in value)
