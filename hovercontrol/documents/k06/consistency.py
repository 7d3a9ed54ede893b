"""Whether the navigation filters' errors are as large as their covariances say: NEES and NIS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.observers.ins import IMU_PERIOD, K06_NOISE, noise_from_sensors
from hovercontrol.documents.k06.consistency_runs import (
    FILTER_RUNS,
    Results,
    own_heading,
    own_motion,
)

#: Where a filter's covariances come from.
SENSORS, PRINTED = "of the stated sensors", "with K06's printed Q1, Q2"
OWN = "all of K06's as printed, and errors drawn from them"
#: Smallest share inside the 95 % band for a filter to count as consistent.
ASKED = 0.9


def main(out: Path, progress: Progress = quiet, *, runs: int = 100, seconds: float = 6.0) -> list[Path]:
    """Run all filters with covariances of the stated sensors and with K06's printed Q1, Q2."""
    found: dict[str, Results] = {SENSORS: {}, PRINTED: {}}
    tests = [make(np.random.default_rng(k), runs, seconds) for k, make in enumerate(FILTER_RUNS)]
    for k, test in enumerate(tests):
        stated = noise_from_sensors(test.errors)
        printed = replace(stated, Q1=K06_NOISE.Q1, Q2=K06_NOISE.Q2)
        for j, (label, noise) in enumerate(((SENSORS, stated), (PRINTED, printed)), 1):
            found[label] |= test.judged(noise)
            progress((2 * k + j) / (2 * len(tests) + 1))
    own: Results = {}
    for k, draw in enumerate((own_heading, own_motion)):
        own |= draw(np.random.default_rng(k), runs, seconds, K06_NOISE).judged(K06_NOISE)
    files = save(
        out,
        "k06_consistency",
        _figure(found),
        {"k06_consistency": _table(found | {OWN: own})},
        _findings(found[SENSORS], found[PRINTED], own, runs),
    )
    progress(1.0)
    return files


def _findings(stated: Results, printed: Results, own: Results, runs: int) -> list[str]:
    good = [r.nees_inside >= ASKED and r.nis_inside >= ASKED for r in stated.values()]
    rows = [
        f"{name}: NEES inside {r.nees_inside:.1%}, NIS {r.nis_inside:.1%}; "
        f"with K06's printed Q1 and Q2 {printed[name].nees_inside:.1%} and {printed[name].nis_inside:.1%}."
        for name, r in stated.items()
    ]
    shares = [r.nees_inside for r in printed.values()]
    ranges = printed["range_filter"]
    lost = float(np.mean(ranges.nees[-1] > 2 * ranges.nees_band[1]))
    drawn = "; ".join(f"{n} {r.nees_inside:.1%} and {r.nis_inside:.1%}" for n, r in own.items())
    return [
        f"Shares of all ticks (NEES) and of {runs} runs (NIS) inside the 95 % band of chi-square; "
        f"{ASKED:.0%} is asked.",
        *rows,
        f"With covariances that follow from the stated sensors {sum(good)} of {len(good)} are consistent.",
        f"With K06's printed Q1 and Q2 NEES is inside in {min(shares):.0%} to {max(shares):.0%} only. They "
        "hold variances of samples, but its model adds them to heading and velocity themselves, which takes "
        f"them times dt^2, {1 / IMU_PERIOD**2:.0f} times less. So the filters all but copy their aids and "
        "claim larger errors than they make.",
        f"Unsure of its heading, the linearised range_filter loses its way in {lost:.0%} of the runs.",
        "The filters' equations are not to blame: with errors drawn from all of K06's printed matrices NEES "
        f"and NIS are inside in: {drawn}.",
    ]


def _table(found: Mapping[str, Results]) -> list[dict[str, Any]]:
    return [
        {
            "filter": name,
            "covariances": label,
            "NEES inside": r.nees_inside,
            "NIS inside": r.nis_inside,
            "mean NEES": float(r.mean_nees.mean()),
            "95 % band of NEES, low": r.nees_band[0],
            "95 % band of NEES, high": r.nees_band[1],
            "mean NIS": float(r.nis.mean()),
        }
        for label, results in found.items()
        for name, r in results.items()
    ]


def _figure(found: Mapping[str, Results]) -> Figure:
    figure = Figure(figsize=(16.0, 8.0), layout="constrained")
    grid = figure.add_gridspec(2, 4, width_ratios=[1.0, 1.0, 1.0, 1.15])
    names = list(found[SENSORS])
    for k, name in enumerate(names):
        _draw_course(figure.add_subplot(grid[k // 3, k % 3]), name, found)
    shares = figure.add_subplot(grid[:, 3])
    for label, style, fill in ((SENSORS, "o", "black"), (PRINTED, "s", "white")):
        for what, color, shift in (("NEES", "black", -0.12), ("NIS", "0.5", 0.12)):
            values = [100 * getattr(r, f"{what.lower()}_inside") for r in found[label].values()]
            at = np.arange(len(names)) + shift
            face = color if fill == "black" else "white"
            shares.plot(values, at, style, color=color, mfc=face, ms=8, label=f"{what}, {label}")
    shares.axvline(100 * ASKED, color="0.5", ls="--", lw=1.0, label=f"asked, {ASKED:.0%}")
    shares.set(xlabel="share inside the 95 % band [%]", xlim=(-3, 103), yticks=range(len(names)))
    shares.set_yticklabels([n.replace(", ", ",\n") for n in names], fontsize=9)
    shares.set_title("Ticks (NEES) and runs (NIS) inside", fontsize=11)
    shares.invert_yaxis()
    lines, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower left", ncols=3, frameon=False, fontsize=9)
    lines, labels = shares.get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower right", ncols=3, frameon=False, fontsize=9)
    return figure


def _draw_course(axes: Axes, name: str, found: Mapping[str, Results]) -> None:
    """Draw the mean of NEES over the runs, by time."""
    low, high = found[SENSORS][name].mean_nees_band
    time = IMU_PERIOD * np.arange(len(found[SENSORS][name].mean_nees))
    axes.axhspan(low, high, color="0.8", label="95 % band of the mean")
    least, most = low, high
    for label, color in ((SENSORS, "black"), (PRINTED, "0.5")):
        mean = found[label][name].mean_nees
        axes.semilogy(time, mean, color=color, lw=1.0, label=f"covariances {label}")
        least, most = min(least, mean.min()), max(most, mean.max())
    decades = 10.0 ** np.array([np.floor(np.log10(least)), np.ceil(np.log10(most))])
    axes.set(xlabel="time [s]", ylabel="mean NEES over the runs [1]", ylim=decades)
    axes.set_title(name, fontsize=11)
