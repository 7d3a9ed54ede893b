"""ZIP archives of FMUs from unknown sources: checked before they are unpacked or parsed.

Names, counts and sizes are checked in the archive's directory first. The same limits then apply to the
unpacked bytes, whatever the directory declares. A streaming parser reads ``modelDescription.xml`` and stops
at the first document type declaration, so no entity is expanded.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import stat
import struct
import unicodedata
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

from hovercontrol.base.errors import InputError

MIB = 2**20
_CHUNK = MIB
#: Python's zipfile reads an archive's directory in one piece; this bounds it.
_LONGEST_READ = 8 * MIB
_ENCODINGS = {"UTF-8", "UTF8", "US-ASCII", "ASCII", "ISO-8859-1", "LATIN1"}
#: Names that mean a device on Windows, with any suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)


class Limits(NamedTuple):
    """Limits of an archive."""

    archive: int = 1024 * MIB  # bytes of the file
    total: int = 1024 * MIB  # bytes unpacked
    description: int = 100 * MIB  # bytes of modelDescription.xml
    ratio: int = 200  # bytes unpacked for one packed, beyond the first MiB
    entries: int = 10_000
    depth: int = 32  # folders within folders
    path: int = 1_000  # characters of one name
    elements: int = 2_000_000  # of modelDescription.xml
    nesting: int = 64  # elements within elements


LIMITS = Limits()


class Header(NamedTuple):
    """The first element of a model description."""

    tag: str
    attributes: dict[str, str]


class Archive:
    """An FMU's archive whose directory has been checked; made by :func:`open_archive`."""

    def __init__(self, path: Path, file: zipfile.ZipFile, size: int, limits: Limits) -> None:
        self.path, self._file, self._limits = path, file, limits
        self._left = min(limits.total, limits.ratio * size + MIB)  # bytes that may still come out
        self._entries: dict[str, zipfile.ZipInfo] = {}
        for info in _checked(path, file.infolist(), size, limits):
            first = self._entries.setdefault(info.filename, info)
            if first is not info and not info.is_dir() and self._digest(first) != self._digest(info):
                raise InputError(f"{path}: entry {info.filename!r} occurs twice, with different content")

    @property
    def names(self) -> list[str]:
        """The names of the files, without folders."""
        return [name for name, info in self._entries.items() if not info.is_dir()]

    def read(self, name: str, limit: int) -> bytes:
        """Return one file's bytes, at most `limit` of them.

        Raises
        ------
        InputError
            If the file does not exist, is larger or is broken.
        """
        out = io.BytesIO()
        self._copy(self._entry(name), out.write, limit)
        return out.getvalue()

    def unpack(self, folder: Path, wanted: Callable[[str], bool]) -> None:
        """Write the files selected by `wanted` to a folder.

        Raises
        ------
        InputError
            If unpacked bytes exceed the limits, or an entry is broken.
        """
        for name in filter(wanted, self.names):
            target = folder / name  # _checked made sure that this stays below the folder
            target.parent.mkdir(parents=True, exist_ok=True)
            with open(target, "xb") as out:
                self._copy(self._entry(name), out.write, self._limits.total)

    def _entry(self, name: str) -> zipfile.ZipInfo:
        info = self._entries.get(name)
        if info is None:
            raise InputError(f"{self.path}: expected an FMU, found an archive without {name}")
        return info

    def _digest(self, info: zipfile.ZipInfo) -> bytes:
        content = hashlib.sha256()
        self._copy(info, content.update, self._limits.total)
        return content.digest()

    def _copy(self, info: zipfile.ZipInfo, write: Callable[[bytes], object], limit: int) -> None:
        name, written = info.filename, 0
        try:
            with self._file.open(info) as source:
                while data := source.read(_CHUNK):
                    written += len(data)
                    self._left -= len(data)
                    if written > limit or self._left < 0:
                        raise InputError(
                            f"{self.path}: entry {name!r} unpacks to more than the limit of an FMU"
                        )
                    write(data)
        except InputError:
            raise
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError) as error:
            raise InputError(f"{self.path}: entry {name!r} is broken: {_line(error)}") from None
        if written != info.file_size:
            raise InputError(
                f"{self.path}: entry {name!r} is broken: {info.file_size} bytes declared, {written} found"
            )


@contextlib.contextmanager
def open_archive(path: str | Path, limits: Limits = LIMITS) -> Iterator[Archive]:
    """Open an FMU's archive and check its directory; nothing is unpacked.

    Parameters
    ----------
    limits : Limits, optional
        What the archive may hold at most.

    Raises
    ------
    InputError
        If the file is not a ZIP archive, or one that could write outside its folder, hide a file, fill the
        disk, or needs a password. The message names the entry.
    """
    path = Path(path)
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # to open a pipe would wait for its other end
            raise InputError(f"{path} is not a file")
        raw = _Bounded(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    with raw:
        size = os.fstat(raw.fileno()).st_size
        if size > limits.archive:
            raise InputError(f"{path} has {size} bytes, more than the limit of {limits.archive}")
        try:
            file = zipfile.ZipFile(raw)
        except (zipfile.BadZipFile, NotImplementedError, struct.error, ValueError, OSError) as error:
            raise InputError(f"{path} is not an FMU: {_line(error)}") from None
        with file:
            yield Archive(path, file, size, limits)


class _Bounded(io.FileIO):
    """A file that is read in pieces of bounded size."""

    def read(self, size: int | None = -1, /) -> bytes:
        left = os.fstat(self.fileno()).st_size - self.tell()
        wanted = left if size is None or size < 0 else min(size, left)
        if wanted > _LONGEST_READ:
            raise zipfile.BadZipFile(f"a directory of {wanted} bytes")
        return super().read(max(wanted, 0)) or b""


def _checked(
    path: Path, infos: list[zipfile.ZipInfo], size: int, limits: Limits
) -> Iterator[zipfile.ZipInfo]:
    """Yield the entries; raise at the first forbidden one.

    Some writers add a file twice: a repetition with the same name, size and checksum is accepted.
    """
    if len(infos) > limits.entries:
        raise InputError(f"{path} holds {len(infos)} entries; an FMU may hold {limits.entries}")
    total = sum(info.file_size for info in infos)
    if total > limits.total:
        raise InputError(f"{path} would unpack to {total} bytes, more than the limit of {limits.total}")
    if total > limits.ratio * size + MIB:
        raise InputError(f"{path} would unpack to {total} bytes, more than {limits.ratio} times its size")
    files: dict[str, str] = {}
    folders: dict[str, str] = {}
    alike: dict[str, tuple[int, int]] = {}
    for info in infos:
        if reason := _fault(info, limits):
            raise InputError(f"{path}: entry {info.orig_filename!r} {reason}")
        parts = info.filename.rstrip("/").split("/")
        for n in range(1, len(parts) + 1):
            name, last = "/".join(parts[:n]), n == len(parts)
            key = _folded(name)
            is_file = last and not info.is_dir()
            other = files.get(key) or (folders.get(key) if is_file else None)
            if is_file and name in alike and alike[name] == (info.file_size, info.CRC):
                continue
            if other is None and not is_file and folders.setdefault(key, name) != name:
                other = folders[key]
            if other is not None:
                raise InputError(
                    f"{path}: entry {info.filename!r} has the same path as {other!r} on some systems"
                )
            if is_file:
                files[key], alike[name] = name, (info.file_size, info.CRC)
    ends = 0
    for info in sorted(
        {(i.header_offset, i.filename): i for i in infos}.values(), key=lambda i: i.header_offset
    ):
        if info.header_offset < ends:
            raise InputError(f"{path}: entry {info.filename!r} overlaps another entry")
        ends = info.header_offset + 30 + info.compress_size
    yield from infos


def _fault(info: zipfile.ZipInfo, limits: Limits) -> str | None:
    """Return the fault of a single entry, if any."""
    name = info.orig_filename
    parts = info.filename.rstrip("/").split("/")
    kind = stat.S_IFMT(info.external_attr >> 16)
    if "\\" in name:
        return "has a backslash in its name"
    if name.startswith("/") or re.match(r"[A-Za-z]:", name):
        return "has an absolute name"
    if ".." in parts:
        return "has a path outside the FMU"
    if ":" in name or any(ord(c) < 32 or ord(c) == 127 for c in name) or {"", "."} & set(parts):
        return "has a name that is none on every system"
    if any(_DEVICES.fullmatch(p) or len(p.encode("utf-8", "replace")) > 255 for p in parts):
        return "has a name that is none on every system"
    if len(name) > limits.path or len(parts) > limits.depth:
        return f"has a longer name than {limits.path} characters or lies deeper than {limits.depth} folders"
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link" if kind == stat.S_IFLNK else "is not a regular file"
    if info.flag_bits & 0x2041:
        return "is encrypted"
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "is compressed by another method than deflate"
    if info.file_size > limits.ratio * info.compress_size + MIB:
        return f"would unpack to more than {limits.ratio} times its packed size"
    return None


def _folded(name: str) -> str:
    """Return a normal form of names that some file systems do not distinguish."""
    parts = (part.rstrip(". ") for part in unicodedata.normalize("NFC", name).casefold().split("/"))
    return "/".join(parts)


def check_xml(data: bytes, where: str, limits: Limits = LIMITS) -> Header:
    """Check a model description with a parser that expands no entities; return its first element.

    Parameters
    ----------
    where : str
        Prefix of messages: the file.

    Raises
    ------
    InputError
        If it is not well-formed XML, declares a document type or entities, has an encoding that FMI does not
        allow, or exceeds the limits of nesting or length.
    """
    if b"\0" in data or data[:2] in (b"\xfe\xff", b"\xff\xfe"):
        raise InputError(f"{where}: expected XML in UTF-8")
    first: list[Header] = []
    depth = count = 0

    def declaration(_version: str, encoding: str | None, _standalone: int) -> None:
        if encoding is not None and encoding.upper() not in _ENCODINGS:
            raise InputError(f"{where}: expected XML in UTF-8, found the encoding {encoding!r}")

    def refuse(*_: object) -> None:
        raise InputError(f"{where}: expected no document type and no entities")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > limits.nesting or count > limits.elements:
            raise InputError(f"{where}: more than {limits.nesting} levels or {limits.elements} elements")
        if not first:
            first.append(Header(tag, attributes))

    def end(_tag: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.XmlDeclHandler = declaration
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise InputError(f"{where} is not XML: {error}") from None
    return first[0]


def _line(error: BaseException) -> str:
    """Return an exception's text in one line."""
    return " ".join(str(error).split()) or type(error).__name__
