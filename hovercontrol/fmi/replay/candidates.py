"""Effects that may act around an FMU, and the values at which a search tries each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.craft.effects import Effect, Shape
from hovercontrol.craft.effects.command import InputDelay
from hovercontrol.craft.effects.generic_commands import (
    backlash,
    command_offset,
    deadzone,
    gain,
    lag,
    saturation,
)
from hovercontrol.craft.effects.generic_forces import drag, offset
from hovercontrol.craft.effects.generic_measurements import bias, scale
from hovercontrol.craft.effects.measurement import TimeOffset
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.rows import Rows
from hovercontrol.fmi.replay.unknowns import estimated

#: Size at which a coefficient without search values is tried, over the size of what it changes.
TRIED = 0.05
_LAWS = ("linear_drag", "quadratic_drag", "coulomb")


@dataclass(frozen=True)
class Candidate:
    """An effect that may be missing: where, which, and the values at which it is tried."""

    place: str
    cls: type[Effect]
    tried: tuple[Effect, ...]

    @property
    def name(self) -> str:
        """Place and name: ``before.u_lag``."""
        return f"{self.place}.{self.cls.name}"

    def added_to(self, plant: FmuPlant, e: Effect) -> FmuPlant:
        """Return the model with the effect at this place."""
        return plant.with_effects(**{self.place: [e]})


def candidates(plant: FmuPlant, logs: Sequence[Rows]) -> list[Candidate]:
    """Return the effects that could be added around an FMU, and to the derivatives of `plant.laws_in`."""
    around = plant.around
    have = {
        *(f"before.{e.name}" for e in around.at_inputs),
        *(f"after.{e.name}" for e in around.at_outputs),
        *(f"added.{e.name}" for e in around.in_equations),
    }
    found = [*_before(plant, logs), *_after(plant, logs), *_added(plant)]
    return [c for c in found if c.name not in have]


def _before(plant: FmuPlant, logs: Sequence[Rows]) -> Iterator[Candidate]:
    moving = []
    for i, s in enumerate(plant.inputs):
        u = np.concatenate([rows.inputs[:, i] for rows in logs])
        if np.ptp(u) == 0.0:
            continue
        moving.append(s)
        size = float(np.abs(u).max())
        for cls in (
            command_offset(s.name, s.unit, ""), gain(s.name, s.unit), deadzone(s.name, s.unit),
            backlash(s.name, s.unit), saturation(s.name, s.unit), lag(s.name, s.unit),
        ):  # fmt: skip
            yield Candidate("before", cls, _tried(cls, size, _step(logs)))
    if moving:
        yield Candidate("before", InputDelay, _tried(InputDelay, 1.0, _step(logs)))


def _after(plant: FmuPlant, logs: Sequence[Rows]) -> Iterator[Candidate]:
    n, timed = len(plant.outputs), False
    for c, place in enumerate(logs[0].places):
        if place >= n:
            continue
        s = plant.outputs[place]
        size = float(np.nanstd(np.concatenate([rows.values[:, c] for rows in logs])))
        for cls in (bias(s.name, s.unit), scale(s.name), lag(s.name, s.unit)):
            yield Candidate("after", cls, _tried(cls, size if "bias" in cls.name else 1.0, _step(logs)))
        timed = True
    if timed and plant.inputs:
        yield Candidate("after", TimeOffset, _tried(TimeOffset, 1.0, _step(logs)))


def _added(plant: FmuPlant) -> Iterator[Candidate]:
    for s in plant.states:
        if s.name in plant.laws_in:
            yield Candidate("added", offset(s.name, s.unit), _tried(offset(s.name, s.unit), 1.0, 1.0))
            for law in _LAWS:
                cls = drag(law, s.name, s.unit, s.nominal)
                yield Candidate("added", cls, _tried(cls, 1.0, 1.0))


def _step(logs: Sequence[Rows]) -> float:
    return float(np.median(np.diff(logs[0].time)))


def _tried(cls: type[Effect], size: float, step: float) -> tuple[Effect, ...]:
    """Return the effect at the values from which a fit may begin."""
    scales = {"input": size, "step": step}
    own = list(estimated(cls.small()))
    first = cls.numbers[own[0]]
    if isinstance(first, Shape) and first.search:
        factor = scales.get(first.of, 1.0)
        return tuple(cls.within_bounds(**{own[0]: factor * value}) for value in first.search)
    return (cls.within_bounds(**{own[0]: TRIED * (size or 1.0)}),)
