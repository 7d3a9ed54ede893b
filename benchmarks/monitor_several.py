"""Several changes along one log: one after the other, two at once, one that ends, one that grows.

The machines with dry friction of the benchmark of sizes, replayed: a change that is named alone is put into
the monitor, and the next is looked for beside it.

``python -m benchmarks.monitor_several RUNS`` simulates RUNS for each pair, end and slope (5).
"""

from __future__ import annotations

import itertools
import math
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import hovercontrol as hc
from benchmarks.monitor_sizes import MACHINES, ONSET, PERIOD, Machine, loop_of, monitor_of
from hovercontrol.identification.monitor.monitor import named_effects
from hovercontrol.identification.monitor.replay import replay

PAIRS = {
    "hovercraft": [
        (("thrust", -0.15), ("yaw_linear_drag", 0.5)),
        (("rudder_torque", -0.6), ("thrust", -0.15)),
        (("yaw_linear_drag", 0.5), ("psi_bias", 0.03)),
        (("psi_bias", 0.03), ("rudder_torque", -0.6)),
    ],
    "boat": [
        (("fan_force", -0.2), ("sway_linear_drag", 1.0)),
        (("fan_torque", -0.7), ("sway_linear_drag", 2.0)),
        (("fan_force", -0.4), ("yaw_linear_drag", 1.0)),
        (("fan_force", -0.4), ("fan_torque", -0.7)),
    ],
    "drive": [
        (("b", 0.6), ("c", 0.6)),
        (("k", -0.8), ("c", 0.6)),
        (("k", -0.8), ("b", 0.6)),
        (("k", -0.8), ("w_bias", 0.3)),
    ],
}
#: Rates of the thrust coefficient, as a part of it in 1 s.
RATES = 0.002, 0.005, 0.01, 0.03
#: Time between two changes, and until an end; after the last; at which a slope is judged [s].
GAP, AFTER, JUDGED = 18.0, 25.0, 12.0
#: Part of a coefficient by which it falls at most.
MOST = 0.7
#: Steps in which a coefficient grows [s].
STEP = 0.2


@dataclass(frozen=True)
class Change:
    """A change of a coefficient or an offset of a sensor, from an onset until an end, or growing [1/s]."""

    name: str
    size: float
    onset: float
    until: float = math.inf
    rate: float = 0.0

    def at(self, t: np.ndarray) -> np.ndarray:
        steps = STEP * np.floor((t - self.onset) / STEP + 1e-6)
        return np.where((t >= self.onset) & (t < self.until), self.size + self.rate * steps, 0.0)


def log_of(machine: Machine, changes: Sequence[Change], seed: int, seconds: float) -> hc.Log:
    """Return a measured log of the loop."""
    loop, rng, t = (
        loop_of(machine, machine.model),
        np.random.default_rng(seed),
        np.arange(0.0, seconds, PERIOD),
    )
    push = {f"push_{n}": q / np.sqrt(PERIOD) * rng.normal(size=t.size) for n, q in machine.process.items()}
    own = [c for c in changes if not c.name.endswith("_bias")]
    keys = {c.name: next(p for p in loop.parameters if p.name.endswith(f".{c.name}")) for c in own}
    sizes = np.array([c.at(t) for c in own]).reshape(len(own), t.size)
    edges = [0, *(1 + np.flatnonzero(np.diff(sizes, axis=1).any(axis=0))), t.size - 1]
    compiled, x0, parts = loop.compile(), None, []
    for a, b in itertools.pairwise(edges):
        params = {
            keys[c.name].name: float(keys[c.name].start) + float(v[a])
            for c, v in zip(own, sizes, strict=True)
        }
        some = {name: values[a : b + 1] for name, values in push.items()}
        run = compiled.simulate(t[a : b + 1], some, x0=x0, params=params, hold="zero")
        x0 = dict(zip((s.name for s in loop.states), run.states[:, -1], strict=True))
        parts.append(run.outputs[:, :-1])
    t, names = t[:-1], [s.name for s in loop.outputs]
    found = dict(zip(names, np.hstack(parts), strict=True))
    for n, std in machine.noise.items():
        wrong = sum((c.at(t) for c in changes if c.name == f"{n}_bias"), np.zeros(t.size))
        found[n] = found[n] + std * rng.normal(size=t.size) + wrong
    return hc.Log("loop", t, {n: found[n] for n in names if n in machine.noise or n not in machine.process})


def pairs(label: str, machine: Machine, watch: hc.Block, gap: float, runs: int) -> Counter[str]:
    """Return how often both changes of a pair are named alone, one, none, and another one alone.

    Of both, how many first sizes lie within two standard errors.
    """
    told: Counter[str] = Counter()
    for one, other in PAIRS[label]:
        both, sizes = [Change(*one, ONSET), Change(*other, ONSET + gap)], dict([one, other])
        for seed in range(1, runs + 1):
            alarms = replay(watch, log_of(machine, both, seed, ONSET + gap + AFTER)).alarms
            alone = [a for a in alarms if not a.rivals and a.kind != "unknown"]
            first = {a.name: a for a in reversed(alone) if a.name in sizes}
            told["another one alone"] += any(a.name not in sizes for a in alone)
            told[("none, or with rivals", "one", "both")[len(first)]] += 1
            if len(first) == 2:
                told["sizes within two standard errors"] += sum(
                    abs(a.change - sizes[name]) < 2.0 * a.std for name, a in first.items()
                )
    return told


def rows(runs: int = 5) -> Iterator[tuple[str, str, str, bool | None]]:
    machines = {label: build(True) for label, build in MACHINES.items()}
    watches = {label: monitor_of(machine) for label, machine in machines.items()}
    cases = [("hovercraft", "one after the other", GAP), *((label, "at once", 0.0) for label in MACHINES)]
    for label, what, gap in cases:
        told = pairs(label, machines[label], watches[label], gap, runs)
        text = ", ".join(f"{k} {n}" for k, n in told.items() if n)
        every = runs * len(PAIRS[label])
        met = told["both"] >= 0.9 * every
        yield f"{label}, two changes {what}: named alone", f"{text}; {every} runs", "both 90 %", met
    machine, watch = machines["hovercraft"], watches["hovercraft"]
    ended = 0
    for seed in range(1, runs + 1):
        change = Change("thrust", -0.15, ONSET, until=ONSET + GAP)
        alarms = replay(watch, log_of(machine, [change], seed, ONSET + GAP + AFTER)).alarms
        ended += bool(alarms) and alarms[0].name == "thrust" and abs(alarms[0].ended - change.until) < 10.0
    yield "a change that ends: told within 10 s", f"{ended} of {runs}", "", ended == runs
    yield from slopes(machine, watch, runs)


def slopes(machine: Machine, watch: hc.Block, runs: int) -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield the slope of a coefficient that grows, some time after the alarm."""
    compiled, every, outputs = watch.compile(), named_effects(watch), [s.name for s in watch.outputs]
    full = float(next(p for p in watch.parameters if p.name.endswith(".thrust")).start)
    for rate in RATES:
        told, errors, stds = Counter[str](), list[float](), list[float]()
        for seed in range(1, runs + 1):
            change = Change("thrust", 0.0, ONSET, rate=-rate * full)
            log = log_of(machine, [change], seed, ONSET + min(2.0 * AFTER, MOST / rate))
            inputs = {s.name: log.columns.get(s.name, 0 * log.time) for s in watch.inputs}
            out = dict(zip(outputs, compiled.simulate(log.time, inputs).outputs, strict=True))
            late = np.flatnonzero((out["alarm"] > 0.5) & (log.time >= ONSET))
            if not late.size:
                told["no alarm"] += 1
                continue
            k = min(late[0] + round(JUDGED / PERIOD), log.time.size - 1)
            found = every[int(out["effect"][k]) - 1]
            told[found] += 1
            if found == "thrust":
                stds.append(float(out["rate_std"][k]) / full)
                errors.append(float(out["rate"][k] - change.rate) / full / stds[-1])
        inside = sum(abs(z) < 2.0 for z in errors)
        said = ", ".join(f"{n} {count}" for n, count in told.items())
        error = f"within two standard errors, {100 * np.median(stds):.2g} % in 1 s" if stds else "named"
        what = f"thrust falls by {100 * rate:g} % in 1 s: {said}"
        yield what, f"{inside} of {len(errors)} slopes {error}", "", None


if __name__ == "__main__":
    for row in rows(int(sys.argv[1]) if sys.argv[1:] else 5):
        print(*row, flush=True)
