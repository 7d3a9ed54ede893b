"""What was left out of the logs and why, warnings, and how to make the report again."""

from __future__ import annotations

from html import escape

import hovercontrol
from hovercontrol.discrepancy.report.html import items, paragraph, table
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.identify.measure import Measured

#: Rejected stretches of a log that are listed.
SHOWN = 8


def appendix(m: Material) -> str:
    """Return the last sections of the page."""
    d = m.diagnosis
    logs = [(log, "") for log in d.selection.final.windowed.data.logs]
    logs += [(log, " (held out)") for log in (d.held.logs if d.held else ())]
    rows = [
        (log.name + note, f"{log.rows_total}", f"{len(log.segments)}", _rejected(log)) for log, note in logs
    ]
    by_script = paragraph("Made by a script: hovercontrol.discrepancy.diagnose, then write_report.")
    command = f"<pre>{escape(m.command)}</pre>" if m.command else by_script
    version = (
        f"hovercontrol {hovercontrol.__version__}. Nothing in it is random: the same logs and model give the "
        "same answer. The method: maximum likelihood over windows with free starts, all coefficients fitted "
        "again with each candidate, the noise of measurements and of the process in the likelihood."
    )
    return (
        f"<h2>The logs</h2>{items('Warnings', m.warnings, 'warn')}"
        f"{table(('log', 'rows', 'stretches', 'what the reader rejected: no craft moves so'), rows)}"
        f"{_left_out(m)}"
        f"<h2>To make this again</h2>{command}{paragraph(version)}"
    )


def _rejected(log: Measured) -> str:
    spans = [f"{s.start:.2f} to {s.stop:.2f} s ({s.rows} rows, {s.reason})" for s in log.rejected]
    more = [f"and {len(spans) - SHOWN} more"] if len(spans) > SHOWN else []
    return "; ".join([*spans[:SHOWN], *more]) or "nothing"


def _left_out(m: Material) -> str:
    """Return how many samples of which log and channel were left out, and why."""
    d = m.diagnosis
    if not d.left_out:
        return paragraph("All samples of all logs were used.")
    total = sum(o.count for o in d.left_out)
    rows = [(o.log + " (held out)" * o.held_out, o.channel, f"{o.count}", o.reason) for o in d.left_out]
    said = f"{total} samples were left out; {d.rows_dropped} rows of the training logs have one."
    return paragraph(said) + table(("log", "channel", "samples", "left out because"), rows)
