"""What a user gives an FMU, checked: its step and name, and values as its types can take them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from pathlib import Path

from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.fmi.importer.interface import Interface, Variable


def checked_step(path: Path, interface: Interface, step: float | None) -> float:
    """Return the communication step [s], with a warning where nobody states one.

    Raises
    ------
    InputError
        Where the FMU cannot take it.
    """
    if step is None:
        step = interface.step
        if step is None:
            step, why = 0.01, "10 ms"
            if interface.duration:
                step, why = interface.duration / 1000, "a thousandth of its default experiment's duration"
            warnings.warn(f"{path} states no step size: taking {step:g} s, {why}", stacklevel=3)
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
    params: Mapping[str, float],
    keys: Mapping[str, tuple[Variable, float]],
    prefix: str,
    interface: Interface,
    pushed: bool,
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
    interface : Interface
    pushed : bool
        They come from ``control.interconnect``, with those of other systems among them.
    """
    own: dict[str, float] = {}
    for given, value in params.items():
        key = given if given in keys or pushed else f"{prefix}.{given}"
        if key in keys:
            own[key] = keys[key][0].number(value, f"FMU {prefix!r}: parameter {key!r}")
        elif (size := interface.structural.get(given.removeprefix(f"{prefix}."))) is not None:
            raise InputError(
                f"FMU {prefix!r}: {given!r} is a structural parameter, which sizes arrays; here it keeps its "
                f"start value {size}"
            )
        elif not pushed or given.split(".")[0] == prefix:
            hint = did_you_mean(given if "." in given else key, keys)
            raise InputError(f"FMU {prefix!r}: unknown parameter {given!r}{hint}")
    return own
