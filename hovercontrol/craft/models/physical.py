"""Coefficients in newtons: the mass and the inertia of a craft convert them to accelerations and back."""

from __future__ import annotations

from hovercontrol.base.errors import InputError, shown
from hovercontrol.blocks.units import UnitError, conversion_factor, dimension, unit_text
from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.craft.models.motion import motion_symbols

#: Unit of each number of the body, and of what it carries: Newton's m u' = F, Euler's J r' = M.
BODY = {"mass": ("kg", "N"), "inertia": ("kg*m^2", "N*m")}


def carried_by(cls: type[Effect]) -> str:
    """Return which number of the body turns an effect's coefficient into a force: ``""`` for none.

    Examples
    --------
    >>> from hovercontrol.craft.effects import effect_class
    >>> [carried_by(effect_class(n)) for n in ("sway_coulomb", "rudder_torque", "input_delay")]
    ['mass', 'inertia', '']
    """
    if isinstance(cls.numbers.get("value"), Shape | None):
        return ""
    axes = set(cls.small().terms(cls.small().symbols("plant"), motion_symbols()))
    return "inertia" if axes == {"r"} else "mass" if axes and "r" not in axes else ""


def force_unit(part: str, unit: str) -> str:
    """Return the unit of a coefficient of that `unit` times mass or inertia.

    Examples
    --------
    >>> [force_unit("mass", unit) for unit in ("m/s^2", "1/s", "1/m", "m/s^2/A", "m/s^2/N")]
    ['N', 'N*s/m', 'N*s^2/m^2', 'N/A', '1']
    >>> [force_unit("inertia", unit) for unit in ("rad/s^2", "1/s", "rad/s^2/N")]
    ['N*m', 'N*m*s', 'm']
    """
    body, force = BODY[part]
    whole = tuple(a + b for a, b in zip(dimension(unit), dimension(body), strict=True))
    if whole[0] != 1 or whole == dimension("kg"):  # of an input that is a force, and of an added mass
        return unit_text(whole)
    rest = unit_text(tuple(a - b for a, b in zip(whole, dimension(force), strict=True)))
    above, *below = rest.split("/")
    return "/".join([force if above == "1" else f"{force}*{above}", *below])


def coefficient_of(
    cls: type[Effect], value: float, unit: str, wanted: str, body: dict[str, float | None]
) -> float:
    """Return an effect's coefficient in the unit `wanted`, given in a unit like it or like a force.

    Raises
    ------
    UnitError
        If the unit is neither, or is one of a force and the body has no mass (of a torque, no inertia).
    """
    part = carried_by(cls)
    force = force_unit(part, wanted) if part else ""
    try:
        if not force or dimension(unit) != dimension(force):
            return value * conversion_factor(unit, wanted)
        factor = conversion_factor(unit, force)
    except InputError:
        other = f" or {force!r}" if force and body[part] is not None else ""
        raise UnitError(f"unit must be like {wanted!r}{other}, found {shown(unit)}") from None
    size = body[part]
    if size is None:
        raise UnitError(
            f"the unit {unit!r} needs the craft's {part} [{BODY[part][0]}] ([plant] {part} = ... in a model "
            f"file, Model(..., {part}=...)); without it the unit must be like {wanted!r}"
        )
    return value * factor / size
