"""Columns of files under names and in units of their own: ``psi`` is ``yaw_deg:deg``."""

from __future__ import annotations

from collections.abc import Container

from hovercontrol.core.units import conversion_factor, plain_si
from hovercontrol.errors import ArgumentError, InputError
from hovercontrol.logs.log import UNITS


def column_of(said: str, header: Container[str]) -> tuple[str, str]:
    """Return a file's column and its unit, from ``NAME`` or ``NAME:UNIT``.

    Parameters
    ----------
    said : str
        A name in the header as it stands is a name, colons and all.
    header : container of str
        The file's column names.

    Returns
    -------
    tuple of str
        The name; the unit, empty where none is given.

    Examples
    --------
    >>> column_of("yaw:deg", ["t", "yaw"]), column_of("imu:x", ["imu:x"]), column_of("t", ["t"])
    (('yaw', 'deg'), ('imu:x', ''), ('t', ''))
    """
    name, colon, unit = said.rpartition(":")
    return (name, unit.strip()) if colon and said not in header else (said, "")


def factor_to_si(name: str, unit: str, wanted: str = "") -> float:
    """Return what the numbers of a column in some unit are multiplied with.

    Parameters
    ----------
    name : str
        Of the column in a log: ``time``, ``psi``, an input.
    unit : str
        Of the numbers in the file; behind a minus they also have the other sign.
    wanted : str, optional
        Unit of the column in the log (default: of what is measured as known, else SI).

    Raises
    ------
    ArgumentError
        If there is no such unit, or it does not measure what the column holds.

    Examples
    --------
    >>> factor_to_si("time", "ms"), round(factor_to_si("rudder", "-deg", "rad"), 6)
    (0.001, -0.017453)
    """
    sign = -1.0 if unit.startswith("-") else 1.0
    plain = unit.removeprefix("-").strip()
    if not plain:
        return sign
    try:
        return sign * conversion_factor(plain, wanted or {"time": "s", **UNITS}.get(name) or plain_si(plain))
    except InputError as error:
        raise ArgumentError(f"column {name!r}, read as {unit!r}: {error}") from None
