"""An FMU as a model: how often an estimate is within two errors, and what a fit costs."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import hovercontrol as hc
from hovercontrol.analysis.intervals import clopper_pearson

RUNS = 200
NOISE = 0.01


def motor() -> hc.Block:
    """Return a first-order machine with quadratic drag."""
    v, u = hc.Signal("v", "m/s"), hc.Signal("u", "V")
    k, b = hc.Signal("k", "m/s^2/V", start=2.0), hc.Signal("b", "1/m", start=0.8)
    return hc.Block(
        "motor", [v], [u], [v], [k, b], {"v": k.symbol * u.symbol - b.symbol * v.symbol * abs(v.symbol)}
    )


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    """Yield what was measured, its value, the bar, and whether it is met."""
    block = motor()
    with tempfile.TemporaryDirectory() as folder:
        path = block.to_fmu(Path(folder) / "motor.fmu", version=2)
        t = 0.02 * np.arange(1000)
        for kind in ("ModelExchange", "CoSimulation"):
            hits, begin = 0, time.perf_counter()
            plant = hc.fmu_plant(path, ["motor.b"], kind=kind, values={"motor.b": 1.1}, isolated=False)
            for seed in range(RUNS):
                rng = np.random.default_rng(seed)
                u = np.repeat(rng.uniform(-2.0, 2.0, 20), 50)
                seen = np.asarray(hc.simulate(block, t, {"u": u}).outputs).reshape(-1)
                log = hc.Log("run", t, {"u": u, "v": seen + NOISE * rng.normal(size=t.size)})
                found = hc.identify(plant, [log])["motor.b"]
                hits += abs(found.value - 0.8) <= 2.0 * found.std
            plant.close()
            low, high = (float(x) for x in clopper_pearson(hits, RUNS))
            each = (time.perf_counter() - begin) / RUNS
            share = hits / RUNS
            said = f"{share:.1%} [{low:.0%}, {high:.0%}]"
            yield f"{kind}: b within two errors, {RUNS} runs", said, "93-97 %", 0.93 <= share <= 0.97
            yield f"{kind}: a fit of one parameter, 1000 rows", f"{each:.2f} s", "", None
