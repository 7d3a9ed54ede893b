"""Changes that are in no candidate of a monitor: three machines in closed loop, with dry friction.

A constant force in each equation, coefficients, effects, offsets and scales of sensors, none of them a
candidate, set in at 12 s. What is said 5 s after the alarm: unknown, a wrong name alone, or a wrong name that
is not alone.

``python -m benchmarks.monitor_unknown RUNS MACHINE ...`` simulates RUNS for each change (4) of machines
(all).
"""

from __future__ import annotations

import itertools
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.monitor_sizes import JUDGED, MACHINES, ONSET, PERIOD, Machine, monitor_of, runs_of
from hovercontrol.identification.monitor.monitor import named_effects

Array = NDArray[np.float64]

#: Two sizes of each change.
CHANGES: dict[str, dict[str, tuple[float, float]]] = {
    "hovercraft": {
        "push_u": (-0.1, 0.3), "push_v": (0.1, -0.3), "push_r": (0.1, -0.4), "sway_linear_drag": (0.5, 1.5),
        "sway_quadratic_drag": (0.7, 2.0), "x_bias": (0.01, 0.05), "y_scale": (0.02, 0.1),
        "rudder_lag": (0.1, 0.2),
    },
    "boat": {
        "push_u": (-0.1, 0.3), "push_v": (0.1, -0.3), "push_r": (0.1, -0.4), "surge_linear_drag": (0.3, 1.0),
        "surge_quadratic_drag": (0.4, 1.0), "y_bias": (0.02, 0.05), "psi_scale": (0.05, 0.2),
    },
    "drive": {"push_w": (-0.5, 2.0), "w_quadratic_drag": (0.1, 0.3), "w_scale": (0.05, 0.2)},
}  # fmt: skip


@dataclass(frozen=True)
class Judged:
    """A run: the change, its samples, the monitor's outputs, and the tick 5 s after the alarm (-1: none)."""

    name: str
    size: float
    data: Mapping[str, Array]
    out: Mapping[str, Array]
    tick: int
    found: str = ""

    @property
    def kind(self) -> str:
        """What is said: none, unknown, ALONE for a name alone, or else "or"."""
        if self.tick < 0:
            return "none"
        if self.found.startswith("unknown_"):
            return "unknown"
        possible = sum(v[self.tick] > 0.5 for o, v in self.out.items() if o.startswith("possible_"))
        return "or" if possible > 1 else "ALONE"


def judged(label: str, machine: Machine, runs: int) -> Iterator[Judged]:
    watch = monitor_of(machine)
    compiled, every = watch.compile(), named_effects(watch)
    outputs = [s.name for s in watch.outputs]
    for name, sizes in CHANGES[label].items():
        for size in sizes:
            for data in runs_of(machine, name, size, range(1, runs + 1)):
                t = PERIOD * np.arange(len(next(iter(data.values()))))
                inputs = {s.name: data.get(s.name, 0 * t) for s in watch.inputs}
                out = dict(zip(outputs, compiled.simulate(t, inputs).outputs, strict=True))
                late = np.flatnonzero((out["alarm"] > 0.5) & (t >= ONSET))
                if not late.size:
                    yield Judged(name, size, data, out, -1)
                    continue
                k = min(int(late[0]) + round(JUDGED / PERIOD), t.size - 1)
                yield Judged(name, size, data, out, k, every[int(out["effect"][k]) - 1])


def rows(runs: int = 4, machines: Sequence[str] = ()) -> Iterator[tuple[str, str, str, bool | None]]:
    total: Counter[str] = Counter()
    for label in machines or MACHINES:
        every = judged(label, MACHINES[label](True), runs)
        for (name, size), some in itertools.groupby(every, lambda run: (run.name, run.size)):
            told: Counter[str] = Counter()
            for run in some:
                total[run.kind] += 1
                told[run.found if run.kind == "unknown" else f"{run.found} {run.kind}".strip()] += 1
            yield (
                f"{label}, {name} {size:g}",
                ", ".join(f"{n} {count}" for n, count in told.items()),
                "",
                None,
            )
    yield "all", ", ".join(f"{n} {count}" for n, count in total.items()), "", None


if __name__ == "__main__":
    given = sys.argv[1:]
    for row in rows(int(given[0]) if given else 4, given[1:]):
        print(*row, flush=True)
