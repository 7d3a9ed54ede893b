"""Checks of a user's values for an FMU: step, name, parameters and inputs."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.fmi.importer.interface import REALS, Interface, Variable


def checked_step(path: Path, interface: Interface, step: float | None) -> float:
    """Return the communication step [s], with a warning if neither user nor FMU gives one.

    Raises
    ------
    InputError
        If the step is not positive, or not a multiple of the FMU's fixed step.
    """
    if step is None:
        step = interface.step
        if step is None:
            step, why = 0.01, "10 ms"
            if interface.duration:
                step, why = interface.duration / 1000, "a thousandth of its default experiment's duration"
            warnings.warn(f"{path} has no step size: using {step:g} s, {why}", stacklevel=3)
    if isinstance(step, bool) or not isinstance(step, (int, float)) or not 0 < step < math.inf:
        raise InputError(f"{path}: step [s] must be a positive number, found {step!r}")
    fixed = interface.fixed_step
    if fixed and abs(step / fixed - max(round(step / fixed), 1)) > 1e-6:
        raise InputError(f"{path}: step must be a multiple of the FMU's own {fixed:g} s, found {step:g} s")
    return float(step)


def checked_name(interface: Interface, name: str | None) -> str:
    """Return the system's name; raise :class:`InputError` if it is not valid."""
    if name is None:
        return interface.identifier
    if not isinstance(name, str) or not name or "." in name:
        raise InputError(f"expected a system name without dots, found {name!r}")
    return name


def parameter_key(name: str, label: str) -> str:
    """Return the key of a parameter: its name in the FMU, prefixed by the system's name."""
    return label if label.startswith(f"{name}.") else f"{name}.{label}"


def own_parameters(
    params: Mapping[str, float],
    keys: Mapping[str, tuple[Variable, float]],
    prefix: str,
    interface: Interface,
    pushed: bool,
) -> dict[str, float]:
    """Return the given parameters that belong to a system, by key; raise on unknown names.

    Parameters
    ----------
    params : mapping of str to float
        By key or by the FMU's own name.
    keys : mapping of str to (Variable, float)
        The system's parameters: variable and value in the FMU, by key.
    prefix : str
        Prefix of the system's keys.
    pushed : bool
        Whether they come from ``control.interconnect``, mixed with those of other systems.
    """
    own: dict[str, float] = {}
    for given, value in params.items():
        key = given if given in keys or pushed else f"{prefix}.{given}"
        if key in keys:
            own[key] = keys[key][0].number(value, f"FMU {prefix!r}: parameter {key!r}")
        elif (name := given.removeprefix(f"{prefix}.")) in interface.structural:
            if name not in interface.sizes or value != interface.sizes[name][2]:
                raise InputError(
                    f"FMU {prefix!r}: {given!r} is a structural parameter (size of arrays): load() sets it"
                )
        elif not pushed or given.split(".")[0] == prefix:
            hint = did_you_mean(given if "." in given else key, keys)
            raise InputError(f"FMU {prefix!r}: unknown parameter {given!r}{hint}")
    return own


class InputCheck:
    """Check of an FMU's inputs: finite, and integers for integer types."""

    def __init__(self, inputs: Sequence[Variable]) -> None:
        labels = [(label, v) for v in inputs for label in v.labels]
        starts = [s for v in inputs for s in (v.start or (0.0,) * len(v.labels))]
        self._labels = [label for label, _ in labels]
        self._whole = [(n, label, v) for n, (label, v) in enumerate(labels) if v.kind not in REALS]
        self._never_zero = [(n, starts[n]) for n, _, v in self._whole if v.items and 0 not in dict(v.items)]

    def checked(self, fmu: str, t: float, u: Any) -> NDArray[np.float64]:
        """Return the inputs at a time, converted for the FMU; raise :class:`InputError` if impossible."""
        inputs = np.array(u, dtype=float).reshape(-1)
        if inputs.size != len(self._labels):
            raise InputError(f"{fmu}: expected {len(self._labels)} inputs, found {inputs.size}")
        if not np.isfinite(inputs).all():
            n = int(np.flatnonzero(~np.isfinite(inputs))[0])
            raise InputError(f"{fmu}: input {self._labels[n]!r} is {inputs[n]} at t = {t:.9g} s")
        for n, label, v in self._whole:
            inputs[n] = v.number(inputs[n], f"{fmu}: input {label!r} at t = {t:.9g} s")
        return inputs + 0.0  # no negative zero: equal inputs are equal bytes

    def connected(self, fmu: str, t: float, u: Any) -> NDArray[np.float64]:
        """Return inputs as :meth:`checked`; a 0 outside an enumeration means an unconnected input."""
        inputs = np.array(u, dtype=float).reshape(-1)
        for n, start in self._never_zero:
            if n < inputs.size and inputs[n] == 0.0:
                inputs[n] = start
        return self.checked(fmu, t, inputs)
