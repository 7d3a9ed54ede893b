"""An FMU's interface for simulation: signals, parameters, step size, capabilities."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.fmi.importer.clocks import Clock

#: The smallest and largest value of each type that is a whole number; FMI 2 has 32 bits.
WHOLE = {f"Int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)}
WHOLE |= {f"UInt{n}": (0, 2**n - 1) for n in (8, 16, 32, 64)}
WHOLE |= {"Integer": WHOLE["Int32"], "Boolean": (0, 1)}
REALS = ("Real", "Float32", "Float64")
Kind = Literal["CoSimulation", "ModelExchange"]
#: Items of an enumeration that an error line names.
MOST_ITEMS = 8


@dataclass(frozen=True)
class Variable:
    """One FMI variable, a scalar or an array; all values are handled as float64.

    Attributes
    ----------
    labels : tuple of str
        One per element in FMI's order (the last index runs fastest): ``name``, ``name[1]``, ``name[2,1]``; of
        our own exports the names that the elements have in the Block.
    units, descriptions : tuple of str
        One per element.
    kind : str
        The type whose functions get and set it: ``Real``, ``Integer``, ``Boolean`` (FMI 2), ``Float64``, ...
    items : tuple of (int, str)
        Values and names of an enumeration; else empty.
    discrete : bool
        In Model Exchange it changes at events only.
    clocks : tuple of int
        References of the clocks at whose ticks it changes; empty if it has none.
    shape : tuple of int
        Of an array.
    """

    name: str
    reference: int
    kind: str
    labels: tuple[str, ...]
    start: tuple[float, ...]
    units: tuple[str, ...]
    descriptions: tuple[str, ...]
    items: tuple[tuple[int, str], ...] = ()
    discrete: bool = False
    clocks: tuple[int, ...] = ()
    shape: tuple[int, ...] = ()

    def number(self, value: Any, where: str) -> float:
        """Return a value as a number of this variable's type.

        Raises
        ------
        InputError
            If that is not possible; the message begins with `where`.
        """
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise InputError(f"{where}: expected a number, found {value!r}") from None
        if not math.isfinite(number):
            raise InputError(f"{where}: expected a finite number, found {number}")
        if self.kind in REALS:
            return number
        least, most = WHOLE[self.kind]
        whole = round(number)
        fits = abs(number - whole) <= 1e-9 * max(1.0, abs(number)) and least <= whole <= most
        if fits and (not self.items or whole in dict(self.items)):
            return float(whole)
        what = "0 or 1" if self.kind == "Boolean" else f"a whole number from {least} to {most}"
        if self.items:
            shown = [f"{n} ({name})" for n, name in self.items[:MOST_ITEMS]]
            what = f"one of {', '.join(shown)}{', ...' if len(self.items) > MOST_ITEMS else ''}"
        raise InputError(f"{where}: expected {what}, found {number:.9g}")


@dataclass(frozen=True)
class Interface:
    """One FMU's part for Co-Simulation or Model Exchange.

    Of Model Exchange only: ``states`` and ``derivatives``, in the same order; ``indicators``, the number of
    event indicators (FMI 3: of those that are listed); ``directional``, whether it gives directional
    derivatives.
    """

    fmi: int
    identifier: str
    token: str
    step: float | None
    duration: float | None  # of the default experiment
    tolerance: float | None
    fixed_step: float | None  # the internal one, where the communication step must be a multiple of it
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    structural: tuple[str, ...]  # names of structural parameters
    feedthrough: dict[str, tuple[str, ...]]
    has_states: bool  # can get and set its state
    once_per_process: bool
    left_out: tuple[str, ...]
    kind: Kind = "CoSimulation"
    states: tuple[Variable, ...] = ()
    derivatives: tuple[Variable, ...] = ()
    indicators: int = 0
    directional: bool = False
    findings: tuple[str, ...] = ()  # what breaks the standard and was tolerated
    clocks: tuple[Clock, ...] = ()  # that the importer ticks
    sizes: dict[str, tuple[int, str, int]] = field(default_factory=dict)  # of these, that the user set

    __repr__ = short_repr


def units_and_descriptions(
    variables: Sequence[Variable], keys: Iterable[str] | None = None
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the units and the descriptions of all elements, by label or by the given keys in their order."""
    names = list(keys) if keys is not None else [label for v in variables for label in v.labels]
    units = [unit for v in variables for unit in v.units]
    texts = [text for v in variables for text in v.descriptions]
    return dict(zip(names, units, strict=True)), dict(zip(names, texts, strict=True))
