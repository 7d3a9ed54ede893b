"""A file of columns, read in pieces: its header, its numbers, and the place of a value in it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol

import pyarrow as pa

from hovercontrol.errors import InputError
from hovercontrol.io.files import readable
from hovercontrol.logs.log import PARQUET
from hovercontrol.logs.readers.tables import Tables

START = 64
"""Bytes at the start of a file by which its format may be known."""


class Source(Protocol):
    """What the reader asks of a file."""

    header: list[str]

    @property
    def units(self) -> Mapping[str, str]:
        """The units of columns where the file states them."""

    @property
    def said(self) -> str:
        """How the file is read, where that is not plain."""

    def kind(self, name: str) -> pa.DataType:
        """Return the type of a column as :meth:`batches` gives it exactly."""

    def numeric(self) -> set[str]:
        """Return the names of the columns that look like numbers at the start of the file."""

    def rows_expected(self) -> int:
        """Return about how many rows there are."""

    def batches(self, names: list[str], exact: Collection[str] = ()) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers as float64, missing ones null; text in them is an error.

        Columns in `exact` come as :meth:`kind` says: text, times, and numbers that a float would round.
        """

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return where data row ``row`` (from 0) stands for the user, and what is written there."""


@dataclass(frozen=True)
class Format:
    """A format of log files.

    Attributes
    ----------
    name : str
        What users call it.
    suffixes : tuple of str
        Names that end so are of this format, unless the content is of another.
    reader : str
        ``module:function`` in :mod:`hovercontrol.logs.readers`; takes the path and returns a
        :class:`Source` or :class:`~hovercontrol.logs.readers.tables.Tables`.
    columns : str
        How columns are called, for the documentation.
    starts : tuple of bytes
        How such a file begins.
    library : str
        Package that reads it, where that comes with the extra ``logs``.
    """

    name: str
    suffixes: tuple[str, ...]
    reader: str
    columns: str
    starts: tuple[bytes, ...] = ()
    library: str = ""


#: How the exports of Vicon begin, with and without a byte order mark.
_VICON = tuple(
    mark + name + end
    for mark in (b"", b"\xef\xbb\xbf")
    for name in (b"Segments", b"Trajectories", b"Joints", b"Model Outputs", b"Devices", b"Objects")
    for end in (b"\n", b"\r\n", b",")
)

#: All formats; CSV is what is none of the others.
FORMATS = (
    Format("Parquet", PARQUET, "parquet:ParquetSource", "as in the file", (b"PAR1",)),
    Format("Motive (OptiTrack) CSV", (), "motive:motive", "`Body.x`, `Body.qx` ... `Body.qw` or `Body.rx`; m, rad; y is up",  # noqa: E501
           (b"Format Version,", b"\xef\xbb\xbfFormat Version,")),
    Format("Vicon CSV", (), "vicon:vicon", "`Body.x`, `Body.rx` (rotation vector), `Body:Marker.x`; m, rad", _VICON),  # noqa: E501
    Format("ROS bag, MCAP", (".bag", ".mcap", ".db3"), "bag:bag", "`/odom/pose.pose.position.x`, `/odom/time` (recorded)",  # noqa: E501
           (b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\0"), "rosbags"),
    Format("PX4 ULog", (".ulg", ".ulog"), "ulog:ulog", "`vehicle_attitude/q[0]`; a second instance `topic[1]/...`",  # noqa: E501
           (b"ULog\x01\x12\x35",), "pyulog"),
    Format("ArduPilot log", (".bin",), "ardupilot:ardupilot", "`ATT/Yaw`, `IMU[0]/GyrZ`; units as the log states them",  # noqa: E501
           (b"\xa3\x95\x80",), "pymavlink"),
    Format("MATLAB, to version 7", (".mat",), "matlab:matlab", "`time`, `log.x`, `log.pos[0]`", (b"MATLAB ",)),  # noqa: E501
    Format("MDF 3 and 4", (".mf4", ".mdf"), "mdf:mdf",
           "the channel, `group/channel` where two have its name; units as the file states them", (b"MDF     ",), "asammdf"),  # noqa: E501
    Format("CSV", (), "csv:CsvSource", "as in the header"),
)  # fmt: skip


def open_log(file: Path) -> Source | Tables:
    """Open a file by its content, or else by its suffix.

    Raises
    ------
    InputError
        No such file, not of its format, no header, a name twice in the header, or a library is missing.
    """
    found = format_of(file)
    module, _, name = found.reader.partition(":")
    reader: Callable[[Path], Source | Tables] = getattr(
        import_module(f"hovercontrol.logs.readers.{module}"), name
    )
    source = reader(file)
    seen: set[str] = set()
    for column in source.header:
        if column and column in seen:
            raise InputError(f"{file}: column {column!r} appears twice in the header")
        seen.add(column)
    return source


def open_source(file: Path) -> Source:
    """Open a file that holds one table.

    Raises
    ------
    InputError
        As :func:`open_log`; or if it holds several.
    """
    found = open_log(file)
    if isinstance(found, Tables):
        if len(found.tables) == 1:
            return found.tables[0]
        raise InputError(
            f"{file}: expected one table, found {len(found.tables)} topics ({found.tables[0].name}, ...)"
        )
    return found


def format_of(file: Path) -> Format:
    """Return the format of a file.

    Raises
    ------
    InputError
        If there is no such file, or it is known not to be a log.
    """
    bag = next(f for f in FORMATS if f.library == "rosbags")
    if file.is_dir() and (file / "metadata.yaml").is_file():  # ROS 2 records into a folder
        return bag
    readable(file, "a log file")
    suffix = file.suffix.lower()
    if suffix in (".toml", ".py", ".fmu"):
        raise InputError(f"{file}: expected a log (CSV or Parquet), found a {suffix} file")
    with file.open("rb") as stream:
        start = stream.read(START)
    by_start = (f for f in FORMATS if f.starts and start.startswith(f.starts))
    by_suffix = (f for f in FORMATS if suffix in f.suffixes)
    return next(by_start, None) or next(by_suffix, FORMATS[-1])
