"""The cost of each imperfection of a real loop: alone, and by its absence from all the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.figure_style import BLUE
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.control.autopilot import SWITCHES, Imperfections, seeds
from hovercontrol.documents.scenarios import Scenario
from hovercontrol.documents.scenarios.parts import loop_parts, phase_parameters
from hovercontrol.documents.scenarios.real import real_loop
from hovercontrol.documents.scenarios.trials import need_trial

#: Groups of imperfections, whose cost is computed too.
GROUPS: dict[str, tuple[str, ...]] = {
    "INS errors": ("ins_bias", "ins_noise", "gyro_range"),
    "delays": ("ins_update", "downlink_delay", "uplink_delay", "update_20ms"),
    "actuators": ("dead_zone", "saturation", "tables", "brake"),
}

#: Sampling period of the gap [s].
GRID = 0.02


@dataclass(frozen=True)
class Cost:
    """The cost of a set of imperfections over many seeds.

    Attributes
    ----------
    runs : ndarray, shape (n_runs,)
        Of each run the rms of the gap to the ideal loop [m/s].
    """

    runs: Array

    __repr__ = short_repr

    @property
    def mean(self) -> float:
        """Mean over the runs [m/s]."""
        return float(self.runs.mean())

    @property
    def error(self) -> float:
        """Standard error of the mean [m/s]."""
        return float(self.runs.std(ddof=1) / np.sqrt(len(self.runs)))


@dataclass(frozen=True)
class Budget:
    """The costs of imperfections in one trial.

    Attributes
    ----------
    trial : str
        The scenario.
    whole, none : Cost
        With all imperfections of the scenario, and with none.
    alone, without : mapping of str to Cost
        With one imperfection (or group) only, and with all but it.
    """

    trial: str
    whole: Cost
    none: Cost
    alone: Mapping[str, Cost]
    without: Mapping[str, Cost]

    def plot(self) -> Figure:
        """Return a figure of the cost of each imperfection alone."""
        return open_in_pyplot(budget_figure(self))

    def share(self, name: str) -> float:
        """Return the share by which the mean square gap falls without one; negative if it grows."""
        return 1 - float(np.mean(self.without[name].runs ** 2) / np.mean(self.whole.runs**2))

    def ranking(self, names: tuple[str, ...] = tuple(SWITCHES)) -> list[str]:
        """Return names of imperfections by their cost alone, the largest first."""
        return sorted((n for n in names if n in self.alone), key=lambda n: -self.alone[n].mean)


def budget(
    scenario: Scenario,
    *,
    runs: int = 20,
    progress: Callable[[float], None] | None = None,
) -> Budget:
    """Return the cost of each imperfection of a trial.

    The cost of a run is the rms over its time of ``sqrt(du^2 + dv^2 + J/m dr^2)``, d being real less ideal:
    the speed at which the craft has the kinetic energy of the difference. Each set of imperfections runs
    with the same seeds, in one compiled Block.

    Parameters
    ----------
    scenario : Scenario
        With an autopilot and one phase.
    runs : int, optional
        Seeds, from 1 on.
    progress : callable, optional
        Called with the share that is done.

    Returns
    -------
    Budget

    Raises
    ------
    InputError
        If the scenario has no autopilot or several phases, or there are fewer than two runs.
    """
    given = need_trial("budget", scenario, runs, at_least=2).imperfections
    loop = real_loop(scenario, loop_parts(scenario))
    sets = {("whole", ""): given, ("none", ""): Imperfections.only()}
    for name, members in {**{n: (n,) for n in SWITCHES}, **GROUPS}.items():
        sets["alone", name] = Imperfections.only(*members)
        if any(m in given.names for m in members):
            sets["without", name] = given.without(*members)
    # The loop is built with some switched off: their sizes are those of a loop with all.
    full = loop.with_values(Imperfections.only(*SWITCHES).parameters(loop))
    columns: dict[str, Any] = {}
    for chosen in sets.values():
        for key, value in chosen.parameters(full).items():
            columns.setdefault(key, []).extend([value] * runs)
    columns |= {key: each * len(sets) for key, each in seeds(loop, runs).items()}
    fixed = phase_parameters(scenario, scenario.phases[0])
    every = {**columns, **fixed, **{f"ideal.{key}": value for key, value in fixed.items()}}
    times = np.arange(round(scenario.end / GRID) + 1) * GRID
    total = runs * len(sets)
    tell = (lambda done: progress(done / total)) if progress else None
    swept = full.compile().sweep(times, params=every, method="rk4", step=GRID, progress=tell)
    rms = swept["gap"].rms.reshape(len(sets), runs)
    costs = {key: Cost(row) for key, row in zip(sets, rms, strict=True)}
    return Budget(
        scenario.name,
        costs["whole", ""],
        costs["none", ""],
        {name: cost for (kind, name), cost in costs.items() if kind == "alone"},
        {name: cost for (kind, name), cost in costs.items() if kind == "without"},
    )


def budget_figure(found: Budget) -> Figure:
    """Return what each imperfection costs alone, with two standard errors, beside all and none."""
    names = sorted(found.alone, key=lambda n: -found.alone[n].mean)
    costs = [("all", found.whole), *((n, found.alone[n]) for n in names), ("none", found.none)]
    figure = Figure(figsize=(7.5, 1.2 + 0.32 * len(costs)), layout="constrained")
    axis = figure.subplots()
    for k, (name, cost) in enumerate(costs):
        whole = name in ("all", "none")
        axis.barh(
            k, cost.mean, xerr=2 * cost.error, color="0.55" if whole else BLUE, hatch="//" if whole else ""
        )
    axis.set_yticks(range(len(costs)), [name for name, _ in costs])
    axis.invert_yaxis()
    axis.set_xlabel("rms gap to the ideal loop, alone, two standard errors [m/s]")
    axis.set_title(found.trial)
    axis.grid(alpha=0.3, axis="x")
    return figure
