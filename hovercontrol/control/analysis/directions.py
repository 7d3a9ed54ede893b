"""Directions in the space of coefficients, said in words: what a motion does not show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arguments import as_row
from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError

#: Components below this share of a direction's largest are left out of its text.
MINOR = 1e-2


@checked
@dataclass(frozen=True, eq=False)
class Direction:
    """A change of several coefficients at once that the motion does not show, or hardly.

    Attributes
    ----------
    normalised : dict of str to float
        Unit vector in the coefficients as scaled for the analysis.
    change : dict of str to float
        The same direction in the coefficients' own units; the one that leads is 1.
    units : dict of str to str

    Examples
    --------
    >>> units = {"surge_coulomb": "m/s^2", "surge_linear_drag": "1/s"}
    >>> d = Direction.of(units, np.array([0.8, -0.6]), np.array([1.0, 2.0]))
    >>> print(d)
    surge_coulomb - 1.5 surge_linear_drag
    >>> print(d.sentence())
    +1 m/s^2 surge_coulomb with -1.5 1/s surge_linear_drag
    """

    normalised: dict[str, float]
    change: dict[str, float]
    units: dict[str, str]

    def __repr__(self) -> str:
        return self.sentence()

    @classmethod
    def of(cls, units: Mapping[str, str], vector: Array, sizes: Array) -> Direction:
        """Return the direction of a vector, shape (m,), of coefficients in units of these sizes.

        Raises
        ------
        InputError
            If there are not as many components and sizes as units, or the vector is zero.
        """
        vector, sizes = (
            as_row(f"Direction.of: {name}", a, len(units))
            for name, a in (("vector", vector), ("sizes", sizes))
        )
        if not vector.any():
            raise InputError("Direction.of: vector: expected another one than zero")
        unit = vector / np.linalg.norm(vector)
        lead = _first_largest(np.abs(unit))
        unit = unit * np.sign(unit[lead])
        change = unit * sizes / (unit[lead] * sizes[lead])
        return cls(
            dict(zip(units, unit.tolist(), strict=True)),
            dict(zip(units, change.tolist(), strict=True)),
            dict(units),
        )

    @property
    def parts(self) -> dict[str, float]:
        """The main parts of ``change``, the leading coefficient first."""
        largest = max(abs(v) for v in self.normalised.values())
        main = [name for name, v in self.normalised.items() if abs(v) >= MINOR * largest]
        lead = next(name for name in main if self.change[name] == 1.0)
        return {name: self.change[name] for name in (lead, *(n for n in main if n != lead))}

    def __str__(self) -> str:
        terms = [f"{'-' if v < 0 else '+'} {_factor(v)}{name}" for name, v in self.parts.items()]
        return " ".join(terms).removeprefix("+ ")

    def sentence(self) -> str:
        """Return the change with its units."""
        terms = [f"{value:+.3g} {self.units[name]} {name}" for name, value in self.parts.items()]
        return " with ".join([terms[0], ", ".join(terms[1:])]) if terms[1:] else terms[0]


def _first_largest(sizes: Array) -> int:
    """Return where the largest is, the first of those that differ by rounding only."""
    return int(np.flatnonzero(sizes >= sizes.max() * (1 - 1e-6))[0])


def _factor(value: float) -> str:
    text = f"{abs(value):.3g}"
    return "" if text == "1" else f"{text} "
