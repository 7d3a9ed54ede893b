"""The result of a scenario: log, metrics and figures."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known
from hovercontrol.base.folders import write_folder
from hovercontrol.base.pyplot import open_in_pyplot
from hovercontrol.base.short_repr import short_repr
from hovercontrol.documents.scenarios.definition import Metric, Scenario
from hovercontrol.documents.scenarios.measures import measure
from hovercontrol.logs import Log

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Measured:
    """A metric and its value."""

    metric: Metric
    value: float

    def __repr__(self) -> str:
        m = self.metric
        met = "met" if self.met else "not met"
        return f"{m.name}: {self.value:.4g} {m.unit}, expected {m.low:g} to {m.high:g}: {met}"

    @property
    def met(self) -> bool:
        """Whether the value lies in the metric's range."""
        return self.metric.low <= self.value <= self.metric.high


@checked
@dataclass(frozen=True)
class Run:
    """A scenario's result.

    Parameters
    ----------
    scenario : Scenario
    time : ndarray, shape (n,)
        [s]
    columns : mapping of str to ndarray (n,)
        All signals by name.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario, run_scenario
    >>> run = run_scenario(load_scenario("k06-stop"))
    >>> run.time.shape, sorted(run.columns)[:3]
    ((1501,), ['force_x', 'force_y', 'psi'])
    """

    scenario: Scenario
    time: Array
    columns: Mapping[str, Array]

    __repr__ = short_repr

    def log(self) -> Log:
        """Return the run as a log that ``identify`` reads."""
        return Log(self.scenario.name, self.time, dict(self.columns))

    def tracking_error(self) -> Array | None:
        """Return ``|z1|`` [m], shape (n,), the distance of the control point from the reference."""
        if "error_x" not in self.columns:
            return None
        return np.hypot(self.columns["error_x"], self.columns["error_y"])

    def estimates(self) -> dict[str, Array]:
        """Return the estimated coefficients by name, each shape (n,)."""
        return {k.removesuffix("_hat"): v for k, v in self.columns.items() if k.endswith("_hat")}

    def truth(self) -> dict[str, Array]:
        """Return the plant's coefficients by name over time, each shape (n,)."""
        own = self.scenario.plant.coefficients()
        ends = [p.until for p in self.scenario.phases[:-1]]
        row = np.searchsorted(ends, self.time, side="right")
        return {
            name: value * np.array([p.scale.get(name, 1.0) for p in self.scenario.phases])[row]
            for name, value in own.items()
        }

    def estimation_error(self) -> Array | None:
        """Return the largest error of the adapted coefficients over max(3 %, 0.02), shape (n,)."""
        names = (self.scenario.controller or {}).get("adapt", [])
        estimates, truth = self.estimates(), self.truth()
        shares = [
            np.abs(estimates[n] - truth[n]) / np.maximum(0.03 * np.abs(truth[n]), 0.02)
            for n in names
            if n in estimates
        ]
        return np.max(shares, axis=0) if shares else None

    def clipped(self) -> dict[str, int]:
        """Return the number of ticks with clipped commands, by counter (``rudder_clipped``)."""
        return {key: int(column[-1]) for key, column in self.columns.items() if key.endswith("_clipped")}

    def metrics(self) -> list[Measured]:
        """Return the scenario's metrics with their measured values."""
        quantities = {"tracking_error": self.tracking_error(), "estimation_error": self.estimation_error()}
        measured = []
        for metric in self.scenario.metrics:
            signal = self.columns.get(f"true_{metric.of}", self.columns.get(metric.of))
            values = quantities.get(metric.of, signal)
            if values is not None:
                measured.append(Measured(metric, measure(metric, self.time, values)))
        return measured

    def _repr_html_(self) -> str:
        from hovercontrol.documents.scenarios.display import run_html

        return run_html(self)

    def plot(self, name: str = "") -> Figure:
        """Return one of the run's figures; default: the tracking error, or else the path.

        Parameters
        ----------
        name : str
            Name of the figure.

        Raises
        ------
        InputError
            If there is no such figure; the message names the nearest one.
        """
        from hovercontrol.documents.scenarios.figures import figures

        drawn = figures(self)
        chosen = name or ("tracking_error" if "tracking_error" in drawn else "path")
        check_known(chosen, drawn, f"no picture {chosen!r}")
        return open_in_pyplot(drawn[chosen])

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``log.csv``, ``metrics.csv`` and the figures, atomically.

        Parameters
        ----------
        folder : path
            Created if missing.

        Returns
        -------
        list of Path
            The written files.
        """
        from hovercontrol.documents.scenarios.figures import figures

        def write(temporary: Path) -> None:
            self.log().save(temporary / "log.csv")
            if self.scenario.metrics:
                _write_metrics(self.metrics(), temporary / "metrics.csv")
            for name, figure in figures(self).items():
                figure.savefig(temporary / f"{name}.png", dpi=130)

        return write_folder(folder, write)


def _write_metrics(metrics: list[Measured], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["figure", "from_s", "to_s", "measured", "unit", "low", "high", "met", "paper"])
        for m in metrics:
            d = m.metric
            rows.writerow([d.name, d.start, d.end, f"{m.value:.6g}", d.unit, d.low, d.high, m.met, d.paper])
