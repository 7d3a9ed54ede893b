"""The interface of a log file: its header, its numbers in pieces, and the position of a value in the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol

import pyarrow as pa

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import readable
from hovercontrol.logs.log import PARQUET
from hovercontrol.logs.readers.tables import Tables

START = 1024
"""Bytes at the start of a file by which its format may be known."""


class Source(Protocol):
    """Interface between the reader and a file."""

    header: list[str]

    @property
    def units(self) -> Mapping[str, str]:
        """The units of the columns for which the file states one."""

    @property
    def said(self) -> str:
        """How the file is read, if that is not obvious; else empty."""

    @property
    def angles(self) -> str:
        """The unit of angles for which the file states none: ``rad`` or ``deg``."""

    @property
    def euler(self) -> str:
        """Order of the axes if three angles of a body are Euler angles; empty for a rotation vector."""

    def kind(self, name: str) -> pa.DataType:
        """Return the type in which :meth:`batches` gives a column that is listed in `exact`."""

    def numeric(self) -> set[str]:
        """Return the names of the columns that look like numbers at the start of the file."""

    def rows_expected(self) -> int:
        """Return the approximate number of rows."""

    def batches(self, names: list[str], exact: Collection[str] = ()) -> Iterator[pa.RecordBatch]:
        """Read columns of numbers as float64, with null for missing values; text in them is an error.

        Columns in `exact` have the type of :meth:`kind`: text, times, and numbers that a float would round.
        """

    def place(self, row: int, column: str) -> tuple[str, str]:
        """Return the user's name for the place of data row ``row`` (from 0), and the text of the cell."""


@dataclass(frozen=True)
class Format:
    """A format of log files.

    Attributes
    ----------
    name : str
        Name for users.
    suffixes : tuple of str
        File suffixes of this format, unless the content shows another format.
    reader : str
        ``module:function`` in :mod:`hovercontrol.logs.readers`; takes the path and returns a
        :class:`Source` or :class:`~hovercontrol.logs.readers.tables.Tables`.
    columns : str
        How columns are named, for the documentation.
    starts : tuple of bytes
        First bytes of such a file.
    library : str
        Package that reads it, if it is one of the extras ``logs`` and ``logs-all``.
    pattern : bytes
        Regular expression that the beginning of such a file matches.
    """

    name: str
    suffixes: tuple[str, ...]
    reader: str
    columns: str
    starts: tuple[bytes, ...] = ()
    library: str = ""
    pattern: bytes = b""

    def begins(self, start: bytes) -> bool:
        """Return whether these first bytes are those of such a file."""
        return bool(
            (self.starts and start.startswith(self.starts))
            or (self.pattern and re.match(self.pattern, start, re.DOTALL))
        )


#: First bytes of Vicon's exports, with and without a byte order mark.
_VICON = tuple(
    mark + name + end
    for mark in (b"", b"\xef\xbb\xbf")
    for name in (b"Segments", b"Trajectories", b"Joints", b"Model Outputs", b"Devices", b"Objects")
    for end in (b"\n", b"\r\n", b",")
)

#: All formats; a file of none of the others is read as CSV.
FORMATS = (
    Format("Parquet", PARQUET, "parquet:ParquetSource", "as in the file", (b"PAR1",)),
    Format("Motive (OptiTrack) CSV", (), "motive:motive", "`Body.x`, `Body.qx` ... `Body.qw` or `Body.rx`; m, rad; y is up",  # noqa: E501
           (b"Format Version,", b"\xef\xbb\xbfFormat Version,")),
    Format("Vicon CSV", (), "vicon:vicon", "`Body.x`, `Body.rx` (rotation vector), `Body:Marker.x`; m, rad", _VICON),  # noqa: E501
    Format("Qualisys TSV", (), "qualisys:qualisys", "`body.x`, `body.yaw`, `marker.x`; mm, deg", (), "",
           rb"(\xef\xbb\xbf)?NO_OF_FRAMES\t"),
    Format("ROS bag, MCAP", (".bag", ".mcap", ".db3"), "bag:bag", "`/odom/pose.pose.position.x`, `/odom/time` (recorded)",  # noqa: E501
           (b"#ROSBAG V2.0", b"\x89MCAP0\r\n", b"SQLite format 3\0"), "rosbags"),
    Format("PX4 ULog", (".ulg", ".ulog"), "ulog:ulog", "`vehicle_attitude/q[0]`; a second instance `topic[1]/...`",  # noqa: E501
           (b"ULog\x01\x12\x35",), "pyulog"),
    Format("ArduPilot log", (".bin",), "ardupilot:ardupilot", "`ATT/Yaw`, `IMU[0]/GyrZ`; units as the log states them",  # noqa: E501
           (b"\xa3\x95\x80",), "pymavlink"),
    Format("MATLAB", (".mat",), "matlab:matlab", "`time`, `log.x`, `log.pos[0]`", (b"MATLAB ",), "mat-io (version 7.3, timetables)"),  # noqa: E501
    Format("MDF 3 and 4", (".mf4", ".mdf"), "mdf:mdf",
           "the channel, `group/channel` where two have its name; units as the file states them", (b"MDF     ",), "asammdf"),  # noqa: E501
    Format("MAVLink telemetry", (".tlog",), "mavlink:mavlink", "`ATTITUDE/yaw`; units as MAVLink defines them", (), "pymavlink",  # noqa: E501
           rb"\x00[\x03-\x0f].{6}[\xfd\xfe]"),
    Format("ArduPilot log as text", (), "ardupilot_text:ardupilot_text", "`ATT/Yaw`, `IMU[0]/GyrZ`", (b"FMT, 128, 89",)),  # noqa: E501
    Format("HDF5", (".h5", ".hdf5"), "hdf5:hdf5", "the path, `log/x`, `log/pos[0]`; units of attributes", (b"\x89HDF\r\n",), "h5py"),  # noqa: E501
    Format("TDMS", (".tdms",), "tdms:tdms", "the channel, `group/channel` where two have its name", (b"TDSm",), "npTDMS"),  # noqa: E501
    Format("LVM", (".lvm",), "lvm:lvm", "`time` and the channels", (b"LabVIEW Measurement",), "lvm-read"),
    Format("CAN frames", (".blf", ".asc"), "can:can", "`Motion/Speed`, by a database (DBC) beside the file", (b"LOGG", b";$FILEVERSION"), "python-can, cantools",  # noqa: E501
           rb"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]+#|date \w+ \w+ +\d+ "),
    Format("NMEA 0183", (".nmea",), "nmea:nmea", "`RMC/lat`, `HDT/heading`; deg, m/s", (),
           "", rb"(\\[^\\]*\\)?\$[A-Z]{2,5}[A-Z0-9]{3},|[^\n$!]{0,64}[$!][A-Z]{2,5}[A-Z0-9]{3},[^\n]*\*[0-9A-F]{2}"),  # noqa: E501
    Format("GPX", (".gpx",), "gpx:gpx", "`time`, `lat`, `lon`", (), "", rb"\s*(\xef\xbb\xbf)?\s*(<\?xml.*?)?<gpx\b"),  # noqa: E501
    Format("FIT", (".fit",), "fit:fit", "`record/position_lat`, `gps_metadata/course`; units as the profile states them", (), "fitdecode",  # noqa: E501
           rb"[\x0c\x0e].{7}\.FIT"),
    Format("C3D", (".c3d",), "c3d:c3d", "`Marker.x`; units as the file states them", (), "ezc3d", rb"[\x02-\x08]\x50"),  # noqa: E501
    Format("TRC (motion capture)", (), "trc:trc", "`Marker.x`; m", (b"PathFileType\t",)),
    Format("CSV", (), "csv:CsvSource", "as in the header; without one by number: `1`, `2`"),
)  # fmt: skip


#: Files that are no logs of these formats: first bytes and their place, what it is, what reads it.
OTHERS = (
    (
        b"PK\x03\x04",
        0,
        "an archive (ZIP, a workbook of Excel, or NumPy's npz)",
        "unpack it, or save the sheet as CSV",
    ),
    (b"\xd0\xcf\x11\xe0", 0, "a workbook of an old Excel", "save the sheet as CSV"),
    (b"\x1f\x8b", 0, "compressed by gzip", "unpack it with gunzip"),
    (b"\x28\xb5\x2f\xfd", 0, "compressed by zstd", "unpack it with unzstd"),
    (b"ARROW1", 0, "an Arrow file (Feather)", "pyarrow.feather reads it; write Parquet"),
    (
        b"H Product:Blackbox",
        0,
        "a log of Betaflight or INAV",
        "blackbox_decode converts it to CSV",
    ),
    (b"IFHD", 0, "an ADTF recording", "adtf_dattool --export writes its streams as CSV"),
    (b"%PDF", 0, "a PDF document", "export the data as CSV"),
    (b"\x89PNG", 0, "a picture", "export the data as CSV"),
    (b"CDF", 0, "a netCDF file of version 3", "`nccopy -k nc4` writes it as HDF5"),
    (b"{", 0, "JSON", "write a CSV or Parquet table, such as pandas.read_json(file, lines=True).to_csv"),
    (b"\x7fELF", 0, "a program", "name its log instead"),
)


def open_log(file: Path) -> Source | Tables:
    """Open a file by its content, or else by its suffix.

    Raises
    ------
    InputError
        If there is no such file, it is not valid in its format, it has no header or a name twice in it, or a
        library is missing.
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
    """Open a file that contains one table.

    Raises
    ------
    InputError
        As :func:`open_log`; or if it contains several tables.
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
        If there is no such file, or its content or suffix shows that it is not a log.
    """
    bag = next(f for f in FORMATS if f.library == "rosbags")
    if file.is_dir() and ((file / "metadata.yaml").is_file() or any(file.glob("*.mcap"))):
        return bag  # ROS 2 records into a folder, and writes the metadata at the end
    readable(file, "a log file")
    suffix = file.suffix.lower()
    if suffix in (".toml", ".py", ".fmu"):
        raise InputError(f"{file}: expected a log (CSV or Parquet), found a {suffix} file")
    with file.open("rb") as stream:
        start = stream.read(START)
    for begin, at, what, reads in OTHERS:
        if start.startswith(begin, at):
            raise InputError(f"{file}: it seems to be {what}: {reads}")
    by_start = (f for f in FORMATS if f.begins(start))
    by_suffix = (f for f in FORMATS if suffix in f.suffixes)
    return next(by_start, None) or next(by_suffix, FORMATS[-1])
