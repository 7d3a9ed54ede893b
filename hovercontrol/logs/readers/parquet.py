"""Parquet files."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import reason
from hovercontrol.logs.readers.arrow import DAMAGED, as_number, is_number
from hovercontrol.logs.readers.tables import unit_or_none

BATCH = 2**16
"""Rows read at a time."""


def _units(schema: pa.Schema) -> dict[str, str]:
    """Return the units that the metadata state: of a field, or in the ``attrs`` of a pandas DataFrame."""
    stated = {f.name: (f.metadata or {}).get(key, b"").decode("utf-8", "replace")
              for f in schema for key in (b"unit", b"units") if key in (f.metadata or {})}  # fmt: skip
    try:
        attrs = json.loads((schema.metadata or {}).get(b"PANDAS_ATTRS", b"{}"))
    except ValueError:
        attrs = {}
    for key in ("unit", "units"):
        found = attrs.get(key) if isinstance(attrs, dict) else None
        stated |= {str(name): str(text) for name, text in found.items()} if isinstance(found, dict) else {}
    return {name: unit for name, text in stated.items() if (unit := unit_or_none(text))}


class ParquetSource:
    """A Parquet file."""

    angles, euler = "rad", ""

    def __init__(self, file: Path) -> None:
        self.file = file
        try:
            self._parquet = pyarrow.parquet.ParquetFile(file, page_checksum_verification=True)
            self.header: list[str] = self._parquet.schema_arrow.names
        except DAMAGED as error:
            raise InputError(f"{file}: not readable as Parquet: {reason(error)}") from None
        self.units: Mapping[str, str] = _units(self._parquet.schema_arrow)
        self.said = "units of the file's metadata" if self.units else ""

    def kind(self, name: str) -> pa.DataType:
        """Return the type of a column in the file."""
        return self._parquet.schema_arrow.field(name).type

    def numeric(self) -> set[str]:
        """Return the columns of a number type."""
        return {field.name for field in self._parquet.schema_arrow if is_number(field.type)}

    def rows_expected(self) -> int:
        """Return the number of rows."""
        return int(self._parquet.metadata.num_rows)

    def batches(self, names: list[str], exact: Collection[str] = ()) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers; a column of another type that is not in `exact` is an error."""
        for name in names:
            kind = self.kind(name)
            if name not in exact and not is_number(kind):
                found = f"{kind} {self.place(0, name)[1]!r}" if self.rows_expected() else str(kind)
                raise InputError(f"{self.file}: row 1, column {name!r}: expected a number, found {found}")
        for batch in self._read(names):
            columns = [as_number(column) for column in batch.columns]
            yield pa.RecordBatch.from_arrays(columns, names=batch.schema.names)

    def _read(self, names: list[str]) -> Iterator[pa.RecordBatch]:
        try:
            yield from self._parquet.iter_batches(batch_size=BATCH, columns=names)
        except DAMAGED as error:
            raise InputError(f"{self.file}: not readable as Parquet: {reason(error)}") from None

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the row (from 1) and the value of a cell."""
        before = 0
        for batch in self._read([column]):
            if row < before + batch.num_rows:
                return f"row {row + 1}", str(batch.column(0)[row - before].as_py())
            before += batch.num_rows
        raise AssertionError("the row was read before")
