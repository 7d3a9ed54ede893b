"""What was left out of the logs, warnings, the method, and the command that makes the report."""

from __future__ import annotations

from html import escape

import numpy as np

import hovercontrol
from hovercontrol.discrepancy.criteria import CRITERIA
from hovercontrol.discrepancy.report.context import Context
from hovercontrol.discrepancy.report.formatting import listed
from hovercontrol.discrepancy.report.html import folded, items, paragraph, table
from hovercontrol.estimation.fit import Fit

#: Rejected stretches of a log that are listed.
SHOWN = 6

_METHOD = (
    "The model is fitted with an unknown random acceleration in each equation (process noise) and the noise "
    "of each sensor; path, coefficients (with a wide prior about the given ones) and noise levels are those "
    "of maximum likelihood (iterated Kalman smoother). Each effect of the catalogue is scored, the best are "
    "fitted, and "
    "a name is given when likelihood, disjoint blocks and held-out predictions agree. What remains is the "
    "process noise that the amended model still needs. A remainder does not withdraw a named effect."
)


def _asked() -> str:
    """Return the thresholds with their reasons."""
    c = CRITERIA
    rows = [
        (
            f"{c.least:g} + {c.each:g} a number",
            "least gain in twice the log likelihood, per effect and per parameter: odds of e^10 and of e^2",
        ),
        (
            f"{100 * c.level:g} %",
            "probability of one false name among all candidates, from the scatter over blocks",
        ),
        (f"{100 * c.spread:g} %", "largest spread between blocks: a further block has the same sign"),
        (f"{c.apart:g}", "a rival less than this behind cannot be distinguished: odds of e^6"),
        (f"{c.remains:g}", "gain of random forces in an equation from which on something remains there"),
        (f"{c.worse:g}", "standard errors by which held-out errors may rise with a name"),
    ]
    return folded("Thresholds", table(("threshold", "of what"), rows))


def appendix(m: Context) -> str:
    """Return the last sections of the page."""
    d = m.diagnosis
    rows = _logs(d.selection.base) + (_logs(d.held_before, " (held out)") if d.held_before else [])
    head = ("log", "rows", "samples left out as outliers", "rejected on reading: no craft moves like this")
    script = paragraph("Made by a script: hovercontrol.discrepancy.diagnose, then write_report.")
    command = f"<pre>{escape(m.command)}</pre>" if m.command else script
    dropped = f"{d.rows_dropped or 'No'} rows of the training logs have at least one sample left out."
    version = paragraph(f"hovercontrol {hovercontrol.__version__}.", "small")
    return (
        f"<h2>The logs</h2>{items('Warnings', d.warnings, 'warn')}{paragraph(dropped)}{table(head, rows)}"
        f"<h2>Method</h2>{paragraph(_METHOD)}{_asked()}"
        f"<h2>How to reproduce this report</h2>{command}{version}"
    )


def _logs(fit: Fit, note: str = "") -> list[tuple[str, ...]]:
    """Return of each log what was not used."""
    problem = fit.problem
    rows: list[tuple[str, ...]] = []
    for k, log in enumerate(problem.logs):
        own = problem.rows.log == k
        counts = []
        for c, channel in enumerate(problem.rows.channels):
            if channel in log.channels:
                measured = int(np.isfinite(log.values[log.channels.index(channel)]).sum())
                used = int((problem.seen[:, own, c] & (problem.rows.at[:, own] >= 0)).sum())
                counts += [f"{measured - used} of {channel}"] if measured > used else []
        spans = [
            f"{s.start:.2f} to {s.stop:.2f} s ({s.rows} {'row' if s.rows == 1 else 'rows'}, {s.reason})"
            for s in log.rejected
        ]
        more = [f"and {len(spans) - SHOWN} more"] if len(spans) > SHOWN else []
        rows.append(
            (
                f"{log.name}{note}",
                f"{log.rows_total}",
                listed(counts) or "none",
                "; ".join([*spans[:SHOWN], *more]) or "nothing",
            )
        )
    return rows
