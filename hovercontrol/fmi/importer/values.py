"""What a user gives an FMU, checked: its step and name, and values as its types can take them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.fmi.importer.interface import REALS, WHOLE, Interface, Variable


def checked_step(path: Path, interface: Interface, step: float | None) -> float:
    """Return the communication step [s]; raise :class:`InputError` where the FMU cannot take it."""
    if step is None:
        step = interface.step
        if step is None:
            raise InputError(f"{path} states no step size; give one: load({path.name!r}, step=...) [s]")
    if isinstance(step, bool) or not isinstance(step, (int, float)) or not 0 < step < math.inf:
        raise InputError(f"{path}: step [s] must be a positive number, found {step!r}")
    fixed = interface.fixed_step
    if fixed and abs(step / fixed - max(round(step / fixed), 1)) > 1e-6:
        raise InputError(f"{path}: step must be a multiple of the FMU's own {fixed:g} s, found {step:g} s")
    return float(step)


def checked_name(interface: Interface, name: str | None) -> str:
    """Return the system's name; raise :class:`InputError` where it is none."""
    if name is None:
        return interface.identifier
    if not isinstance(name, str) or not name or "." in name:
        raise InputError(f"a system's name is a word without dots, found {name!r}")
    return name


def parameter_key(name: str, label: str) -> str:
    """Return the key of a parameter: its name in the FMU, after the system's unless it begins so."""
    return label if label.startswith(f"{name}.") else f"{name}.{label}"


def own_parameters(
    params: Mapping[str, float], keys: Mapping[str, tuple[Variable, float]], prefix: str, pushed: bool
) -> dict[str, float]:
    """Return a system's own parameters among those given, by key; refuse what can only be a mistake.

    Parameters
    ----------
    params : mapping of str to float
        By key or by the FMU's own name.
    keys : mapping of str to (Variable, float)
        The system's parameters: variable and value in the FMU, by key.
    prefix : str
        Begins the system's keys.
    pushed : bool
        They come from ``control.interconnect``, with those of other systems among them.
    """
    own: dict[str, float] = {}
    for given, value in params.items():
        key = given if given in keys or pushed else f"{prefix}.{given}"
        if key in keys:
            own[key] = checked_number(value, keys[key][0].kind, f"FMU {prefix!r}: parameter {key!r}")
        elif not pushed or given.split(".")[0] == prefix:
            hint = did_you_mean(given if "." in given else key, keys)
            raise InputError(f"FMU {prefix!r}: unknown parameter {given!r}{hint}")
    return own


def checked_number(value: Any, kind: str, where: str) -> float:
    """Return a value as the number its type can take; raise if it cannot."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{where}: expected a number, found {value!r}") from None
    if not math.isfinite(number):
        raise InputError(f"{where}: expected a finite number, found {number}")
    if kind in REALS:
        return number
    least, most = WHOLE[kind]
    whole = round(number)
    if abs(number - whole) > 1e-9 * max(1.0, abs(number)) or not least <= whole <= most:
        what = "0 or 1" if kind == "Boolean" else f"a whole number from {least} to {most}"
        raise InputError(f"{where}: expected {what}, found {number:.9g}")
    return float(whole)
