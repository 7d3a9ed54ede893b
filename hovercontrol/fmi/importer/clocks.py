"""Clocks of FMI 3.0 that tick at a fixed interval, from the model description."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree

#: Differences of time below this part of the interval are none.
NEAR = 1e-6


@dataclass(frozen=True)
class Clock:
    """A clock that the importer ticks: at t = start + shift + k interval, k = 0, 1, ..."""

    name: str
    reference: int
    interval: float  # [s]
    shift: float  # [s]

    def time(self, start: float, k: int) -> float:
        """Return the time of a tick [s] of a run from `start`."""
        return start + self.shift + k * self.interval

    def due(self, start: float, k: int, time: float) -> bool:
        """Return whether a tick is due at a time [s]."""
        return time >= self.time(start, k) - NEAR * self.interval


def clocks_of(root: ElementTree.Element, kind: str) -> tuple[Clock, ...]:
    """Return the input clocks with a constant or fixed interval that the description gives.

    In Co-Simulation they are ticked if the FMU has event mode and saves its state: a tick is repeated if
    inputs at its instant are found to be others.
    """
    part = root.find(kind)
    needed = ("hasEventMode", "canGetAndSetFMUState") if kind == "CoSimulation" else ()
    if part is None or any(part.get(ability) not in ("true", "1") for ability in needed):
        return ()
    found = []
    for element in root.iterfind("ModelVariables/Clock"):
        interval, shift = _seconds(element, "interval"), _seconds(element, "shift")
        periodic = element.get("intervalVariability") in ("constant", "fixed")
        if periodic and element.get("causality") == "input" and 0.0 < interval < math.inf and shift >= 0.0:
            found.append(
                Clock(element.get("name", ""), int(element.get("valueReference", "0")), interval, shift)
            )
    return tuple(found)


def _seconds(element: ElementTree.Element, what: str) -> float:
    """Return an interval or a shift [s]: a decimal, or a counter over the resolution; 0 if not given."""
    decimal, counter = element.get(f"{what}Decimal"), element.get(f"{what}Counter")
    if decimal is not None:
        return float(decimal)
    return int(counter) / int(element.get("resolution", "1")) if counter is not None else 0.0
