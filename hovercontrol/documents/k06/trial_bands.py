"""K06's trials in the real loop over many seeds: the bands in K06's text, and how often they are met."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.control.analysis.output import Progress, part, quiet, save
from hovercontrol.documents.printed import printed
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.trials import trial_metrics


class Asked(NamedTuple):
    """A statement of K06's text on a trial as a band; the scenario's metrics measure it.

    Attributes
    ----------
    metrics : tuple of str
        Their names; the largest of their values counts, so that all must be in the band.
    low, high : float
    unit, name : str
    """

    metrics: tuple[str, ...]
    low: float
    high: float
    unit: str
    name: str


_DEGREE = math.radians(1.0)
_REST = tuple(
    f"time until the {what} stays within {size}"
    for what, size in (("surge", "0.1 m/s"), ("sway", "0.1 m/s"), ("yaw rate", "0.3 rad/s"))
)
_SWING = ("heading error at the end, largest",)
_NEAR = ("time until within 1 deg for the first time",)

#: What the text says of figures 6.7 to 6.10, by the metric.
_SAID = {p.name: p for k in range(7, 11) for p in printed("k06", f"fig 6.{k}").values()}


def _as_printed(name: str, *metrics: str) -> Asked:
    """Return the band of the first metric's printed number."""
    said = _SAID[metrics[0]]
    return Asked(metrics, said.low, said.high, said.unit, name)


#: By trial (``k06-real-...``) the figures asked for; figures 6.11 and 6.12 are drawn to 35 s.
ASKED: dict[str, tuple[Asked, ...]] = {
    "stop": (_as_printed("at rest", *_REST),),
    "forward": (
        _as_printed("first at 1.1 m/s", "time until 1.1 m/s for the first time"),
        Asked(("surge from 8 s, farthest from 1.1 m/s",), 0.0, 0.1, "m/s", "off 1.1 m/s from 8 s on"),
    ),
    "reverse": (
        _as_printed("within 0.05 of -0.76 m/s", "time until -0.71 m/s, 0.05 from the reference"),
        Asked(("surge from 8 s, farthest from -0.76 m/s",), 0.0, 0.1, "m/s", "off -0.76 m/s from 8 s on"),
    ),
    "turn": (_as_printed("mean yaw rate", "yaw rate, mean"),),
    "heading-bangbang": (Asked(_SWING, 0.0, _DEGREE, "rad", "heading error, 25 to 35 s"),),
    "heading-proportional": (Asked(_SWING, 0.0, _DEGREE, "rad", "heading error, 25 to 35 s"),),
    "heading-bangbang-rest": (
        Asked(_NEAR, 0.0, 35.0, "s", "first within 1 deg"),
        Asked(_SWING, 0.0, _DEGREE, "rad", "heading error, 15 to 25 s"),
    ),
    "heading-proportional-rest": (
        Asked(_NEAR, 0.0, 35.0, "s", "first within 1 deg"),
        Asked(_SWING, 0.0, _DEGREE, "rad", "heading error, 15 to 25 s"),
    ),
}  # fmt: skip


class Row(NamedTuple):
    """A band of a trial, and the value for each seed."""

    trial: str
    asked: Asked
    values: Array

    @property
    def met(self) -> float:
        """Share of the seeds inside the band."""
        return float(np.mean((self.values >= self.asked.low) & (self.values <= self.asked.high)))


def main(out: Path, progress: Progress = quiet, *, trial: str = "", runs: int = 20) -> list[Path]:
    """Run the trials with the seeds from 1 on; compare each value with its band."""
    trials = chosen_trials("k06_trials", trial, list(ASKED))
    rows: list[Row] = []
    for k, name in enumerate(trials):
        found = trial_metrics(
            load_scenario(f"k06-real-{name}"), runs=runs, progress=part(progress, k, len(trials))
        )
        for asked in ASKED[name]:
            rows.append(Row(name, asked, np.max([found[key] for key in asked.metrics], axis=0)))
    return save(out, "k06_trials", _figure(rows, runs), {"k06_trials": _columns(rows)}, _words(rows, runs))


def chosen_trials(analysis: str, trial: str, known: Sequence[str]) -> list[str]:
    """Return one trial (``turn``, ``k06-turn``, ``k06-real-turn`` are the same), or all if none is named."""
    short = trial.removeprefix("k06-").removeprefix("real-")
    if trial and short not in known:
        raise InputError(f"{analysis}: unknown trial {trial!r}{did_you_mean(short, known)}")
    return [short] if trial else list(known)


def panels(
    count: int, size: tuple[float, float], edge: tuple[float, float], *, sharey: bool = False
) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes in rows of three; their size and that of the edges are in inches."""
    columns = min(3, count)
    rows = math.ceil(count / columns)
    figsize = (size[0] * columns + edge[0], size[1] * rows + edge[1])
    figure = Figure(figsize=figsize, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharey=sharey).ravel().tolist()
    for place in axes[count:]:
        place.remove()
    return figure, axes[:count]


def _words(rows: Sequence[Row], runs: int) -> list[str]:
    heads = ["trial", "figure", "asked", "median", "range", "met"]
    lines = [heads]
    for trial, asked, values in rows:
        ends = (float(np.median(values)), float(values.min()), float(values.max()))
        median, low, high = (_plain(v, asked.unit) for v in ends)
        band = f"{_plain(asked.low, asked.unit)} to {_plain(asked.high, asked.unit)}"
        name = f"{asked.name} [{'deg' if asked.unit == 'rad' else asked.unit}]"
        met = f"{100 * Row(trial, asked, values).met:.0f} %"
        lines.append([trial, name, band, median, f"{low} to {high}", met])
    widths = [max(len(line[k]) for line in lines) for k in range(len(heads))]
    table = ["  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines]
    return [
        *table,
        f"{runs} seeds. At rest: |u|, |v| < 0.1 m/s and |r| < 0.3 rad/s for good; inf: not within the trial.",
        "Asked of the headings is their pointing tolerance; K06 prints no figure of its own real loop's end,",
        "and the axis of its figure 6.12d shows that the heading passes 2 rad where 1 rad is wanted.",
    ]


def _plain(value: float, unit: str) -> str:
    """Return a number in words, angles in degrees."""
    if unit == "rad":
        return f"{math.degrees(value):.0f}"
    return f"{value:.1f}" if unit == "s" else f"{value:.2f}"


def _figure(rows: Sequence[Row], runs: int) -> Figure:
    figure, places = panels(len(rows), (4.2, 1.5), (0.6, 1.0))
    for row, place in zip(rows, places, strict=True):
        _draw(place, row)
    figure.suptitle(f"K06's real loop, {runs} seeds: asked (green), each seed, median")
    return figure


def _draw(axes: Axes, row: Row) -> None:
    factor = 1 / _DEGREE if row.asked.unit == "rad" else 1.0
    there = row.values[np.isfinite(row.values)] * factor
    spread = np.linspace(-0.25, 0.25, len(there)) if len(there) > 1 else np.zeros(len(there))
    axes.axvspan(row.asked.low * factor, row.asked.high * factor, color="C2", alpha=0.25, lw=0)
    axes.plot(there, spread, "o", color="C0", ms=3.5, alpha=0.8)
    axes.axvline(float(np.median(row.values)) * factor, color="C3", lw=1.5)
    missing = len(row.values) - len(there)
    if missing:
        told = f"{missing} not within the trial"
        axes.text(0.98, 0.9, told, transform=axes.transAxes, ha="right", va="top", fontsize=8)
    axes.set(ylim=(-0.6, 0.6), yticks=[])
    axes.set_xlabel(f"{row.asked.name} [{'deg' if factor != 1 else row.asked.unit}]", fontsize=9)
    axes.set_title(f"{row.trial}: {100 * row.met:.0f} % inside", fontsize=9)
    axes.grid(axis="x", alpha=0.3)


def _columns(rows: Sequence[Row]) -> dict[str, list[Any]]:
    return {
        "trial": [r.trial for r in rows],
        "figure": [r.asked.name for r in rows],
        "unit": [r.asked.unit for r in rows],
        "asked from": [r.asked.low for r in rows],
        "asked to": [r.asked.high for r in rows],
        "median": [float(np.median(r.values)) for r in rows],
        "least": [float(r.values.min()) for r in rows],
        "largest": [float(r.values.max()) for r in rows],
        "share inside": [r.met for r in rows],
    }
