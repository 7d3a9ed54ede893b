"""K06 chapter 7: the position by raw ranges, a particle filter against the extended Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.simulation.sampled import SampledFilter
from hovercontrol.control.analysis.ins_monte_carlo import Course, course, inputs_of, ranged, sensed, started
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.observers.ins import (
    IMU_PERIOD,
    noise_from_sensors,
    range_filter,
    range_particles,
    simulate_runs,
)
from hovercontrol.control.observers.ins.particles import PARTICLES
from hovercontrol.craft.hardware.sensors import Beacons
from hovercontrol.documents.k06.consistency_runs import BEACONS, ERRORS, RANGE_NOISE, UNITS

TWO = Beacons([(0.0, 0.0), (4.0, 0.0)], 2.0)
#: The area in which the craft starts if its start is unknown, and the true start [m].
AREA, AT = ((0.0, 4.0), (-4.0, 4.0)), (1.5, 1.2)
#: A run that ends with a larger error counts as lost [m].
LOST = 0.5
#: Share of the ranges that are echoes, in the case with echoes; they lie evenly up to 10 m.
ECHOES = 0.05
KALMAN, PARTICLE = "extended Kalman filter", "particle filter"
OUTPUTS = ["psi_hat", "x_hat", "y_hat"]


class Case(NamedTuple):
    """The beacons, whether the start is known, and the share of echoes."""

    name: str
    beacons: Beacons
    known: bool
    echoes: float


CASES = (
    Case("four beacons, start known", BEACONS, True, 0.0),
    Case("four beacons, start unknown", BEACONS, False, 0.0),
    Case("two beacons, start unknown", TWO, False, 0.0),
    Case(f"four beacons, {ECHOES:.0%} of the ranges echoes", BEACONS, True, ECHOES),
)


class Errors(NamedTuple):
    """Of one filter in one case, shape (ticks, runs): distance [m] and heading error [rad]."""

    place: Array
    heading: Array

    @property
    def late(self) -> Array:
        """Root mean square distance of the second half of each run [m]."""
        return np.asarray(np.sqrt(np.mean(self.place[len(self.place) // 2 :] ** 2, axis=0)))

    @property
    def late_heading(self) -> Array:
        """Root mean square heading error of the second half of each run [rad]."""
        return np.asarray(np.sqrt(np.mean(self.heading[len(self.heading) // 2 :] ** 2, axis=0)))

    @property
    def lost(self) -> int:
        """Number of lost runs."""
        return int((self.place[-1] > LOST).sum())


def main(
    out: Path,
    progress: Progress = quiet,
    *,
    runs: int = 12,
    seconds: float = 10.0,
    particles: int = PARTICLES,
) -> list[Path]:
    """Run both filters on the same simulated ranges and inertial measurements, case by case."""
    truth = course(seconds, 0.3, 0.9, period=IMU_PERIOD, at=AT)
    found: dict[str, dict[str, Errors]] = {}
    for k, case in enumerate(CASES):
        found[case.name] = _both(case, truth, np.random.default_rng(k + 1), runs, particles)
        progress((k + 1) / len(CASES))
    return save(
        out,
        "k06_particles",
        _figure(truth.time, found),
        {"k06_particles": _table(found)},
        _findings(found, runs, particles),
    )


def _both(
    case: Case, truth: Course, rng: np.random.Generator, runs: int, particles: int
) -> dict[str, Errors]:
    seen = sensed(rng, truth, ERRORS, every=1.0, runs=runs)
    inputs = seen.inputs | ranged(rng, truth, case.beacons, UNITS, noise=RANGE_NOISE, runs=runs)
    if case.echoes:
        for k in range(1, len(case.beacons.positions) + 1):
            values = inputs[f"range_{k}"]
            echo = rng.random(values.shape) < case.echoes
            inputs[f"range_{k}"] = np.where(echo, rng.uniform(0.0, 10.0, values.shape), values)
    start = seen.start.copy()
    noise = told = noise_from_sensors(ERRORS)
    if not case.known:  # the Kalman filter starts at a random place and heading, with their variances
        start[0] = rng.uniform(-np.pi, np.pi, runs)
        low, high = np.array(AREA).T[:, :, None]
        start[3:5] = rng.uniform(low, high, (2, runs)) - np.array(AT)[:, None]
        sides = np.ptp(AREA, axis=1) ** 2 / 12
        turns = (2 * np.pi) ** 2 / 12
        told = replace(noise, P1=(turns, noise.P1[1]), P2=(*noise.P2[:2], *sides.tolist(), *noise.P2[4:]))
    filters: dict[str, Block | SampledFilter] = {
        KALMAN: range_filter(case.beacons, UNITS, range_noise=RANGE_NOISE, noise=told),
        PARTICLE: range_particles(
            case.beacons,
            UNITS,
            range_noise=RANGE_NOISE,
            noise=noise,
            area=None if case.known else AREA,
            echoes=case.echoes,
            particles=particles,
        ),
    }
    states = started([f"last_xhat[{i}]" for i in range(5)], start, truth)
    return {
        name: _errors(simulate_runs(block, inputs_of(block, inputs), OUTPUTS, start=states), truth)
        for name, block in filters.items()
    }


def _errors(told: Mapping[str, Array], truth: Course) -> Errors:
    x, y = (told[n] - p[:, None] for n, p in zip(OUTPUTS[1:], truth.position, strict=True))
    turned = told["psi_hat"] - truth.psi[:, None]
    return Errors(np.hypot(x, y), np.abs((turned + np.pi) % (2 * np.pi) - np.pi))


def _table(found: Mapping[str, Mapping[str, Errors]]) -> list[dict[str, Any]]:
    return [
        {
            "case": case,
            "filter": name,
            "position error, median run [m]": float(np.median(e.late)),
            "position error, worst run [m]": float(e.late.max()),
            "heading error, median run [deg]": float(np.degrees(np.median(e.late_heading))),
            "runs": e.place.shape[1],
            "runs lost": e.lost,
        }
        for case, filters in found.items()
        for name, e in filters.items()
    ]


def _findings(found: Mapping[str, Mapping[str, Errors]], runs: int, particles: int) -> list[str]:
    lines = [
        f"{runs} runs of each case, ranges of two units with {1000 * RANGE_NOISE:g} mm of noise, each once a "
        f"second; {particles} particles. Root mean square errors of the second half of a run; lost is a run "
        f"that ends more than {LOST:g} m off."
    ]
    for case, filters in found.items():
        words = [
            f"{name} {100 * np.median(e.late):.1f} cm (worst run {100 * e.late.max():.1f} cm), "
            f"heading {np.degrees(np.median(e.late_heading)):.1f} deg, {e.lost} of {runs} lost"
            for name, e in filters.items()
        ]
        lines.append(f"{case}: {'; '.join(words)}.")
    lines.append(
        "Started anywhere, the Kalman filter is told a place and a heading drawn from the same area, with "
        "the area's variance. It has no model of echoes and no gate against them; the particle filter is "
        "told how often they come."
    )
    return lines


def _figure(time: Array, found: Mapping[str, Mapping[str, Errors]]) -> Figure:
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    for axes, (case, filters) in zip(figure.subplots(2, 2, sharex=True).flat, found.items(), strict=True):
        _draw(axes, time, filters)
        axes.set_title(case, fontsize=11)
    lines, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw(axes: Axes, time: Array, filters: Mapping[str, Errors]) -> None:
    for (name, e), color in zip(filters.items(), ("0.45", "C0"), strict=True):
        low, middle, high = np.quantile(np.maximum(e.place, 1e-4), (0.0, 0.5, 1.0), axis=1)
        axes.fill_between(time, low, high, color=color, alpha=0.2, lw=0, label=f"{name}, all runs")
        axes.semilogy(time, middle, color=color, lw=1.5, label=f"{name}, median")
    axes.set(xlabel="time [s]", ylabel="position error [m]", ylim=(1e-3, 2e1))
    axes.grid(alpha=0.3)
