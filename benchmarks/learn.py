"""JAX and Gymnasium: sweeps beside the compiled lanes, gradients of a run, steps of environments."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from benchmarks.compiled import RUNS, loop_without_estimator, spent, sweep
from benchmarks.step import per_call
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.scenarios import load_scenario

ENVIRONMENTS, STEPS = 1024, 1000


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    import jax

    loop = loop_without_estimator(load_scenario("table1"))
    key = "plant.yaw_linear_drag"
    drag = np.linspace(0.5, 1.5, RUNS) * loop.default_parameters[key]
    ours, lanes = loop.to_jax(), loop.compile()
    grid, options = np.linspace(0.0, 50.0, 501), {"method": "rk4", "step": 1e-3, "threads": 1}
    lanes.sweep([0.0, 0.1], method="rk4", step=1e-3)  # its library is built
    begin = time.process_time()
    short = np.linspace(0.0, 0.501, 502)[:501]
    ours.sweep(short, params={key: drag}, **options)
    yield "tracing and compiling that loop in JAX", f"{time.process_time() - begin:.1f} s", "", None
    by_lanes = spent(lambda: sweep(lanes, **options), 1)
    by_jax = spent(lambda: ours.sweep(grid, params={key: drag}, **options), 1)
    yield f"{RUNS} loops of Table I, 50 s, RK4 at 1 ms, lanes", f"{by_lanes:.1f} s", "", None
    yield "the same in JAX, processor time", f"{by_jax:.1f} s", "", None
    yield "ratio", f"{by_jax / by_lanes:.1f} times", "<= 4 times", by_jax <= 4 * by_lanes

    keys, ten = ["controller.k1", "controller.k2"], np.linspace(0.0, 10.0, 101)
    run = ours.run_function(ten, step=1e-3)

    def cost(gains: object) -> object:
        found = run(dict(zip(keys, gains, strict=True)))
        return jax.numpy.mean(found["error_x"] ** 2 + found["error_y"] ** 2)

    gains = np.array([loop.default_parameters[k] for k in keys])
    forward, gradient = jax.jit(cost), jax.jit(jax.grad(cost))
    tangents = jax.jit(jax.jacfwd(cost))
    times = []
    for call in (forward, gradient, tangents):
        call(gains).block_until_ready()
        times.append(spent(lambda call=call: call(gains).block_until_ready(), 5))
    yield "a run of 10 s, RK4 at 1 ms, in JAX", f"{1e3 * times[0]:.0f} ms", "", None
    for what, spent_ in (("reverse", times[1]), ("forward", times[2])):
        ratio = spent_ / times[0]
        yield f"its gradient by two gains, {what} mode", f"{ratio:.1f} runs", "<= 5 runs", ratio <= 5

    plant = vehicle("c17_simulation").plant()
    task = {
        "reward": -(plant.states[0].symbol ** 2),
        "bounds": {"thrust": (-2.0, 2.0), "rudder": (-0.5, 0.5)},
    }
    env, action = plant.gym(0.01, **task), np.array([1.0, 0.1])
    env.reset(seed=1)
    bare, packed = env._run, action.tobytes()

    def in_c() -> None:
        bare.time += 0.01
        bare._engine.step(bare.time, packed)

    c = per_call(in_c)
    env.reset(seed=1)
    over = per_call(lambda: env.step(action)) - c
    yield "env.step over the runner's C function", f"{1e6 * over:.2f} us", "<= 2 us", over <= 2e-6
    many = plant.gym(0.01, num_envs=ENVIRONMENTS, **task)
    many.reset(seed=1)
    actions = np.tile(action, (ENVIRONMENTS, 1))
    whole = spent(lambda: [many.step(actions) for _ in range(STEPS)], 1)
    count = f"{ENVIRONMENTS} x {STEPS}"
    yield f"{count} steps of 10 ms in a vector environment, ten RK4 steps each", f"{whole:.2f} s", "", None
