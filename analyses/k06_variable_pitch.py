"""K06 chapter 7: what a variable-pitch propeller would gain, trial by trial, over K06's reversing fan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.csv
from matplotlib.figure import Figure

from hovercontrol.analysis.k06.trials import fly_trial
from hovercontrol.analysis.k06.variable_pitch import PITCH_LAG, with_variable_pitch
from hovercontrol.analysis.output import Progress, save, script
from hovercontrol.scenarios import load_scenario

TRIALS = ("stop", "forward", "reverse", "turn", "heading-bangbang-rest", "heading-proportional-rest")


def main(
    out: Path, progress: Progress | None = None, *, runs: int = 8, trials: tuple[str, ...] = TRIALS
) -> list[Path]:
    """Fly each trial with both propellers; compare the rms gap to the ideal loop, and headings."""
    rows, findings = [], []
    for k, name in enumerate(trials):
        own = load_scenario(f"k06-real-{name}")
        found = [fly_trial(s, runs=runs) for s in (own, with_variable_pitch(own))]
        gaps = [np.sqrt(np.mean(c["gap"] ** 2, axis=1)) for _, c in found]
        rows.append((name, *gaps))
        text = f"{name}: gap to the ideal loop {gaps[0].mean():.3f} to {gaps[1].mean():.3f} m/s"
        if "heading_error" in found[0][1]:
            swings = [np.degrees(np.abs(c["heading_error"][:, t > t[-1] - 10]).max(axis=1)) for t, c in found]
            first, second = (f"{swing.mean():.0f}" for swing in swings)
            text += f"; largest heading error of the last 10 s {first} to {second} deg"
        findings.append(text + ".")
        if progress:
            progress((k + 1) / len(trials))
    findings.append(
        f"Means of {runs} seeds, K06's fan to a variable-pitch propeller: same force backward, no brake, "
        f"pitch behind a lag of {PITCH_LAG:g} s (assumed)."
    )
    figure = Figure(figsize=(8.0, 1.4 + 0.5 * len(rows)), layout="constrained")
    axes = figure.subplots()
    place = np.arange(len(rows))[::-1]
    for which, label in enumerate(("reversing fan with its brake", "variable pitch")):
        means, spread = (np.array([f(row[1 + which]) for row in rows]) for f in (np.mean, np.std))
        axes.barh(place + 0.2 - 0.4 * which, means, 0.36, xerr=spread, color=f"C{which}", label=label)
    axes.set_yticks(place, [row[0] for row in rows])
    axes.set_xlabel("rms gap of the real to the ideal loop [m/s]")
    axes.legend(frameon=False)
    table = pyarrow.table(
        {
            "trial": [row[0] for row in rows],
            "gap, fan [m/s]": [float(row[1].mean()) for row in rows],
            "gap, variable pitch [m/s]": [float(row[2].mean()) for row in rows],
        }
    )
    tables = {"k06_variable_pitch": lambda path: pyarrow.csv.write_csv(table, path)}
    return save(out, "k06_variable_pitch", figure, tables, findings)


if __name__ == "__main__":
    script(main, __doc__ or "")
