"""Signals: the named quantities of a Block, with unit, bounds and description."""

from __future__ import annotations

import dataclasses
import math
import re
import warnings
from dataclasses import dataclass
from typing import Any

import sympy as sp

from hovercontrol.base.boundary import as_user, checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.units import Dimension, dimension, is_plain_si, plain_si

#: The independent variable, in seconds. Expressions that depend on time use this symbol.
time = sp.Symbol("t", real=True)

#: Tolerance at the bounds as a fraction of the nominal size; a smaller excess counts as rounding.
ROUNDING = 1e-6

_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*(\[\d+(,\d+)*\])?")


@checked
@dataclass(frozen=True)
class Signal:
    """A named quantity with its unit and bounds.

    Parameters
    ----------
    name : str
        An identifier, with dots for a signal of a part of a larger Block: ``yaw_coulomb``, ``plant.u``,
        ``P[0,1]``.
    unit : str, optional
        SI unit as text, ``"1"`` for a dimensionless quantity.
    description : str, optional
        Short description.
    start : float, optional
        Initial value of a state, default value of a parameter or an unconnected input.
    nominal : float, optional
        Typical size, for scaling; positive.
    lower, upper : float, optional
        Bounds.
    modes : sequence of str, optional
        For a mode, the names of its values 0, 1, 2...; they determine its bounds. It has no unit.
    saturates : bool, optional
        For an input: the Block's equations clip it to its bounds, so that a value outside is not an error
        (:func:`hovercontrol.craft.models.actuated.actuated`).

    Raises
    ------
    InputError
        If the name is not an identifier, the unit is unknown or not SI (deg, km), `start` is outside the
        bounds, a mode has a unit, or two modes have the same name.

    Examples
    --------
    >>> Signal("yaw_coulomb", "rad/s^2", "dry friction in yaw", start=0.83, lower=0.0).symbol
    yaw_coulomb
    """

    name: str
    unit: str = "1"
    description: str = ""
    start: float = 0.0
    nominal: float = 1.0
    lower: float = -math.inf
    upper: float = math.inf
    modes: tuple[str, ...] = ()
    saturates: bool = dataclasses.field(default=False, repr=False)  # keeps the hashes of Blocks

    def __post_init__(self) -> None:
        if self.modes:
            self._become_mode()
        if not isinstance(self.name, str) or not _NAME.fullmatch(self.name):
            raise InputError(f"{self.name!r} is not a valid signal name; use letters, digits, _ and dots")
        if self.name == time.name:
            raise InputError("'t' is the name of time: give the signal another name")
        if not is_plain_si(self.unit):
            plain = plain_si(self.unit)
            raise InputError(
                f"{self.name}: signals are in SI units, found {self.unit!r}; give it in {plain!r}"
            )
        for field in ("start", "nominal", "lower", "upper"):
            value = getattr(self, field)
            try:
                object.__setattr__(self, field, float(value))
            except (TypeError, ValueError):
                raise InputError(f"{self.name}: {field} must be a number, found {value!r}") from None
        if not 0 < self.nominal < math.inf:
            raise InputError(f"{self.name}: nominal must be positive, found {self.nominal:g}")
        object.__setattr__(self, "start", self.check(self.start))

    def _become_mode(self) -> None:
        given: Any = self.modes
        names = tuple(given)
        if isinstance(given, str) or not all(isinstance(n, str) for n in names):
            raise InputError(f"{self.name}: modes must be a sequence of names, found {given!r}")
        if len(set(names)) < len(names) or self.unit != "1":
            raise InputError(f"{self.name}: a mode has different names and no unit, found {names!r}")
        object.__setattr__(self, "modes", names)
        object.__setattr__(self, "lower", 0)
        object.__setattr__(self, "upper", len(names) - 1)

    def mode(self, name: str) -> int:
        """Return the value of a mode by its name.

        Raises
        ------
        InputError
            If there is no such mode; the message suggests the nearest name.

        Examples
        --------
        >>> Signal("mode", modes=("stop", "turn")).mode("turn")
        1
        """
        check_known(name, self.modes, f"{self.name}: unknown mode {name!r}")
        return self.modes.index(name)

    @property
    def room(self) -> float:
        """Tolerance at the bounds for rounding: 1e-6 times the nominal size or the range, if that is smaller.

        This is ten times the rounding error of single precision, and of six printed digits.
        """
        return ROUNDING * min(self.nominal, self.upper - self.lower)

    def check(self, value: float, name: str = "") -> float:
        """Return a value of this signal if it lies within the bounds.

        A value outside by at most :attr:`room` is set to the bound; a warning says so once for each name.

        Raises
        ------
        InputError
            If it is further outside; the message gives the signal (or `name`), its unit and its bounds.

        Examples
        --------
        >>> Signal("F", "N", lower=0.0).check(2.0)
        2.0
        """
        if self.lower <= value <= self.upper:
            return value
        if math.isnan(value):
            raise InputError(f"{name or self.name}: expected a number, found nan")
        nearest = min(max(value, self.lower), self.upper)
        line = (
            f"{name or self.name} = {value:.9g} {self.unit} is out of its bounds "
            f"[{self.lower:g}, {self.upper:g}]"
        )
        if abs(value - nearest) <= self.room:
            _warn_once(name or self.name, f"{line} by rounding: it is set to {nearest:g}")
            return nearest
        raise InputError(line)

    @property
    def symbol(self) -> sp.Symbol:
        """The SymPy symbol of this signal in expressions."""
        return sp.Symbol(self.name, real=True)

    @property
    def dimension(self) -> Dimension:
        """Exponents of the SI base units."""
        return dimension(self.unit)

    def replace(self, **changes: Any) -> Signal:
        """Return a copy with some fields changed.

        Parameters
        ----------
        **changes
            Fields by name.

        Returns
        -------
        Signal

        Examples
        --------
        >>> Signal("u", "m/s").replace(name="v").name
        'v'
        """
        return as_user(dataclasses.replace, self, **changes)

    but = replace  # former name, still used in scripts


_TOLD: set[str] = set()


def _warn_once(name: str, line: str) -> None:
    if name not in _TOLD:
        _TOLD.add(name)
        warnings.warn(line, stacklevel=3)


def suffixed(name: str, suffix: str) -> str:
    """Return ``NAME_suffix``, with an index kept at the end.

    Examples
    --------
    >>> suffixed("plant.u", "hat"), suffixed("c[0]", "hat")
    ('plant.u_hat', 'c_hat[0]')
    """
    base, bracket, index = name.partition("[")
    return f"{base}_{suffix}{bracket}{index}"


def within_name(name: str) -> str:
    """Return a name as a part of another name: without dots and brackets.

    Examples
    --------
    >>> within_name("plant.u"), within_name("x[0]"), within_name("P[0,1]")
    ('plant_u', 'x_0', 'P_0_1')
    """
    return re.sub(r"\W+", "_", name).strip("_")
