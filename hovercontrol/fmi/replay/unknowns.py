"""What a fit of an FMU estimates: parameters, numbers of effects around it, states at the start of logs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows
from hovercontrol.fmi.replay.runs import RunFailed

#: Relative step of differences: of an FMU that our steps integrate, and of one with its own solver, whose
#: tolerance makes its outputs rough.
STEPS = {"ModelExchange": 1e-6, "CoSimulation": 1e-4}
#: The same where outputs jump as an unknown changes: where slopes over the one and the other step differ by
#: more than this part of their size.
ROUGH_STEP, ROUGH = 1e-2, 0.1


@dataclass(frozen=True)
class Unknown:
    """One number that a fit estimates.

    Attributes
    ----------
    name : str
        Of a parameter, of a number around the FMU (``before.u_lag_seconds``), or ``LOG.state``.
    unit : str
    size, lower, upper : float
    place : {"fmu", "before", "after", "added", "start"}
    log : int
        The log whose first row it is a state of; -1 for all others.
    """

    name: str
    unit: str
    size: float
    lower: float
    upper: float
    place: str
    log: int = -1
    state: int = -1


class Unknowns:
    """The unknowns of a model over logs, and the predictions that they give.

    Parameters
    ----------
    plant : FmuPlant
        Its values are where a fit begins.
    logs : sequence of Rows
    starts_only : bool, optional
        Whether only the states at the start of the logs are estimated.
    """

    def __init__(self, plant: FmuPlant, logs: Sequence[Rows], *, starts_only: bool = False) -> None:
        self.plant, self.logs = plant, list(logs)
        self.every = [] if starts_only else [*_of_fmu(plant), *_around(plant)]
        if plant.free_start:
            self.every += _starts(plant, self.logs)
        self.names = tuple(u.name for u in self.every)
        self.lower = np.array([u.lower for u in self.every])
        self.upper = np.array([u.upper for u in self.every])
        self.size = np.array([u.size for u in self.every])
        self.of_model = tuple(j for j, u in enumerate(self.every) if u.log < 0)
        self._kept: dict[tuple[int, bytes], Array] = {}
        self._rough: dict[int, bool] = {}

    @property
    def rough(self) -> bool:
        """Whether outputs jump as an unknown changes; found by :meth:`slopes`."""
        return any(self._rough.values())

    def head(self, share: float) -> Unknowns:
        """Return the same unknowns over the first part of each log."""
        return Unknowns(self.plant, [rows.head(share) for rows in self.logs])

    def start(self) -> Array:
        """Return the values where a fit begins.

        States begin at their measured values where they were measured, else at the FMU's start.

        Raises
        ------
        RunFailed
            If the FMU does not initialise.
        """
        around, found = self.plant.around.values, []
        initial = (
            {k: self.plant.initial(rows.inputs[0]) for k, rows in enumerate(self.logs)}
            if (self.plant.free_start)
            else {}
        )
        for u in self.every:
            if u.place == "fmu":
                found.append(self.plant.value(u.name))
            elif u.log < 0:
                found.append(around[u.name])
            else:
                measured = _measured_start(self.plant, self.logs[u.log], u.state)
                found.append(initial[u.log][u.state] if measured is None else measured)
        return np.clip(np.array(found, dtype=float), self.lower, self.upper)

    def model(self, values: Array) -> FmuPlant:
        """Return the model with these values."""
        return self.plant.with_values({self.every[j].name: float(values[j]) for j in self.of_model})

    def predict(self, values: Array, only: int | None = None) -> list[Array]:
        """Return the measured channels at the rows of each log (or of one), shape (K, C).

        Raises
        ------
        RunFailed
        """
        plant = self.model(values)
        fmu = [j for j in self.of_model if self.every[j].place != "after"]
        found = []
        for k, rows in enumerate(self.logs):
            if only is not None and k != only:
                continue
            own = [j for j, u in enumerate(self.every) if u.log == k]
            key = (k, values[[*fmu, *own]].tobytes())
            grid, inputs, places = plant.fine(rows.time, rows.inputs)
            raw = self._kept.get(key)
            if raw is None:
                states = values[own].tolist() if self.plant.free_start else None
                raw = plant.raw(grid, inputs, states, (len(grid) - 1) // (len(rows.time) - 1))
                if len(self._kept) > 2 * len(self.logs):
                    self._kept.clear()
                self._kept[key] = raw
            found.append(plant.seen(grid, raw)[places][:, list(rows.places)])
        return found

    def slopes(self, values: Array, base: Sequence[Array]) -> list[Array]:
        """Return the sensitivities of :meth:`predict` by one-sided differences, (K, C, P) of each log.

        A step that the FMU refuses is tried in the other direction; where it refuses both, the column is
        zero: nothing is known of that unknown. Steps are longer where outputs jump as an unknown changes.
        """
        usual = STEPS[self.plant.interface.kind]
        found = [np.zeros((*y.shape, len(values))) for y in base]
        for j, u in enumerate(self.every):
            column = self._column(values, base, j, ROUGH_STEP if self._rough.get(j) else usual)
            if self._jumps and j not in self._rough and u.place in ("fmu", "before"):
                wide = self._column(values, base, j, ROUGH_STEP)
                self._rough[j] = _differ(column, wide)
                column = wide if self._rough[j] else column
            for k, slope in column.items():
                found[k][..., j] = slope
        return found

    @property
    def _jumps(self) -> bool:
        """Whether the FMU's own solver may take events at its steps."""
        return self.plant.interface.kind == "CoSimulation"

    def _column(self, values: Array, base: Sequence[Array], j: int, relative: float) -> dict[int, Array]:
        """Return the slopes of the outputs of each log with one unknown."""
        u = self.every[j]
        only = u.log if u.log >= 0 else None
        for sign in (1.0, -1.0):
            h = sign * relative * max(abs(values[j]), 0.1 * self.size[j])
            if not self.lower[j] <= values[j] + h <= self.upper[j]:
                continue
            moved = values.copy()
            moved[j] += h
            try:
                there = self.predict(moved, only)
            except RunFailed:
                continue
            logs = [only] if only is not None else range(len(base))
            return {k: (y - base[k]) / h for k, y in zip(logs, there, strict=True)}
        return {}


def _differ(one: dict[int, Array], other: dict[int, Array]) -> bool:
    """Return whether slopes over two steps differ by more than `ROUGH`."""
    pairs = [(one[k], other[k]) for k in one.keys() & other.keys()]
    apart = sum(float(((a - b) ** 2).sum()) for a, b in pairs)
    return apart > ROUGH**2 * sum(float((b**2).sum()) for _, b in pairs)


def _of_fmu(plant: FmuPlant) -> list[Unknown]:
    found = []
    for name in plant.fit:
        p = plant.parameters[name]
        size = abs(plant.value(name)) or 1.0
        found.append(Unknown(name, p.unit, size, p.lower, p.upper, "fmu"))
    return found


def estimated(effect: Effect) -> dict[str, tuple[float, float, str]]:
    """Return the numbers of an effect that a fit estimates: lower and upper bound, unit.

    The width of dry friction is kept.
    """
    return {
        k: (n.lower, n.upper, n.unit)
        for k, n in effect.numbers.items()
        if not (isinstance(n, Shape) and n.fixed) and effect.parameter(k) != effect.friction_width()
    }


def _around(plant: FmuPlant) -> list[Unknown]:
    around, found = plant.around, []
    places = (("before", around.at_inputs), ("after", around.at_outputs), ("added", around.in_equations))
    for owner, effects in places:
        for e in effects:
            for k, (lower, upper, unit) in estimated(e).items():
                size = abs(e.values[k]) or 0.1
                found.append(Unknown(f"{owner}.{e.parameter(k)}", unit, size, lower, upper, owner))
    return found


def _starts(plant: FmuPlant, logs: Sequence[Rows]) -> list[Unknown]:
    found = []
    for k, rows in enumerate(logs):
        for i, s in enumerate(plant.states):
            measured = _measured(plant, rows, i)
            size = float(np.nanstd(measured)) if measured is not None else abs(s.start)
            found.append(
                Unknown(f"{rows.name}.{s.name}", s.unit, size or 1.0, -math.inf, math.inf, "start", k, i)
            )
    return found


def _measured(plant: FmuPlant, rows: Rows, state: int) -> Array | None:
    """Return what a log has of a state: a channel of its name."""
    names = [s.name for s in (*plant.outputs, *plant.states)]
    for c, place in enumerate(rows.places):
        if names[place] == plant.states[state].name:
            return rows.values[:, c]
    return None


def _measured_start(plant: FmuPlant, rows: Rows, state: int) -> float | None:
    values = _measured(plant, rows, state)
    if values is None:
        return None
    first = values[np.isfinite(values)]
    return float(first[0]) if len(first) and np.isfinite(values[:3]).any() else None
