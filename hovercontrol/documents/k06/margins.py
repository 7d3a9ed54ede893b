"""The delay, jitter and loss that K06's forward law tolerates, and C17's tracking loop along its ellipse."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol import interconnect, tracking_controller, vehicle
from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.loops import c17_ellipse, on_reference
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.analysis.packet_loss import Lost, packet_loop
from hovercontrol.control.analysis.stability_margins import FrozenMargins, Margins, margins, margins_along
from hovercontrol.control.controllers.k06 import forward, setpoints
from hovercontrol.documents.k06.law_loop import ROUND_TRIP, force_craft, trial_numbers

#: K06 table 6.2: gains [kg/s] and reference of the surge velocity [m/s].
K1, K2, SURGE = (trial_numbers("forward")[name] for name in ("k1", "k2", "surge_ref"))
#: The operating point.
AHEAD = {"craft.u": SURGE}
#: Period of C17's commands [s].
SENT = 0.0225


def main(out: Path, progress: Progress = quiet, *, points: int = 40, instants: int = 60) -> list[Path]:
    """Draw delay and jitter margins over k2 and along the ellipse, and the tolerable loss over the period."""
    gains, periods = np.linspace(0.5, 12.0, points), np.linspace(0.02, 0.34, points)
    by_gain = [margins(_forward(k2), "force_y", AHEAD) for k2 in gains.tolist()]
    progress(0.4)
    loss = {
        f"{lost}, {said}": _critical(periods, lost, tries)
        for tries, said in ((1, "sent once"), (2, "sent once more"))
        for lost in ("hold", "zero")
    }
    progress(0.6)
    along = _along_ellipse(instants)
    time = along.times - along.times[0]
    figure = Figure(figsize=(16.0, 6.0), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    _draw_gains(left, gains, by_gain)
    _draw_loss(middle, periods, loss)
    _draw_ellipse(right, time, along)
    tables = {
        "k06_margins_gain": {"k2 [kg/s]": gains}
        | {f"{n} [s]": np.array([getattr(m, n) for m in by_gain]) for n in ("delay", "jitter")},
        "k06_margins_loss": {"period [s]": periods, **loss},
        "k06_margins_ellipse": {
            "time [s]": time,
            "delay [s]": along["delay"],
            "jitter [s]": along["jitter"],
            "phase [deg]": along["phase"],
        },
    }
    files = save(out, "k06_margins", figure, tables, _findings(periods, loss, along))
    progress(1.0)
    return files


def _findings(periods: Array, loss: Mapping[str, Array], along: FrozenMargins) -> list[str]:
    half = len(periods) // 2
    once, twice = (loss[f"hold, sent once{more}"] for more in ("", " more"))
    worst, table_62 = along.worst, margins(_forward(K2), "force_y", AHEAD)
    return [
        f"K06 forward law, table 6.2 (k2 = {K2:g} kg/s, {SURGE:g} m/s), side force: phase margin "
        f"{table_62.phase:.1f} deg at {table_62.crossover:.2f} rad/s; the loop is stable with a constant "
        f"delay up to {1000 * table_62.delay:.0f} ms, and with one that varies up to "
        f"{1000 * table_62.jitter:.0f} ms; the link's mean round trip is {1000 * ROUND_TRIP:.0f} ms.",
        f"Packets every {1000 * periods[half]:.0f} ms, last commands held on loss: the loop is stable with "
        f"corruption of {once[half]:.0%} of them if each is sent once, of {twice[half]:.0%} if one that "
        "arrives corrupted is sent once more (K06: |a| q > 1 with a second try; a^2 q > 1 without).",
        f"C17 along the ellipse, rudder, frozen: phase margin {worst.phase:.1f} deg at worst, delay "
        f"{1000 * worst.delay:.0f} ms.",
    ]


def _forward(k2: float) -> list[Block]:
    law = forward(k1=K1, k2=k2, name="law")
    return [force_craft(), law, setpoints([law], {"surge_ref": SURGE})]


def _critical(periods: Array, lost: Lost, tries: int) -> Array:
    wires = ["force_x", "force_y"]
    loops = (packet_loop(_forward(K2), wires, period, AHEAD, lost=lost) for period in periods.tolist())
    return np.array([min(loop.critical_corruption(tries), 1.0) for loop in loops])


def _along_ellipse(instants: int) -> FrozenMargins:
    model, reference, arm = vehicle("c17_simulation"), c17_ellipse(), 0.2
    blocks = [model.plant(), tracking_controller(model, control_point=arm, k1=2.0, k2=2.0), reference]
    loop = interconnect(blocks, "loop").compile()
    begin = {k: v for k, v in on_reference(reference, arm).items() if k.startswith("plant")}
    settled = loop.simulate([0.0, 20 * np.pi], x0=begin).states[:, -1]
    motion = loop.simulate(np.linspace(20 * np.pi, 22 * np.pi, instants + 1), x0=settled)
    return margins_along(blocks, "rudder", motion)


def _draw_gains(axes: Axes, gains: Array, found: list[Margins]) -> None:
    for name, style, label in (("delay", "-", "constant delay"), ("jitter", "--", "jitter, section 5.3.3")):
        axes.plot(gains, [1000 * getattr(m, name) for m in found], "k" + style, label=label)
    axes.axhline(1000 * ROUND_TRIP, color="black", ls=":", label="mean round trip of the link, table 5.1")
    axes.axvline(K2, color="0.6", lw=1.0, label="k2 of table 6.2")
    axes.set(xlabel="gain k2 [kg/s]", ylabel="largest stable force delay [ms]", ylim=(0.0, None))
    axes.set_title(f"K06 forward law at {SURGE:g} m/s", fontsize=10)
    axes.legend(frameon=False)


def _draw_loss(axes: Axes, periods: Array, loss: Mapping[str, Array]) -> None:
    for (lost, critical), style in zip(loss.items(), ("k-", "k--", "C0-", "C0--"), strict=True):
        axes.plot(1000 * periods, critical, style, label=lost)
    axes.set(
        xlabel="time between packets [ms]", ylabel="critical probability of corruption [1]", ylim=(0.0, 1.0)
    )
    axes.set_title("K06 forward law: stable in the mean square below", fontsize=10)
    axes.legend(frameon=False)


def _draw_ellipse(axes: Axes, time: Array, along: FrozenMargins) -> None:
    axes.plot(time, 1000 * along["delay"], "k-", label="constant delay")
    axes.plot(time, 1000 * along["jitter"], "k--", label="jitter")
    axes.axhline(1000 * SENT, color="black", ls=":", label="C17 sends commands every 22.5 ms")
    axes.set(
        xlabel="time along the ellipse [s]",
        ylabel="largest stable rudder delay [ms]",
        ylim=(0.0, None),
    )
    axes.set_title("C17 simulation: frozen linearisations", fontsize=10)
    axes.legend(frameon=False)
