"""C17 section VIII-A: Table I and figures 2 to 8, from the scenario ``table1``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np

from hovercontrol.reproduce.item import Item, about, at_most
from hovercontrol.scenarios import Run, load_scenario, run_scenario
from hovercontrol.scenarios.figures import figures

LACKS = (
    "C17 prints neither the simulation's coefficients nor its initial state and covariance; the coefficients "
    "are those of the experiment (c1 to c7), with c8 = a c7 m/J"
)


@lru_cache(maxsize=1)
def run() -> Run:
    """Return the run of Table I."""
    return run_scenario(load_scenario("table1"))


def table_1(folder: Path) -> Mapping[str, float]:
    """Mean tracking errors of the three phases [C17 table 1]."""
    run().save(folder)
    return {m.metric.name: m.value for m in run().metrics()}


def picture(name: str) -> Callable[[Path], Mapping[str, float]]:
    """Return what draws one picture of the run, without numbers."""

    def draw(folder: Path) -> Mapping[str, float]:
        figures(run())[name].savefig(folder / f"{name}.png", dpi=130)
        return {}

    return draw


def fig_5(folder: Path) -> Mapping[str, float]:
    """Tracking error over time [C17 fig 5]."""
    picture("tracking_error")(folder)
    error = run().tracking_error()
    assert error is not None
    late = (run().time >= 25.0) & (run().time <= 30.0)
    return {"error with altered drag": float(np.mean(error[late])), "error at 50 s": float(error[-1])}


#: [C17 fig 2, 5]
ITEMS = [
    Item(
        "c17",
        "table",
        "1",
        "simulation in three phases: tracking error",
        table_1,
        (
            at_most("error before the change", 0.01, "m", text="driven to zero"),
            about("error with altered drag", 0.6, 0.03, "m", text="around 60 cm"),
            at_most("error 10 s after the estimator", 0.01, "m", text="gradually to zero"),
        ),
        lacks=LACKS,
    ),
    Item("c17", "fig", "2", "simulation: path and reference", picture("path"), lacks=LACKS),
    Item(
        "c17",
        "fig",
        "5",
        "simulation: tracking error",
        fig_5,
        (
            about("error with altered drag", 0.6, 0.03, "m", text="around 60 cm"),
            at_most("error at 50 s", 0.01, "m", text="gradually to zero"),
        ),
        lacks=LACKS,
    ),
]
