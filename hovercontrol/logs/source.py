"""A file of columns, read in pieces: its header, its numbers, and the place of a value in it."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, TextIO

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from hovercontrol.errors import InputError
from hovercontrol.io.files import readable, reason
from hovercontrol.logs.log import PARQUET

BLOCK = 2**20
"""Bytes of text converted at a time."""

NO_NUMBER = frozenset(pyarrow.csv.ConvertOptions().null_values)
"""Texts that stand for a missing number (empty, NaN, NA, null)."""


#: What a damaged file may make Arrow raise.
_DAMAGED = (pa.ArrowException, OSError, ValueError, TypeError, KeyError, OverflowError)


class Source(Protocol):
    """What the reader asks of a file."""

    header: list[str]

    def numeric(self) -> set[str]:
        """Return the names of the columns that look like numbers at the start of the file."""

    def rows_expected(self) -> int:
        """Return about how many rows there are."""

    def batches(self, names: list[str]) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers as float64, missing ones null; text in them is an error."""

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return where data row ``row`` (from 0) stands for the user, and what is written there."""


def open_source(file: Path) -> Source:
    """Open a file by its suffix: Parquet, or else CSV.

    Raises
    ------
    InputError
        No such file, not of that format, no header, or a name twice in the header.
    """
    readable(file, "a CSV or Parquet file")
    if file.suffix.lower() in (".toml", ".py", ".fmu"):
        raise InputError(f"{file}: expected a log (CSV or Parquet), found a {file.suffix.lower()} file")
    source: Source = ParquetSource(file) if file.suffix.lower() in PARQUET else CsvSource(file)
    for i, name in enumerate(source.header):
        if name in source.header[:i]:
            raise InputError(f"{file}: column {name!r} appears twice in the header")
    return source


class CsvSource:
    """A comma-separated file whose first line names the columns."""

    def __init__(self, file: Path) -> None:
        self.file = file
        with file.open("rb") as stream:
            start = stream.read(4096)
        if b"\0" in start:
            raise InputError(f"{file}: not a CSV file: expected text, found binary data")
        if not start:
            raise InputError(f"{file}: the file is empty, expected a header")
        with self._text() as stream_text:
            header = next(self._cells(csv.reader(stream_text)), [])
        self.header = [name.strip() for name in header]
        self._check_header()

    def _check_header(self) -> None:
        if len(self.header) == 1:
            for mark, called in ((";", "semicolons"), ("\t", "tabs")):
                if mark in self.header[0]:
                    raise InputError(f"{self.file}: line 1: expected commas between names, found {called}")
        if not any(self.header) or all(_number(name) for name in self.header):
            raise InputError(
                f"{self.file}: line 1: expected a header of column names, "
                f"found {','.join(self.header)[:60]!r}"
            )

    def _cells(self, reader: Any) -> Iterator[list[str]]:
        """Give the rows of a reader; a cell of over 131,072 characters (a quote left open) is an error."""
        try:
            yield from reader
        except csv.Error as error:
            raise InputError(f"{self.file}: line {reader.line_num}: not readable as CSV: {error}") from None

    def _text(self) -> TextIO:
        return self.file.open(encoding="utf-8-sig", errors="replace", newline="")

    def _open(self, convert: pyarrow.csv.ConvertOptions) -> pyarrow.csv.CSVStreamingReader:
        read = pyarrow.csv.ReadOptions(block_size=BLOCK, column_names=self.header, skip_rows=1)
        return pyarrow.csv.open_csv(self.file, read_options=read, convert_options=convert)

    def numeric(self) -> set[str]:
        """Return the columns that hold numbers, or nothing, in the first block."""
        try:
            with self._open(pyarrow.csv.ConvertOptions()) as reader:
                schema = reader.schema
        except (pa.ArrowInvalid, UnicodeDecodeError) as error:
            raise self._fault(self.header, error) from None
        return {field.name for field in schema if pa.types.is_null(field.type) or is_number(field.type)}

    def rows_expected(self) -> int:
        """Return the rows of the file if the lines are as long as the first thousand."""
        with self.file.open("rb") as stream:
            lines = [len(line) for line, _ in zip(stream, range(1000), strict=False)]
        return round(self.file.stat().st_size / sum(lines) * len(lines)) - 1

    def batches(self, names: list[str]) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers as float64; text in them is an error."""
        convert = pyarrow.csv.ConvertOptions(
            include_columns=names, column_types=dict.fromkeys(names, pa.float64())
        )
        try:
            with self._open(convert) as reader:
                yield from reader
        except (pa.ArrowInvalid, UnicodeDecodeError) as error:
            raise self._fault(names, error) from None

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the line (the header is line 1, blank lines count) and the text of a cell."""
        at = self.header.index(column)
        for number, (line, cells) in enumerate(self._rows()):
            if number == row:
                return f"line {line}", cells[at] if at < len(cells) else ""
        raise AssertionError("the row was read before")

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        with self._text() as stream:
            reader = csv.reader(stream)
            rows = self._cells(reader)
            next(rows)
            for cells in rows:
                if cells:
                    yield reader.line_num, cells

    def _fault(self, names: list[str], error: Exception) -> InputError:
        """Find the cell on which the fast reader stumbled."""
        at = {name: self.header.index(name) for name in names}
        for line, cells in self._rows():
            if len(cells) != len(self.header):
                return InputError(
                    f"{self.file}: line {line}: expected {len(self.header)} values as in the "
                    f"header, found {len(cells)}"
                )
            for name, i in at.items():
                text = cells[i].strip()
                if text not in NO_NUMBER and not _number(text):
                    return InputError(
                        f"{self.file}: line {line}, column {name!r}: expected a number, found {text[:40]!r}"
                    )
        return InputError(f"{self.file}: not readable as CSV: {reason(error)}")


class ParquetSource:
    """A Parquet file."""

    def __init__(self, file: Path) -> None:
        self.file = file
        try:
            self._parquet = pyarrow.parquet.ParquetFile(file)
            self.header: list[str] = self._parquet.schema_arrow.names
        except _DAMAGED as error:
            raise InputError(f"{file}: not readable as Parquet: {reason(error)}") from None

    def numeric(self) -> set[str]:
        """Return the columns of a number type."""
        return {field.name for field in self._parquet.schema_arrow if is_number(field.type)}

    def rows_expected(self) -> int:
        """Return the number of rows."""
        return int(self._parquet.metadata.num_rows)

    def batches(self, names: list[str]) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers; a column of another type is an error."""
        for name in names:
            kind = self._parquet.schema_arrow.field(name).type
            if not is_number(kind):
                found = f"{kind} {self.place(0, name)[1]!r}" if self.rows_expected() else str(kind)
                raise InputError(f"{self.file}: row 1, column {name!r}: expected a number, found {found}")
        yield from self._read(names)

    def _read(self, names: list[str]) -> Iterator[pa.RecordBatch]:
        try:
            yield from self._parquet.iter_batches(batch_size=BLOCK // 16, columns=names)
        except _DAMAGED as error:
            raise InputError(f"{self.file}: not readable as Parquet: {reason(error)}") from None

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the row (from 1) and the value of a cell."""
        before = 0
        for batch in self._read([column]):
            if row < before + batch.num_rows:
                return f"row {row + 1}", str(batch.column(0)[row - before].as_py())
            before += batch.num_rows
        raise AssertionError("the row was read before")


def is_number(kind: pa.DataType) -> bool:
    """Return whether an Arrow type is an integer, a float or a decimal."""
    kinds = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal)
    return any(check(kind) for check in kinds)


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
