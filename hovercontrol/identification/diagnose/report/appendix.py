"""Appendix: samples left out of the logs, warnings, the method, and the command that makes the report."""

from __future__ import annotations

import numpy as np

import hovercontrol
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.report.context import Context
from hovercontrol.identification.diagnose.report.formatting import listed
from hovercontrol.identification.diagnose.report.templates import Table, render, table
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.outliers import OUTLIERS

#: Maximum number of rejected stretches of a log that are listed.
SHOWN = 6


def _asked(candidates: int) -> Table:
    """Return the thresholds with their reasons."""
    c = CRITERIA
    rows = [
        (
            f"{c.least:g} + {c.each:g} a number",
            "least gain in twice the log likelihood, per effect and per parameter: odds of e¹⁰ and of e²",
        ),
        (
            f"{100 * c.level:g} %",
            "probability of one false name among all candidates, from the scatter over segments",
        ),
        (
            f"{100 * c.spread(candidates):.0f} %",
            "largest spread between segments: a further segment has the same sign",
        ),
        (f"{c.apart:g}", "a rival less than this behind is not distinguished: odds of e⁶"),
        (f"{c.remains:g}", "gain of random forces in an equation from which on something remains there"),
        (f"{c.worse:g}", "standard errors by which held-out errors may rise with a name"),
    ]
    return table(("threshold", "of what"), rows)


def appendix(m: Context) -> str:
    """Return the last sections of the page."""
    d = m.diagnosis
    rows = _logs(d.selection.base) + (_logs(d.held_before, " (held out)") if d.held_before else [])
    head = (
        "log",
        "rows",
        "samples left out as outliers",
        "samples down-weighted",
        "rejected on reading: implausible motion",
    )
    problem = d.selection.base.problem
    seconds = sum(float(log.time[-1] - log.time[0]) for log in problem.logs)
    return render(
        "appendix.html",
        warnings=d.warnings,
        dropped=_rows(d.rows_dropped),
        down_weighted=_rows(d.rows_down_weighted),
        limits=OUTLIERS,
        logs=table(head, rows),
        count="one log" if len(problem.logs) == 1 else f"{len(problem.logs)} logs",
        rows=sum(log.rows_total for log in problem.logs),
        seconds=f"{seconds:.3g}",
        channels=listed(problem.rows.channels),
        driven=[f"{problem.block.states[problem.free[i]].name}′" for i in problem.driven],
        unknowns=len(problem.names),
        candidates=d.selection.candidates,
        held_out=m.held_out,
        thresholds=_asked(d.selection.candidates),
        version=hovercontrol.__version__,
        command=m.command,
    )


def _rows(count: int) -> str:
    return f"{count} rows" if count > 1 else "one row" if count else "no rows"


def _logs(fit: Fit, note: str = "") -> list[tuple[str, ...]]:
    """Return the rows of the table of samples left out, one per log."""
    problem = fit.problem
    rows: list[tuple[str, ...]] = []
    for k, log in enumerate(problem.logs):
        own = problem.rows.log == k
        counts, less = [], []
        for c, channel in enumerate(problem.rows.channels):
            if channel in log.channels:
                measured = int(np.isfinite(log.values[log.channels.index(channel)]).sum())
                used = int((problem.seen[:, own, c] & (problem.rows.at[:, own] >= 0)).sum())
                counts += [f"{measured - used} of {channel}"] if measured > used else []
                down = int((problem.data.down_weighted[:, own, c] & (problem.rows.at[:, own] >= 0)).sum())
                less += [f"{down} of {channel}"] if down else []
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
                listed(less) or "none",
                "; ".join([*spans[:SHOWN], *more]) or "nothing",
            )
        )
    return rows
