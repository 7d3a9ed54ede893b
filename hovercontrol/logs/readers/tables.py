"""Tables in memory, and files with several tables, each on its own clock."""

from __future__ import annotations

import gc
import logging
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from traceback import clear_frames
from typing import Any

import numpy as np
import pyarrow as pa

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import reason
from hovercontrol.blocks.units import dimension
from hovercontrol.logs.readers.arrow import is_number

BATCH = 2**16
"""Rows given at a time."""

#: Returns the named columns, all of one length.
Loader = Callable[[Sequence[str]], Mapping[str, Any]]


@dataclass
class Table:
    """A table whose columns are loaded on demand.

    Attributes
    ----------
    file : path
    name : str
        Name of the table in its file, such as a topic.
    header : list of str
    rows : int
    load : callable
        Returns columns by name as NumPy arrays of `rows` values.
    clock : str
        The time column; empty if the file does not identify it.
    units : mapping of str to str
        Units of the columns for which the file states one.
    said : str
        How the file is read, if that is not obvious; else empty.
    line : int
        The line number of the first row in the file; 0 if the file has no lines.
    angles, euler : str
        Unit and kind of angles, see :class:`~hovercontrol.logs.source.Source`.
    """

    file: Path
    name: str
    header: list[str]
    rows: int
    load: Loader
    clock: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    said: str = ""
    line: int = 0
    angles: str = "rad"
    euler: str = ""
    _loaded: dict[str, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls,
        file: Path,
        name: str,
        columns: Mapping[str, Any],
        clock: str,
        units: Mapping[str, str],
        said: str = "",
    ) -> Table:
        """Return a table of columns that are loaded; units of other columns are left out."""
        rows = len(next(iter(columns.values())))
        own = {key: unit for key, unit in units.items() if key in columns}
        return cls(file, name, list(columns), rows, lambda n: {k: columns[k] for k in n}, clock, own, said)

    def columns(self, names: Sequence[str]) -> dict[str, Any]:
        """Return columns as arrays; loaded columns are cached."""
        missing = [name for name in names if name not in self._loaded]
        if missing:
            with faults(self.file, self.name):
                self._loaded.update(self.load(missing))
        return {name: self._loaded[name] for name in names}

    def kind(self, name: str) -> pa.DataType:
        """Return the type of a column."""
        return pa.from_numpy_dtype(self.columns([name])[name].dtype)

    def numeric(self) -> set[str]:
        """Return all columns: a table contains only numbers."""
        return set(self.header)

    def rows_expected(self) -> int:
        """Return the number of rows."""
        return self.rows

    def batches(self, names: list[str], exact: Collection[str] = ()) -> Iterator[pa.RecordBatch]:
        """Yield columns of numbers in pieces, in their own types."""
        data = self.columns(names)
        for name, values in data.items():
            if name not in exact and not is_number(pa.from_numpy_dtype(values.dtype)):
                raise InputError(f"{self.file}: column {name!r}: expected numbers, found {values.dtype}")
        for first in range(0, self.rows, BATCH):
            part = [pa.array(np.ascontiguousarray(data[name][first : first + BATCH])) for name in names]
            yield pa.RecordBatch.from_arrays(part, names=names)

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the row (from 1), or the line, and the value of a cell."""
        where = f"line {self.line + row}" if self.line else f"row {row + 1}"
        return where, str(self.columns([column])[column][row])


@dataclass
class Tables:
    """A file with several tables, each on its own clock, such as the topics of a flight log.

    Attributes
    ----------
    file : path
    tables : sequence of Table
        The tables; column names are unique across them.
    aliases : mapping of str to str
        Other names by which columns are known.
    """

    file: Path
    tables: Sequence[Table]
    aliases: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def header(self) -> list[str]:
        """The names of all columns."""
        return [name for table in self.tables for name in table.header]

    @cached_property
    def _dotted(self) -> dict[str, str]:
        known = {_dots(name): full for name, full in self.aliases.items()}
        return {**known, **{_dots(name): name for name in reversed(self.header)}}

    def named(self, column: str) -> str:
        """Return the full name of a column, given by an alias, with dots for slashes or without the first."""
        return column if column in self.header else self._dotted.get(_dots(column), column)

    def table_of(self, column: str) -> Table | None:
        """Return the table that has a column, or None."""
        return next((table for table in self.tables if column in table.header), None)


def _dots(name: str) -> str:
    return name.replace("/", ".").lstrip(".")


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress the output of a library, because standard output may have to be one JSON value."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
            yield
    finally:
        logging.disable(before)


@contextmanager
def faults(file: Path, what: str) -> Iterator[None]:
    """Convert any exception of a library on a damaged file to a one-line InputError."""
    with quiet():
        try:
            yield
            return
        except InputError:
            raise
        except MemoryError:
            why = "it asks for more memory than there is"
        except Exception as error:
            why = reason(error)
            clear_frames(error.__traceback__)
        gc.collect()  # partly initialised objects may print warnings when they are deleted
    raise InputError(f"{file}: not readable as {what}: {why}")


def unit_or_none(text: str) -> str:
    """Return the unit that a file states, or an empty text if it is not a unit.

    Examples
    --------
    >>> unit_or_none(" m/s"), unit_or_none("°/s"), unit_or_none("furlongs/x")
    ('m/s', 'deg/s', '')
    """
    text = text.strip("\0 ").replace("°", "deg").replace("²", "^2").replace("µ", "u")
    try:
        dimension(text)
    except InputError:
        return ""
    return text


def library(file: Path, module: str, what: str, extra: str = "logs", package: str = "") -> Any:
    """Return a module of an optional package.

    Parameters
    ----------
    what : str
        What it reads, for the error message.
    extra : str, optional
        The extra of this package that installs it.
    package : str, optional
        Its name, if the module has another.

    Raises
    ------
    InputError
        If it is not installed; the message says how to install it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise missing_library(file, package or module.partition(".")[0], what, extra, reason(error)) from None


def missing_library(file: Path, package: str, what: str, extra: str, why: str) -> InputError:
    """Return the error that an optional package is missing."""
    return InputError(f'{file}: reading {what} needs {package}: pip install ".[{extra}]" ({why})')
