"""Sizes of a monitor's named changes: three machines in closed loop, with and without dry friction.

Each candidate changes at 12 s, in three sizes; the size is judged 5 s after the alarm. A cell is met if at
least 85 % of the runs in which the change is named lie within two standard errors, with a mean error below
half a standard error. The noise of each cell is its own. A cell that misses is simulated MOST times: the mean
of 8 runs has a standard error of 0.35 standard errors itself.

``python -m benchmarks.monitor_sizes RUNS MACHINE ...`` simulates RUNS for each cell (8) of machines (all).
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

import hovercontrol as hc
from benchmarks import monitor as craft_loop
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import time
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.monitor.monitor import named_effects

Array = NDArray[np.float64]
PERIOD, ONSET, LENGTH, JUDGED = 0.02, 12.0, 20.0, 5.0
#: Runs of a cell that misses, and its bars: share within two standard errors, and mean error.
MOST, SHARE, MEAN = 40, 0.85, 0.5


@dataclass(frozen=True)
class Machine:
    """A machine in its loop.

    Attributes
    ----------
    model : Model or BlockModel
    law : list of Block
        Without the plant; its commands hold from tick to tick.
    noise, process : dict of str to float
        Of the measured channels and of the derivatives, as a monitor takes them.
    changes : dict of str to sequence of float
        Three sizes by candidate.
    """

    model: AnyModel
    law: Sequence[hc.Block]
    noise: Mapping[str, float]
    process: Mapping[str, float]
    changes: Mapping[str, Sequence[float]]


def hold(sent: Sequence[hc.Signal]) -> hc.Block:
    wanted = [s.replace(name=f"{s.name}_wanted", lower=-sp.oo, upper=sp.oo) for s in sent]
    values = {s.name: w.symbol for s, w in zip(sent, wanted, strict=True)}
    return hc.Block("hold", [], wanted, sent, output_expressions=values, period=PERIOD)


def hovercraft(dry: bool) -> Machine:
    model = craft_loop.craft()
    if not dry:
        model = model.without_effects("surge_coulomb", "sway_coulomb", "yaw_coulomb")
    changes = {
        "thrust": (-0.06, -0.15, -0.3), "yaw_linear_drag": (0.1, 0.3, 1.0),
        "rudder_torque": (-0.2, -0.6, -1.2),
        "surge_quadratic_drag": (0.15, 0.35, 0.8), "rudder_offset": (0.02, 0.06, 0.15),
        "thrust_lag": (0.1, 0.2, 0.4), "munk_moment": (0.3, 0.65, 1.5), "psi_bias": (0.01, 0.03, 0.1),
    }  # fmt: skip
    return Machine(model, craft_loop.law(model), craft_loop.NOISE, craft_loop.PROCESS, changes)


def boat(dry: bool) -> Machine:
    """Two fans astern; the speed and the yaw rate follow sines."""
    friction = [hc.effect("surge_coulomb", 0.15, width=0.01), hc.effect("yaw_coulomb", 0.2, width=0.01)]
    drags = [
        hc.effect("surge_linear_drag", 0.5), hc.effect("sway_linear_drag", 1.2),
        hc.effect("yaw_linear_drag", 0.8), hc.effect("fan_force", 0.8), hc.effect("fan_torque", 1.5),
    ]  # fmt: skip
    fans = (hc.Fan("left", -0.3, -0.2, 0.0, reverses=True), hc.Fan("right", -0.3, 0.2, 0.0, reverses=True))
    model = hc.Model("boat", [*drags, *(friction if dry else [])], fans=fans)
    u, r, left, right = model.plant().signal("u"), model.plant().signal("r"), *model.plant().inputs
    ahead, turn = hc.Signal("ahead", "N*s/m", start=4.0), hc.Signal("turn", "N*s/rad", start=3.0)
    speed, rate = hc.Signal("speed", "m/s", start=0.1), hc.Signal("rate", "rad/s", start=0.6)
    second = hc.Signal("second", "1/s", start=1.0)
    clock = second.symbol * time
    push = ahead.symbol * (speed.symbol * (5 + 2 * sp.sin(0.5 * clock)) - u.symbol)
    yaw = turn.symbol * (rate.symbol * sp.sin(0.8 * clock) - r.symbol)
    wanted = [s.replace(name=f"{s.name}_wanted", lower=-sp.oo, upper=sp.oo) for s in (left, right)]
    pilot = hc.Block(
        "pilot", [], [u, r], wanted, [ahead, turn, speed, rate, second],
        output_expressions={wanted[0].name: push + yaw, wanted[1].name: push - yaw},
    )  # fmt: skip
    changes = {
        "fan_force": (-0.08, -0.2, -0.4), "fan_torque": (-0.1, -0.3, -0.7),
        "sway_linear_drag": (0.4, 1.0, 2.0),
        "yaw_linear_drag": (0.1, 0.3, 1.0), "fan_lag": (0.1, 0.2, 0.4), "x_bias": (0.005, 0.02, 0.05),
    }  # fmt: skip
    noise, process = {"x": 2e-3, "y": 2e-3, "psi": 4e-3}, {"u": 0.02, "v": 0.02, "r": 0.05}
    return Machine(model, [pilot, hold([left, right])], noise, process, changes)


def drive(dry: bool) -> Machine:
    """A motor whose speed follows two sines through zero."""
    w, U = hc.Signal("w", "rad/s"), hc.Signal("U", "V")
    k, b = hc.Signal("k", "rad/s^2/V", start=4.0), hc.Signal("b", "1/s", start=1.5)
    c, width = hc.Signal("c", "rad/s^2", start=1.5), hc.Signal("width", "rad/s", start=0.05)
    rub = c.symbol * sgn(w.symbol, width.symbol) if dry else 0 * c.symbol
    numbers = [k, b, c, width] if dry else [k, b]
    block = hc.Block("drive", [w], [U], [w], numbers, {"w": k.symbol * U.symbol - b.symbol * w.symbol - rub})
    gain, size = hc.Signal("gain", "V*s/rad", start=1.0), hc.Signal("size", "rad/s", start=3.0)
    second, sent = hc.Signal("second", "1/s", start=1.0), U.replace(name="U_wanted")
    clock = second.symbol * time
    wanted = size.symbol * (sp.sin(1.1 * clock) + sp.sin(2.3 * clock)) - w.symbol
    law = hc.Block(
        "law", [], [w], [sent], [gain, size, second], output_expressions={"U_wanted": gain.symbol * wanted}
    )
    changes = {
        "k": (-0.3, -0.8, -2.0), "b": (0.2, 0.6, 2.0), "U_deadzone": (0.1, 0.3, 0.6),
        "U_lag": (0.05, 0.1, 0.3),
        "w_bias": (0.1, 0.3, 1.0), **({"c": (-0.3, 0.6, 1.5)} if dry else {}),
    }  # fmt: skip
    return Machine(hc.BlockModel(block), [law, hold([U])], {"w": 0.02}, {"w": 0.1}, changes)


MACHINES: dict[str, Callable[[bool], Machine]] = {"hovercraft": hovercraft, "boat": boat, "drive": drive}


def loop_of(machine: Machine, model: AnyModel) -> hc.Block:
    commands = [s.name for s in machine.model.plant().inputs]
    outputs = list(dict.fromkeys([*machine.noise, *machine.process, *commands]))
    parts = [craft_loop.pushed(model, machine.process), *machine.law]
    return hc.interconnect(parts, inputs=[f"push_{n}" for n in machine.process], outputs=outputs)


def runs_of(machine: Machine, name: str, size: float, seeds: Sequence[int]) -> Iterator[dict[str, Array]]:
    """Yield measured channels and commands of loops in which a change sets in.

    ``push_NAME`` is a constant acceleration, ``NAME_bias`` and ``NAME_scale`` are errors of a sensor.
    """
    model, first = as_model(machine.model), loop_of(machine, machine.model)
    own = {model.coefficient_name(key): key for key in model.coefficients()}
    then, params = first, {}
    if name in own:
        key = f"{model.plant().name}.{own[name].rpartition('.')[2]}"
        key = next(p.name for p in first.parameters if p.name.endswith(key.rpartition(".")[2]))
        params = {key: float(first.parameter(key).start) + size}
    elif not name.endswith(("_bias", "_scale")) and not name.startswith("push_"):
        cls = model.effect_class(name)
        number = next(k for k, n in cls.numbers.items() if not np.isnan(n.neutral))
        then = loop_of(machine, model.with_effects([cls(**{number: size})]))
    t = np.arange(0.0, LENGTH + PERIOD / 2, PERIOD)
    k = round(ONSET / PERIOD)
    names = [s.name for s in first.outputs]
    for seed in seeds:
        rng = np.random.default_rng(seed)
        push = {
            f"push_{n}": q / np.sqrt(PERIOD) * rng.normal(size=t.size) for n, q in machine.process.items()
        }
        one = first.compile().simulate(t[: k + 1], {n: v[: k + 1] for n, v in push.items()}, hold="zero")
        start = dict(zip((s.name for s in first.states), one.states[:, -1], strict=True))
        for s in then.states:  # a lag begins at its command
            for command in names:
                if s.name.endswith(f"{command}_lagged"):
                    start[s.name] = float(one.outputs[names.index(command), -1])
        start = {s.name: start[s.name] for s in then.states if s.name in start}
        if name in push:
            push[name] = push[name] + size * (t >= ONSET)
        two = then.compile().simulate(
            t[k:], {n: v[k:] for n, v in push.items()}, x0=start, params=params, hold="zero"
        )
        found = dict(zip(names, np.hstack([one.outputs[:, :-1], two.outputs]), strict=True))
        for n, std in machine.noise.items():
            wrong = {f"{n}_bias": 1.0, f"{n}_scale": found[n]}.get(name, 0.0) * size * (t >= ONSET)
            found[n] = found[n] + std * rng.normal(size=t.size) + wrong
        yield {n: found[n] for n in names if n in machine.noise or n not in machine.process}


def sound(machine: Machine, seconds: float, seed: int) -> hc.Log:
    """Return a measured log of the loop in which nothing changes."""
    loop, t = loop_of(machine, machine.model), np.arange(0.0, seconds, PERIOD)
    rng = np.random.default_rng(seed)
    push = {f"push_{n}": q / np.sqrt(PERIOD) * rng.normal(size=t.size) for n, q in machine.process.items()}
    run = loop.compile().simulate(t, push, hold="zero")
    found = dict(zip((s.name for s in loop.outputs), np.atleast_2d(run.outputs), strict=True))
    for n, std in machine.noise.items():
        found[n] = found[n] + std * rng.normal(size=t.size)
    kept = {n: v for n, v in found.items() if n in machine.noise or n not in machine.process}
    return hc.Log("loop", t, kept)


def monitor_of(machine: Machine) -> hc.Block:
    """Return the monitor of a machine, with one false alarm an hour.

    Its commands follow speeds that the monitor does not measure, so that they tell more than its samples: the
    dispersion along a log covers that.
    """
    return hc.monitor(
        machine.model, list(machine.changes), false_alarms_per_hour=1.0, period=PERIOD,
        process_noise=machine.process, measurement_noise=machine.noise, motion=sound(machine, 120.0, 999),
        dispersion=True,
    )  # fmt: skip


@dataclass
class Cell:
    """What a monitor says of one size of a change: findings, and errors by their standard errors."""

    told: Counter[str]
    errors: list[float]

    @property
    def inside(self) -> int:
        return sum(abs(z) < 2.0 for z in self.errors)

    @property
    def met(self) -> bool | None:
        if not self.errors:
            return None
        return self.inside >= SHARE * len(self.errors) and abs(float(np.mean(self.errors))) < MEAN

    def __str__(self) -> str:
        if not self.errors:
            return "not named"
        return f"{self.inside} of {len(self.errors)}, mean {np.mean(self.errors):.2f}"


def judge(
    cell: Cell, watch: hc.Block, machine: Machine, name: str, size: float, seeds: Sequence[int]
) -> None:
    """Add runs to a cell."""
    compiled, every = watch.compile(), named_effects(watch)
    outputs = [s.name for s in watch.outputs]
    for data in runs_of(machine, name, size, seeds):
        t = PERIOD * np.arange(len(next(iter(data.values()))))
        inputs = {s.name: data.get(s.name, 0 * t) for s in watch.inputs}
        out = dict(zip(outputs, compiled.simulate(t, inputs).outputs, strict=True))
        late = np.flatnonzero(out["alarm"] > 0.5)
        if late.size and t[late[0]] < ONSET:
            cell.told["an alarm before the change"] += 1
            continue
        if not late.size:
            cell.told["none"] += 1
            continue
        k = min(late[0] + round(JUDGED / PERIOD), t.size - 1)
        found = every[int(out["effect"][k]) - 1]
        rivals = sum(out[o][k] > 0.5 for o in outputs if o.startswith("possible_")) > 1
        cell.told[f"{found}{' or more' if rivals else ''}"] += 1
        if found == name:
            cell.errors.append((float(out["change"][k]) - size) / float(out["change_std"][k]))


def rows(runs: int = 8, machines: Sequence[str] = ()) -> Iterator[tuple[str, str, str, bool | None]]:
    bar, seed = f"{100 * SHARE:.0f} %, mean < {MEAN:g}", 0
    for label in machines or MACHINES:
        every: list[Cell] = []
        for dry in (False, True):
            machine = MACHINES[label](dry)
            watch = monitor_of(machine)
            for name, size in ((n, s) for n, sizes in machine.changes.items() for s in sizes):
                cell, seed = Cell(Counter(), []), seed + MOST
                judge(cell, watch, machine, name, size, range(seed, seed + runs))
                if cell.met is False:
                    judge(cell, watch, machine, name, size, range(seed + runs, seed + max(runs, MOST)))
                every.append(cell)
                said = ", ".join(f"{n} {count}" for n, count in cell.told.items())
                where = f"{label}{', dry friction' if dry else ''}"
                yield f"{where}, {name} {size:g}: {said}", str(cell), bar, cell.met
        whole = Cell(Counter(), [z for cell in every for z in cell.errors])
        named = [cell for cell in every if cell.errors]
        met = sum(bool(cell.met) for cell in named)
        early = sum(cell.told["an alarm before the change"] for cell in every)
        text = f"{met} of {len(named)} cells met; runs: {whole}; an alarm before the change: {early}"
        yield f"{label}, all", text, "", None


if __name__ == "__main__":
    given = sys.argv[1:]
    for row in rows(int(given[0]) if given else 8, given[1:]):
        print(*row, flush=True)
