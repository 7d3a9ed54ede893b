"""Rows that are lost, jitter, or have a clock of another rate: a cart whose force changes sign, 60 s each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

import hovercontrol as hc

Array = NDArray[np.float64]
Rows = Callable[[hc.Log, np.random.Generator], hc.Log]

PERIOD, DRAG, MASS, NOISE = 0.1, 0.5, 2.0, 0.01
CHANGE, ONSET, LOGS = 0.3, 30.0, 100


def log(seed: int, change: float) -> hc.Log:
    """Return position and force of the cart in exact steps; its drag changes at the onset."""
    rng, t = np.random.default_rng(seed), PERIOD * np.arange(600.0)
    F, x, p = 2.0 * np.sign(np.sin(0.9 * t + 0.1)), np.zeros(2), []
    steps = [_step(DRAG), _step(DRAG + change)]
    for k, now in enumerate(t):
        p.append(x[0] + NOISE * rng.normal())
        x = steps[int(now >= ONSET)] @ [*x, F[k]]
    return hc.Log("cart", t, {"p": np.array(p), "F": F})


def _step(drag: float) -> Array:
    slopes = np.array([[0.0, 1.0, 0.0], [0.0, -drag, 1.0 / MASS], [0.0, 0.0, 0.0]])
    return np.asarray(expm(PERIOD * slopes)[:2])


def lost(share: float) -> Rows:
    return lambda run, rng: run.select(rng.uniform(size=run.time.size) >= share)


def jitter(std: float) -> Rows:
    def make(run: hc.Log, rng: np.random.Generator) -> hc.Log:
        away = PERIOD * np.clip(std * rng.normal(size=run.time.size), -0.45, 0.45)
        return hc.Log(run.name, run.time + away, run.columns)

    return make


def faster(rate: float) -> Rows:
    return lambda run, rng: hc.Log(run.name, rate * run.time, run.columns)


def watch() -> hc.Block:
    p, v, F = hc.Signal("p", "m"), hc.Signal("v", "m/s"), hc.Signal("F", "N")
    m, c = hc.Signal("m", "kg", start=MASS), hc.Signal("c", "1/s", start=DRAG)
    slopes = {"p": v.symbol, "v": F.symbol / m.symbol - c.symbol * v.symbol}
    return hc.monitor(
        hc.Block("cart", (p, v), (F,), (p, v), (m, c), slopes), ["c", "p_bias"], false_alarms_per_hour=0.1,
        period=PERIOD, measured=["p"], process_noise={"v": 0.01}, measurement_noise={"p": NOISE},
        lost_samples=["p"],
    )  # fmt: skip


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    block = watch()
    for label, make, bound in (
        ("rows as they are", lost(0.0), True),
        *((f"{100 * share:g} % of the rows lost", lost(share), share < 0.2) for share in (0.02, 0.1, 0.3)),
        # a jitter of 25 ms at 4 m/s is ten times the noise that the monitor knows
        *((f"jitter of {100 * std:g} % of a period", jitter(std), std < 0.2) for std in (0.1, 0.25)),
        *((f"clock at {rate:g} times the rate", faster(rate), True) for rate in (0.99, 1.001, 1.01)),
    ):
        alarmed, named, within = 0, 0, 0
        for seed in range(LOGS):
            rng = np.random.default_rng([seed, 1])
            alarmed += bool(hc.replay(block, make(log(seed, 0.0), rng)).alarms)
            found = hc.replay(block, make(log(seed, CHANGE), rng)).alarms
            if [a.name for a in found] == ["c"] and found[0].time > ONSET - 1.0:
                named += 1
                within += abs(found[0].change - CHANGE) < 2.0 * found[0].std
        yield (
            f"{label}: reference logs with an alarm",
            f"{alarmed} of {LOGS}",
            "<= 2",
            alarmed <= 2 if bound else None,
        )
        text = f"{label}: change named alone; size within 2 std"
        yield text, f"{named} of {LOGS}; {within} of {named}", ">= 90", named >= 90 if bound else None
