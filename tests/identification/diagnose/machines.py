"""Machines that are no craft, each lacking something: what ``diagnose`` makes of two logs of each.

``python -m tests.identification.diagnose.machines --seeds 3``. Simulated here, apart from the package, by
Runge-Kutta steps of order 4 with commands held between rows.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import sympy as sp

import hovercontrol as hc
from hovercontrol.identification.benchmark.machines import pendulum as library_pendulum

S = hc.Signal
Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Machine:
    """One kind: the incomplete model, and how to draw two logs of the true machine."""

    model: hc.BlockModel
    lacks: tuple[tuple[str, ...], ...]  # each by one of these names
    draw: Callable[[np.random.Generator], Callable[[np.random.Generator], hc.Log]]


def integrate(rates: Rates, x: np.ndarray, commands: np.ndarray, dt: float, fine: int = 10) -> np.ndarray:
    """Return the states at each row, shape (rows, n)."""
    rows, h = [], dt / fine
    for u in commands:
        rows.append(x)
        for _ in range(fine):
            a = rates(x, u)
            b = rates(x + 0.5 * h * a, u)
            c = rates(x + 0.5 * h * b, u)
            d = rates(x + h * c, u)
            x = x + h / 6 * (a + 2 * b + 2 * c + d)
    return np.array(rows)


def steps(rng: np.random.Generator, n: int, dt: float, size: float, hold: float) -> np.ndarray:
    """Return commands that hold for a while [s] and jump."""
    edges = np.cumsum(rng.uniform(0.5 * hold, 1.5 * hold, int(n * dt / hold * 2) + 2))
    return rng.uniform(-size, size, edges.size)[np.searchsorted(edges, dt * np.arange(n))]


def _block(
    name: str, states: list, inputs: list, outputs: list, parameters: list, rates: dict
) -> hc.BlockModel:
    return hc.BlockModel(hc.Block(name, states, inputs, outputs, parameters, rates))


def motor() -> Machine:
    """A motor with a driver's dead zone and a delay, seen through few steps beside a random load."""
    w, u = S("speed", "rad/s"), S("voltage", "V")
    gain, damping = S("gain", "rad/s^2/V", start=14.0, lower=0.0), S("damping", "1/s", start=4.0, lower=0.0)
    model = _block(
        "motor", [w], [u], [w], [gain, damping], {"speed": gain.symbol * u.symbol - damping.symbol * w.symbol}
    )

    def draw(truth: np.random.Generator) -> Callable[[np.random.Generator], hc.Log]:
        dead, k, d = truth.uniform(1.6, 2.2), truth.uniform(12, 16), truth.uniform(3.5, 4.5)

        def log(rng: np.random.Generator) -> hc.Log:
            dt, n = 0.02, 850
            volt = steps(rng, n, dt, 6.0, 2.5)
            late = np.r_[0.0, 0.0, volt[:-2]]  # 40 ms
            drive = np.sign(late) * np.maximum(np.abs(late) - dead, 0.0)
            load = np.zeros(n)
            for i in range(1, n):
                load[i] = load[i - 1] * np.exp(-dt / 0.6) + 3.6 * np.sqrt(dt) * rng.normal()
            w = integrate(
                lambda x, c: k * c[:1] - d * x + c[1:], np.zeros(1), np.column_stack([drive, load]), dt
            )
            seen = w[:, 0] + 0.05 * rng.normal(size=n)
            return hc.Log("motor", dt * np.arange(n), {"voltage": volt, "speed": seen})

        return log

    return Machine(model, (("voltage_deadzone", "speed_coulomb"), ("input_delay", "time_offset")), draw)


def pendulum() -> Machine:
    """A pendulum with Coulomb friction in its bearing."""
    model = library_pendulum().with_coefficients({"viscous": 0.1})

    def draw(truth: np.random.Generator) -> Callable[[np.random.Generator], hc.Log]:
        k, weight, c = truth.uniform(5.5, 7.5), truth.uniform(17, 21), truth.uniform(0.6, 1.2)

        def log(rng: np.random.Generator) -> hc.Log:
            dt, n = 0.01, 2500
            u = steps(rng, n, dt, 2.0, 0.7)
            x = integrate(
                lambda x, c_: np.array(
                    [x[1], k * c_[0] - weight * np.sin(x[0]) - 0.15 * x[1] - c * np.tanh(x[1] / 0.02)]
                ),
                np.zeros(2), u[:, None], dt,
            )  # fmt: skip
            return hc.Log(
                "pendulum",
                dt * np.arange(n),
                {"torque": u, "angle": x[:, 0] + 1e-3 * rng.normal(size=n)},
            )

        return log

    return Machine(model, (("rate_coulomb",),), draw)


def rover() -> Machine:
    """A rover that follows its commands of speed and turn with first-order lags."""
    x, y, psi, v, r = S("x", "m"), S("y", "m"), S("psi", "rad"), S("speed", "m/s"), S("turn", "rad/s")
    drive, scrub = S("drive", "1", start=1.0, lower=0.0), S("scrub", "1", start=1.0, lower=0.0)
    forward = drive.symbol * v.symbol
    rates = {
        "x": forward * sp.cos(psi.symbol),
        "y": forward * sp.sin(psi.symbol),
        "psi": scrub.symbol * r.symbol,
    }
    model = _block("rover", [x, y, psi], [v, r], [x, y, psi], [drive, scrub], rates)

    def draw(truth: np.random.Generator) -> Callable[[np.random.Generator], hc.Log]:
        lag_v, lag_r, a, b = *truth.uniform(0.15, 0.35, 2), *truth.uniform(0.8, 1.1, 2)

        def log(rng: np.random.Generator) -> hc.Log:
            dt, n = 0.05, 1200
            u = np.column_stack([steps(rng, n, dt, 0.8, 1.5), steps(rng, n, dt, 1.0, 1.2)])
            path = integrate(
                lambda z, c: np.array(
                    [
                        a * z[3] * np.cos(z[2]),
                        a * z[3] * np.sin(z[2]),
                        b * z[4],
                        (c[0] - z[3]) / lag_v,
                        (c[1] - z[4]) / lag_r,
                    ]
                ),
                np.zeros(5), u, dt,
            )  # fmt: skip
            noise = rng.normal(size=(n, 3)) * [5e-3, 5e-3, 5e-3]
            seen = dict(zip(("x", "y", "psi"), (path[:, :3] + noise).T, strict=True))
            return hc.Log("rover", dt * np.arange(n), {"speed": u[:, 0], "turn": u[:, 1], **seen})

        return log

    return Machine(model, (("speed_lag",), ("turn_lag",)), draw)


def servo() -> Machine:
    """A servo whose target has play; quantised, at 25 Hz."""
    q, w, u = S("position", "rad"), S("rate", "rad/s"), S("target", "rad")
    k, d = S("stiffness", "1/s^2", start=80.0, lower=0.0), S("damping", "1/s", start=15.0, lower=0.0)
    pull = k.symbol * (u.symbol - q.symbol) - d.symbol * w.symbol
    model = _block("servo", [q, w], [u], [q], [k, d], {"position": w.symbol, "rate": pull})

    def draw(truth: np.random.Generator) -> Callable[[np.random.Generator], hc.Log]:
        play, stiff, damp = truth.uniform(0.03, 0.06), truth.uniform(70, 90), truth.uniform(13, 17)

        def log(rng: np.random.Generator) -> hc.Log:
            dt, n = 0.04, 1000
            t = dt * np.arange(n)
            phases = rng.uniform(0, 2 * np.pi, 4)
            waves = zip((0.2, 0.45, 0.8, 1.3), phases, strict=True)
            target = sum(0.25 * np.sin(2 * np.pi * f * t + a) for f, a in waves)
            inside = np.zeros(n)
            for i in range(1, n):
                inside[i] = np.clip(inside[i - 1], target[i] - play / 2, target[i] + play / 2)
            x = integrate(
                lambda x, c: np.array([x[1], stiff * (c[0] - x[0]) - damp * x[1]]),
                np.zeros(2), inside[:, None], dt, 20,
            )  # fmt: skip
            seen = np.round((x[:, 0] + 2e-4 * rng.normal(size=n)) / 1e-3) * 1e-3
            return hc.Log("servo", t, {"target": target, "position": seen})

        return log

    return Machine(model, (("target_backlash",),), draw)


MACHINES = {f.__name__: f for f in (motor, pendulum, rover, servo)}


def logs(kind: Machine, seed: int) -> tuple[hc.Log, hc.Log]:
    """Return the training log and the held-out log of one drawn machine."""
    log = kind.draw(np.random.default_rng((seed, 0)))
    return log(np.random.default_rng((seed, 1))), log(np.random.default_rng((seed, 2)))


def right(kind: Machine, found: set[str]) -> bool:
    """Whether all that is named is lacking, and all that is lacking is named."""
    known = set().union(*kind.lacks)
    return found <= known and all(found & set(names) for names in kind.lacks)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", choices=sorted(MACHINES))
    args = parser.parse_args()
    counts = {"right": 0, "part": 0, "nothing": 0, "wrong": 0}
    for name, make in MACHINES.items():
        if args.only not in (None, name):
            continue
        kind = make()
        for seed in range(args.seeds):
            begin = time.perf_counter()
            train, kept = logs(kind, seed)
            d = hc.diagnose(kind.model, [train], kept)
            found = {e.effect for e in d.effects}
            wrong = found - set().union(*kind.lacks)
            word = "wrong" if wrong else "right" if right(kind, found) else "part" if found else "nothing"
            counts[word] += 1
            took = time.perf_counter() - begin
            print(
                f"{name:10} {seed:2}  {d.verdict:12} {', '.join(sorted(found)):34} {word:8} {took:5.1f} s",
                flush=True,
            )
    print(", ".join(f"{n} {word}" for word, n in counts.items()))


if __name__ == "__main__":
    main()
