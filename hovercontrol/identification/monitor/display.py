"""Figure and HTML of a replay: evidence over time with the threshold, alarms, onsets and dead sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.envelope import envelope
from hovercontrol.base.html import card, lines, table

if TYPE_CHECKING:
    from hovercontrol.identification.monitor.alarms import Alarm
    from hovercontrol.identification.monitor.replay import Replayed

#: Candidates that are drawn in colour: those with alarms, then those with the largest evidence.
COLOURED = 6

#: Evidence below this is drawn there [1].
FLOOR = 0.1


def draw(found: Replayed) -> Figure:
    """Return the figure of a replay."""
    figure = Figure(figsize=(8.0, 5.2), layout="constrained")
    top, low = figure.subplots(2, 1, sharex=True, height_ratios=[3.2, 1.0])
    alarmed = [a.name for a in found.alarms if a.kind != "dead"]
    order = sorted(
        found.evidence, key=lambda n: (n not in alarmed, -float(found.evidence[n].max(initial=0.0)))
    )
    for k, name in reversed(list(enumerate(order))):
        row = np.maximum(found.evidence[name], FLOOR)
        drawn = envelope(row)
        style = {"color": f"C{k}", "lw": 1.3} if k < COLOURED else {"color": "0.8", "lw": 0.7}
        top.plot(
            found.time[drawn], row[drawn], label=name if k < COLOURED else None, zorder=3 - 0.1 * k, **style
        )
    top.axhline(found.threshold, color="k", ls="--", lw=1.0)
    top.annotate(
        f"threshold {found.threshold:.1f}", (1.0, found.threshold), xycoords=("axes fraction", "data"),
        xytext=(-4, 3), textcoords="offset points", ha="right", fontsize="small",
    )  # fmt: skip
    top.set_yscale("log")
    top.set_ylabel("evidence [1]")
    top.set_title(_title(found), loc="left", fontsize="medium")
    handles, labels = top.get_legend_handles_labels()
    figure.legend(
        handles[::-1], labels[::-1], loc="outside lower center", fontsize="small", frameon=False, ncols=3
    )
    _alarms(low, found, {name: k for k, name in enumerate(order)})
    low.set_xlabel("time [s]")
    return figure


def _title(found: Replayed) -> str:
    if not found.alarms:
        return f"{found.log}: nothing changed"
    names = dict.fromkeys(f"{a.name} dead" if a.kind == "dead" else a.name for a in found.alarms)
    shown = list(names)[:3]
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{found.log}: {', '.join(shown)}{more}"


def _alarms(axis, found: Replayed, colours: dict[str, int]) -> None:  # type: ignore[no-untyped-def]
    """Draw a bar from the onset of each alarm to when it was seen last, and a mark where it was raised."""
    names = list(dict.fromkeys(a.name for a in found.alarms))
    axis.set_yticks(range(len(names)), names, fontsize="small")
    axis.set_ylim(len(names) - 0.4, -0.6)
    if not names:
        axis.text(0.5, 0.5, "no alarm", transform=axis.transAxes, ha="center", va="center", color="0.4")
    for a in found.alarms:
        row = names.index(a.name)
        # of a dead sensor and of an unknown change no evidence is drawn
        colour = f"C{min(colours[a.name], 9)}" if a.kind in ("change", "bias") else "0.3"
        axis.barh(row, max(a.last - a.since, 0.0), left=a.since, height=0.5, color=colour, alpha=0.5)
        axis.plot(a.time, row, marker="v", color=colour, ms=6)


def rows_of(alarms: tuple[Alarm, ...]) -> list[tuple[object, ...]]:
    """Return the rows of the table of alarms."""
    return [
        (
            f"{a.time:.1f}",
            f"no samples of {a.name}" if a.kind == "dead" else a.name,
            "" if a.kind == "dead" else f"{a.change:.4g} ± {a.std:.2g} {'' if a.unit == '1' else a.unit}",
            f"{a.since:.1f}",
            f"{a.last:.1f}",
            f"at once with {a.beside}" if a.beside else ", ".join(a.rivals),
        )
        for a in alarms
    ]


HEADINGS = ("alarm [s]", "what", "change", "since [s]", "last seen [s]", "or")


def replayed_html(found: Replayed) -> str:
    """Return the HTML of a replay for a notebook."""
    remark = f"{found.seconds:.1f} s, {found.time.size} ticks, threshold {found.threshold:.1f}"
    nothing = "" if found.alarms else "nothing changed"
    return card(
        "replay",
        found.log,
        remark,
        lines(nothing),
        table(HEADINGS, rows_of(found.alarms)),
        lines(*found.notes),
    )
