"""Column specifications with the file's own name and unit: ``psi`` is ``yaw_deg:deg``."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping

from hovercontrol.base.errors import ArgumentError, InputError
from hovercontrol.blocks.units import conversion, dimension, plain_si
from hovercontrol.logs.log import UNITS
from hovercontrol.logs.readers.dialect import unit_in_name

#: Units that people write at the end of a column's name, and are not those of a log.
NAMED = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees"), "deg"),
    **dict.fromkeys(("dps", "degps"), "deg/s"),
    **{unit: unit for unit in ("mm", "cm", "km", "ms", "us", "ns", "rpm")},
    **{"millis": "ms", "micros": "us", "nanos": "ns", "mv": "mV", "ma": "mA"},
}


def unit_at_end(name: str) -> str:
    """Return the unit at the end of a column's name, empty if there is none.

    Examples
    --------
    >>> unit_at_end("yaw_deg"), unit_at_end("t (ms"), unit_at_end("x")
    ('deg', 'ms', '')
    """
    return NAMED.get(re.split(r"[^A-Za-z]", name.strip())[-1].lower(), "")


def column_of(said: str, header: Container[str]) -> tuple[str, str]:
    """Return a file's column and its unit, from ``NAME`` or ``NAME:UNIT``.

    Parameters
    ----------
    said : str
        The specification. A name in the header is taken as a whole, even if it contains colons. A name with
        its unit in brackets is that of a column whose unit was read from there.
    header : container of str
        The file's column names.

    Returns
    -------
    tuple of str
        The name, and the unit (empty if none is given).

    Examples
    --------
    >>> column_of("yaw:deg", ["t", "yaw"]), column_of("imu:x", ["imu:x"]), column_of("t", ["t"])
    (('yaw', 'deg'), ('imu:x', ''), ('t', ''))
    >>> column_of("yaw [deg]", ["t", "yaw"]), column_of("yaw [deg]", ["yaw [deg]"])
    (('yaw', 'deg'), ('yaw [deg]', ''))
    """
    if said in header:
        return said, ""
    name, unit = unit_in_name(said)
    if unit and name in header:
        return name, unit
    name, colon, unit = said.rpartition(":")
    if not colon:
        return said, ""
    plain, stated = unit_in_name(name)
    return plain if stated and name not in header and plain in header else name, unit.strip()


def conversion_to_si(name: str, unit: str, wanted: str = "") -> tuple[float, float]:
    """Return factor a and offset b that convert the numbers x of a column to the log's unit: a x + b.

    Parameters
    ----------
    name : str
        Name of the column in a log: ``time``, ``psi``, an input.
    unit : str
        Unit of the numbers in the file; a leading minus also flips the sign (alone, of what the file states).
    wanted : str, optional
        Unit of the column in the log (default: that of time, pose and velocity where known, else SI).

    Raises
    ------
    ArgumentError
        If there is no such unit, or its dimension does not fit the column.

    Examples
    --------
    >>> conversion_to_si("time", "ms"), conversion_to_si("water", "degC"), conversion_to_si("x", "-mm")
    ((0.001, 0.0), (1.0, 273.15), (-0.001, 0.0))
    """
    sign = -1.0 if unit.startswith("-") else 1.0
    plain = unit.removeprefix("-").strip()
    if not plain:
        return sign, 0.0
    try:
        factor, offset = conversion(plain, wanted or {"time": "s", **UNITS}.get(name) or plain_si(plain))
    except InputError as error:
        raise ArgumentError(f"column {name!r}, read as {unit!r}: {error}") from None
    return sign * factor, offset


def unit_hints(
    file: str, names: Mapping[str, str], known: Container[str], wanted: Mapping[str, str]
) -> list[str]:
    """Return a line for each column that is read in one unit while its name ends in another.

    Parameters
    ----------
    file : str
        For the lines.
    names : mapping of str to str
        The file's column name for each signal name.
    known : container of str
        Signal names of the columns whose unit is known.
    wanted : mapping of str to str
        Units in which signals are read.

    Examples
    --------
    >>> unit_hints("a.csv", {"angle": "arm_deg", "x": "x_m"}, {}, {"angle": "rad", "x": "m"})
    ["a.csv: column 'arm_deg' is read in rad; if it is in deg: --columns angle=arm_deg:deg"]
    """
    lines = []
    for ours, theirs in names.items():
        unit = unit_at_end(theirs)
        read = {"time": "s", **UNITS, **wanted}.get(ours, "")
        if not unit or not read or ours in known or dimension(unit) != dimension(read):
            continue
        if conversion(unit, read) != (1.0, 0.0):
            option = f"--columns {ours}={theirs}:{unit}"
            lines.append(f"{file}: column {theirs!r} is read in {read}; if it is in {unit}: {option}")
    return lines


def conversions_of_file(
    file: str,
    units: Mapping[str, str],
    names: Mapping[str, str],
    said: Container[str],
    wanted: Mapping[str, str],
) -> dict[str, tuple[float, float]]:
    """Return factor and offset of the columns whose units the file itself states.

    Parameters
    ----------
    file : str
        For error messages.
    units : mapping of str to str
        Units by the file's column names.
    names : mapping of str to str
        The file's column name for each signal name.
    said : container of str
        Signal names of the columns whose unit the user gave.
    wanted : mapping of str to str
        Units to which inputs are converted.

    Raises
    ------
    InputError
        If the unit of time, pose, velocity or an input has the wrong dimension.
    """
    found = {}
    for ours, theirs in names.items():
        if ours in said or theirs not in units:
            continue
        try:
            linear = conversion_to_si(ours, units[theirs], wanted.get(ours, ""))
        except ValueError as error:  # an InputError, or a text that is too long for a unit
            if ours in wanted or ours in ("time", *UNITS):
                raise InputError(f"{file}: {error}; another unit: --columns {ours}={theirs}:UNIT") from None
            continue  # the column is not used
        if linear != (1.0, 0.0):
            found[ours] = linear
    return found


def with_angles(
    stated: Mapping[str, str], angles: str, names: Mapping[str, str], wanted: Mapping[str, str]
) -> dict[str, str]:
    """Return the units of a file's columns, with those of angles if the file measures them in degrees.

    Parameters
    ----------
    stated : mapping of str to str
        Units that the file states, by its column names.
    angles : str
        Unit of the other angles of the file: ``rad`` or ``deg``.
    names : mapping of str to str
        The file's column name for each signal name.
    wanted : mapping of str to str
        Units of the model's signals.

    Examples
    --------
    >>> with_angles({"x": "mm"}, "deg", {"x": "x", "psi": "yaw", "r": "gyro"}, {})
    {'x': 'mm', 'yaw': 'deg', 'gyro': 'deg/s'}
    """
    units = dict(stated)
    for ours, theirs in names.items() if angles != "rad" else ():
        unit = {**UNITS, **wanted}.get(ours, "")
        if theirs not in units and re.match(r"rad\b", unit):
            units[theirs] = re.sub(r"^rad\b", angles, unit)
    return units
