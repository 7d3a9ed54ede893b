"""The gap, before and after: bars, simulations over measurements, errors, whether what remains is noise."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hovercontrol.discrepancy.report import pictures
from hovercontrol.discrepancy.report.html import folded, grid, paragraph, table
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.discrepancy.report.verdict import shown_gap
from hovercontrol.discrepancy.report.words import listed, percent, unit

LEGEND = {
    "measured": "measured",
    "before": "the model as it was, coefficients fitted anew",
    "after": "the amended model",
    "noise": "twice the noise of the measurement",
    "start": "start of a simulation",
}


def legend(*kinds: str) -> str:
    """Return which colour is what."""
    return '<p class="legend">' + "".join(f'<span class="{k}">{LEGEND[k]}</span>' for k in kinds) + "</p>"


def gap(m: Material) -> str:
    """Return the bars that stand beside the verdict."""
    before, after, where = shown_gap(m.diagnosis)
    kinds = ("before", "after") if m.changed else ("before",)
    note = "Windows of a second, each from its own fitted start. The line is 1: no model can do better."
    return (
        f"<h2>Error {where}, in multiples of its noise</h2>{pictures.gap_bars(before, after, m.changed)}"
        f"{legend(*kinds)}{paragraph(note, 'small')}"
    )


def proof(m: Material) -> str:
    """Return the section that shows simulations beside a log."""
    before, after = m.before.trace, m.after.trace
    took = "which took no part in the fit" if m.held_out else "one of the training logs"
    kinds = ("measured", "before", "after") if m.changed else ("measured", "before")
    noise = {c.channel: c.noise for c in m.before.comparison.channels}
    plots = [*pictures.overlays(before, after, m.changed), pictures.path(before, after, m.changed)]
    begin, end = pictures.worst(before)
    part = end - begin < before.time[-1] - before.time[0]
    lead = (
        f"Log {before.log}, {took}. The simulations get the commands alone, from a state fitted to the "
        f"measurement. {_restarts(m)}"
    ) + (" Shown is the stretch in which the model as it was errs most." if part else "")
    gaps = pictures.errors(before, after, noise, m.changed)
    return (
        f"<h2>Simulation beside measurement</h2>{paragraph(lead)}"
        f"{legend(*kinds, *_marked(plots))}{grid(plots)}"
        f"<h3>What simulation and measurement differ by</h3>{legend(*kinds[1:], 'noise', *_marked(gaps))}"
        f"{grid(gaps)}"
        f"<h3>In numbers</h3>{_numbers(m)}{_tests(m)}"
    )


def _restarts(m: Material) -> str:
    """Return after which time the simulations of the log that is shown start afresh."""
    often = np.diff(m.before.trace.starts)
    if not often.size:
        return "They run through it once."
    navigated = m.diagnosis.selection.final.windowed.data.navigated
    why = "at every correction of the navigation, " if navigated else ""
    return f"They start afresh {why}about every {float(np.median(often)):.2g} s: there the line breaks."


def _marked(plots: Iterable[str]) -> tuple[str, ...]:
    """Return the legend's entry for the rings where simulations start, if there are any."""
    return ("start",) if any('class="start' in plot for plot in plots) else ()


def _numbers(m: Material) -> str:
    """Return the errors as a table, in units and in parts of each channel's size."""
    before, after, _ = shown_gap(m.diagnosis)
    gaps = (before, after) if m.changed else (before,)
    rows = []
    for c in before.rms:
        u = unit(m.before.trace.units.get(c, ""))
        errors = [f"{g.rms[c]:.3g} {u} ({percent(g.nrmse[c])})" for g in gaps]
        rows.append((c, *errors, percent(before.floor[c])))
    head = ("channel", "before", "after", "noise") if m.changed else ("channel", "before", "noise")
    return paragraph("Windows of a second; in percent of how much the channel moves.") + table(head, rows)


def _tests(m: Material) -> str:
    sides = [("as it was", m.before)] + ([("amended", m.after)] if m.changed else [])
    rows = [
        (
            c.channel,
            words,
            f"{c.short:.3g}",
            f"{c.free:.3g}",
            f"{c.remains:.2f}",
            _chance(c.white),
            _chance(c.independent),
        )
        for words, side in sides
        for c in side.comparison.channels
    ]
    last = sides[-1][1].comparison
    left = [(c.channel, last.beyond(c)) for c in last.channels]
    beyond = listed([f"{channel} ({', '.join(why)})" for channel, why in left if why])
    said = f"Not noise is what remains of {beyond}." if beyond else "What remains is noise."
    if not beyond and m.diagnosis.selection.process:
        said = (
            "In the tests below random forces that come and go count as noise: beyond them nothing is left. "
            "The errors above are what these forces do."
        )
    if beyond and m.diagnosis.selection.process:
        said += " Gusts are told from it by a simple law of size and duration, which leaves traces."
    text = (
        "Error over windows of a second and in one run over the whole log, in the channel's unit; size of "
        "what the rows before do not foretell, over noise; chance of such correlations in time (Ljung-Box), "
        "and with past commands, were it noise."
    )
    head = ("channel", "model", "1 s", "whole log", "over noise", "in time", "with commands")
    return paragraph(said) + folded("Tests of what remains on this log", paragraph(text) + table(head, rows))


def _chance(p: float) -> str:
    return f"{p:.2g}" if p >= 1e-4 else "< 0.0001"
