"""The cost of each imperfection of K06's real loop in each trial, and whether INS noise dominates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.control.analysis.output import Progress, part, quiet, save
from hovercontrol.control.autopilot import SWITCHES
from hovercontrol.documents.k06.trial_bands import chosen_trials, panels
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.budget import GROUPS, Budget, budget

#: K06's trials, as ``k06-real-...``.
TRIALS = ("stop", "forward", "reverse", "turn", "heading-bangbang", "heading-proportional")


def main(out: Path, progress: Progress = quiet, *, trial: str = "", runs: int = 20) -> list[Path]:
    """Run each trial with every imperfection alone and with all but it; rank their costs."""
    trials = [f"k06-real-{name}" for name in chosen_trials("k06_budget", trial, TRIALS)]
    jobs = len(trials) + ("k06-real-forward" in trials)
    found = [
        budget(load_scenario(name), runs=runs, progress=part(progress, k, jobs))
        for k, name in enumerate(trials)
    ]
    findings = [_words(one, runs) for one in found]
    findings.append("The tables end where the saturation does, so that all but the saturation is all.")
    for one in found:
        if one.trial == "k06-real-forward":
            scenario = load_scenario(one.trial)
            modelled = scenario.with_autopilot(navigation="error_model")
            readings = {
                "sensors and filters in full": one,
                "K06's error model": budget(modelled, runs=runs),
            }
            findings += _verdict(readings)
    progress(1.0)
    return save(out, "k06_budget", _figure(found), {"k06_budget": _columns(found)}, findings)


def _words(one: Budget, runs: int) -> str:
    first = ", ".join(f"{_plain(n)} {_mm(one.alone[n].mean)}" for n in one.ranking()[:3])
    shares = sorted((n for n in GROUPS), key=lambda n: -one.share(n))
    parts = ", ".join(f"without {n} {100 * one.share(n):.0f} %" for n in shares)
    return (
        f"{one.trial}, {runs} seeds: the real loop is {_mm(one.whole.mean)} (rms) from the ideal one, "
        f"{_mm(one.none.mean)} with everything switched off. Alone cost most: {first}. "
        f"The mean square gap falls, {parts}."
    )


def _verdict(readings: dict[str, Budget]) -> list[str]:
    lines = []
    for reading, one in readings.items():
        share = {n: one.share(n) for n in GROUPS}
        worst = max(share, key=lambda n: share[n])
        alone = ", ".join(f"{n} {_mm(one.alone[n].mean)}" for n in GROUPS)
        verdict = "confirmed" if worst == "INS errors" else f"not confirmed: {worst} weigh more"
        lines.append(
            f"Forward, {reading}: gap {_mm(one.whole.mean)}; alone {alone}; without INS errors the mean "
            f"square gap falls by {100 * share['INS errors']:.0f} %. K06's \"primary cause of these "
            f'oscillations is the INS noise" is {verdict}.'
        )
    return lines


def _figure(found: Sequence[Budget]) -> Figure:
    figure, axes = panels(len(found), (5.4, 4.6), (1.6, 0.0), sharey=True)
    for one, place in zip(found, axes, strict=True):
        _draw(place, one)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle("K06's real loop: rms distance from the ideal loop, mean and its standard error")
    return figure


def _draw(axes: Axes, one: Budget) -> None:
    names = [*GROUPS, *SWITCHES]
    at = np.arange(len(names))[::-1]
    alone = [one.alone[n] for n in names]
    axes.barh(
        at + 0.2, [1000 * c.mean for c in alone], 0.36, color="C0", label="it alone",
        xerr=[1000 * c.error for c in alone],
    )  # fmt: skip
    there = [(y, one.without[n]) for y, n in zip(at, names, strict=True) if n in one.without]
    axes.barh(
        [y - 0.2 for y, _ in there], [1000 * c.mean for _, c in there], 0.36, color="C1",
        label="all but it", xerr=[1000 * c.error for _, c in there],
    )  # fmt: skip
    axes.axvline(1000 * one.whole.mean, color="k", ls="--", lw=1.0, label="all")
    axes.axhline(len(SWITCHES) - 0.5, color="0.6", lw=0.8)
    axes.set_yticks(at, [_plain(n) for n in names])
    axes.set(xlabel="distance from the ideal loop [mm/s]")
    axes.set_title(one.trial.removeprefix("k06-real-"), fontsize=10)
    axes.grid(axis="x", alpha=0.3)


def _plain(name: str) -> str:
    return name.replace("_", " ").replace("ins ", "INS ")


def _mm(speed: float) -> str:
    return f"{1000 * speed:.1f} mm/s" if speed < 0.01 else f"{1000 * speed:.0f} mm/s"


def _columns(found: Sequence[Budget]) -> dict[str, list[Any]]:
    lines: list[list[Any]] = []
    for one in found:
        lines.append([one.trial, "all", one.whole.mean, one.whole.error, math.nan, math.nan, math.nan])
        lines.append([one.trial, "none", one.none.mean, one.none.error, math.nan, math.nan, math.nan])
        for name, cost in one.alone.items():
            rest = one.without.get(name)
            lines.append(
                [one.trial, name, cost.mean, cost.error]
                + ([rest.mean, rest.error, one.share(name)] if rest else [math.nan] * 3)
            )
    heads = ["trial", "imperfection", "alone [m/s]", "its standard error [m/s]", "all but it [m/s]",
             "its standard error, all but it [m/s]", "part of the mean square gap"]  # fmt: skip
    return {head: list(column) for head, column in zip(heads, zip(*lines, strict=True), strict=True)}
