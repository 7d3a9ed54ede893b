"""Columns derived while a file is read: time from stamps or a period, heading from a rotation.

``time=sec+nanosec`` adds integer columns. Dates and stamps since an epoch become seconds since the first
row; without a column of time a period gives it. ``psi=qx,qy,qz,qw:z-up`` and ``psi=rx,ry,rz`` compute a
heading from a quaternion or a rotation vector, ``x=lat,lon:east`` and ``y=lat,lon:north`` a position from
latitude and longitude.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from hovercontrol.base.errors import ArgumentError, did_you_mean
from hovercontrol.logs.column_units import column_of
from hovercontrol.logs.heading import Heading, parse_up
from hovercontrol.logs.place import Place
from hovercontrol.logs.source import Source
from hovercontrol.logs.stamps import Stamps, needs_stamps

_UP = re.compile(r":\s*(-?[xyz]-(?:up|down))\s*$")
_AXIS = re.compile(r":\s*(east|north)\s*$")

#: Computes the values of a column from its parts in some rows of the file, piece by piece and in order.
Make = Callable[[list[pa.Array], range], Any]


@dataclass(frozen=True)
class Recipe:
    """How a derived column is computed.

    Attributes
    ----------
    parts : tuple of str
        Columns of the file that it is computed from.
    begin : callable
        Returns a new :data:`Make` function for one pass through the file.
    exact : bool
        Whether the parts are read in their own types.
    remark : callable
        Returns what looks wrong in the values after a pass, or an empty text.
    """

    parts: tuple[str, ...]
    begin: Callable[[], Make]
    exact: bool = False
    remark: Callable[[], str] = str


@dataclass
class Derived:
    """A source with derived columns.

    Attributes
    ----------
    source : Source
    recipes : mapping of str to Recipe
        By the name of the derived column, which may replace a column of the file.
    stamps : Stamps, optional
        The clock, if time counts from the first row.
    """

    source: Source
    recipes: Mapping[str, Recipe]
    stamps: Stamps | None = None
    header: list[str] = field(init=False)

    def __post_init__(self) -> None:
        clock = [part for part, _ in self.stamps.parts] if self.stamps else []
        own = [name for name in self.source.header if name in self.recipes or name not in clock]
        self.header = [*own, *(name for name in self.recipes if name not in own)]

    @property
    def units(self) -> Mapping[str, str]:
        """The units of the columns that are not derived."""
        return {k: v for k, v in self.source.units.items() if k not in self.recipes}

    @property
    def angles(self) -> str:
        """Unit of angles without a stated unit."""
        return self.source.angles

    @property
    def euler(self) -> str:
        """Kind of three angles of a body."""
        return self.source.euler

    @property
    def remarks(self) -> list[str]:
        """What looks wrong in the derived columns, one line each."""
        return [text for recipe in self.recipes.values() if (text := recipe.remark())]

    @property
    def said(self) -> str:
        """How the file is read."""
        notes = [self.source.said, self.stamps.said if self.stamps else ""]
        return ", ".join(note for note in notes if note)

    def kind(self, name: str) -> pa.DataType:
        """Return the type of a column."""
        return pa.float64() if name in self.recipes else self.source.kind(name)

    def numeric(self) -> set[str]:
        """Return the columns that look like numbers."""
        return self.source.numeric() | set(self.recipes)

    def rows_expected(self) -> int:
        """Return the approximate number of rows."""
        return self.source.rows_expected()

    def batches(self, names: list[str], exact: Collection[str] = ()) -> Iterator[pa.RecordBatch]:
        """Read columns and compute the derived ones."""
        made = {name: self.recipes[name] for name in names if name in self.recipes}
        plain = [name for name in names if name not in made]
        parts = [part for recipe in made.values() for part in recipe.parts]
        wanted = list(dict.fromkeys([*plain, *parts])) or [min(self.source.numeric())]  # for its rows
        typed = {part for recipe in made.values() if recipe.exact for part in recipe.parts} | set(exact)
        makers = {name: recipe.begin() for name, recipe in made.items()}
        row = 0
        for batch in self.source.batches(wanted, typed):
            arrays = []
            for name in names:
                if name in makers:
                    given = [batch.column(part) for part in made[name].parts]
                    rows = range(row, row + batch.num_rows)
                    arrays.append(pa.array(makers[name](given, rows), type=pa.float64()))
                else:
                    arrays.append(batch.column(name))
            row += batch.num_rows
            yield pa.RecordBatch.from_arrays(arrays, names=names)

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the place of a row, and the text of the cells from which its column is derived."""
        if column not in self.recipes:
            return self.source.place(row, column)
        found = [self.source.place(row, part) for part in self.recipes[column].parts]
        return found[0][0], " ".join(text for _, text in found)


def with_derived(
    file: Path, source: Source, columns: Mapping[str, str], period: float | None = None
) -> Source:
    """Return a source with the columns that ``--columns`` derives from others, and time.

    Parameters
    ----------
    file : Path
        For error messages.
    columns : mapping
        Signal name to the specification of the file's column, as for :func:`.read.read_log`.
    period : float, optional
        Time between two rows [s] of a file without a column of time.

    Raises
    ------
    ArgumentError
        If a part is not a column of the file, or a period is given for a file that has a time.
    """
    recipes: dict[str, Recipe] = {}
    for ours, said in columns.items():
        if ours != "time" and column_of(said, source.header)[0] not in source.header:
            recipe = _place(file, source, ours, said) or _heading(file, source, ours, said)
            if recipe:
                recipes[said] = recipe
    said = columns.get("time", "time")
    if period is not None:
        recipes["time"] = _by_period(file, source, columns, period)
        return Derived(source, recipes)
    parts = _clock_parts(file, source, said)
    if not parts:
        return Derived(source, recipes) if recipes else source
    stamps = Stamps(file, source, parts)
    recipes[said] = Recipe(tuple(name for name, _ in parts), lambda: stamps.seconds, exact=True)
    return Derived(source, recipes, stamps)


def _by_period(file: Path, source: Source, columns: Mapping[str, str], period: float) -> Recipe:
    """Return the time of a file's rows: t = 0, period, 2 period, ..."""
    if "time" in columns or "time" in source.header:
        raise ArgumentError(
            f"{file}: expected no column of time beside --period, found {columns.get('time', 'time')!r}"
        )
    if not (math.isfinite(period) and period > 0.0):
        raise ArgumentError(f"--period: expected a positive time in seconds, found {period:g}")
    return Recipe((), lambda: lambda parts, rows: period * np.asarray(rows))


def parts_of(said: str, header: Collection[str]) -> list[str]:
    """Return the columns, with units, from which ``--columns`` derives one; a column of the file is kept.

    Examples
    --------
    >>> parts_of("sec+nanosec", ["sec", "nanosec"]), parts_of("quat(a;b;c;d):y-up", [])
    (['sec', 'nanosec'], ['a', 'b', 'c', 'd'])
    >>> parts_of("yaw:deg", ["yaw"]), parts_of("a+b", ["a+b"])
    (['yaw:deg'], ['a+b'])
    """
    if column_of(said, header)[0] in header:
        return [said]
    text = said.rpartition(":")[0] if _UP.search(said) or _AXIS.search(said) else said
    inside = re.fullmatch(r"(?:quat|rotvec)\((.*)\)", text.strip())
    return [part.strip() for part in re.split("[;,+]", inside[1] if inside else text)]


def _clock_parts(file: Path, source: Source, said: str) -> list[tuple[str, str]]:
    """Return the columns, with units, from which time is computed; none if time is read unchanged."""
    name, unit = column_of(said, source.header)
    if name in source.header:
        unit = unit or source.units.get(name, "")
        return [(name, unit)] if needs_stamps(source, name, unit) else []
    return (
        [column_of(part, source.header) for part in _known(file, source, "time", said)] if "+" in said else []
    )


def _place(file: Path, source: Source, ours: str, said: str) -> Recipe | None:
    """Return how a position is computed from latitude and longitude, or None if they are not given."""
    axis, parts = _AXIS.search(said), parts_of(said, source.header)
    if not axis or len(parts) != 2:
        return None
    if ours not in ("x", "y"):
        raise ArgumentError(f"{file}: column {ours!r}: only x and y are east or north, found {said!r}")
    _known(file, source, ours, said)
    (lat, one), (lon, two) = (column_of(part, source.header) for part in parts)
    units = (one or source.units.get(lat, "deg"), two or source.units.get(lon, "deg"))
    return Recipe((lat, lon), lambda: Place(str(file), (lat, lon), units, axis[1]).values)


def _heading(file: Path, source: Source, ours: str, said: str) -> Recipe | None:
    """Return how the heading is computed from a rotation, or None if no rotation is given."""
    names = parts_of(said, source.header)
    if len(names) not in (3, 4) or "+" in said:
        return None
    if ours != "psi":
        raise ArgumentError(
            f"{file}: column {ours!r}: only psi can be computed from a rotation, found {said!r}"
        )
    _known(file, source, ours, said)
    found = _UP.search(said)
    up = parse_up(found[1] if found else "z-up")
    angle = source.angles if len(names) == 3 else ""
    units = [source.units.get(name, angle) for name in names]
    heading = Heading(str(file), tuple(names), up, units, source.euler if len(names) == 3 else "")
    return Recipe(tuple(names), heading.begin, remark=heading.remark)


def _known(file: Path, source: Source, ours: str, said: str) -> list[str]:
    """Return the parts of a column; raise ArgumentError if the file lacks one."""
    parts = parts_of(said, source.header)
    for part in parts:
        name = column_of(part, source.header)[0]
        if name not in source.header:
            hint = did_you_mean(name, source.header)
            raise ArgumentError(f"{file}: no column {name!r} to read {ours!r} from{hint}")
    return parts
