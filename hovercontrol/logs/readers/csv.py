"""Text tables: CSV and its dialects."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import reason
from hovercontrol.logs.readers.arrow import as_number, is_number
from hovercontrol.logs.readers.dialect import (
    COMMENTS,
    HEAD,
    Dialect,
    is_comment,
    recognise,
    unit_in_cell,
    without_units,
)

BLOCK = 2**20
"""Bytes of text converted at a time."""

NO_NUMBER = frozenset(pyarrow.csv.ConvertOptions().null_values)
"""Texts that stand for a missing number (empty, NaN, NA, null)."""

TRUTHS = frozenset({"true", "false", "True", "False", "TRUE", "FALSE"})
"""Texts that are read as 1 and 0."""

_WITH_UNIT = re.compile(r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?\s*([^\d\s.,:;+-].*)")

LARGE = 1e8
"""From this size on a number may have more digits than a float keeps, and its type is exact."""

EXACT = pa.decimal128(38, 18)


class CsvSource:
    """A text table whose header names the columns; without one they are named 1, 2, ...

    Parameters
    ----------
    dialect : Dialect, optional
        Dialect of the file; by default it is recognised from the start of the file.
    """

    def __init__(self, file: Path, dialect: Dialect | None = None) -> None:
        self.file = file
        with file.open("rb") as stream:
            self._head = stream.read(HEAD)
        if not self._head:
            raise InputError(f"{file}: the file is empty, expected a header")
        self.dialect = dialect or recognise(self._head, str(file))
        self.said = self.dialect.text
        self.angles, self.euler = self.dialect.angles, ""
        if self.dialect.names:
            self.header = [name.strip() for name in self.dialect.names]
        else:
            with self._text() as stream_text:
                header = next(self._cells(csv.reader(stream_text)), [])
            self.header = [name.strip() for name in header]
            self._check_header()
        self.units: Mapping[str, str] = {
            name: unit for name, unit in zip(self.header, self.dialect.units, strict=False) if unit
        }
        if not self.units:
            self.header, self.units = without_units(self.header)
            named = "units taken from column names" if self.units else ""
            self.said = ", ".join(filter(None, [self.said, named]))
        self._worded = self._units_of_cells()
        if self._worded:
            self.units = {**self.units, **{name: unit for name, (_, unit) in self._worded.items()}}
            self.said = ", ".join(filter(None, [self.said, "units in cells"]))
        self._cut = self._cut_line()
        if self._cut:
            self.said = ", ".join(filter(None, [self.said, "an incomplete last line left out"]))
        # Arrow requires different names; columns without a name are never requested
        self._names = [name or f"\0{k}" for k, name in enumerate(self.header)]

    def _cut_line(self) -> int:
        """Return the size of a last line without all values and a line end: the logger lost its power."""
        if self.dialect.rewritten:
            return 0
        with self.file.open("rb") as stream:
            stream.seek(max(self.file.stat().st_size - HEAD, 0))
            _, end, last = stream.read().rpartition(b"\n")
        text = last.decode(self.dialect.encoding, errors="replace")
        cut = end and text.strip() and not text.endswith("\r") and '"' not in text
        return len(last) if cut and len(self.dialect.cells(text)) < len(self.header) else 0

    def _units_of_cells(self) -> dict[str, tuple[str, str]]:
        """Return the units of columns with cells like ``0.5 sec``, as written and as units."""
        _, cells = next(self._rows(), (0, []))
        found = [_WITH_UNIT.fullmatch(cell.strip()) for cell in cells]
        return {
            name: (cell[1], unit)
            for name, cell in zip(self.header, found, strict=False)
            if name and cell and (unit := unit_in_cell(cell[1]))
        }

    def _check_header(self) -> None:
        if not any(self.header) or all(map(_number, re.split(r"[;\s|,]+", ",".join(self.header)))):
            raise InputError(
                f"{self.file}: line 1: expected a header of column names, "
                f"found {','.join(self.header)[:60]!r}; if that is a row, add a line of names above it"
            )

    def _cells(self, reader: Any, before: int = 0) -> Iterator[list[str]]:
        """Yield the rows of a reader; a cell of over 131,072 characters (an open quote) is an error."""
        try:
            yield from reader
        except csv.Error as error:
            line = reader.line_num + before
            raise InputError(f"{self.file}: line {line}: not readable as CSV: {error}") from None

    def _text(self) -> TextIO:
        return self.file.open(encoding=self.dialect.encoding, errors="replace", newline="")

    def _open(self, convert: pyarrow.csv.ConvertOptions) -> pyarrow.csv.CSVStreamingReader:
        dialect = self.dialect
        convert.decimal_point = dialect.decimal
        skipped = 0 if dialect.rewritten else dialect.first
        read = pyarrow.csv.ReadOptions(block_size=BLOCK, column_names=self._names, skip_rows=skipped)
        parse = pyarrow.csv.ParseOptions(delimiter="," if dialect.separator == " " else dialect.separator)
        if dialect.separator == " " and dialect.decimal == ",":
            parse.delimiter = ";"
        source: Any = self.file
        if self._cut:
            source = io.BufferedReader(_Beginning(self.file, self.file.stat().st_size - self._cut), BLOCK)
        if dialect.rewritten:
            source = io.BufferedReader(_Rewritten(self.file, dialect, parse.delimiter), BLOCK)
        return pyarrow.csv.open_csv(source, read_options=read, parse_options=parse, convert_options=convert)

    def kind(self, name: str) -> pa.DataType:
        """Return the type of the first value of a column: text, a number, or one too large for a float."""
        at = self.header.index(name)
        for _, cells in islice(self._rows(), 100):
            text = cells[at].strip() if at < len(cells) else ""
            if text in NO_NUMBER:
                continue
            if text in TRUTHS:
                return pa.bool_()
            if name in self._worded:
                return pa.float64()
            if not self._is_number(text):
                return pa.string()
            large = abs(float(text.replace(self.dialect.decimal, "."))) >= LARGE and "e" not in text.lower()
            return EXACT if large else pa.float64()
        return pa.float64()

    def numeric(self) -> set[str]:
        """Return the columns that are numbers or blank in the first block."""
        try:
            with self._open(pyarrow.csv.ConvertOptions()) as reader:
                schema = reader.schema
        except (pa.ArrowInvalid, UnicodeDecodeError) as error:
            if not self._comments_found():
                raise self._fault(self.header, error) from None
            return self.numeric()
        numbers = {field.name for field in schema if pa.types.is_null(field.type) or is_number(field.type)}
        return numbers | set(self._worded)

    def rows_expected(self) -> int:
        """Return the number of rows, estimated from the length of the first thousand lines."""
        with self.file.open("rb") as stream:
            lines = [len(line) for line, _ in zip(stream, range(1000), strict=False)]
        return max(round(self.file.stat().st_size / sum(lines) * len(lines)) - 1, 0)

    def batches(self, names: list[str], exact: Collection[str] = ()) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers as float64, those in `exact` as :meth:`kind` says; text is an error."""
        if not names:  # Arrow would give all columns
            return
        types = {name: self._stored(name, name in exact) for name in names}
        convert = pyarrow.csv.ConvertOptions(include_columns=names, column_types=types)
        rows = 0
        try:
            with self._open(convert) as reader:
                for batch in reader:
                    start, rows = rows, rows + batch.num_rows
                    columns = [
                        self._without_unit(name, column, start) if name in self._worded else as_number(column)
                        for name, column in zip(names, batch.columns, strict=True)
                    ]
                    yield pa.RecordBatch.from_arrays(columns, names=names)
        except (pa.ArrowInvalid, UnicodeDecodeError) as error:
            if not self._comments_found():
                numbers = [name for name in names if not pa.types.is_string(types[name])]
                raise self._fault(numbers, error) from None
            for batch in self.batches(names, exact):  # again without comments, after the rows already given
                rest = batch.slice(min(rows, batch.num_rows))
                rows -= batch.num_rows - rest.num_rows
                if rest.num_rows:
                    yield rest

    def _stored(self, name: str, exact: bool) -> pa.DataType:
        """Return the type in which a column is parsed."""
        if name in self._worded:
            return pa.string()
        kind = self.kind(name)
        return kind if exact or pa.types.is_boolean(kind) else pa.float64()

    def _without_unit(self, name: str, column: Any, start: int) -> Any:
        """Return the numbers of a column whose cells are a number and the unit of the first cell."""
        text = pc.utf8_trim_whitespace(column)
        suffix, point = rf"\s*{re.escape(self._worded[name][0])}$", self.dialect.decimal
        plain = pc.replace_substring(pc.replace_substring_regex(text, suffix, ""), point, ".")
        try:
            return pc.if_else(pc.equal(plain, ""), None, plain).cast(pa.float64())
        except pa.ArrowInvalid:
            for k, value in enumerate(plain.to_pylist()):
                if value and not _number(value):
                    where, found = self.place(start + k, name)
                    raise InputError(
                        f"{self.file}: {where}, column {name!r}: expected a number and "
                        f"{self._worded[name][0]!r}, found {found[:40]!r}"
                    ) from None
            raise

    def _comments_found(self) -> bool:
        """Return whether there are unexpected comment lines; from then on the dialect includes comments."""
        if self.dialect.comments:
            return False
        with self._text() as stream:
            found = any(is_comment(line) for line in islice(stream, self.dialect.first, None))
        self.dialect = replace(self.dialect, comments=found)
        return found

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the line (the file's first is line 1, blank lines count) and the text of a cell."""
        at = self.header.index(column)
        for number, (line, cells) in enumerate(self._rows()):
            if number == row:
                return f"line {line}", cells[at] if at < len(cells) else ""
        raise AssertionError("the row repeats an earlier one")

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        dialect = self.dialect
        with self._text() as stream:
            for _ in islice(stream, dialect.first):
                pass
            if dialect.separator == " ":
                for line, text in enumerate(stream, dialect.first + 1):
                    if text.strip() and not is_comment(text):
                        yield line, text.split()
                return
            reader = csv.reader(stream, delimiter=dialect.separator)
            for cells in self._cells(reader, dialect.first):
                if cells and not (dialect.comments and is_comment(cells[0])):
                    yield reader.line_num + dialect.first, cells

    def _is_number(self, text: str) -> bool:
        return _number(text.replace(self.dialect.decimal, ".") if self.dialect.decimal != "." else text)

    def _fault(self, names: list[str], error: Exception) -> InputError:
        """Return the error for the cell at which the fast reader failed."""
        at = {name: self.header.index(name) for name in names if name}
        if not any(True for _ in self._rows()):
            return InputError(f"{self.file}: expected samples below the header, found no rows")
        for line, cells in self._rows():
            if len(cells) != len(self.header):
                where = f"line {self.dialect.first + 1}" if self.dialect.headless else "the header"
                return InputError(
                    f"{self.file}: line {line}: expected {len(self.header)} values as in {where}, "
                    f"found {len(cells)}"
                )
            for name, i in at.items():
                text = cells[i].strip()
                if text not in NO_NUMBER and text not in TRUTHS and not self._is_number(text):
                    return InputError(
                        f"{self.file}: line {line}, column {name!r}: expected a number, found {text[:40]!r}"
                    )
        return InputError(f"{self.file}: not readable as CSV: {reason(error)}")


class _Beginning(io.RawIOBase):
    """The first bytes of a file."""

    def __init__(self, file: Path, size: int) -> None:
        self._file: BinaryIO = file.open("rb")
        self._left = size

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        block = self._file.read(min(len(buffer), self._left))
        self._left -= len(block)
        buffer[: len(block)] = block
        return len(block)

    def close(self) -> None:
        self._file.close()
        super().close()


class _Rewritten(io.RawIOBase):
    """The rows of a text table as UTF-8, with one separator between cells and without comment lines."""

    def __init__(self, file: Path, dialect: Dialect, separator: str) -> None:
        self._file: BinaryIO = file.open("rb")
        self._decode = None
        if dialect.encoding.startswith("utf-16"):
            self._decode = codecs.getincrementaldecoder(dialect.encoding)(errors="replace")
        self._blanks = separator.encode() if dialect.separator == " " else b""
        self._skip = dialect.first
        self._rest, self._ready, self._ended = b"", b"", False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._ready and not self._ended:
            self._ready = self._lines()
        size = min(len(buffer), len(self._ready))
        buffer[:size], self._ready = self._ready[:size], self._ready[size:]
        return size

    def _lines(self) -> bytes:
        block = self._file.read(BLOCK)
        self._ended = not block
        if self._decode:
            block = self._decode.decode(block, final=self._ended).encode(errors="replace")
        text = self._rest + block
        cut = len(text) if self._ended else text.rfind(b"\n") + 1
        text, self._rest = text[:cut], text[cut:]
        while self._skip and text:
            text = text[text.find(b"\n") + 1 :] if b"\n" in text else b""
            self._skip -= 1
        if any(mark.encode() in text for mark in COMMENTS):
            text = re.sub(rb"(?m)^[ \t]*(?:#|%|//).*(?:\n|\Z)", b"", text)
        if self._blanks:
            text = text.replace(b"\t", b" ").replace(b"\r\n", b"\n")
            while b"  " in text:
                text = text.replace(b"  ", b" ")
            text = text.replace(b"\n ", b"\n").replace(b" \n", b"\n").strip(b" ").replace(b" ", self._blanks)
        return text

    def close(self) -> None:
        self._file.close()
        super().close()


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
