"""Figure and HTML of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.figure_style import BLUE, VERMILION
from hovercontrol.base.html import card, fold, lines, table
from hovercontrol.base.percent import percent

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Diagnosis


def diagnosis_html(found: Diagnosis, sentences: Sequence[str]) -> str:
    """Return a diagnosis as HTML: verdict, sentences on it, what was added, what remains, what came near."""
    added = [(e.effect, e.parameter, e.place, e.value, f"± {e.std:.2g}", e.unit) for e in found.effects]
    left = [(r.equation, r.rms, r.unit, percent(r.share_explained)) for r in found.remainders]
    leads = [(lead.name, lead.gain, lead.reason) for lead in found.leads]
    return card(
        "Diagnosis",
        found.verdict,
        "",
        lines(*sentences),
        table(("effect", "number", "place", "value", "std. error", "unit"), added, "added"),
        table(("equation", "remains", "unit", "explained"), left, "what remains"),
        fold("came near", table(("effect", "gain", "why it is not named"), leads)) if leads else "",
        lines(*(f"warning: {w}" for w in found.warnings)),
        lines(f"next: {found.advice}" if found.advice else ""),
    )


def diagnosis_figure(found: Diagnosis) -> Figure:
    """Return errors without and with what was added: held out by horizon, else of the training logs."""
    if not found.ahead:
        return _bars(found)
    channels = list(dict.fromkeys(a.channel for a in found.ahead))
    columns = min(3, len(channels))
    rows = -(-len(channels) // columns)
    figure = Figure(figsize=(3.4 * columns + 0.6, 2.5 * rows + 0.9), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, channel in zip(axes, channels, strict=False):
        own = [a for a in found.ahead if a.channel == channel]
        at = [a.horizon for a in own]
        axis.loglog(at, [a.before for a in own], "o--", color=VERMILION, label="model as given")
        axis.loglog(at, [a.after for a in own], "s-", color=BLUE, label="with what was added")
        axis.set_xticks(at, [f"{h:g}" for h in at])
        axis.minorticks_off()
        axis.set_ylabel(f"{channel} [{own[0].unit}]")
        axis.set_xlabel("time ahead [s]")
        axis.grid(alpha=0.3)
    for axis in axes[len(channels) :]:
        axis.remove()
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{_title(found)}: errors on held-out logs")
    return figure


def _bars(found: Diagnosis) -> Figure:
    before, after = found.train_before.nrmse, found.train_after.nrmse
    figure = Figure(figsize=(1.8 + 1.1 * len(before), 3.6), layout="constrained")
    axis = figure.subplots()
    at = np.arange(len(before))
    axis.bar(at - 0.2, list(before.values()), 0.38, color=VERMILION, hatch="//", label="model as given")
    axis.bar(at + 0.2, [after[c] for c in before], 0.38, color=BLUE, label="with what was added")
    axis.set_xticks(at, list(before))
    axis.set_ylabel("error 1 s ahead over the scatter [1]")
    axis.grid(alpha=0.3, axis="y")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle(f"{_title(found)}: training logs")
    return figure


def _title(found: Diagnosis) -> str:
    names = ", ".join(dict.fromkeys(e.effect for e in found.effects))
    return f"{found.verdict}: {names}" if names else str(found.verdict)
