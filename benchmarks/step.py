"""Step by step: what a runner costs over the C function that does the step.

Times are processor time of one thread. The C cost is that of the runner's C function, its arguments ready,
less that of such a call to a function that does nothing.
"""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.compiled import spent
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.runner import BlockRunner, Inputs, Snapshot
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

STEPS, DT = 5000, 0.01


def per_call(work: Callable[[], object]) -> float:
    """Return the least of some mean times of one call [s], the loop's own time taken off."""

    def least(call: Callable[[], object]) -> float:
        return min(spent(lambda: [call() for _ in range(STEPS)], 1) for _ in range(9)) / STEPS

    return least(work) - least(lambda: None)


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    plant = vehicle("c17_experiment").plant()
    loop = interconnect(list(loop_parts(load_scenario("table1")).values()), "loop")
    none = ctypes.PyDLL(None).getpid
    none.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_char_p]
    nothing = per_call(lambda: none(0, 0.1, b""))
    for what, block in (("C17's plant", plant), ("C17's loop with its estimator, 83 states", loop)):
        run = block.compile().start()
        begin = run.save()
        arrays = [
            np.array([3.0, rudder])[: len(block.inputs)] for rudder in (0.2, 0.21)
        ]  # they jump each time
        names = [s.name for s in block.inputs]

        def bare(run: BlockRunner, packed: bytes) -> None:
            run.time += DT
            run._engine.step(run.time, packed)

        def step(run: BlockRunner, inputs: Inputs) -> None:
            run.step(inputs, DT)

        def cost(call: Callable, forms: list, run: BlockRunner = run, begin: Snapshot = begin) -> float:
            run.restore(begin)
            turns = itertools.cycle(forms)
            return per_call(lambda: call(run, next(turns)))

        c = cost(bare, [a.tobytes() for a in arrays]) - nothing
        yield f"{what}, a step of 10 ms in C", f"{1e6 * c:.2f} us", "", None
        forms = {
            "list": [a.tolist() for a in arrays],
            "array": arrays,
            "mapping": [dict(zip(names, a.tolist(), strict=True)) for a in arrays],
        }
        for form, inputs in forms.items() if names else [("None", [None])]:
            over = cost(step, inputs) - c
            wanted = ("", None) if form == "mapping" else ("<= 2 us", over <= 2e-6)
            yield f"runner.step({form}, 0.01), over that", f"{1e6 * over:.2f} us", *wanted
    yield (
        "save() and restore() of that loop",
        f"{1e6 * per_call(lambda: run.restore(run.save())):.1f} us",
        "",
        None,
    )
    python = plant.start()
    slow = spent(lambda: [python.step([3.0, 0.2], DT) for _ in range(200)], 5) / 200
    yield "a step of the plant on Python floats", f"{1e6 * slow:.0f} us", "", None
