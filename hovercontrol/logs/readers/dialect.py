"""The dialect of a text table: separator, decimal mark, lines above the header, units below it, comments."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from hovercontrol.base.errors import InputError

HEAD = 2**16
"""Bytes at the start of a file from which its dialect is recognised."""

COMMENTS = ("#", "%", "//")

#: Separators in the order in which they are tried; a blank stands for any run of blanks and tabs.
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "blanks"}

_POINT = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.IGNORECASE)
_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_DATE = re.compile(r"\d{4}-\d\d-\d\d.*|\d\d\.\d\d\.\d{4}.*|\d\d:\d\d:\d\d.*")
_ONE = (
    r"(?:[numkcMµ]?(?:s|m|rad|g|N|Nm|V|A|W|Hz|Pa|J|bar)"
    r"|[mcd]?[lL](?=/)"  # litres in a flow: a column (L) is one on the left
    r"|sec|min|h|hr|in|inch|ft|deg|°|degC|°C|K|rpm|RPM|rev|kmh|kph|mph|T|uT|%|1)"
)
_UNIT = re.compile(rf"{_ONE}(?:\^?-?\d)?(?:[*/·. ]{_ONE}(?:\^?-?\d)?)*")
_CELL = re.compile(rf"({_POINT.pattern}|{_COMMA.pattern})(\s*{_UNIT.pattern})?|true|false", re.IGNORECASE)
_IN_DEGREES = re.compile(r"\s*in_?degrees\s*[=:]\s*(yes|true|1)\s*$", re.IGNORECASE)
_NAMED = re.compile(r"(.*\S)\s*(\[[^\[\]]*\]|\([^()]*\))\s*")
_NO_UNIT = frozenset({"", "-", "--", "1", "%", "none", "n/a"})


@dataclass(frozen=True)
class Dialect:
    """The dialect of a text table.

    Attributes
    ----------
    encoding : str
        Python's name of the encoding.
    separator : str
        Separator of cells; a blank stands for any run of blanks and tabs.
    decimal : str
        Decimal mark, ``.`` or ``,``.
    header, first : int
        Line numbers (from 0) of the header and of the first row of data.
    names, units : tuple of str
        Names and units of the columns; `units` is empty if the file states none.
    comments : bool
        Whether there are comment lines below the header.
    angles : str
        Unit of angles without a stated unit, as OpenSim's ``inDegrees=yes`` above the header says it.
    headless : bool
        Whether there is no header; the columns are then named ``1``, ``2``, ...
    """

    encoding: str = "utf-8-sig"
    separator: str = ","
    decimal: str = "."
    header: int = 0
    first: int = 1
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    comments: bool = False
    angles: str = "rad"
    headless: bool = False

    @property
    def text(self) -> str:
        """The differences from plain CSV, in words; empty for plain CSV."""
        said = []
        if self.encoding.startswith("utf-16"):
            said.append("UTF-16")
        if self.separator != ",":
            said.append(f"{SEPARATORS[self.separator]} between values")
        if self.decimal != ".":
            said.append("decimal commas")
        if self.headless:
            said.append(f"no header, columns named 1 to {len([*filter(None, self.names)])}")
        elif self.header:
            said.append(f"header in line {self.header + 1}")
        if self.units:
            said.append("a line of units below the header")
        if self.comments:
            said.append("comment lines")
        if self.angles != "rad":
            said.append(f"angles in {self.angles}")
        return ", ".join(said)

    @property
    def rewritten(self) -> bool:
        """Whether the text must be rewritten before a CSV parser can read it."""
        return self.encoding.startswith("utf-16") or self.separator == " " or self.comments

    def cells(self, line: str) -> list[str]:
        """Return the cells of one line."""
        if self.separator == " ":
            return line.split()
        return next(csv.reader([line], delimiter=self.separator), [])


def unit_in_name(name: str) -> tuple[str, str]:
    """Return a column's name and its unit, if the name ends in a unit in brackets; else the name and "".

    Examples
    --------
    >>> unit_in_name("x pos [mm]"), unit_in_name("yaw rate(deg/s)"), unit_in_name("xyz[2]")
    (('x pos', 'mm'), ('yaw rate', 'deg/s'), ('xyz[2]', ''))
    >>> unit_in_name("inlet [l/min]"), unit_in_name("wheel (L)")
    (('inlet', 'l/min'), ('wheel (L)', ''))
    """
    found = _NAMED.fullmatch(name)
    if not found or not _is_unit(inside := found[2][1:-1].strip()):
        return name, ""
    unit = _bare(inside)
    return (found[1], unit) if unit else (name, "")


def unit_in_cell(text: str) -> str:
    """Return the unit that a text after a number stands for, or an empty text.

    Examples
    --------
    >>> unit_in_cell("sec"), unit_in_cell("hr"), unit_in_cell("m/s"), unit_in_cell("days 00:00:01")
    ('s', 'h', 'm/s', '')
    """
    text = text.strip()
    return {"hr": "h"}.get(text, _bare(text)) if _UNIT.fullmatch(text) else ""


def without_units(header: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns without units in brackets, and the units; no name is there twice.

    Examples
    --------
    >>> without_units(["t [ms]", "y (m)", "y (mm)"])
    (['t', 'y (m)', 'y (mm)'], {'t': 'ms'})
    """
    pairs = [unit_in_name(name) for name in header]
    plain = [name for name, _ in pairs]
    units = {name: unit for name, unit in pairs if unit and plain.count(name) == 1}
    return [name if name in units else given for given, name in zip(header, plain, strict=True)], units


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    return line.lstrip().startswith(COMMENTS)


def recognise(head: bytes, file: str) -> Dialect:
    r"""Return the dialect of a text table, recognised from its first bytes.

    Parameters
    ----------
    head : bytes
        Up to :data:`HEAD` bytes.
    file : str
        Name of the file in error messages.

    Raises
    ------
    InputError
        If the bytes are not text.

    Examples
    --------
    >>> found = recognise(b"Run 7\nt;x\ns;mm\n0;1,5\n1;2,5\n", "a.csv")
    >>> found.names, found.units
    (('t', 'x'), ('s', 'mm'))
    >>> found.text
    'semicolons between values, decimal commas, header in line 2, a line of units below the header'
    """
    encoding, text = _decoded(head, file)
    lines = text.splitlines()
    if len(head) >= HEAD and len(lines) > 1:
        lines.pop()  # cut within the line
    plain = Dialect(encoding)
    if not encoding.startswith("utf-16") and _is_plain(lines):
        return plain
    for kind in (_with, _headless):
        found = [d for separator in SEPARATORS if (d := kind(replace(plain, separator=separator), lines))]
        if found:
            return max(found, key=lambda d: len(d.names))
    return plain


def _decoded(head: bytes, file: str) -> tuple[str, str]:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16", head[: len(head) // 2 * 2].decode("utf-16", errors="replace")
    if b"\0" in head:
        for encoding, odd in (("utf-16-le", 1), ("utf-16-be", 0)):
            zeros = head[odd::2].count(0)
            if zeros > 0.9 * len(head[odd::2]) and not head[1 - odd :: 2].count(0):
                return encoding, head[: len(head) // 2 * 2].decode(encoding, errors="replace")
        raise InputError(f"{file}: not a CSV file: expected text, found binary data")
    try:
        return "utf-8-sig", head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if error.start > len(head) - 4 and len(head) >= HEAD:  # cut within a letter
            return "utf-8-sig", head.decode("utf-8-sig", errors="replace")
        return "cp1252", head.decode("cp1252", errors="replace")


def _is_plain(lines: Sequence[str]) -> bool:
    """Return whether line 1 is a header of comma-separated names and the next line a row of numbers."""
    if not lines or is_comment(lines[0]):
        return False
    plain = Dialect()
    try:
        names = plain.cells(lines[0])
        below = [plain.cells(line) for line in lines[1:50] if line.strip()]
    except csv.Error:
        return True  # the reader reports the line
    if not below:
        return len(names) > 1 or not any(mark in lines[0] for mark in ";\t|")
    row = below[0]
    return (
        len(names) == len(row)
        and any(_POINT.fullmatch(cell.strip()) for cell in row)
        and not any(_POINT.fullmatch(name.strip()) for name in names)
        and not any(_COMMA.fullmatch(cell.strip()) for cells in below for cell in cells)
        and not any(is_comment(line) for line in lines)
    )


def _with(dialect: Dialect, lines: Sequence[str]) -> Dialect | None:
    """Return the completed dialect if, with its separator, a header is followed by rows of numbers."""
    try:
        rows = _rows(dialect, lines[:1000])
    except csv.Error:
        return None
    for at, header in enumerate(rows):
        below = [row for row in rows[at + 1 : at + 60] if not row.comment]
        names = header.cells
        if not is_header(names, least=2 if dialect.separator != "," else 1) or not below:
            continue
        units = units_below(names, below[0].cells)
        data = [row.cells for row in (below[1:] if units else below)]
        if not data or not _fits_header(names, data, dialect.separator):
            continue
        if header.comment and any(
            len(row.cells) == len(data[0]) and is_header(row.cells)
            for row in rows[at + 1 :]
            if not row.comment
        ):
            continue  # a header that is no comment follows
        first = below[1 if units else 0].line
        return replace(
            dialect,
            decimal="," if _has_decimal_comma(data) else ".",
            header=header.line,
            first=first,
            names=(*names, *[""] * (len(data[0]) - len(names))),
            units=units,
            comments=any(is_comment(text) for text in lines[first:]),
            angles="deg" if any(_IN_DEGREES.match(text) for text in lines[: header.line]) else "rad",
        )
    return None


class _Row(NamedTuple):
    """A line that is not empty: its number, whether it is a comment, and its cells."""

    line: int
    comment: bool
    cells: list[str]


def _rows(dialect: Dialect, lines: Sequence[str]) -> list[_Row]:
    rows = []
    for k, line in enumerate(lines):
        comment = is_comment(line)
        text = line.strip().lstrip("#%/") if comment else line
        rows.append(_Row(k, comment, [cell.strip() for cell in dialect.cells(text)]))
    return [row for row in rows if any(row.cells)]


def _fits_header(names: Sequence[str], data: Sequence[list[str]], separator: str) -> bool:
    """Return whether rows are data below names: as wide, or by one empty cell wider."""
    width = len(data[0])
    trailing = width == len(names) + 1 and not data[0][-1]
    alike = sum(len(cells) == width for cells in data)
    if (width != len(names) and not trailing) or 2 * alike < len(data):
        return False
    return all(_is_data(cells, separator) for cells in data[:3])


def _has_decimal_comma(data: Sequence[list[str]]) -> bool:
    point = any("." in cell and _POINT.fullmatch(cell) for row in data for cell in row)
    return _has_comma(data) and not point


def _has_comma(data: Sequence[list[str]]) -> bool:
    return any(_COMMA.fullmatch(cell) for row in data for cell in row)


def _headless(dialect: Dialect, lines: Sequence[str]) -> Dialect | None:
    """Return the completed dialect if, with its separator, the file has rows of numbers and no header.

    A first row that counts columns (0, 1, 2 or 1, 2, 3) may be a header: None.
    """
    rows = [(k, line) for k, line in enumerate(lines[:1000]) if line.strip() and not is_comment(line)]
    try:
        cells = [[cell.strip() for cell in dialect.cells(line)] for _, line in rows]
    except csv.Error:
        return None
    width = len(cells[0]) if cells else 0
    alike = [row for row in cells if len(row) == width and _all_numbers(row)]
    if not alike or alike[0] is not cells[0] or 2 * len(alike) <= len(cells):
        return None
    if any(cells[0] == [str(k + first) for k in range(width)] for first in (0, 1)):
        return None
    first, filled = rows[0][0], width - (width > 1 and not any(row[-1] for row in alike))
    return replace(
        dialect,
        decimal="," if _has_comma(alike) else ".",
        header=first,
        first=first,
        names=tuple(str(k + 1) if k < filled else "" for k in range(width)),
        comments=any(is_comment(text) for text in lines[first:]),
        headless=True,
    )


def _all_numbers(cells: Sequence[str]) -> bool:
    """Return whether all cells that are not blank are numbers or dates, with one decimal mark."""
    given = [cell for cell in cells if cell]
    points = all(_POINT.fullmatch(c) or _DATE.fullmatch(c) for c in given)
    commas = all(_COMMA.fullmatch(c) or re.fullmatch(r"[-+]?\d+", c) or _DATE.fullmatch(c) for c in given)
    return bool(given) and (points or commas)


def is_header(cells: Sequence[str], least: int = 2) -> bool:
    """Return whether cells are names: at least half of them are not empty, and none is a number."""
    named = [cell for cell in cells if cell]
    numbers = any(_POINT.fullmatch(cell) or _COMMA.fullmatch(cell) or _DATE.fullmatch(cell) for cell in named)
    return len(cells) >= least and 2 * len(named) >= len(cells) and not numbers


def _is_data(cells: Sequence[str], separator: str) -> bool:
    numbers = [c for c in cells if _CELL.fullmatch(c) or _DATE.fullmatch(c)]
    return bool(numbers) and 2 * len(numbers) >= len([cell for cell in cells if cell])


def units_below(names: Sequence[str], cells: Sequence[str]) -> tuple[str, ...]:
    """Return the units in the line below a header; none if it does not contain units.

    Examples
    --------
    >>> units_below(["t", "x", "run"], ["ms", "[mm]", "-"]), units_below(["t", "x"], ["0", "1"])
    (('ms', 'mm', ''), ())
    """
    bare = tuple(_bare(cell) for cell in cells)
    if len(cells) != len(names) or all(unit.lower() in _NO_UNIT for unit in bare):
        return ()
    return bare if all(_is_unit(cell) for cell in cells) else ()


def _bare(cell: str) -> str:
    found = re.fullmatch(r"\[(.*)\]|\((.*)\)|<(.*)>", cell)
    text = (next(part for part in found.groups() if part is not None) if found else cell).strip()
    if text.lower() in _NO_UNIT:
        return ""
    text = re.sub(r"([a-zA-Z])(-?\d)", r"\1^\2", text.replace("²", "^2"))
    for ours, theirs in (("°C", "degC"), ("°", "deg"), ("µ", "u"), ("μ", "u"), ("sec", "s"), ("·", "*")):
        text = text.replace(ours, theirs)
    return text


def _is_unit(cell: str) -> bool:
    """Return whether a cell is a unit; any text in brackets counts as one."""
    return not _bare(cell) or _bare(cell) != cell or bool(_UNIT.fullmatch(cell))
