"""Where and when the model as it was disagrees: the force it lacks, over time and over what it depends on."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from hovercontrol.discrepancy.localize import Missing
from hovercontrol.discrepancy.report import pictures
from hovercontrol.discrepancy.report.html import folded, grid, paragraph
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.discrepancy.report.proof import legend
from hovercontrol.discrepancy.report.words import prime, unit

Array = NDArray[np.float64]

#: Part of a velocity's spread, per second, below which a missing force is nothing to look at.
SMALL = 0.02

#: Part of the rows in which a force must stand out of its band to be there.
THERE = 0.01

#: Part of a force's variance that its means over a quantity must explain to be shown.
TELLING = 0.1

#: Logs whose forces are drawn at most.
LOGS = 3


def where(m: Material) -> str:
    """Return the section on the missing force."""
    d = m.diagnosis
    if not d.missing:
        return ""
    worst = max(d.missing, key=lambda f: f.share * f.rms)
    kinds = ("before", "after") if m.changed else ("before",)
    there = worst.share > THERE
    if there:
        size = f"{worst.rms:.2g} {unit(worst.unit)}".strip()
        lead = (
            f"Most {prime(d.regime)}. The force that the model as it was lacks there has a root mean square "
            f"of {size}, and stands out of its band in {100 * worst.share:.0f} % of the rows of {worst.log}."
        )
    else:
        lead = "The missing force stays within its band: there is nothing to be seen beyond noise."
    before, after = _by_log(d.missing), _by_log(m.missing_after)
    first = next(k for k, forces in enumerate(before) if worst in forces)
    order = sorted(range(len(before)), key=lambda k: k != first)
    parts = []
    for k in order[:LOGS]:
        plots = grid(pictures.forces(before[k], after[k], _least(m), m.changed))
        log = before[k][0].log
        parts.append(folded(log, plots) if k != first else f"<h3>Over time, in {escape(log)}</h3>{plots}")
    how = (
        "Force per mass, torque per inertia, reconstructed from the logs as an unknown addition to each "
        "equation (Kalman smoother); the band is twice its standard error. Marked at the foot: stretches in "
        "which the force still stands out of it."
    )
    over = _dependences(m, first, before[first], after[first]) if there else ""
    return f"<h2>Where it is</h2>{paragraph(lead)}{paragraph(how)}{legend(*kinds)}{over}{''.join(parts)}"


def _by_log(forces: Sequence[Missing]) -> list[list[Missing]]:
    """Return the forces of each log; two logs may share a name."""
    count = len({f.equation for f in forces})
    return [list(forces[k : k + count]) for k in range(0, len(forces), count)]


def _least(m: Material) -> dict[str, float]:
    """Return by equation a force too small to care about: a part of how its velocity changes in a second."""
    w = m.diagnosis.selection.base.windowed
    sizes = {}
    for i, s in enumerate(w.block.states):
        rows = [log.states[i] for log in w.data.logs if i < len(log.states)]
        known = np.concatenate([row[np.isfinite(row)] for row in rows] or [np.zeros(1)])
        sizes[f"{s.name}'"] = SMALL * float(known.std()) if known.size else SMALL
    return sizes


def _dependences(m: Material, log: int, before: Sequence[Missing], after: Sequence[Missing]) -> str:
    """Return for each equation of a log the force over the quantity that explains most of it."""
    quantities = _quantities(m, log)
    plots = []
    for was, now in zip(before, after, strict=True):
        shares = [pictures.share_explained(values, was.force) for _, _, values in quantities]
        if was.share < THERE or max(shares, default=0.0) < TELLING:
            continue
        *label, values = quantities[int(np.argmax(shares))]
        least = _least(m)[was.equation]
        plots.append(pictures.dependence(was, now, values, (label[0], label[1]), least, m.changed))
    if not plots:
        return ""
    text = (
        "Means over equal shares of the rows, against the velocity or command that explains most of the "
        f"force in {before[0].log}."
    )
    return f"<h3>Over what it depends on most</h3>{paragraph(text)}{grid(plots)}"


def _quantities(m: Material, log: int) -> list[tuple[str, str, Array]]:
    """Return label, unit and rows of a log's velocities, as simulated, and commands."""
    w = m.diagnosis.selection.base.windowed
    moving = {f.equation.removesuffix("'") for f in m.diagnosis.missing}
    track = w.tracks()[log]
    states = [(s.name, s.unit, track[i]) for i, s in enumerate(w.block.states) if s.name in moving]
    inputs = [(s.name, s.unit, w.data.logs[log].inputs[i]) for i, s in enumerate(w.block.inputs)]
    return states + inputs
