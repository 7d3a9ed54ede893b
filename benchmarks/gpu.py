"""A million closed loops on a GPU by JAX: a sampled controller, its delay and noise, 1,000 steps."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import sympy as sp

from benchmarks.fused import systems
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delay_line import constant_delay
from hovercontrol.blocks.interconnect import interconnect, rename
from hovercontrol.blocks.random_numbers import random_numbers
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.vehicles import vehicle

LOOPS, STEP, PERIOD = 1_000_000, 0.001, 0.02


def sampled_loop() -> Block:
    """C17's craft holds its heading: sampled every 20 ms, with noise, the rudder 40 ms late."""
    psi, r, seen = Signal("psi", "rad"), Signal("r", "rad/s"), Signal("psi_seen", "rad")
    rudder, thrust = Signal("rudder", "rad"), Signal("thrust", "1")
    kp, kd = Signal("kp", "1", start=0.8), Signal("kd", "s", start=0.5)
    size, level = Signal("size", "rad", start=0.01), Signal("level", "1", start=2.0)
    noise = random_numbers(1, salt="sensor")
    sensor = Block(
        "sensor", noise.states, [psi], [seen], (*noise.parameters, size), noise.next_values,
        {"psi_seen": psi.symbol + size.symbol * noise.values[0]}, noise.definitions, period=PERIOD,
    )  # fmt: skip
    law = kp.symbol * seen.symbol + kd.symbol * r.symbol
    controller = Block(
        "controller", [], [seen, r], [thrust, rudder], [kp, kd, level],
        output_expressions={"thrust": level.symbol, "rudder": sp.Max(-0.5, sp.Min(0.5, law))}, period=PERIOD,
    )  # fmt: skip
    link = constant_delay([rudder], 2 * PERIOD, PERIOD, suffix="_late")
    craft = rename(vehicle("c17_simulation").plant(), {"rudder": "rudder_late"})
    return interconnect([craft, sensor, controller, link], "held", outputs=["psi", "x", "y"])


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    try:
        import jax

        found = [d for d in jax.devices() if d.platform != "cpu"]
    except (ImportError, RuntimeError):
        found = []
    if not found:
        yield "no GPU that JAX can use is here: nothing is measured", "", "", None
        return
    for what, block, key, limit in (
        ("6 states", sampled_loop(), "controller.kp", 1.0),
        ("83 states", systems()[0].block, "plant.yaw_linear_drag", 10.0),
    ):
        functions, grid = block.to_jax(), np.array([0.0, 1000 * STEP])
        params = {key: np.linspace(0.8, 1.2, LOOPS) * block.default_parameters[key]}
        if "sensor.seed" in block.default_parameters:
            params["sensor.seed"] = np.arange(1.0, LOOPS + 1)  # noise of its own in each loop
        begin = time.perf_counter()
        functions.sweep(grid, params=params, step=STEP)
        first, seconds = time.perf_counter() - begin, []
        for _ in range(3):
            begin = time.perf_counter()
            result = functions.sweep(grid, params=params, step=STEP)
            seconds.append(time.perf_counter() - begin)
        yield (
            f"{LOOPS} loops of {what}, 1000 steps, {found[0].device_kind}",
            f"{min(seconds):.2f} s",
            f"<= {limit:g} s",
            min(seconds) <= limit,
        )
        yield "the first time, with compilation", f"{first:.1f} s", "", None
        some = np.linspace(0, LOOPS - 1, 16).astype(int)
        cpu = block.compile().sweep(
            grid, params={name: v[some] for name, v in params.items()}, method="rk4", step=STEP
        )
        gap = float(np.abs(result.states_final[some] - cpu.states_final).max())
        yield "largest difference of the states from the CPU's", f"{gap:.1e}", "<= 1e-10", gap <= 1e-10


if __name__ == "__main__":
    for row in rows():
        print(*row)
