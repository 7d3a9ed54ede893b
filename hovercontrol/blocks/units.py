"""Physical dimensions of unit strings (with Pint's unit names) and of SymPy expressions (derived here).

Angles are dimensionless, as in the SI: ``rad/s`` and ``1/s`` agree, ``m/s`` and ``rad/s`` do not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

import pint
import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.lookup import entry
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.unitsyntax import factors, parse_unit, registry
from hovercontrol.blocks.unknown_function import UnknownFunction

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")  #: SI base units, in FMI's order (``rad`` apart)
_PINT_NAMES = ("[mass]", "[length]", "[time]", "[current]", "[temperature]", "[substance]", "[luminosity]")

#: Exponents of the seven base units. Zero has the dimension ``None``, which matches every other.
Dimension = tuple[sp.Rational, ...]
DIMENSIONLESS: Dimension = (sp.Integer(0),) * len(BASE)


#: Functions of dimensionless arguments that every backend can compute.
KNOWN_FUNCTIONS = (
    sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.exp, sp.log,
    sp.floor, sp.ceiling, sp.Heaviside,
)  # fmt: skip


class UnitError(InputError):
    """An expression combines quantities of different dimensions.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> u, t = hc.Signal("u", "m/s"), hc.Signal("t1", "s")
    >>> try:
    ...     hc.Block("sum", [], [u, t], [hc.Signal("y")], output_expressions={"y": u.symbol + t.symbol})
    ... except UnitError as error:
    ...     print(error)
    block 'sum': y: units do not fit in 't1 + u': 't1' is in s, 'u' is in m/s
    """


def dimension(unit: str) -> Dimension:
    """Return the dimension of a unit string.

    Parameters
    ----------
    unit : str
        ``"m/s^2"``, ``"rad/s"``, ``"1"``.

    Returns
    -------
    tuple of 7 sympy.Rational
        Exponents of the units in :data:`BASE`.

    Raises
    ------
    InputError
        If Pint does not know the unit, or it has no SI base units.

    Examples
    --------
    >>> dimension("m/s^2") == dimension("N/kg")
    True
    """
    return _dimension(unit if isinstance(unit, str) else shown(unit))


@lru_cache(maxsize=4096)
def _dimension(unit: str) -> Dimension:
    try:
        found = registry().get_dimensionality(parse_unit(unit))
    except (pint.errors.PintError, AttributeError, TypeError, ValueError, AssertionError) as error:
        raise InputError(f"unknown unit {shown(unit)}: expected one like 'm/s^2' or '1'") from error
    unknown = [name for name in found if name not in _PINT_NAMES]
    if unknown:
        raise InputError(f"unit {unit!r} has no SI base units ({', '.join(unknown)})")
    return tuple(sp.nsimplify(found.get(name, 0)) for name in _PINT_NAMES)


@checked
def conversion(unit: str, target: str) -> tuple[float, float]:
    """Return factor a and offset b that convert a number x from `unit` to `target`: a x + b.

    Raises
    ------
    UnitError
        If the two units have different dimensions, the factor is out of range, or the scale is logarithmic;
        if one counts in Hz and the other turns through angles, which Pint has as 1 Hz = 1 rad/s.

    Examples
    --------
    >>> conversion("degC", "K"), conversion("cm", "m")
    ((1.0, 273.15), (0.01, 0.0))
    """
    if dimension(unit) != dimension(target):
        raise UnitError(f"expected a unit like {target!r}, found {unit!r}")
    given, wanted = parse_unit(unit), parse_unit(target)
    if _angles(given) != _angles(wanted) and any("hertz" in str(u) for u in (given, wanted)):
        raise UnitError(
            f"expected a unit like {target!r}, found {unit!r}; a turn a second is 'rps', 2 pi rad/s"
        )

    def converted(x: float) -> float:
        return float(registry().Quantity(x, given).to(wanted).magnitude)

    try:
        b, a, twice = (converted(x) for x in (0.0, 1.0, 2.0))
        if not math.isclose(twice - a, a - b, rel_tol=1e-6):  # decibels
            raise ArithmeticError
        a = (converted(1e6) - b) / 1e6 if b else a  # from far apart: rounding of b takes no digits of a
    except (ArithmeticError, pint.errors.PintError):
        a, b = math.inf, 0.0
    if not 0 < a < math.inf:
        raise UnitError(f"expected a unit like {target!r}, found {unit!r}, which has another scale")
    return a, b


def _angles(unit: Any) -> float:
    """Return the power of the radian in a unit."""
    return float(dict(registry().get_root_units(unit)[1]._units).get("radian", 0))


@checked
def conversion_factor(unit: str, target: str) -> float:
    """Return the factor that converts a number from `unit` to `target`.

    Raises
    ------
    UnitError
        If the two units have different dimensions or zeros, or the factor is out of range.

    Examples
    --------
    >>> round(conversion_factor("deg/s", "rad/s"), 6)
    0.017453
    """
    factor, offset = conversion(unit, target)
    if offset:
        raise UnitError(f"expected a unit like {target!r}, found {unit!r}, which has another zero")
    return factor


@lru_cache(maxsize=4096)
def is_plain_si(unit: str) -> bool:
    """Return whether a unit is a product of SI units without a factor: true for ``N``, not ``deg`` or ``km``.

    Examples
    --------
    >>> is_plain_si("rad/s"), is_plain_si("deg/s")
    (True, False)
    """
    base = unit_text(dimension(unit))
    try:
        zero, one = (
            float(registry().Quantity(v, parse_unit(unit)).to(parse_unit(base)).magnitude) for v in (0.0, 1.0)
        )
    except (pint.errors.PintError, ValueError, ArithmeticError):
        return False
    return zero == 0.0 and abs(one - 1.0) < 1e-12


def plain_si(unit: str) -> str:
    """Return the SI unit without a factor that has the dimension of `unit`.

    Examples
    --------
    >>> plain_si("deg/s"), plain_si("km")
    ('rad/s', 'm')
    """
    found = registry().Quantity(1.0, parse_unit(unit)).to_base_units().units
    return f"{found:~C}".replace("**", "^") or "1"


def unit_text(dims: Dimension) -> str:
    """Return a dimension as a unit string in SI base units.

    Examples
    --------
    >>> unit_text(dimension("N"))
    'kg*m/s^2'
    """
    return _joined(dict(zip(BASE, dims, strict=True)))


@lru_cache(maxsize=4096)
def simplified(unit: str) -> str:
    """Return a unit with each name once, in the units as they are written.

    It is in SI base units where they take at most half as many names.

    Examples
    --------
    >>> simplified("(N/V)/(kg)"), simplified("A/(m/s)"), simplified("(rad/s)/s"), simplified("(N*s/m)/(kg)")
    ('N/V/kg', 'A*s/m', 'rad/s^2', '1/s')
    """
    found = factors(unit)
    base = {name: power for name, power in zip(BASE, dimension(unit), strict=True) if power}
    return _joined(base if 2 * len(base) <= len(found.keys() - {"rad"}) else found)


def _joined(powers: Mapping[str, Any]) -> str:
    """Return names with powers as a unit string."""

    def power(name: str, exponent: Any) -> str:
        if exponent == 1:
            return name
        return f"{name}^{exponent}" if exponent.denominator == 1 else f"{name}^({exponent})"

    above = [power(n, e) for n, e in powers.items() if e > 0]
    below = [power(n, -e) for n, e in powers.items() if e < 0]
    return "/".join(["*".join(above) or "1", *below])


class DimensionChecker:
    """Derives the dimension of expressions whose symbols have known dimensions.

    Parameters
    ----------
    units : mapping of sympy.Symbol to str, optional
        Units of symbols in error messages (``rad/s`` rather than ``1/s``).
    """

    def __init__(
        self, symbols: Mapping[sp.Symbol, Dimension], units: Mapping[sp.Symbol, str] | None = None
    ) -> None:
        self._units: dict[sp.Basic | None, str] = dict(units or {})
        self._known: dict[sp.Basic, Dimension | None] = dict(symbols)

    def __call__(self, expression: sp.Expr) -> Dimension | None:
        """Return the dimension of an expression; ``None`` for zero.

        Raises
        ------
        UnitError
            If the expression adds or compares different dimensions, or a function has an argument of the
            wrong dimension.
        """
        if expression not in self._known:
            self._known[expression] = self._derive(expression)
        return self._known[expression]

    def declare(self, symbol: sp.Symbol, dims: Dimension) -> None:
        """Add the dimension of another symbol."""
        self._known[symbol] = dims

    def _derive(self, e: sp.Basic) -> Dimension | None:
        if isinstance(e, sp.Number) or e.is_number:
            if e.is_finite is not True or e.is_real is not True:
                raise UnitError(f"expected finite real numbers, found '{e}'")
            return None if e.is_zero else DIMENSIONLESS
        if isinstance(e, sp.Mul):
            return self._product(e.args)
        if isinstance(e, sp.Pow):
            return self._power(e)
        if isinstance(e, sp.Add | sp.Max | sp.Min | sp.Abs | sp.Mod):
            return self._common(e, e.args)
        if isinstance(e, sp.Piecewise):
            for _, condition in e.args:
                self(condition)
            return self._common(e, [value for value, _ in e.args])
        if isinstance(e, UnknownFunction):
            for argument in e.arguments:
                self(argument)
            return dimension(e.unit)
        self._check_dimensionless(e)
        return DIMENSIONLESS

    def _check_dimensionless(self, e: sp.Basic) -> None:
        """Raise if the value has a unit that is not known, or the parts have wrong units."""
        if isinstance(e, sgn | sp.atan2 | Relational):
            self._common(e, e.args)
        elif isinstance(e, Boolean) and not e.is_Symbol:
            for part in e.args:
                self(part)
        elif isinstance(e, sp.sign | sp.Heaviside):
            self(e.args[0])
        elif isinstance(e, entry):
            self._need_dimensionless(e, e.args[:1])
        elif isinstance(e, KNOWN_FUNCTIONS):
            self._need_dimensionless(e, e.args)
        elif isinstance(e, sp.Function):
            names = ", ".join(sorted(f.__name__ for f in KNOWN_FUNCTIONS))
            raise UnitError(
                f"the function {e.func} in '{e}' cannot be computed by every backend; known: {names}"
            )
        else:
            raise UnitError(f"the unit of {e} cannot be derived ({type(e).__name__})")

    def _product(self, factors: Iterable[sp.Basic]) -> Dimension | None:
        total: tuple[sp.Rational, ...] = DIMENSIONLESS
        for factor in factors:
            dims = self(factor)
            if dims is None:
                return None
            total = tuple(a + b for a, b in zip(total, dims, strict=True))
        return total

    def _power(self, e: sp.Pow) -> Dimension | None:
        base, exponent = e.as_base_exp()
        dims = self(base)
        if not exponent.is_number:
            self._need_dimensionless(e, e.args)
            return DIMENSIONLESS
        if dims is None or dims == DIMENSIONLESS:
            return dims
        power = exponent if exponent.is_Rational else sp.nsimplify(exponent)
        return tuple(d * power for d in dims)

    def _common(self, e: sp.Basic, parts: Iterable[sp.Basic]) -> Dimension | None:
        common: Dimension | None = None
        first: sp.Basic | None = None
        for part in parts:
            dims = self(part)
            if dims is None:
                continue
            if common is None:
                common, first = dims, part
            elif dims != common:
                advice = "; give the number as a parameter with a unit" if _has_number(first, part) else ""
                raise UnitError(
                    f"units do not fit in '{_short(e)}': '{_short(first)}' is in "
                    f"{self._unit(first, common)}, '{_short(part)}' is in {self._unit(part, dims)}{advice}"
                )
        return common

    def _unit(self, part: sp.Basic | None, dims: Dimension) -> str:
        return self._units.get(part) or unit_text(dims)

    def _need_dimensionless(self, e: sp.Basic, parts: Iterable[sp.Basic]) -> None:
        for part in parts:
            dims = self(part)
            if dims not in (None, DIMENSIONLESS):
                raise UnitError(
                    f"units do not fit in '{e}': '{part}' must be dimensionless, "
                    f"it is in {unit_text(dims or DIMENSIONLESS)}"
                )


def _short(e: sp.Basic | None) -> str:
    """Return an expression with numbers as short as they are: 9.81, not 9.81000000000000."""
    return str(sp.sstr(e, full_prec=False))


def _has_number(*parts: sp.Basic | None) -> bool:
    return any(isinstance(part, sp.Number) for part in parts)
