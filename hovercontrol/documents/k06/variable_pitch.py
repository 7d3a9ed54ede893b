"""K06 chapter 7: what a variable-pitch propeller would gain over K06's reversing fan, trial by trial."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.craft.hardware.actuators import VariablePitch, fan_force
from hovercontrol.craft.hardware.actuators.k06 import HIGHEST_SPEED
from hovercontrol.documents.scenarios import Scenario, load_scenario
from hovercontrol.documents.scenarios.trials import run_trial

TRIALS = ("halt", "stop", "forward", "reverse", "turn", "heading-bangbang-rest", "heading-proportional-rest")


def with_variable_pitch(scenario: Scenario, propeller: VariablePitch | None = None) -> Scenario:
    """Return a trial of the real loop run with a variable-pitch propeller.

    Parameters
    ----------
    scenario : Scenario
        With an autopilot and the stand-in tables of the fan, whose loss at a turned rudder stays.
    propeller : VariablePitch, optional

    Raises
    ------
    InputError
        If the scenario has no autopilot or tables of its own.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> with_variable_pitch(load_scenario("k06-real-reverse")).autopilot.propeller.thrust
    1.944
    """
    changed = scenario.with_autopilot(propeller=propeller or VariablePitch())
    if changed.autopilot and changed.autopilot.tables is not None:
        raise InputError(f"variable pitch: {scenario.name!r} has tables of its own, not K06's")
    return changed


def without_brake(scenario: Scenario) -> Scenario:
    """Return a trial without the brake of the speed controller, which then reverses at once.

    Raises
    ------
    InputError
        If the scenario has no autopilot.

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> without_brake(load_scenario("k06-real-stop")).autopilot.imperfections.brake
    False
    """
    own = scenario.autopilot
    if own is None:
        raise InputError(f"variable pitch: {scenario.name!r} is no trial of the real loop")
    return scenario.with_autopilot(imperfections=own.imperfections.without("brake"))


FAN, FREE, PITCH = "reversing fan with its brake", "the same fan without the brake", "variable pitch"
#: By propeller, a function that changes a trial.
PROPELLERS = {FAN: lambda trial: trial, FREE: without_brake, PITCH: with_variable_pitch}


def main(
    out: Path, progress: Progress = quiet, *, runs: int = 8, trials: tuple[str, ...] = TRIALS
) -> list[Path]:
    """Run each trial with the propellers; compare the rms gap to the ideal loop, headings, and the halt."""
    gaps: dict[str, dict[str, Array]] = {}
    findings: list[str] = []
    tracks: dict[str, tuple[Array, Array]] = {}
    for k, name in enumerate(trials):
        own = load_scenario(f"k06-real-{name}")
        found = {label: run_trial(make(own), runs=runs) for label, make in PROPELLERS.items()}
        gaps[name] = {label: np.sqrt(np.mean(c["gap"] ** 2, axis=1)) for label, (_, c) in found.items()}
        findings.append(f"{name}: gap to the ideal loop {_each(gaps[name], '.3f')} m/s{_more(name, found)}.")
        if name == "halt":
            tracks = {label: (t, c["x"]) for label, (t, c) in found.items()}
        progress((k + 1) / len(trials))
    made, astern = VariablePitch(), -float(fan_force(-HIGHEST_SPEED))
    findings.append(
        f"Means of {runs} seeds: {', '.join(PROPELLERS)}. The propeller gives {made.thrust:.2f} N either "
        f"way, its pitch {made.lag:g} s behind (an assumption); the fan gives {astern:.2f} N astern."
    )
    rows = [
        {"trial": name, "propeller": label, "gap [m/s]": float(gap.mean())}
        | ({"distance [m]": float(tracks[label][1].max(axis=1).mean())} if name == "halt" else {})
        for name, labels in gaps.items()
        for label, gap in labels.items()
    ]
    return save(out, "k06_variable_pitch", _figure(gaps, tracks), {"k06_variable_pitch": rows}, findings)


def _more(name: str, found: dict[str, tuple[Array, dict[str, Array]]]) -> str:
    """Return the stopping distance of a halt, the heading error of a heading trial."""
    if name == "halt":
        distances = {label: c["x"].max(axis=1) for label, (_, c) in found.items()}
        return f"; from 1.1 m/s it stands after {_each(distances, '.2f')} m"
    if name.startswith("heading"):
        swings = {
            label: np.degrees(np.abs(c["heading_error"][:, t > t[-1] - 10]).max(axis=1))
            for label, (t, c) in found.items()
        }
        return f"; largest heading error of the last 10 s {_each(swings, '.0f')} deg"
    return ""


def _each(values: dict[str, Array], digits: str) -> str:
    return ", ".join(f"{value.mean():{digits}}" for value in values.values())


def _figure(gaps: dict[str, dict[str, Array]], tracks: dict[str, tuple[Array, Array]]) -> Figure:
    figure = Figure(figsize=(11.0, 2.0 + 0.55 * len(gaps)), layout="constrained")
    bars, halt = figure.subplots(1, 2, width_ratios=[1.3, 1.0]) if tracks else (figure.subplots(), None)
    place = np.arange(len(gaps))[::-1]
    for which, label in enumerate(PROPELLERS):
        means, spread = (np.array([f(row[label]) for row in gaps.values()]) for f in (np.mean, np.std))
        bars.barh(place + 0.27 * (1 - which), means, 0.25, xerr=spread, color=f"C{which}", label=label)
    bars.set_yticks(place, list(gaps))
    bars.set_xlabel("rms gap of the real to the ideal loop [m/s]")
    if halt is not None:
        _draw_halt(halt, tracks)
    lines, labels = bars.get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _draw_halt(axes: Axes, tracks: dict[str, tuple[Array, Array]]) -> None:
    for which, (time, x) in enumerate(tracks.values()):
        axes.fill_between(time, x.min(axis=0), x.max(axis=0), color=f"C{which}", alpha=0.25, lw=0)
        axes.plot(time, x.mean(axis=0), color=f"C{which}")
    axes.set(xlabel="time [s]", ylabel="distance run from 1.1 m/s [m]")
    axes.set_title("halt", fontsize=11)
    axes.grid(alpha=0.3)
