"""TOML files and what is checked of every one: which keys there are, and that numbers are numbers."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any

from hovercontrol.errors import InputError, did_you_mean


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return a TOML file's content.

    Raises
    ------
    InputError
        If the file is not there or is not TOML; the line says where.
    """
    try:
        with Path(path).open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise InputError(f"{path}: not readable as TOML: {error}") from None


def check_keys(kind: str, found: Mapping[str, Any], known: Iterable[str]) -> None:
    """Refuse a key that is not known; `kind` says what the keys are ("effect", "key in [plant]")."""
    names = list(known)
    for key in found:
        if key not in names:
            raise InputError(f"unknown {kind} {key!r}{did_you_mean(key, names)}")


def table(where: str, value: Any) -> dict[str, Any]:
    """Return a value that must be a table."""
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a table, found {value!r}")
    return value


def number(where: str, value: Any) -> float:
    """Return a value that must be a number, as a float."""
    if isinstance(value, bool) or not isinstance(value, Real) or math.isnan(value):
        raise InputError(f"{where} must be a number, found {value!r}")
    return float(value)


def positive(where: str, value: Any) -> float:
    """Return a number that must be positive and finite."""
    if not 0 < number(where, value) < math.inf:
        raise InputError(f"{where} must be positive, found {value!r}")
    return float(value)


def text(where: str, value: Any) -> str:
    """Return a value that must be text."""
    if not isinstance(value, str):
        raise InputError(f"{where} must be text, found {value!r}")
    return value
