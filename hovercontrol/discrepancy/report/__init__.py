"""``report.html``: a diagnosis for a reader who never saw the code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from hovercontrol.discrepancy.diagnosis import Diagnosis
from hovercontrol.discrepancy.report.appendix import appendix
from hovercontrol.discrepancy.report.equations import coefficients, equations
from hovercontrol.discrepancy.report.evidence import evidence
from hovercontrol.discrepancy.report.material import collect
from hovercontrol.discrepancy.report.page import page
from hovercontrol.discrepancy.report.proof import gap, proof
from hovercontrol.discrepancy.report.verdict import gap_sentence, headline, verdict
from hovercontrol.discrepancy.report.where import where
from hovercontrol.files import write_whole
from hovercontrol.logs import Log

__all__ = ["gap_sentence", "headline", "write_report"]


def write_report(
    diagnosis: Diagnosis,
    holdout: Log | None,
    path: str | Path,
    *,
    names: Sequence[str] | None = None,
    warnings: Sequence[str] = (),
    command: str = "",
) -> Path:
    """Write a diagnosis as one self-contained HTML page.

    Parameters
    ----------
    diagnosis : Diagnosis
    holdout : Log or None
        As given to the diagnosis; without it the first training log is shown.
    path : path
    names : sequence of str, optional
        Effects that were considered; default: all.
    warnings : sequence of str, optional
        About the logs (:func:`~hovercontrol.discrepancy.checks.check_logs`).
    command : str, optional
        That makes the report again.

    Returns
    -------
    Path
        Of the page, which appears whole or not at all.
    """
    with threadpool_limits(1, "blas"):  # as in diagnose
        m = collect(diagnosis, holdout, names, warnings, command)
    top = f'<div class="top"><div>{verdict(diagnosis)}</div><div>{gap(m)}</div></div>'
    sections = [top, equations(m), proof(m), where(m), evidence(m), coefficients(m), appendix(m)]
    text = page(headline(diagnosis), sections)
    return write_whole(path, lambda target: target.write_text(text, encoding="utf-8"))
