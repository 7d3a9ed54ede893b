"""Parameters of any form: time of a fit with ten of them, and estimates beside those of an output-error fit.

    python benchmarks/parameters.py

The simulators share no code with the package: exact solutions or Runge-Kutta steps in NumPy. The output-error
fit is ``scipy.optimize.least_squares`` on the same stretches of the logs, each with an initial state of its
own (:mod:`hovercontrol.identification.engine.rows`), weighted by the noise levels of the package's fit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import least_squares

import hovercontrol as hc

Array = NDArray[np.float64]
Law = Callable[[Mapping[str, float], Array, Array], Array]

#: Rows and time step of the logs: 60 s at 100 Hz. Runge-Kutta steps from row to row.
ROWS, STEP, PIECES = 6000, 0.01, 4


def steps(rng: np.random.Generator, low: float, high: float, every: int) -> Array:
    """Return a command that is drawn anew every so many rows."""
    return np.repeat(rng.uniform(low, high, ROWS // every), every)


def run(law: Law, p: Mapping[str, float], u: Array, x: Array) -> Array:
    """Return the states of parallel runs at all rows, (K, n, W), by Runge-Kutta steps; u is (K, m, W)."""
    found, h = np.empty((len(u), *x.shape)), STEP / PIECES
    for k, now in enumerate(u):
        found[k] = x
        for _ in range(PIECES):
            a = law(p, x, now)
            b = law(p, x + 0.5 * h * a, now)
            c = law(p, x + 0.5 * h * b, now)
            x = x + h / 6.0 * (a + 2 * b + 2 * c + law(p, x + h * c, now))
    return found


def boat(p: Mapping[str, float], x: Array, u: Array) -> Array:
    """Return the accelerations of a boat with masses, inertia and drags."""
    v, w, r = x
    return np.array(
        [
            (u[0] + p["mv"] * w * r - p["du"] * v * abs(v) - p["eu"] * v) / p["mu"],
            (-p["mu"] * v * r - p["dv"] * w) / p["mv"] + p["kv"] * u[1] / p["mv"],
            (p["arm"] * u[1] + (p["mu"] - p["mv"]) * v * w - p["dr"] * r - p["er"] * r * abs(r))
            / p["inertia"],
        ]
    )


BOAT = {
    "mu": (12.0, "kg"), "mv": (18.0, "kg"), "inertia": (1.5, "kg*m^2"), "du": (6.0, "kg/m"),
    "eu": (2.0, "kg/s"), "dv": (20.0, "kg/s"), "kv": (0.4, "1"), "arm": (0.6, "m"),
    "dr": (1.2, "kg*m^2/s"), "er": (0.5, "kg*m^2"),
}  # fmt: skip


def boat_block(start: Mapping[str, float], linear: bool) -> hc.Block:
    """Return the boat as a Block: with masses in denominators, or with ten linear coefficients."""
    v, w, r = hc.Signal("u", "m/s"), hc.Signal("v", "m/s"), hc.Signal("r", "rad/s")
    X, N = hc.Signal("X", "N"), hc.Signal("N", "N")
    if not linear:
        named = {n: hc.Signal(n, unit, start=start[n]) for n, (_, unit) in BOAT.items()}
        p = {n: s.symbol for n, s in named.items()}
        of_v = (
            X.symbol
            + p["mv"] * w.symbol * r.symbol
            - p["du"] * v.symbol * sp.Abs(v.symbol)
            - p["eu"] * v.symbol
        )
        of_w = -p["mu"] * v.symbol * r.symbol - p["dv"] * w.symbol + p["kv"] * N.symbol
        of_r = p["arm"] * N.symbol + (p["mu"] - p["mv"]) * v.symbol * w.symbol - p["dr"] * r.symbol
        of_r -= p["er"] * r.symbol * sp.Abs(r.symbol)
        laws = {"u": of_v / p["mu"], "v": of_w / p["mv"], "r": of_r / p["inertia"]}
        return hc.Block("boat", [v, w, r], [X, N], [v, w, r], list(named.values()), laws)
    s, drag, spin = start, v.symbol * sp.Abs(v.symbol), r.symbol * sp.Abs(r.symbol)
    of = {
        "a1": (1 / s["mu"], "1/kg", "u", X.symbol),
        "a2": (s["mv"] / s["mu"], "1", "u", w.symbol * r.symbol),
        "a3": (-s["du"] / s["mu"], "1/m", "u", drag),
        "a4": (-s["eu"] / s["mu"], "1/s", "u", v.symbol),
        "a5": (-s["mu"] / s["mv"], "1", "v", v.symbol * r.symbol),
        "a6": (-s["dv"] / s["mv"], "1/s", "v", w.symbol),
        "a7": (s["kv"] / s["mv"], "1/kg", "v", N.symbol),
        "a8": (s["arm"] / s["inertia"], "1/kg/m", "r", N.symbol),
        "a9": (-s["dr"] / s["inertia"], "1/s", "r", r.symbol),
        "a10": (-s["er"] / s["inertia"], "1", "r", spin),
    }
    parameters = [hc.Signal(n, unit, start=value) for n, (value, unit, _, _) in of.items()]
    laws = {"u": sp.S.Zero, "v": sp.S.Zero, "r": sp.S.Zero}
    for signal, (_, _, state, form) in zip(parameters, of.values(), strict=True):
        laws[state] += signal.symbol * form
    return hc.Block("boat", [v, w, r], [X, N], [v, w, r], parameters, laws)


def cart(p: Mapping[str, float], x: Array, u: Array) -> Array:
    """Return the acceleration of a cart."""
    return np.array([(u[0] - p["c"] * x[0]) / p["m"]])


def pendulum(p: Mapping[str, float], x: Array, u: Array) -> Array:
    """Return the rates of a pendulum with a mass at its end."""
    inertia = p["m"] * p["l"] ** 2
    return np.array([x[1], (u[0] - p["m"] * 9.81 * p["l"] * np.sin(x[0]) - p["d"] * x[1]) / inertia])


def motor(p: Mapping[str, float], x: Array, u: Array) -> Array:
    """Return the rates of current and speed of a DC motor."""
    i, w = x
    return np.array([(u[0] - p["R"] * i - p["K"] * w) / p["L"], (p["K"] * i - p["b"] * w) / p["J"]])


def saturated(p: Mapping[str, float], x: Array, u: Array) -> Array:
    """Return the acceleration of a cart whose force saturates."""
    return np.array([np.clip(u[0], -p["L"], p["L"]) / p["m"] - p["c"] * x[0]])


def blocks(p: Mapping[str, hc.Signal]) -> dict[str, tuple[list[hc.Signal], hc.Signal, dict[str, sp.Expr]]]:
    """Return states, input and equations of the small machines."""
    s = {n: one.symbol for n, one in p.items()}
    q, w, v, i = hc.Signal("q", "rad"), hc.Signal("w", "rad/s"), hc.Signal("v", "m/s"), hc.Signal("i", "A")
    F, T, V = hc.Signal("F", "N"), hc.Signal("T", "N*m"), hc.Signal("V", "V")
    found: dict[str, tuple[list[hc.Signal], hc.Signal, dict[str, sp.Expr]]] = {}
    if set(s) == {"m", "c"}:
        found["cart"] = [v], F, {"v": (F.symbol - s["c"] * v.symbol) / s["m"]}
    if set(s) == {"m", "l", "d", "g"}:
        push = T.symbol - s["m"] * s["g"] * s["l"] * sp.sin(q.symbol) - s["d"] * w.symbol
        found["pendulum"] = [q, w], T, {"q": w.symbol, "w": push / (s["m"] * s["l"] ** 2)}
    if set(s) == {"R", "L", "K", "J", "b"}:
        volt = V.symbol - s["R"] * i.symbol - s["K"] * w.symbol
        found["motor"] = (
            [i, w],
            V,
            {"i": volt / s["L"], "w": (s["K"] * i.symbol - s["b"] * w.symbol) / s["J"]},
        )
    if set(s) == {"m", "c", "L"}:
        force = sp.Max(-s["L"], sp.Min(s["L"], F.symbol))
        found["saturated"] = [v], F, {"v": force / s["m"] - s["c"] * v.symbol}
    return found


#: Law, true parameters with units, what is kept, reach of the command and rows between its jumps, noise.
MACHINES: dict[str, tuple[Law, dict[str, tuple[float, str]], Sequence[str], float, int, list[float]]] = {
    "cart": (cart, {"m": (2.0, "kg"), "c": (1.0, "kg/s")}, (), 2.5, 120, [4e-3]),
    "pendulum": (
        pendulum,
        {"m": (0.5, "kg"), "l": (0.4, "m"), "d": (0.05, "N*m*s"), "g": (9.81, "m/s^2")},
        ("g",), 1.2, 50, [3e-3, np.nan],
    ),
    "motor": (
        motor,
        {"R": (1.5, "ohm"), "L": (0.05, "H"), "K": (0.1, "V*s"), "J": (1e-3, "kg*m^2"), "b": (2e-3, "N*m*s")},
        (), 12.0, 40, [0.02, 0.3],
    ),
    "saturated": (saturated, {"m": (2.0, "kg"), "c": (0.5, "1/s"), "L": (1.6, "N")}, (), 2.5, 120, [4e-3]),
}  # fmt: skip


def compared(name: str, seed: int) -> float:
    """Print the estimates of a machine beside those of an output-error fit; return the largest difference."""
    law, truth, fixed, reach, every, noise = MACHINES[name]
    rng = np.random.default_rng(seed)
    p = {n: value for n, (value, _) in truth.items()}
    start = {n: value if n in fixed else value * rng.choice([0.9, 1.1]) for n, value in p.items()}
    signals = {n: hc.Signal(n, unit, start=start[n]) for n, (_, unit) in truth.items()}
    states, command, laws = blocks(signals)[name]
    block = hc.Block(name, states, [command], states, list(signals.values()), laws)
    u = steps(rng, -reach, reach, every)
    x = run(law, p, u[:, None, None], np.zeros((len(states), 1)))[..., 0]
    seen = {s.name: x[:, j] + noise[j] * rng.normal(size=ROWS) for j, s in enumerate(states) if noise[j] > 0}
    found = hc.identify(block, [hc.Log(name, STEP * np.arange(ROWS), {**seen, command.name: u})], fixed=fixed)
    problem = found.fit.problem
    at = np.maximum(problem.rows.at, 0)  # K, W
    names = [f.name for f in found.coefficients]
    own = [j for j, s in enumerate(states) if s.name in seen]

    def residuals(z: Array) -> Array:
        now = p | dict(zip(names, z[: len(names)].tolist(), strict=True))
        begin = z[len(names) :].reshape(len(states), -1)
        path = run(law, now, u[at][:, None], begin)
        here = problem.rows.at >= 0
        each = []
        for j in own:
            level, measured = found.residual[states[j].name], seen[states[j].name][at]
            each.append(((path[:, j] - measured) / level)[here])
        return np.concatenate(each)

    first = np.concatenate([[start[n] for n in names], x[at[0]].T.ravel()])
    fit = least_squares(residuals, first, x_scale="jac")
    std = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    worst = 0.0
    for j, f in enumerate(found.coefficients):
        off = (f.value - fit.x[j]) / std[j]
        worst = max(worst, abs(off))
        print(
            f"{name:10} {f.name:3} true {p[f.name]:8.5g}  {f.value:9.6g} +- {f.noise_std:.2g}  output error "
            f"{fit.x[j]:9.6g} +- {std[j]:.2g}  apart {off:+.3f} standard errors"
        )
    return worst


def seconds(linear: bool) -> float:
    """Return the time of a fit of the boat with ten parameters, 60 s at 100 Hz, the best of three."""
    rng = np.random.default_rng(3)
    p = {n: value for n, (value, _) in BOAT.items()}
    u = np.stack([steps(rng, 0.0, 12.0, 120), steps(rng, -1.5, 1.5, 100)], axis=1)
    x = run(boat, p, u[..., None], np.array([[0.5], [0.0], [0.0]]))[..., 0]
    noise = 0.005 * rng.normal(size=x.shape)
    log = hc.Log(
        "boat",
        STEP * np.arange(ROWS),
        dict(zip(("u", "v", "r", "X", "N"), [*(x + noise).T, *u.T], strict=True)),
    )
    block = boat_block({n: 0.95 * value for n, value in p.items()}, linear)
    times = []
    for _ in range(4):
        begin = time.process_time()
        found = hc.identify(block, [log])
        times.append(time.process_time() - begin)
    if not linear:
        worst = max(abs(f.value - p[f.name]) / f.noise_std for f in found.coefficients)
        print(f"boat: ten parameters, the worst {worst:.1f} standard errors from the truth")
    return min(times[1:])


def main() -> None:
    """Print both comparisons."""
    worst = max(compared(name, seed) for name in MACHINES for seed in (1, 2))
    print(f"estimates: at most {worst:.2f} standard errors from an output-error fit")
    ten, line = seconds(False), seconds(True)
    said = f"{ten:.2f} s with masses in denominators, {line:.2f} s linear, {ten / line:.2f} times"
    print(f"ten parameters, 60 s at 100 Hz, processor time: {said}")


if __name__ == "__main__":
    main()
