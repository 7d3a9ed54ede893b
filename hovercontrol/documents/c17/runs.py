"""The runs of C17 that several items show, each made once; their pictures."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from hovercontrol.documents.printed import Measure
from hovercontrol.documents.scenarios import Run, load_scenario, run_scenario
from hovercontrol.documents.scenarios.figures import figures

VELOCITIES = {"u": "m/s", "v": "m/s", "r": "rad/s"}


@lru_cache(maxsize=8)
def run(name: str) -> Run:
    """Return the run of a scenario."""
    return run_scenario(load_scenario(name))


def draw(name: str, folder: Path, *pictures: str) -> None:
    """Save pictures of a run, by their names."""
    drawn = figures(run(name))
    for picture in pictures:
        drawn[picture].savefig(folder / f"{picture}.png", dpi=130)


def extremes(name: str, start: float, signals: Mapping[str, str]) -> dict[str, float]:
    """Return least and largest values of true signals of a run from a time on [s], by name and unit."""
    found, late = run(name), run(name).time >= start
    values: dict[str, float] = {}
    for signal, unit in signals.items():
        column = found.columns.get(f"true_{signal}", found.columns[signal])[late]
        values[f"least {signal} [{unit}]"] = float(column.min())
        values[f"largest {signal} [{unit}]"] = float(column.max())
    return values


def shows(name: str, picture: str, signals: Mapping[str, str]) -> Measure:
    """Return what draws a picture of a run, and measures the extremes of its signals from 5 s on."""

    def measure(folder: Path) -> Mapping[str, float]:
        draw(name, folder, picture)
        return extremes(name, 5.0, signals)

    return measure


def error_between(name: str, start: float, end: float) -> float:
    """Return the mean tracking error of a run between two times [m]."""
    found = run(name)
    error = found.tracking_error()
    assert error is not None
    return float(error[(found.time >= start) & (found.time <= end)].mean())
