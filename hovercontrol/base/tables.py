"""TOML files and checks of their keys and values."""

from __future__ import annotations

import csv
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any

from hovercontrol.base.errors import InputError, check_known, shown
from hovercontrol.base.files import readable, reason

#: Bytes of the largest TOML file that is read.
LARGEST = 4 * 2**20


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return a TOML file's content.

    Raises
    ------
    InputError
        If the file is not there or is not TOML; the line says where.
    """
    file = readable(path, "a TOML file")
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise InputError(
                f"{path}: expected a TOML file of {LARGEST / 2**20:.0f} MiB at most, found a larger"
            )
        written = content.decode()
        return tomllib.loads(written)
    except RecursionError:
        raise InputError(f"{path}: not readable as TOML: tables or lists are nested too deeply") from None
    except (ValueError, OSError) as error:  # no TOML, no UTF-8, a number of too many digits
        if isinstance(error, InputError):
            raise
        if isinstance(error, UnicodeDecodeError):
            raise InputError(f"{path}: not readable as TOML: expected text, found binary data") from None
        hint = _hint(written, str(error)) if isinstance(error, tomllib.TOMLDecodeError) else ""
        raise InputError(f"{path}: not readable as TOML: {reason(error)}{hint}") from None


def _hint(written: str, said: str) -> str:
    """Return a hint on a common mistake in the line of an error."""
    number = re.search(r"at line (\d+)", said)
    line = written.splitlines()[int(number[1]) - 1] if number else ""
    if re.search(r"=\s*[-+]?\d+,\d", line):
        return ": expected a decimal point, found a comma"
    if "overwrite" in said:
        return f": {shown(line.split('=')[0].strip())} occurs twice"
    return ""


def csv_rows(file: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a CSV file that are not empty, with their numbers."""
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            return [(k, row) for k, row in enumerate(csv.reader(stream), 1) if any(c.strip() for c in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: not readable as CSV: {error}") from None


def check_keys(kind: str, found: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raise if a key is unknown; `kind` names the keys ("effect", "key in [plant]")."""
    names = list(known)
    for key in found:
        check_known(key, names, f"unknown {kind} {shown(key)}")


def table(where: str, value: Any) -> dict[str, Any]:
    """Return a value that must be a table."""
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a table, found {shown(value)}")
    return value


def number(where: str, value: Any) -> float:
    """Return a value that must be a number, as a float."""
    try:
        if not isinstance(value, bool) and isinstance(value, Real) and not math.isnan(value):
            return float(value)
    except OverflowError:  # an integer beyond what a float holds
        pass
    raise InputError(f"{where} must be a number, found {shown(value)}")


def finite(where: str, value: Any) -> float:
    """Return a number that must be finite."""
    if not math.isfinite(number(where, value)):
        raise InputError(f"{where} must be a finite number, found {shown(value)}")
    return float(value)


def positive(where: str, value: Any) -> float:
    """Return a number that must be positive and finite."""
    if not 0 < number(where, value) < math.inf:
        raise InputError(f"{where} must be positive, found {shown(value)}")
    return float(value)


def not_negative(where: str, value: Any) -> float:
    """Return a number that must be 0 or more, and finite."""
    if not 0 <= number(where, value) < math.inf:
        raise InputError(f"{where} must not be negative, found {shown(value)}")
    return float(value)


def text(where: str, value: Any) -> str:
    """Return a value that must be text."""
    if not isinstance(value, str):
        raise InputError(f"{where} must be text, found {shown(value)}")
    return value
