"""The monitor of a rudder craft in closed loop: false alarms, delays, names, coefficients, cost.

The craft has the coefficients of the blind table, Table II's noise of the pose (0.3 mm, 1 mrad) and white
noise in its accelerations, known to the monitor; with gusts also Ornstein-Uhlenbeck accelerations. It runs on
an ellipse under the tracking controller of C17.

``python -m benchmarks.monitor HOURS RATE ...`` simulates HOURS for each wanted rate of false alarms [1/h]:
2000 1 0.1 0.01, for example.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Collection, Iterator
from functools import cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy import stats

import hovercontrol as hc
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.monitor.monitor import named_effects

Array = NDArray[np.float64]

PERIOD, ONSET, AFTER = 0.02, 15.0, 10.0
NOISE = {"x": 3e-4, "y": 3e-4, "psi": 1e-3}
PROCESS = {"u": 0.01, "v": 0.01, "r": 0.03}
GUST, GUST_SECONDS = {"u": 0.05, "v": 0.05, "r": 0.15}, 0.3
#: Simulated hours by the wanted rate of false alarms [1/h].
HOURS = {20.0: 48.0, 1.0: 48.0}
#: Runs side by side, of one hour each.
RUNS = 48

#: Effects at the middle of the sizes of the blind table.
CASES: dict[str, dict[str, float]] = {
    "surge_quadratic_drag": {"value": 0.35},
    "sway_quadratic_drag": {"value": 0.7},
    "body_surge_force": {"value": -0.1},
    "slope": {"x": 0.1, "y": 0.0},
    "thrust_yaw_torque": {"value": 0.2},
    "rudder_offset": {"value": 0.065},
    "munk_moment": {"value": 0.65},
    "yaw_quadratic_drag": {"value": 0.2},
    "thrust_lag": {"seconds": 0.2},
    "rudder_lag": {"seconds": 0.165},
}
CANDIDATES = [*CASES, "thrust"]
FEW = ["thrust", "yaw_linear_drag", "surge_quadratic_drag", "rudder_offset"]


def craft() -> hc.Model:
    width = {"width": 0.01}
    return hc.Model(
        "craft",
        [
            hc.effect("surge_coulomb", 0.35, **width), hc.effect("surge_linear_drag", 0.4),
            hc.effect("sway_coulomb", 0.3, **width), hc.effect("sway_linear_drag", 0.9),
            hc.effect("yaw_coulomb", 0.6, **width), hc.effect("yaw_linear_drag", 0.5),
            hc.effect("thrust", 0.75), hc.effect("rudder_torque", 2.5),
        ],
    )  # fmt: skip


def pushed(model: AnyModel, driven: Collection[str] = tuple(PROCESS)) -> hc.Block:
    """Return the plant with accelerations ``push_NAME`` as inputs."""
    plant = as_model(model).plant()
    push = [hc.Signal(f"push_{k}", f"({plant.signal(k).unit})/s") for k in driven]
    rates = dict(plant.derivatives)
    for k, s in zip(driven, push, strict=True):
        rates[k] = rates[k] + s.symbol
    return hc.Block(
        plant.name, plant.states, (*plant.inputs, *push), plant.outputs, plant.parameters, rates,
        plant.output_expressions, plant.definitions, plant.definition_signals, delays=plant.delays,
    )  # fmt: skip


def law(model: hc.Model | None = None) -> list[hc.Block]:
    """Return the reference, the controller, which reads the true motion, and the hold of its commands."""
    way = hc.ellipse(1.4, 2.0, 0.7, 0.0)
    controller = hc.tracking_controller(model or craft(), control_point=0.6, k1=1.0, k2=1.5)
    sent = [hc.Signal("thrust", "1"), hc.Signal("rudder", "rad")]
    wanted = [s.replace(name=f"{s.name}_wanted") for s in sent]
    values = {s.name: w.symbol for s, w in zip(sent, wanted, strict=True)}
    hold = hc.Block("hold", [], wanted, sent, output_expressions=values, period=PERIOD)
    return [way, hc.rename(controller, {s.name: w.name for s, w in zip(sent, wanted, strict=True)}), hold]


def disturbed(gusts: bool, salt: str) -> hc.Block:
    """Return the noise of the measurements and of the accelerations, which hold from tick to tick."""
    noise = random_numbers(9, salt=salt)
    measured = [hc.Signal(k, u) for k, u in (("x", "m"), ("y", "m"), ("psi", "rad"))]
    seen = [s.replace(name=f"{s.name}_seen") for s in measured]
    units = {"u": "m/s^2", "v": "m/s^2", "r": "rad/s^2"}
    push = [hc.Signal(f"push_{k}", unit) for k, unit in units.items()]
    states = [hc.Signal(f"gust_{k}", unit) for k, unit in units.items()]
    one = {u: hc.Signal(f"one_{k}", u, start=1.0) for k, u in enumerate(("m", "rad", "m/s^2", "rad/s^2"))}
    n = list(noise.values)
    values = {
        s.name: m.symbol + NOISE[m.name] * one[m.unit].symbol * n[i]
        for i, (s, m) in enumerate(zip(seen, measured, strict=True))
    }
    following, decay = dict(noise.next_values), float(np.exp(-PERIOD / GUST_SECONDS))
    for i, (k, unit) in enumerate(units.items()):
        gust = states[i].symbol
        white = PROCESS[k] / np.sqrt(PERIOD) * one[unit].symbol * n[3 + i]
        values[f"push_{k}"] = gust + white
        size = GUST[k] * np.sqrt(1 - decay**2) if gusts else 0.0
        following[states[i].name] = decay * gust + size * one[unit].symbol * n[6 + i]
    return hc.Block(
        "disturbed", (*noise.states, *states), measured, (*seen, *push), (*noise.parameters, *one.values()),
        following, values, noise.definitions, period=PERIOD,
    )  # fmt: skip


def counter() -> hc.Block:
    """Count alarms; each is followed by a reset."""
    alarm, count, reset = hc.Signal("alarm"), hc.Signal("alarms"), hc.Signal("reset")
    following = {"alarms": count.symbol + alarm.symbol}
    return hc.Block(
        "counter", [count], [alarm], [count, reset], [], following, {"reset": alarm.symbol}, period=PERIOD
    )


def motion() -> hc.Log:
    """Return a minute of the loop without noise."""
    loop = hc.interconnect([craft().plant(), *law()], outputs=[*NOISE, "thrust", "rudder"])
    t = np.arange(0.0, 60.0, PERIOD)
    run = loop.compile().simulate(t)
    return hc.Log(
        "loop", t, dict(zip((s.name for s in loop.outputs), np.atleast_2d(run.outputs), strict=True))
    )


def watch(log: hc.Log, candidates: list[str], rate: float, gusts: bool) -> hc.Block:
    more = {"gusts": GUST, "gust_seconds": GUST_SECONDS} if gusts else {}
    return hc.monitor(
        craft(), candidates, false_alarms_per_hour=rate, period=PERIOD, process_noise=PROCESS,
        measurement_noise=NOISE, motion=log, start_std=dict.fromkeys(("x", "y", "psi", "u", "v", "r"), 0.3),
        **more,
    )  # fmt: skip


def false_alarms(block: hc.Block, threshold: float, hours: float, gusts: bool) -> Iterator[int]:
    """Yield the number of alarms above a threshold in each RUNS simulated hours."""
    names = {k: f"{k}_seen" for k in NOISE}
    seen = hc.rename(block, names)
    loop = hc.interconnect(
        [pushed(craft()), *law(), disturbed(gusts, "false"), seen, counter()], outputs=["alarms"]
    ).compile()
    for first in range(1, round(hours) + 1, RUNS):
        seeds = np.arange(first, min(first + RUNS, round(hours) + 1))
        params = {"disturbed.seed": seeds, "monitor.threshold": np.full(seeds.size, threshold)}
        found = loop.sweep(np.array([0.0, 3600.0]), params=params, method="rk4", step=PERIOD)
        yield int(found["alarms"].final.sum())


@cache
def loop_with(name: str | None) -> hc.Block:
    """Return the loop of a craft with an effect, or without; inputs are accelerations."""
    model = craft() if name is None else craft().with_effects([hc.effect(name, **CASES[name])])
    outputs = [*(s.name for s in craft().plant().states), "thrust", "rudder"]
    return hc.interconnect([pushed(model), *law()], inputs=[f"push_{n}" for n in PROCESS], outputs=outputs)


def changed(name: str | None, seed: int, noisy: bool = True) -> dict[str, Array]:
    """Return the measured channels and commands of a loop in which an effect sets in at ONSET."""
    rng = np.random.default_rng(seed)
    size = 1.0 if noisy else 0.0
    t = np.arange(0.0, ONSET + AFTER + PERIOD / 2, PERIOD)
    k = round(ONSET / PERIOD)
    push = {f"push_{n}": size * q / np.sqrt(PERIOD) * rng.normal(size=t.size) for n, q in PROCESS.items()}
    loops = [loop_with(None), loop_with(name)]
    outputs = [o.name for o in loops[0].outputs]
    first = loops[0].compile().simulate(t[: k + 1], {n: v[: k + 1] for n, v in push.items()})
    start = dict(zip((s.name for s in loops[0].states), first.states[:, -1], strict=True))
    start |= {  # a lag begins at its command: another start would be a second change
        s.name: float(first.outputs[outputs.index(command), -1])
        for s in loops[1].states
        for command in ("thrust", "rudder")
        if s.name.endswith(f"{command}_lagged")
    }
    then = loops[1].compile().simulate(t[k:], {n: v[k:] for n, v in push.items()}, x0=start)
    rows = np.hstack([first.outputs[:, :-1], then.outputs])
    found = dict(zip(outputs, rows, strict=True))
    for n, sd in NOISE.items():
        found[n] = found[n] + size * sd * rng.normal(size=t.size)
    return {n: found[n] for n in (*NOISE, "thrust", "rudder")}


def jumps(log: hc.Log, seeds: int = 10) -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield how a sensor that is off from ONSET on is told, 1 s after the alarm."""
    block = watch(log, [*CANDIDATES, *(f"{k}_bias" for k in NOISE)], 1.0, False)
    compiled, names, channels = block.compile(), named_effects(block), [s.name for s in block.outputs]
    for channel, size in (("x", 0.02), ("x", 0.005), ("psi", 0.05), ("psi", 0.01)):
        right, within, widest = 0, 0, 0.0
        for seed in range(1, seeds + 1):
            data = changed(None, seed)
            t = PERIOD * np.arange(len(data["x"]))
            data[channel] = data[channel] + size * (t >= ONSET)
            out = dict(zip(channels, compiled.simulate(t, data | {"reset": 0 * t}).outputs, strict=True))
            late = np.flatnonzero((out["alarm"] > 0.5) & (t >= ONSET))
            if not late.size:
                continue
            k = late[0] + round(1.0 / PERIOD)
            right += names[round(float(out["effect"][k])) - 1] == f"{channel}_bias"
            within += abs(out["change"][k] - size) < 2 * out["change_std"][k]
            widest = max(widest, float(out["change_std"][k]))
        unit = block.signal(channel).unit
        yield (
            f"{channel} off by {size:g} {unit}: named, and within 2 standard deviations",
            f"{right} and {within} of {seeds}; at most {widest:.2g} {unit}",
            "90 % within",
            within >= 0.9 * seeds,
        )


def information(block: hc.Block) -> Ticking:
    """Return a monitor whose outputs are its whitened innovations."""
    outputs = tuple(hc.Signal(f"e{i}") for i in range(len(NOISE)))
    symbols = {s.name: sp.Symbol(f"whitened[{i}]", real=True) for i, s in enumerate(outputs)}
    return Ticking(block.unchecked(outputs=outputs, output_expressions=Expressions(symbols)))


def bound(run: Ticking, log: dict[str, Array], rate: float) -> float:
    """Return Lorden's bound of the mean delay [s]: the time at which the divergence reaches ln(gamma).

    The divergence is half the sum of squares of the means of the whitened innovations, which a log without
    noise shows; gamma is the mean time between false alarms in ticks.
    """
    total, state = 0.0, run.state
    for k in range(len(log["x"])):
        e = run.tick(k * PERIOD, {n: v[k] for n, v in log.items()} | {"reset": 0.0})
        total += 0.5 * sum(v**2 for v in e.values()) if k * PERIOD >= ONSET else 0.0
        if total >= np.log(3600.0 / PERIOD / rate):
            run.state = state
            return k * PERIOD - ONSET
    run.state = state
    return float("inf")


def rows(hours: dict[float, float] | None = None) -> Iterator[tuple[str, str, str, bool | None]]:
    log = motion()
    yield from delays(log)
    yield from jumps(log)
    for gusts in (False, True):
        label, first = "with gusts" if gusts else "white noise", None
        for asked, simulated in (hours or HOURS).items():
            block = watch(log, FEW, asked, gusts)
            threshold = float(block.parameter("threshold").start)
            first = first or block
            begin = time.perf_counter()
            count = 0
            for block_of_hours, some in enumerate(false_alarms(first, threshold, simulated, gusts), 1):
                count += some
                done = min(RUNS * block_of_hours, round(simulated))
                print(f"  {label}, {asked:g} in 1 h: {count} in {done} h", end="\r", file=sys.stderr)
            spent = time.perf_counter() - begin
            low, high = stats.chi2.ppf(0.025, 2 * count) / 2, stats.chi2.ppf(0.975, 2 * count + 2) / 2
            low = 0.0 if count == 0 else low
            measured, expected = count / simulated, asked * simulated
            enough = expected >= 400  # 10 % are two standard deviations
            yield (
                f"{label}, asked for {asked:g} in 1 h: {count} in {simulated:g} h ({spent:.0f} s)",
                f"{measured:.3g} in 1 h ({low / simulated:.3g} to {high / simulated:.3g})",
                f"{asked:g} +- 10 %" if enough else f"{asked:g} in the interval",
                abs(measured / asked - 1) <= 0.1 if enough else low <= expected <= high,
            )


def delays(log: hc.Log, rate: float = 1.0, seeds: int = 10) -> Iterator[tuple[str, str, str, bool | None]]:
    block = watch(log, CANDIDATES, rate, False)
    compiled, run, names = block.compile(), information(block), named_effects(block)
    channels = [s.name for s in block.outputs]
    right, alone, within, early, all_delays, total = 0, 0, 0, 0, [], 0
    missed: Counter[str] = Counter()
    shares, sizes = [], []
    candidates = [s.name.removeprefix("possible_") for s in block.outputs if s.name.startswith("possible_")]
    for name in CASES:
        least, took = bound(run, changed(name, 0, noisy=False), rate), []
        told = []
        for seed in range(1, seeds + 1):
            data = changed(name, seed)
            t = PERIOD * np.arange(len(data["x"]))
            out = dict(zip(channels, compiled.simulate(t, data | {"reset": 0 * t}).outputs, strict=True))
            total += 1
            late = np.flatnonzero((out["alarm"] > 0.5) & (t >= ONSET))
            if not late.size:
                told.append("none")
                continue
            took.append(float(t[late[0]] - ONSET))
            k = min(late[0] + round(5.0 / PERIOD), t.size - 1)
            best = names[round(float(out["effect"][k])) - 1]
            possible = [n for n in candidates if out[f"possible_{n}"][k] > 0.5]
            told.append(best if len(possible) == 1 else f"{best} or {len(possible) - 1} more")
            wanted = f"{name}_x" if name == "slope" else name
            early += out[f"possible_{wanted}"][late[0] + round(1.0 / PERIOD)] > 0.5
            right += wanted in possible and len(possible) <= 3
            alone += wanted not in possible and len(possible) == 1
            truth = next(iter(CASES[name].values()))
            error = abs(float(out["change"][k]) - truth)
            inside = error < 2 * float(out["change_std"][k])
            within += best == wanted and inside
            missed[name] += best == wanted and not inside
            shares.append(float(out[f"evidence_{wanted}"][k] / out["evidence"][k]))
            sizes.append(len(possible))
        all_delays += took
        mean = float(np.mean(took)) if took else float("inf")
        yield (
            f"delay, {name}",
            f"{mean:.2f} s; {', '.join(f'{n} {k}' for k, n in Counter(told).items())}",
            f"{1.5 * least:.2f} s",
            mean <= 1.5 * least,
        )
    yield "median delay", f"{np.median(all_delays):.2f} s", "1.0 s", bool(np.median(all_delays) <= 1.0)
    yield "right name within 5 s, alone or among 3", f"{right} of {total}", "95 %", right >= 0.95 * total
    yield "right name possible 1 s after the alarm", f"{early} of {total}", "", None
    yield "wrong name alone, 5 s after the alarm", f"{alone} of {total}", "1 %", alone <= 0.01 * total
    yield (
        "coefficient within 2 standard deviations, 5 s after the alarm",
        f"{within} of {right}",
        "90 %",
        within >= 0.9 * right,
    )
    yield "outside, by effect", ", ".join(f"{n} {k}" for n, k in missed.items() if k), "", None
    yield "share of the right name in the largest evidence, least", f"{min(shares):.2f}", "", None
    yield "names that are possible, mean", f"{np.mean(sizes):.2f}", "", None
    yield "operations per tick", f"{operations(block)}", "", None
    size = 8 * len(block.states)
    yield "state", f"{size} bytes", "32 kB", size < 32768


def operations(block: hc.Block) -> int:
    """Return the number of operations per tick, of all expressions of a Block."""
    every = (block.definitions, block.derivatives, block.output_expressions)
    return sum(int(sp.count_ops(e)) for some in every for e in some.values())


if __name__ == "__main__":
    given = [float(a) for a in sys.argv[1:]]
    for row in rows(dict.fromkeys(given[1:] or HOURS, given[0]) if given else None):
        print(*row, flush=True)
