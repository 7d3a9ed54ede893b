"""Effects that act in one regime only: is the regime found, is the function right, is a name false?

``python -m benchmarks.local_effects [--machines cart] [--effects hump stall] [--seeds 5] [--seconds 60]``

The generator shares no code with the package: three machines in NumPy, eight effects, each limited to a
regime, two logs and one held out. It prints a row for each case, then the figures of all:

* F1 of the rows of the training logs in which the named effects of the right equation act, or, where nothing
  is named there, of the regions without a name;
* function: what the amended model still misses of the true acceleration, at the true states, over what was
  hidden (rms). A form that is the same in these logs is as right as the one that was hidden;
* right: F1 of at least 0.85, and at most 0.25 of what was hidden is missed (rms);
* false: names in an equation in which nothing is hidden, and names without the right signal as their region
  unless the function is right;
* within: coefficients of the given model within two standard errors of the truth.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import hovercontrol as hc

Array = np.ndarray
Signals = Mapping[str, Any]

RATE, SUB = 50, 20
SEED = 58_2026

#: Part of what was hidden (rms) that an amended model with the right function may miss.
RIGHT = 0.25


@dataclass(frozen=True)
class Machine:
    """A machine: its equations, coefficients, commands and noise, and the signals on which effects act."""

    states: tuple[str, ...]
    nominal: Mapping[str, float]
    slopes: Callable[[Signals, Mapping[str, float]], dict[str, Any]]
    commands: Callable[[np.random.Generator, int], dict[str, Array]]
    noise: Mapping[str, float]
    speed: str  # the state on which drags act, its usual size, and the equation of the steering
    usual: float
    turning: str
    push: str
    push_usual: float
    steer: str
    steer_usual: float
    place: str
    model: Callable[[Mapping[str, float]], Any]


def held(rng: np.random.Generator, n: int, draw: Callable[[], float], short: float, long: float) -> Array:
    """Return a command that is held for random times."""
    out, k = np.zeros(n), 0
    while k < n:
        d = int(rng.uniform(short, long) * RATE)
        out[k : k + d] = draw()
        k += d
    return out


def craft_slopes(s: Signals, p: Mapping[str, float]) -> dict[str, Any]:
    c, n = np.cos(s["psi"]), np.sin(s["psi"])
    dry = {k: np.tanh(s[k] / 0.01) for k in "uvr"}
    return {
        "x": c * s["u"] - n * s["v"],
        "y": n * s["u"] + c * s["v"],
        "psi": s["r"],
        "u": -p["surge_coulomb"] * dry["u"] - p["surge_linear_drag"] * s["u"]
        + p["thrust"] * s["thrust"] * np.cos(s["rudder"]) + s["v"] * s["r"],
        "v": -p["sway_coulomb"] * dry["v"] - p["sway_linear_drag"] * s["v"]
        + p["thrust"] * s["thrust"] * np.sin(s["rudder"]) - s["u"] * s["r"],
        "r": -p["yaw_coulomb"] * dry["r"] - p["yaw_linear_drag"] * s["r"]
        - p["rudder_torque"] * s["thrust"] * np.sin(s["rudder"]),
    }  # fmt: skip


def craft_model(p: Mapping[str, float]) -> Any:
    return hc.Model("craft", tuple(hc.effect(name, value) for name, value in p.items()))


def ship_slopes(s: Signals, p: Mapping[str, float]) -> dict[str, Any]:
    c, n = np.cos(s["psi"]), np.sin(s["psi"])
    return {
        "x": c * s["u"] - n * s["v"],
        "y": n * s["u"] + c * s["v"],
        "psi": s["r"],
        "u": p["kn"] * s["n"] - p["du"] * s["u"] - p["duu"] * abs(s["u"]) * s["u"],
        "v": p["kv"] * s["u"] * s["delta"] - p["dv"] * s["v"] - p["mv"] * s["u"] * s["r"],
        "r": p["kr"] * s["u"] * s["delta"] - p["dr"] * s["r"] - p["drr"] * abs(s["r"]) * s["r"],
    }


def ship_model(p: Mapping[str, float]) -> Any:
    import sympy as sp

    units = {"kn": "m/s^2", "du": "1/s", "duu": "1/m", "kv": "1/s", "dv": "1/s", "mv": "1", "kr": "rad/s/m",
             "dr": "1/s", "drr": "1/rad"}  # fmt: skip
    of = {"x": "m", "y": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}
    s = {name: hc.Signal(name, unit) for name, unit in of.items()}
    w = {"n": hc.Signal("n"), "delta": hc.Signal("delta", "rad")}
    q = {name: hc.Signal(name, units[name], start=value) for name, value in p.items()}
    e = {k: v.symbol for k, v in {**s, **w}.items()}
    g = {k: v.symbol for k, v in q.items()}
    c, n = sp.cos(e["psi"]), sp.sin(e["psi"])
    laws = {
        "x": c * e["u"] - n * e["v"],
        "y": n * e["u"] + c * e["v"],
        "psi": e["r"],
        "u": g["kn"] * e["n"] - g["du"] * e["u"] - g["duu"] * sp.Abs(e["u"]) * e["u"],
        "v": g["kv"] * e["u"] * e["delta"] - g["dv"] * e["v"] - g["mv"] * e["u"] * e["r"],
        "r": g["kr"] * e["u"] * e["delta"] - g["dr"] * e["r"] - g["drr"] * sp.Abs(e["r"]) * e["r"],
    }
    return hc.Block("ship", list(s.values()), list(w.values()), list(s.values()), list(q.values()), laws)


def cart_slopes(s: Signals, p: Mapping[str, float]) -> dict[str, Any]:
    return {"x": s["v"], "v": p["g"] * s["F"] - p["c"] * s["v"] - p["d"] * abs(s["v"]) * s["v"]}


def cart_model(p: Mapping[str, float]) -> Any:
    import sympy as sp

    x, v, F = hc.Signal("x", "m"), hc.Signal("v", "m/s"), hc.Signal("F", "N")
    g, c, d = (hc.Signal(n, unit, start=p[n]) for n, unit in (("g", "1/kg"), ("c", "1/s"), ("d", "1/m")))
    force = g.symbol * F.symbol - c.symbol * v.symbol - d.symbol * sp.Abs(v.symbol) * v.symbol
    return hc.Block("cart", [x, v], [F], [x, v], [g, c, d], {"x": v.symbol, "v": force})


MACHINES = {
    "craft": Machine(
        ("x", "y", "psi", "u", "v", "r"),
        {"surge_coulomb": 0.45, "surge_linear_drag": 0.35, "sway_coulomb": 0.4, "sway_linear_drag": 0.8,
         "yaw_coulomb": 0.6, "yaw_linear_drag": 0.9, "thrust": 0.75, "rudder_torque": 3.66},
        craft_slopes,
        lambda g, n: {"thrust": held(g, n, lambda: g.choice([0, 0.4, 0.9, 1.6, 2.3, 3.0, 3.5]), 0.8, 3.0),
                      "rudder": held(g, n, lambda: g.uniform(-0.42, 0.42), 0.5, 2.0)},
        {"x": 2e-3, "y": 2e-3, "psi": 4e-3, "u": 1e-2, "v": 1e-2, "r": 2e-2},
        "u", 1.2, "r", "thrust", 1.8, "rudder", 0.25, "x", craft_model,
    ),
    "ship": Machine(
        ("x", "y", "psi", "u", "v", "r"),
        {"kn": 0.5, "du": 0.15, "duu": 0.2, "kv": 0.15, "dv": 0.5, "mv": 0.4, "kr": 1.2, "dr": 0.6,
         "drr": 0.3},
        ship_slopes,
        lambda g, n: {"n": held(g, n, lambda: g.uniform(0.0, 2.0), 2.0, 6.0),
                      "delta": held(g, n, lambda: g.uniform(-0.6, 0.6), 1.0, 4.0)},
        {"x": 5e-3, "y": 5e-3, "psi": 2e-3, "u": 1e-2, "v": 1e-2, "r": 5e-3},
        "u", 1.2, "r", "n", 1.0, "delta", 0.3, "x", ship_model,
    ),
    "cart": Machine(
        ("x", "v"), {"g": 0.9, "c": 0.5, "d": 0.15}, cart_slopes,
        lambda g, n: {"F": held(g, n, lambda: g.uniform(-2.0, 2.0), 0.5, 3.0)},
        {"x": 2e-3, "v": 1e-2}, "v", 1.2, "v", "F", 1.0, "F", 1.0, "x", cart_model,
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Hidden:
    """An effect in one regime: what it adds, where, in which equations, and of which signal."""

    adds: Callable[[Signals], dict[str, Any]]
    where: Callable[[Signals], Any]
    equations: tuple[str, ...]
    signal: str


def hidden(m: Machine, kind: str, rng: np.random.Generator, p: Mapping[str, float]) -> Hidden:
    """Return an effect of a kind, of random size and place."""
    a, s, t = rng.uniform(0.8, 1.3), m.speed, m.turning
    U, P, S = m.usual, m.push_usual, m.steer_usual
    if kind == "hump":
        at, wide, size = rng.uniform(0.5, 0.8) * U, 0.1 * U, 0.35 * a
        return Hidden(
            lambda x: {s: -size * np.exp(-(((x[s] - at) / wide) ** 2))},
            lambda x: abs(x[s] - at) < 1.5 * wide, (s,), s,
        )  # fmt: skip
    if kind == "drag_above":
        at, size = (1.3 if t == "r" and s == "u" else 0.8 * U) * rng.uniform(0.85, 1.1), 1.5 * a
        at = 0.5 * at if m.push == "n" else at
        return Hidden(
            lambda x: {t: -size * np.sign(x[t]) * max(abs(x[t]) - at, 0.0)}, lambda x: abs(x[t]) > at, (t,), t
        )
    if kind == "drag_fades":
        drag = {"craft": "surge_linear_drag", "ship": "du", "cart": "c"}[name_of(m)]
        at, size = rng.uniform(0.4, 0.6) * U, 0.6 * p[drag]
        return Hidden(
            lambda x: {s: size * np.sign(x[s]) * max(abs(x[s]) - at, 0.0)}, lambda x: abs(x[s]) > at, (s,), s
        )
    if kind == "stall":
        at, loss = 1.1 * S, 0.55 * a
        cut = lambda d: np.sign(d) * max(abs(d) - at, 0.0)  # noqa: E731
        gain = {"craft": 3.6, "ship": 1.2, "cart": 0.9}[name_of(m)]
        sign = -1.0 if name_of(m) == "craft" else 1.0
        by = {"craft": m.push, "ship": "u", "cart": ""}[name_of(m)]
        return Hidden(
            lambda x: {t: -sign * loss * gain * (x[by] if by else 1.0) * cut(x[m.steer])},
            lambda x: abs(x[m.steer]) > at, (t,), m.steer,
        )  # fmt: skip
    if kind == "torque_above":
        at, size = 1.2 * P, 0.6 * a
        return Hidden(lambda x: {t: size * (x[m.push] > at)}, lambda x: x[m.push] > at, (t,), m.push)
    if kind == "weak_below":
        at, size = 0.6 * P, 0.5 * a
        return Hidden(
            lambda x: {s: -size * p[next(k for k in p if k in ("thrust", "kn", "g"))] * x[m.push]
                       * (0 < x[m.push] < at)},
            lambda x: (x[m.push] > 0) & (x[m.push] < at), (s,), m.push,
        )  # fmt: skip
    if kind == "one_way":
        way, size = ("v" if name_of(m) != "cart" else s), 0.6 * a
        return Hidden(lambda x: {way: -size * min(x[way], 0.0)}, lambda x: x[way] < 0.0, (way,), way)
    if kind == "tent":
        at, wide, size = rng.uniform(0.5, 0.8) * U, 0.2 * U, 0.35 * a
        return Hidden(
            lambda x: {s: -size * max(1.0 - abs(x[s] - at) / wide, 0.0)},
            lambda x: abs(x[s] - at) < wide,
            (s,),
            s,
        )
    low, wide, size = rng.uniform(-1.0, 0.0), 1.5, 0.6 * a
    return Hidden(
        lambda x: {s: -size * x[s] * (low < x[m.place] < low + wide)},
        lambda x: (x[m.place] > low) & (x[m.place] < low + wide), (s,), m.place,
    )  # fmt: skip


KINDS = ("hump", "drag_above", "drag_fades", "stall", "torque_above", "weak_below", "one_way", "rough_place")

#: A hump of a shape that no form has.
ALL = (*KINDS, "tent")


def name_of(m: Machine) -> str:
    return next(name for name, one in MACHINES.items() if one is m)


def log(
    m: Machine, name: str, rng: np.random.Generator, p: Mapping[str, float], e: Hidden, seconds: float
) -> tuple[hc.Log, dict[str, Array]]:
    """Return a log of the machine with the effect, with measurement noise, and the true rows without it."""
    n, h = int(seconds * RATE), 1 / RATE / SUB
    commands = m.commands(rng, n)
    x = dict.fromkeys(m.states, 0.0)
    rows = {k: np.empty(n) for k in m.states}

    def slope(x: Signals, u: Signals) -> dict[str, Any]:
        found = m.slopes({**x, **u}, p)
        for key, value in e.adds({**x, **u}).items():
            found[key] = found[key] + value
        return found

    for k in range(n):
        u = {key: row[k] for key, row in commands.items()}
        for key in m.states:
            rows[key][k] = x[key]
        for _ in range(SUB):
            d = slope(x, u)
            d = slope({key: x[key] + 0.5 * h * d[key] for key in m.states}, u)
            x = {key: x[key] + h * d[key] for key in m.states}
    seen = {key: rows[key] + rng.normal(size=n) * m.noise[key] for key in m.states}
    return hc.Log(name, np.arange(n) / RATE, {**seen, **commands}), {**rows, **commands}


def function_error(m: Machine, amended: Any, p: Mapping[str, float], e: Hidden, rows: Signals) -> float:
    """Return by how much an amended model misses the true acceleration, over what was hidden there (rms)."""
    block = amended.plant()
    n = len(rows[m.states[0]])
    x, u = ([rows.get(s.name, np.zeros(n)) for s in group] for group in (block.states, block.inputs))
    found = block.to_numpy().array_derivatives(np.zeros(n), x, u, block.parameter_values())
    found = dict(zip([s.name for s in block.states], found, strict=True))
    each = [{k: row[i] for k, row in rows.items()} for i in range(n)]
    hides = {q: np.array([e.adds(one)[q] for one in each]) for q in e.equations}
    known = m.slopes(rows, p)
    missed = [np.mean((found[q] - known[q] - hides[q]) ** 2) / np.mean(hides[q] ** 2) for q in e.equations]
    return float(np.sqrt(max(missed)))


def inside(regions: Sequence[Mapping[str, Any]], rows: Signals) -> Array:
    """Return the rows in any of some ranges of signals, as a mask."""
    said = np.zeros(len(next(iter(rows.values()))), dtype=bool)
    for r in regions:
        low, high = (-np.inf if r["low"] is None else r["low"]), (np.inf if r["high"] is None else r["high"])
        said |= (rows[r["signal"]] > low) & (rows[r["signal"]] < high)
    return said


def case(machine: str, kind: str, seed: int, seconds: float) -> dict[str, Any]:
    """Return the figures of one case."""
    m = MACHINES[machine]
    rng = np.random.default_rng([SEED, seed, list(MACHINES).index(machine), ALL.index(kind)])
    p = {k: v * (1 + rng.uniform(-0.15, 0.15)) for k, v in m.nominal.items()}
    e = hidden(m, kind, rng, p)
    made = [log(m, f"{which}.csv", rng, p, e, seconds) for which in ("one", "two", "hold")]
    given = {k: v * (1 + rng.uniform(-0.03, 0.03)) for k, v in p.items()}
    begun = time.process_time()
    found = hc.diagnose(m.model(given), [made[0][0], made[1][0]], made[2][0])
    spent = time.process_time() - begun
    result = found.result()
    rows = {k: np.concatenate([made[0][1][k], made[1][1][k]]) for k in made[0][1]}
    error = function_error(m, found.amended, p, e, rows)
    hides = [f"{q}'" for q in e.equations]
    own = [one for one in result["effects"] if one["equation"] in hides]
    ranges = [r for one in own for r in one["region"] or []]
    false = [
        one["name"]
        for one in result["effects"]
        if one["equation"] not in hides
        or (error > RIGHT and e.signal not in {r["signal"] for r in one["region"] or []})
    ]
    said = inside(ranges or [r for r in result["where"]["regions"] if r["equation"] in hides], rows)
    there = np.asarray(e.where(rows), dtype=bool)
    f1 = 2 * float((said & there).sum()) / max(float(said.sum() + there.sum()), 1.0)
    fitted = {c["name"].rpartition(".")[2]: c for c in result["coefficients"]}
    within = [abs(fitted[k]["value"] - v) <= 2 * fitted[k]["std"] for k, v in p.items() if k in fitted]
    names = [one["name"] for one in result["effects"]]
    return {"f1": f1, "error": error, "right": f1 >= 0.85 and error <= RIGHT, "false": false,
            "within": within, "names": names, "seconds": spent, "verdict": result["verdict"]}  # fmt: skip


def main() -> None:
    """Run the cases and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", nargs="+", default=list(MACHINES), choices=list(MACHINES))
    parser.add_argument("--effects", nargs="+", default=list(KINDS), choices=ALL)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--seconds", type=float, default=60.0, help="length of each log")
    given = parser.parse_args()
    found = []
    print("machine effect       seed  verdict          F1  function  right false  within  time  named")
    for seed in range(given.first, given.first + given.seeds):
        for machine in given.machines:
            for kind in given.effects:
                one = case(machine, kind, seed, given.seconds)
                found.append(one)
                print(f"{machine:7s} {kind:12s} {seed:4d}  {one['verdict']:12s} {one['f1']:6.2f} "
                      f"{one['error']:8.2f}  {'yes' if one['right'] else 'no':5s} {len(one['false']):5d}   "
                      f"{sum(one['within'])}/{len(one['within'])} {one['seconds']:6.0f} s  "
                      f"{', '.join(one['names'])}", flush=True)  # fmt: skip
    within = [w for one in found for w in one["within"]]
    print(f"{len(found)} cases: region (F1 >= 0.85) and function right "
          f"{np.mean([one['right'] for one in found]):.0%} (bar 80 %), "
          f"false names {np.mean([bool(one['false']) for one in found]):.0%} (bar 3 %), "
          f"coefficients within two errors {np.mean(within):.0%} (bar 90 %), "
          f"{np.mean([one['seconds'] for one in found]):.0f} s of processor time each")  # fmt: skip


if __name__ == "__main__":
    main()
