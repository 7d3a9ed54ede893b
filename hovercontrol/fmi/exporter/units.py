"""Units of an FMU: names, exponents of the base units, display units, quantities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from hovercontrol.blocks.units import BASE, dimension
from hovercontrol.blocks.unitsyntax import parse_unit, registry

#: Degrees in a radian: FMI's factor from a unit to its display unit.
DEGREES = 180.0 / math.pi

#: Names of common quantities by exponents of m, kg, s, rad (ISO 80000).
_QUANTITIES: dict[tuple[int, ...], str] = {
    (0, 0, 0, 0): "Number",
    (1, 0, 0, 0): "Length",
    (1, 0, -1, 0): "Velocity",
    (1, 0, -2, 0): "Acceleration",
    (0, 0, 0, 1): "Angle",
    (0, 0, -1, 1): "AngularVelocity",
    (0, 0, -2, 1): "AngularAcceleration",
    (0, 0, 1, 0): "Time",
    (0, 0, -1, 0): "Rate",
    (0, 1, 0, 0): "Mass",
    (1, 1, -2, 0): "Force",
    (2, 1, -2, 0): "Torque",
    (2, 1, 0, 0): "MomentOfInertia",
}


@dataclass(frozen=True)
class Unit:
    """A unit as FMI describes it.

    Parameters
    ----------
    exponents : tuple of (str, int) or None
        Exponents of the base units, including ``rad``; empty for dimensionless numbers. None if FMI cannot
        express them: it has integer exponents only, and a noise density is in m/s^2.5.
    quantity : str
        A name for the type definition, such as ``AngularVelocity``.
    display : str or None
        The display unit where there is one (``deg/s``); its factor is :data:`DEGREES`.
    """

    name: str
    exponents: tuple[tuple[str, int], ...] | None
    quantity: str
    display: str | None


@cache
def fmi_unit(text: str, per_second: bool = False) -> Unit:
    """Return the FMI unit of a signal's unit, or of its time derivative.

    Parameters
    ----------
    text : str
        A signal's unit.

    Examples
    --------
    >>> fmi_unit("rad/s", per_second=True).name
    'rad/s^2'
    >>> fmi_unit("(m/s)*(rad/s)").exponents
    (('m', 1), ('s', -2), ('rad', 1))
    """
    unit = parse_unit(text)
    if per_second:
        unit = unit / registry().second
    name = f"{unit:~C}".replace("**", "^") or "1"
    dims = dimension(text)
    in_base_units = dict(registry().Quantity(1.0, unit).to_base_units().unit_items())
    powers = dict(zip(BASE, dims, strict=True))
    powers["s"] -= 1 if per_second else 0
    powers["rad"] = in_base_units.get("radian", 0)
    if any(int(power) != power for power in powers.values()):
        return Unit(name, None, _plain_name(name), None)
    exponents = [(base, int(power)) for base, power in powers.items() if power]
    known = dict(exponents)
    key = tuple(known.pop(base, 0) for base in ("m", "kg", "s", "rad"))
    quantity = _QUANTITIES.get(key, "") if not known else ""
    display = "deg" + name.removeprefix("rad") if _is_rate_of_angle(name) else None
    return Unit(name, tuple(exponents), quantity or _plain_name(name), display)


def _is_rate_of_angle(name: str) -> bool:
    return name in ("rad", "rad/s", "rad/s^2")


def _plain_name(unit: str) -> str:
    """Return an identifier for a unit without a named quantity: ``m2_per_s3``."""
    above, *below = unit.replace("^", "").replace("*", "_").replace(".", "_").split("/")
    return "_per_".join(["Quantity_" + above, *below])
