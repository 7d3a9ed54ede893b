"""The logs of a fleet: where they are, of which craft each is, and when it was recorded."""

from __future__ import annotations

import glob
import hashlib
import importlib
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.logs import Log
from hovercontrol.logs.gather import split_files
from hovercontrol.logs.source import FORMATS

#: Endings of the files of a folder that are taken for logs.
SUFFIXES = tuple(sorted({s for f in FORMATS for s in f.suffixes} | {".csv", ".tsv"}))

#: A date in a name, with or without a time of day: 2026-11-28, 20261128_1405, 2026-11-28T14-05-30.
DATE = re.compile(
    r"(?<!\d)((?:19|20)\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])"
    r"(?:[T_ -]?([01]\d|2[0-3])[-:_h]?([0-5]\d)(?:[-:_m]?([0-5]\d))?)?(?!\d)"
)

#: Times before this one [s] count from the start of a recorder, or logs, not from 1970.
DATED = datetime(2000, 1, 1, tzinfo=UTC).timestamp()


def find(logs: Sequence[str], out: Path) -> list[str]:
    """Return the addresses of all logs, sorted: files, those in folders, and those that patterns match.

    Parameters
    ----------
    logs : sequence of str
        Paths, patterns (``*``), folders, or addresses with a protocol that fsspec knows (``s3://...``).
    out : path
        Folder of the results: what is in it is no log.

    Raises
    ------
    InputError
        If one of them has no log, or cannot be reached.
    """
    if not logs:
        raise InputError("fleet: expected logs: files, folders, patterns or addresses")
    found: dict[str, None] = {}
    for one in logs:
        if one.startswith("--"):
            raise InputError(f"fleet: expected logs, found {one}: does the option before it lack its value?")
        here = _remote(one) if "://" in one else _local(one, out)
        if not here:
            raise InputError(f"fleet: {one}: no log there: expected files ending in {', '.join(SUFFIXES)}")
        found |= dict.fromkeys(here)
    return sorted(found)


def _local(one: str, out: Path) -> list[str]:
    path = Path(one)
    if path.is_dir():
        own = out.resolve()
        inside = (p for p in path.rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())
        return [str(p) for p in inside if own not in p.resolve().parents and not _hidden(p.relative_to(path))]
    if not path.exists() and glob.has_magic(one):
        return [p for p in glob.glob(one, recursive=True) if Path(p).is_file()]
    for part in split_files(one):
        if not part.is_file():
            raise InputError(f"fleet: {part}: expected a log, a folder or a pattern; there is no such file")
    return [one]


def _hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _remote(one: str) -> list[str]:
    fs, path = _file_system(one)
    try:
        if glob.has_magic(one):
            names = fs.glob(path)
        else:
            names = [n for n in fs.find(path) if n.lower().endswith(SUFFIXES)] if fs.isdir(path) else [path]
            names = names if names != [path] or fs.exists(path) else []
    except Exception as error:  # each file system has errors of its own
        raise InputError(f"fleet: {one}: cannot be reached: {error or type(error).__name__}") from None
    return [str(fs.unstrip_protocol(name)) for name in names]


def _file_system(address: str) -> tuple[Any, str]:
    """Return the file system of an address, and the path in it."""
    try:
        fs, path = importlib.import_module("fsspec.core").url_to_fs(address)
    except ImportError as error:
        raise InputError(f"fleet: {address}: needs fsspec and its file system: {error}") from None
    except ValueError as error:
        raise InputError(f"fleet: {address}: {error}") from None
    return fs, path


@contextmanager
def local(address: str) -> Iterator[str]:
    """Give the path of a log on this machine; one from elsewhere is fetched for the ``with``."""
    if "://" not in address:
        yield address
        return
    fs, path = _file_system(address)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / PurePosixPath(path).name
        fs.get_file(path, str(file))
        yield str(file)


def digest(address: str) -> str:
    """Return the SHA-256 of a log's bytes.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        with local(address) as name:
            found = hashlib.sha256()
            for path in split_files(name):
                found.update(hashlib.sha256(path.read_bytes()).digest())
    except OSError as error:
        raise InputError(f"{address}: cannot be read: {error.strerror or error}") from None
    return found.hexdigest()


def bare_reason(log: str, why: str) -> str:
    """Return why a log is refused without the log's name: the same for all logs with that reason."""
    return why.replace(log, "").replace(log.rpartition("/")[2], "").lstrip(":, ")


def file_name(craft: str) -> str:
    """Return a craft's name as that of a file."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in craft)


class By:
    r"""The rule by which a log belongs to a craft.

    Parameters
    ----------
    text : str
        ``folder``, the name of the log's folder; a regular expression with a group, found in its address; or
        a column of the log.

    Examples
    --------
    >>> By("folder").craft("logs/boat7/a.csv", None), By(r"boat(\d+)").craft("logs/boat7/a.csv", None)
    ('boat7', '7')
    """

    def __init__(self, text: str) -> None:
        self.text, self.pattern = text, None
        if "(" in text:
            try:
                self.pattern = re.compile(text)
            except re.error as error:
                raise InputError(f"fleet: --by {text}: not a regular expression: {error}") from None
            if not self.pattern.groups:
                raise InputError(f"fleet: --by {text}: expected a group, such as 'boat(\\d+)'")

    @property
    def column(self) -> str:
        """The column to be read; empty if the address says it."""
        return "" if self.pattern or self.text == "folder" else self.text

    def craft(self, address: str, path: str | None) -> str:
        """Return the craft of a log, by its address, or by the column of its file.

        Raises
        ------
        InputError
            If the address or the column does not tell one craft.
        """
        if self.pattern is not None:
            found = self.pattern.search(address)
            if found is None:
                raise InputError(f"no craft: --by {self.text} does not match the address")
            return "-".join(g for g in found.groups() if g)
        if self.text == "folder":
            return PurePosixPath(address.replace("\\", "/")).parent.name or "."
        return _value(str(path), self.text)


def _value(path: str, column: str) -> str:
    """Return the one value of a column, which may be text."""
    import pyarrow.csv
    import pyarrow.parquet

    from hovercontrol.logs.read import header_of

    file = split_files(path)[0]
    if column not in (names := header_of(file, {})):
        raise ArgumentError(
            f"{file.name}: no column {column!r}, by which logs belong to craft; found {', '.join(names)}"
        )
    parquet = file.suffix.lower() in (".parquet", ".pq")
    table = pyarrow.parquet.read_table(file, columns=[column]) if parquet else pyarrow.csv.read_csv(file)
    values = {str(v) for v in table[column].unique().to_pylist() if v is not None}
    if len(values) != 1:
        raise InputError(f"{file.name}: expected one craft in column {column!r}, found {len(values)}")
    return values.pop()


def recorded(address: str, log: Log) -> tuple[float | None, str]:
    """Return when a log was recorded [s since 1970, UTC], and what says so: its name, its clock or ""."""
    for text in reversed(PurePosixPath(address.replace("\\", "/")).parts[-3:]):
        found = DATE.search(text)
        if found:
            numbers = [int(n) if n else 0 for n in found.groups()]
            try:
                return datetime(*numbers, tzinfo=UTC).timestamp(), "name"  # type: ignore[misc, arg-type]
            except ValueError:  # 30 February
                continue
    begin = 1e-9 * log.origin + float(log.time[0]) if log.origin else 0.0
    return (begin, "clock") if begin > DATED else (None, "")
