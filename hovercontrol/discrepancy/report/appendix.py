"""What was left out of the logs, warnings, the method, and how to make the report again."""

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
    "The model, its coefficients free about the given ones, is fitted with an unknown acceleration of random "
    "walk in each equation (process noise) and the noise of each sensor; path, coefficients and levels of noise "
    "are those of maximum likelihood (iterated Kalman smoother). Each effect of the catalogue is scored, the "
    "best are fitted, and a name is given when likelihood, disjoint blocks and held-out predictions agree. What "
    "remains is the process noise that the amended model still needs. A remainder takes no name away."
)


def appendix(m: Context) -> str:
    """Return the last sections of the page."""
    d = m.diagnosis
    rows = _logs(d.selection.base) + (_logs(d.held_before, " (held out)") if d.held_before else [])
    head = ("log", "rows", "samples left out: they stand out", "left out by the reader: no craft moves so")
    script = paragraph("Made by a script: hovercontrol.discrepancy.diagnose, then write_report.")
    command = f"<pre>{escape(m.command)}</pre>" if m.command else script
    asked = [
        (f"{CRITERIA.least:g} + {CRITERIA.each:g} a number", "likelihood gained, at least: odds of e^10, and e^2 for each"),
        (f"{100 * CRITERIA.level:g} %", "chance of one false name among all candidates, by the scatter over blocks"),
        (f"{100 * CRITERIA.spread:g} %", "spread of a size from block to block at most: nearly every block has its sign"),
        (f"{CRITERIA.apart:g}", "a rival no more than this behind cannot be told apart: odds of e^6"),
        (f"{CRITERIA.remains:g}", "likelihood gained by random forces in an equation from which on something remains"),
        (f"{CRITERIA.worse:g}", "standard errors by which a held-out error may rise with a name that stays"),
    ]  # fmt: skip
    return (
        f"<h2>The logs</h2>{items('Warnings', d.warnings, 'warn')}"
        f"{paragraph(f'{d.rows_dropped} rows of the training logs have a sample that was left out.')}"
        f"{table(head, rows)}"
        f"<h2>Method</h2>{paragraph(_METHOD)}{folded('What is asked for', table(('threshold', 'of what'), asked))}"
        f"<h2>To make this again</h2>{command}{paragraph(f'hovercontrol {hovercontrol.__version__}.', 'small')}"
    )


def _logs(fit: Fit, note: str = "") -> list[tuple[str, ...]]:
    """Return of each log what was not used."""
    problem = fit.problem
    rows = []
    for k, log in enumerate(problem.logs):
        own = problem.rows.log == k
        counts = []
        for c, channel in enumerate(problem.rows.channels):
            if channel in log.channels:
                measured = int(np.isfinite(log.values[log.channels.index(channel)]).sum())
                used = int((problem.seen[:, own, c] & (problem.rows.at[:, own] >= 0)).sum())
                counts += [f"{measured - used} of {channel}"] if measured > used else []
        spans = [f"{s.start:.2f} to {s.stop:.2f} s ({s.rows} rows, {s.reason})" for s in log.rejected]
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
