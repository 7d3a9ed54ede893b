"""The heading of two Cricket units on the bench, raw and with the INS's help: figure 6.20."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.control.analysis.output import save
from hovercontrol.documents.k06.bench.aids import SECONDS, SETTLED, aided_settings
from hovercontrol.documents.k06.bench.runs import (
    COLUMNS,
    GUESSED,
    LACKS,
    SEEDS,
    Rms,
    Settings,
    errors,
    rows,
    time_course,
)
from hovercontrol.documents.printed import printed, rebuilds
from hovercontrol.documents.scenarios.real_figures import within_a_turn

PRINTED = printed("k06", "fig 6.20")
#: Other places of the second Cricket unit, 8 in from the first, in the body's axes [m].
PLACES = {
    "farther from the axis": (0.0, -8 * 0.0254),
    "ahead along x": (8 * 0.0254, 0.0),
    "behind along x": (-8 * 0.0254, 0.0),
}


def unit_headings(settings: Settings, *, seeds: int = 16) -> tuple[Rms, Rms]:
    """Return rms errors of the two units' heading on the beam, raw and assisted [deg]."""
    own = {**settings, **aided_settings("cricket")}
    found = errors(own, seeds, SECONDS["cricket"], SETTLED["cricket"])
    raw, assisted = (Rms(np.degrees(found[f"{name}_error"]), PRINTED[name]) for name in ("raw", "assisted"))
    return raw, assisted


def second_unit(place: Sequence[float]) -> dict[str, float]:
    """Return the parameters that put the second Cricket unit to a place in the body's axes [m]."""
    return {
        f"{block}.unit_2_{axis}": value
        for block in ("cricket_ranges", "two_unit_heading", "assisted_heading")
        for axis, value in zip("xy", place, strict=True)
    }


@rebuilds("k06", "fig 6.20", lacks=LACKS)
def fig_6_20(folder: Path) -> Mapping[str, float]:
    """Headings of two Cricket units, raw and with the INS's help [K06 fig 6.20]."""
    heading_figure().savefig(folder / "headings.png", dpi=130)
    raw, assisted = unit_headings(COLUMNS[GUESSED], seeds=SEEDS)
    return {"raw": raw.mean, "assisted": assisted.mean, "gained": raw.mean - assisted.mean}


def heading_figure() -> Figure:
    """Return one run's two headings beside the true one, and their errors."""
    run = time_course({**COLUMNS[GUESSED], **aided_settings("cricket")}, 30.0)
    figure = Figure(figsize=(13.0, 8.0), layout="constrained")
    heading, error = figure.subplots(2, 1, sharex=True)
    shown = run["time"] > 22.0
    time = run["time"][shown]
    heading.plot(time, within_a_turn(run["psi"][shown]), color="0.6", lw=2.5, label="true")
    arrived = run["heading_fix_arrived"][shown] > 0
    for name, signal, mark, fill, style in (
        ("raw", "heading_fix", "ko", "black", "k-"),
        ("assisted", "heading_assisted", "ks", "white", "k--"),
    ):
        fixes = run[signal][shown][arrived] % (2 * np.pi)
        heading.plot(time[arrived], fixes, mark, mfc=fill, ms=8, label=name)
        values = np.degrees(abs(run[f"{name}_error"][shown]))
        error.plot(time, values, style, drawstyle="steps-post", label=name)
        known = PRINTED[name].value
        error.axhline(known, color="0.7", ls=":", label=f"{name}, figure 6.20: about {known:.0f} deg")
    heading.set(ylabel="heading [rad]", ylim=(0.0, 2 * np.pi))
    heading.set_title(f"Two Cricket units at -115 deg/s, sensors: {GUESSED}", fontsize=11)
    error.set(xlabel="time [s]", ylabel="error of the heading [deg]", ylim=(0.0, 40.0))
    for axes in (heading, error):
        axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def save_headings(out: Path, seeds: int) -> list[Path]:
    """Draw figure 6.20; write its errors for all sensors and for other places of the second unit."""
    found = {column: unit_headings(settings, seeds=seeds) for column, settings in COLUMNS.items()}
    elsewhere = {
        text: unit_headings({**COLUMNS[GUESSED], **second_unit(place)}, seeds=seeds)
        for text, place in PLACES.items()
    }
    findings = [
        f"Figure 6.20, {seeds} seeds: "
        + "; ".join(
            f"{column}: raw {raw.words(1)}, assisted {helped.words(1)}, gained "
            f"{raw.mean - helped.mean:.1f} deg"
            for column, (raw, helped) in found.items()
        )
        + f". K06 has about {', '.join(f'{p.value:g}' for p in PRINTED.values())} deg.",
        "The units stand along the beam, the second 8 in nearer to the spin axis (assumed). Elsewhere the "
        "two headings are less like K06's: "
        + "; ".join(f"{text} {a.mean:.1f} and {b.mean:.1f} deg" for text, (a, b) in elsewhere.items())
        + ". What is left with the INS's help is how old the fixes are: K06's errors of 5, 10 and 20 deg "
        "at 57, 115 and 230 deg/s (figure 6.14) are those of 87 ms, less than its slot of 100 ms.",
    ]
    name = "k06_bench_heading"
    return save(out, name, heading_figure(), {name: rows(found)}, findings)
