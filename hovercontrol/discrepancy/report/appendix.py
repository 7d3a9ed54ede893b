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
    logs = d.selection.final.windowed.data.logs
    rows = [(log.name, f"{log.rows_total}", f"{len(log.segments)}", _left_out(log)) for log in logs]
    by_script = paragraph("Made by a script: hovercontrol.discrepancy.diagnose, then write_report.")
    command = f"<pre>{escape(m.command)}</pre>" if m.command else by_script
    dropped = f"{d.rows_dropped} rows have a sample that was left out."
    version = (
        f"hovercontrol {hovercontrol.__version__}. Nothing in it is random: the same logs and model give the "
        "same answer. The method: maximum likelihood over windows with free starts, all coefficients fitted "
        "again with each candidate, the noise of measurements and of the process in the likelihood."
    )
    return (
        f"<h2>The logs</h2>{items('Warnings', m.warnings, 'warn')}{paragraph(dropped)}"
        f"{table(('log', 'rows', 'stretches', 'left out because no craft moves so'), rows)}"
        f"<h2>To make this again</h2>{command}{paragraph(version)}"
    )


def _left_out(log: Measured) -> str:
    spans = [f"{s.start:.2f} to {s.stop:.2f} s ({s.rows} rows, {s.reason})" for s in log.rejected]
    more = [f"and {len(spans) - SHOWN} more"] if len(spans) > SHOWN else []
    return "; ".join([*spans[:SHOWN], *more]) or "nothing"
