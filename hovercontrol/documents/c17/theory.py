"""C17 sections III to VII: what its equations and theorems say in numbers, and where they are misprinted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hovercontrol.analysis.lyapunov import decay
from hovercontrol.analysis.observability import observability_gramian
from hovercontrol.analysis.zero_dynamics import predict, theorem_4_margin
from hovercontrol.documents.c17.drawings import craft
from hovercontrol.documents.c17.runs import draw, run
from hovercontrol.documents.printed import rebuilds
from hovercontrol.estimators import Regressors, regression
from hovercontrol.models.vehicles import c17_experiment, c17_simulation


@rebuilds("c17", "fig 1", lacks="a drawing has no numbers")
def fig_1(folder: Path) -> Mapping[str, float]:
    """Draw the craft, its frames and its control point."""
    craft().savefig(folder / "craft.png", dpi=130)
    return {}


@rebuilds(
    "c17",
    "eq 6",
    why="(6) prints t_f as the upper limit of the inner integral, and so does the Peano-Baker series "
    "before it; the proof of Lemma 2 has t. With t_f the rank is that of [I Gamma], 3",
)
def eq_6(folder: Path) -> Mapping[str, float]:
    """Rank of the Gramian along Table I, integrated to t, and to t_f as printed."""
    found = run("table1")
    lap = (found.time >= 8.0) & (found.time < 8.0 + 2 * math.pi)
    signals = {name: found.columns[name][lap] for name in ("u", "v", "r", "thrust", "rudder")}
    plant, time = c17_simulation().plant(), found.time[lap]
    gramian = observability_gramian(plant, time, signals)
    G = Regressors(regression(plant), drift=False).series(time, signals)[:, 1:]
    gamma = np.trapezoid(G, time, axis=-1)  # to t_f, the same at all times t
    printed = np.hstack([np.eye(len(gramian.states)), gamma])
    ranks = {"rank integrated to t": gramian.matrix, "rank as printed": printed.T @ printed}
    return {
        key: float(np.linalg.matrix_rank(W, tol=1e-12 * np.linalg.norm(W, 2))) for key, W in ranks.items()
    }


@rebuilds("c17", "eq 14c")
def eq_14c(folder: Path) -> Mapping[str, float]:
    """Estimates on a circle, where the sets (14a-c) are dependent."""
    draw("c17-dependent", folder, "estimates")
    found = run("c17-dependent")
    late = found.time >= 50.0
    error = found.estimation_error()
    assert error is not None
    return {
        "change of the estimates in the last 10 s": max(
            float(np.ptp(v[late])) for v in found.estimates().values()
        ),
        "worst error of c1..c6 at the end": float(error[-1]),
    }


@rebuilds("c17", "eq 19", lacks="C17 states both bounds; that (18) follows from (19) is ours")
def eq_19(folder: Path) -> Mapping[str, float]:
    """Whether (19) implies (18), at random gains."""
    k1, k2 = np.random.default_rng(0).uniform(0.01, 20.0, (2, 10_000))
    found = decay(k1, k2)
    return {
        "gains of 10,000 at which (18) is the tighter bound": float(np.sum(found.bound_18 < found.bound_19))
    }


@rebuilds(
    "c17",
    "eq 24",
    why="(24) as printed lacks a factor J^-1 on its right side, as its units show; (23) has it",
)
def eq_24(folder: Path) -> Mapping[str, float]:
    """(24) as printed and corrected at a control point where the loop spins away."""
    there = predict(0.14, 0.09)
    return {
        "(24) as printed holds at a = 0.14 m, dx = 0.09 m": float(there.printed),
        "(24) corrected holds there": float(there.bounded),
    }


@rebuilds(
    "c17",
    "theorem 4",
    lacks="a value of Delta. C17's own control point of 0.2 m lies beyond it, where (24) holds again",
)
def theorem_4(folder: Path) -> Mapping[str, float]:
    """Return the margin Delta of both craft."""
    return {
        "Delta of the simulation's craft": theorem_4_margin(c17_simulation()),
        "Delta of the experiment's craft [m]": theorem_4_margin(c17_experiment()),
    }
