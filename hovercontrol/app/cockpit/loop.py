"""The ideal loop, tick by tick: the pilot's commands and the displayed signals."""

from __future__ import annotations

import math
from collections.abc import Mapping

from hovercontrol.app.cockpit.disturbances import note, possible, with_disturbances
from hovercontrol.app.cockpit.gusts import GUST, gusts
from hovercontrol.app.cockpit.laws import STICK, choices, energy, law
from hovercontrol.app.cockpit.orders import Flown
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.simulation.runge_kutta import rk4
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.controllers.k06.heading import TICK
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.motion import MOTION

_GUSTS = tuple(s.name for s in GUST)


class Loop(Flown):
    """The ideal loop: commands act at once, and the law uses the model's measurements.

    Its commands are constant over a tick, limited to the bounds of the plant's inputs.

    Raises
    ------
    InputError
        If the model has an effect that is not an equation (a delay).

    Examples
    --------
    >>> from hovercontrol.craft.models.vehicles import vehicle
    >>> loop = Loop(vehicle("hoverdemon"))
    >>> loop.command(law="forward", references={"surge_ref": 1.0})
    >>> loop.advance(1.0)
    >>> round(loop.signals()["u"], 2)  # 1 - exp(-k1 t/m)
    0.32
    """

    kind = "ideal"

    def __init__(self, model: Model) -> None:
        super().__init__(with_disturbances(model), choices(model), possible(model))
        plant = self.model.plant()
        self.inputs = plant.inputs
        self._plant = plant
        self._rhs, self._see = (
            numpy_functions(plant).scalar_pair(rows) for rows in ("derivatives", "outputs")
        )
        self._limits = [(s.lower, s.upper) for s in plant.inputs]
        self._own = plant.parameter_values()
        self._places = {p.name: k for k, p in enumerate(plant.parameters)}
        self._blocks = {key: law(key, model) for key in self.choices}
        self._gust_block = gusts()
        self._gust_every = round(self._gust_block.period / TICK)
        self._energy = Ticking(energy()) if len(self.choices) > 1 else None
        for block in self._blocks.values():
            Ticking(block)  # its functions are made now, not while the craft flies
        self.reset()

    def reset(self) -> None:
        """Put the craft at its start, at rest and at time 0; law, references and disturbances are kept."""
        self._count = self._next_gust = 0
        self._state = [s.start for s in self._plant.states]
        self._gusts = Ticking(self._gust_block, {"gusts.speed": self._gust_speed()})
        self._gust = dict.fromkeys(_GUSTS, 0.0)
        self._told: dict[str, float] = {}
        self._fresh = False
        self._take_law()
        self._set_plant()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return round(self._count * TICK, 9)

    def modes(self) -> dict[str, tuple[str, ...]]:
        """Return the names of the modes of the present law, by signal."""
        return {s.name: s.modes for s in self._blocks[self.law].outputs if s.modes}

    def advance(self, until: float) -> None:
        """Advance simulated time to `until` [s], a multiple of the tick.

        Raises
        ------
        InputError
            If the motion is not a number any more.
        """
        last = round(until / TICK)
        while self._count < last:
            self._tick()
            held = [self._told[s.name] for s in self.inputs]
            now = self._count * TICK
            self._state = rk4(self._rhs, now, self._state, held, self._values, now + TICK, 1)
            self._count += 1
            self._fresh = False
        if not all(map(math.isfinite, self._state)):
            raise InputError(f"the craft's motion is no longer a number at {self.time:.2f} s: reset it")

    def signals(self) -> dict[str, float]:
        """Return the displayed signals by name, in SI units.

        Returns
        -------
        dict of str to float
            ``time``; the motion, and ``..._measured`` where a measurement differs; the present commands;
            further outputs of the law (``surge_ref``, ``mode``); ``wind_x, wind_y`` [m/s] with its gusts,
            earth frame; and ``energy`` [J] of K06's craft.
        """
        self._tick()
        seen = self._outputs()
        found = {"time": self.time, **seen, **self._told}
        found |= {name: self._values[self._places[f"plant.{name}"]] for name in ("wind_x", "wind_y")}
        if self._energy is not None:
            found |= self._energy.tick(self.time, seen)
        return found

    def notes(self) -> str:
        """Return notes to the pilot on the disturbances, or ``""``."""
        drags = (self._values[self._places[f"plant.{axis}_linear_drag"]] for axis in ("surge", "sway"))
        return note(self.switched_on, drags)

    # ---- inside --------------------------------------------------------------------------------------

    def _obey(self, law: bool, references: bool, disturbances: bool, switched: Mapping[str, bool]) -> None:
        if self._fresh:  # what was told at this instant is told anew
            self._law.state, self._fresh = self._before, False
        if law:
            self._take_law()
        elif references:
            self._set_law()
        if disturbances:
            self._gusts.set_parameters({"gusts.speed": self._gust_speed()})
            self._set_plant()

    def _outputs(self) -> dict[str, float]:
        held = [self._told.get(s.name, 0.0) for s in self.inputs]
        values = call_scalar(self._see, self.time, self._state, held, self._values)
        return dict(zip([s.name for s in self._plant.outputs], values, strict=True))

    def _tick(self) -> None:
        """Step all sampled parts, once at an instant."""
        if self._fresh:
            return
        if "gusts" in self.switched_on and self._count >= self._next_gust:
            self._gust = self._gusts.tick(self.time, {})
            self._next_gust = self._count + self._gust_every
            self._set_plant()
        seen = self._outputs()
        for s in MOTION:
            seen[s.name] = seen.get(f"{s.name}_measured", seen[s.name])
        pushed = dict(zip([s.name for s in STICK], self.stick, strict=True))
        self._before = self._law.state
        self._told = self._law.tick(self.time, {**seen, **pushed})
        for signal, (lower, upper) in zip(self.inputs, self._limits, strict=True):
            self._told[signal.name] = min(max(self._told[signal.name], lower), upper)
        self._fresh = True

    def _take_law(self) -> None:
        self._law = Ticking(self._blocks[self.law])
        self._set_law()

    def _set_law(self) -> None:
        told = dict(self.references[self.law])
        if "heading_ref" in told:  # it is not wrapped, and neither is psi
            psi = self._state[2]
            told["heading_ref"] = psi + math.remainder(told["heading_ref"] - psi, math.tau)
        self._law.set_parameters({f"reference.{name}": value for name, value in told.items()})

    def _gust_speed(self) -> float:
        return self.switched_on.get("gusts", {}).get("speed", 0.0)

    def _set_plant(self) -> None:
        values = list(self._own)
        for name, numbers in self.switched_on.items():
            for knob in self.disturbances[name].knobs:
                for parameter in knob.parameters:
                    values[self._places[f"plant.{parameter}"]] += numbers[knob.signal.name]
        if "gusts" in self.switched_on:
            for axis, gust in zip("xy", _GUSTS, strict=True):
                values[self._places[f"plant.wind_{axis}"]] += self._gust[gust]
        else:
            self._gust = dict.fromkeys(_GUSTS, 0.0)
        self._values = tuple(values)
