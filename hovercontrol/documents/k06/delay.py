"""K06 (5.1): the law that knows the link's constant delay beside one that does not, on the craft ahead."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.control.analysis.delayed_law import DelayedLoop
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.documents.k06.law_loop import ROUND_TRIP, force_craft, trial_numbers

#: Weights of u, v [s^2/m^2] and r [s^2], and of the forces [1/N^2].
STATES, FORCES = (1.0, 1.0, 0.1), (0.1, 0.1)

#: Sampling periods [s].
PERIODS = (0.1, 0.2, 0.3)


def main(out: Path, progress: Progress = quiet, *, points: int = 41) -> list[Path]:
    """Draw the quadratic cost of both laws over the delay, for several sampling periods."""
    surge = trial_numbers("forward")["surge_ref"]
    line = force_craft().linearize([surge, 0.0, 0.0], [0.0, 0.0])
    shares = np.linspace(0.0, 1.0, points)
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.subplots()
    rows: dict[str, list[float]] = {
        "period [s]": [],
        "delay [s]": [],
        "cost, (5.1)": [],
        "cost, no delay": [],
    }
    findings = []
    for k, period in enumerate(PERIODS):
        costs = []
        for share in shares.tolist():
            loop = DelayedLoop(line.A, line.B, period, share * period, np.diag(STATES), np.diag(FORCES))
            both = [loop.cost(loop.gain(knows_delay=knows)) for knows in (True, False)]
            costs.append(both)
            for key, value in zip(rows, (period, share * period, *both), strict=True):
                rows[key].append(value)
        knows, ignores = np.array(costs).T
        axes.plot(
            1000 * period * shares, knows, f"C{k}-", label=f"{1000 * period:.0f} ms, knows the delay (5.1)"
        )
        axes.plot(1000 * period * shares, ignores, f"C{k}--", label=f"{1000 * period:.0f} ms, does not")
        lost = np.flatnonzero(~np.isfinite(ignores))
        end = f"unstable from {1000 * period * shares[lost[0]]:.0f} ms on" if lost.size else "stable"
        near = int(np.argmin(np.abs(shares * period - min(ROUND_TRIP, period))))
        findings.append(
            f"Samples every {1000 * period:.0f} ms: the law without the delay is {end}; at a delay of "
            f"{1000 * period * shares[near]:.0f} ms it costs {ignores[near] / knows[near]:.2f} times "
            "what (5.1) does."
        )
        progress((k + 1) / len(PERIODS))
    axes.axvline(1000 * ROUND_TRIP, color="0.6", ls=":", label="mean round trip, table 5.1")
    axes.set(xlabel="delay [ms]", ylabel="cost per sample [1]", ylim=(0.0, 40.0))
    axes.set_title(f"K06's craft about {surge:g} m/s, optimal laws, white noise in u, v, r", fontsize=10)
    axes.legend(frameon=False, fontsize=8)
    return save(out, "k06_delay", figure, {"k06_delay": rows}, findings)
