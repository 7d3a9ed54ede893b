"""The Blocks whose FMUs are tested."""

import tempfile
from functools import cache
from pathlib import Path

import sympy as sp

from hovercontrol import Block, Signal, interconnect, vehicle, waypoints
from hovercontrol.blocks.signals import time
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

PARTS = loop_parts(load_scenario("table1"))


def odd() -> Block:
    """One Block with all that names, units, bounds and equations may do."""
    v, w = Signal("w_ψ", "rad/s", start=1.0, nominal=2.0), Signal("P[0,1]", "m^2/s^2", lower=-5.0)
    u, x = Signal("u", "N", "push & pull <", lower=-1.0, upper=3.0), Signal("time", "1")
    a, b = Signal("a", "1/s", start=2.0, lower=0.0), Signal("b", "m^2/s^2/N", start=0.5)
    steps = sp.floor(u.symbol / Signal("N0").symbol)
    return Block(
        "odd_ö",
        states=(v, w, x),
        inputs=(u,),
        outputs=(v, u, Signal("jump"), Signal("late", "s"), Signal("cut", "N")),
        parameters=(a, b, Signal("N0", "N", start=1.0, lower=0.1)),
        derivatives={
            v.name: -a.symbol * v.symbol,
            w.name: a.symbol * b.symbol * u.symbol + 3 * a.symbol * w.symbol,
            x.name: a.symbol * steps,
        },
        output_expressions={"jump": steps, "late": 2 * time, "cut": sp.Max(u.symbol, 0)},
    )


BLOCKS = {
    **PARTS,
    "loop": interconnect(list(PARTS.values()), "loop"),
    "four_fan": vehicle("four_fan").plant(),
    "waypoints": waypoints([[0, 0], [1, 2], [3, 1]], [0.0, 1.0, 2.5]),
    "odd": odd(),
}


_FOLDER = tempfile.TemporaryDirectory(prefix="hovercontrol-test-")  # removed at the end of the process


@cache
def exported(name: str, version: int, friction: str = "events", **options) -> Path:
    """Return the FMU of a Block, written once in this process."""
    folder = Path(tempfile.mkdtemp(dir=_FOLDER.name))
    return BLOCKS[name].to_fmu(folder / f"{name}.fmu", version=version, friction=friction, **options)
