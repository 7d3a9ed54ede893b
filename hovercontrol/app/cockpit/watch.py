"""The monitor beside the pilot: what it sees of the craft, and what it says on the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.monitor.alarms import Alarm, Alarms
from hovercontrol.identification.monitor.feed import Feed, Tick
from hovercontrol.identification.monitor.monitor import monitor
from hovercontrol.identification.monitor.replay import alarm_json, events, threshold_of

#: Period of the monitor [s].
PERIOD = 0.02

#: Standard deviations of the pose that the monitor sees, those of a motion capture [m, m, rad].
NOISE = {"x": 0.002, "y": 0.002, "psi": 0.004}

#: Root spectral density of what the model leaves open: commands change between two ticks.
PROCESS = {"u": 0.01, "v": 0.01, "r": 0.02}

#: Wanted rate of false alarms, one in ten hours [1/h].
FALSE_ALARMS_PER_HOUR = 0.1

#: Alarms that the page lists, the last ones.
LISTED = 5

#: Wind reaches the craft through air drag only, and then it is to the pose what a slope is. The tests are
#: linear in a change: a large drag in yaw is named dry friction.
ALIKE = {"slope_x": "wind", "slope_y": "wind", "yaw_coulomb": "yaw_linear_drag"}


def watch_block(model: Model) -> Block:
    """Return the monitor of a craft with the effects of its disturbances, each a coefficient of the model."""
    plant = one_air_drag(model.plant())
    known = [_short(p) for p in plant.parameters]
    names = [n for n in known if not n.startswith("wind_") and not n.endswith("_width")]
    block = monitor(
        plant,
        names,
        false_alarms_per_hour=FALSE_ALARMS_PER_HOUR,
        period=PERIOD,
        process_noise=PROCESS,
        measurement_noise=NOISE,
        start_std={"x": 0.01, "y": 0.01, "psi": 0.02, "u": 0.1, "v": 0.1, "r": 0.1},
    )
    Feed(block)  # compiled into the cache of all processes
    return block


def one_air_drag(plant: Block) -> Block:
    """Return a plant whose drags in surge and sway are one coefficient, as the switch of the page has it."""
    known = {_short(p): p for p in plant.parameters}
    both = [known[n] for n in ("surge_linear_drag", "sway_linear_drag") if n in known]
    if len(both) < 2 or any(p.start for p in both):
        return plant
    name = both[0].name.replace("surge_linear_drag", "air_drag")
    drag = both[0].replace(name=name, description="drag in surge and sway")
    swap = {p.symbol: drag.symbol for p in both}

    def swapped(expressions: Mapping[str, sp.Expr]) -> Expressions:
        return Expressions((k, e.xreplace(swap)) for k, e in expressions.items())

    return Block(
        plant.name,
        plant.states,
        plant.inputs,
        plant.outputs,
        (*(p for p in plant.parameters if p not in both), drag),
        swapped(plant.derivatives),
        swapped(plant.output_expressions),
        definitions=swapped(plant.definitions),
        definition_signals=plant.definition_signals,
    )


def _short(parameter: Signal) -> str:
    return parameter.name.rpartition(".")[2]


class Watch:
    """A monitor fed with the signals of a flown craft.

    Parameters
    ----------
    block : Block
        From :func:`watch_block`.
    """

    def __init__(self, block: Block) -> None:
        self._block, self._threshold = block, threshold_of(block)
        self._random = np.random.default_rng(1)
        self.restart()

    def restart(self) -> None:
        """Begin anew with the model as it is: the craft was put back to its start."""
        self._feed, self._alarms = Feed(self._block), Alarms(self._block)
        self._last: Tick | None = None
        self._begun: float | None = None

    def row(self, signals: dict[str, float]) -> None:
        """Take the signals of an instant: the pose with the noise of a motion capture, and the commands."""
        time = signals["time"]
        if self._begun is None:
            self._begun = time
        if abs((time - self._begun) / PERIOD - round((time - self._begun) / PERIOD)) > 1e-3:
            return
        seen = {k: signals[k] + std * self._random.normal() for k, std in NOISE.items()}
        for one in self._feed.rows(time, {**seen, **{k: signals[k] for k in self._feed.commands}}):
            self._last = one if isinstance(one, Tick) else self._last
            for _ in events(self._feed, self._alarms, one):
                pass

    def state(self) -> dict[str, Any]:
        """Return what the page shows: present finding, earlier ones, evidence and threshold."""
        names = [s.name for s in self._block.outputs]
        evidence = 0.0 if self._last is None else float(self._last.values[names.index("evidence")])
        return {
            "begun": self._begun,
            "evidence": evidence,
            "threshold": self._threshold,
            "open": None if self._alarms.open is None else _shown(self._alarms.open),
            "alarms": [_shown(a) for a in self._alarms.found[-LISTED:]],
        }


def _shown(alarm: Alarm) -> dict[str, Any]:
    found = alarm_json(alarm)
    if alarm.name in ALIKE and ALIKE[alarm.name] not in alarm.rivals:
        found["rivals"] = [*found["rivals"], ALIKE[alarm.name]]
    return found
