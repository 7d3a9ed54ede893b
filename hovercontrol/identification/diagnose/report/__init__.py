"""``report.html``: a diagnosis for readers who do not know the code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits

from hovercontrol.base.boundary import checked
from hovercontrol.base.files import write_atomically
from hovercontrol.identification.diagnose.report.appendix import appendix
from hovercontrol.identification.diagnose.report.context import collect
from hovercontrol.identification.diagnose.report.equations import coefficients, equations
from hovercontrol.identification.diagnose.report.evidence_section import evidence, holdout
from hovercontrol.identification.diagnose.report.free_run_section import free_runs
from hovercontrol.identification.diagnose.report.functions_section import functions
from hovercontrol.identification.diagnose.report.page import page
from hovercontrol.identification.diagnose.report.remainder_section import remainder
from hovercontrol.identification.diagnose.report.rivals_section import rivals_section
from hovercontrol.identification.diagnose.report.verdict import (
    gap_sentence,
    headline,
    remainder_sentence,
    verdict,
)
from hovercontrol.identification.diagnose.report.where_section import where

if TYPE_CHECKING:
    from hovercontrol.identification.diagnose.diagnosis import Diagnosis

__all__ = ["gap_sentence", "headline", "remainder_sentence", "write_report"]


@checked
def write_report(diagnosis: Diagnosis, path: str | Path, *, command: str = "") -> Path:
    """Write a diagnosis as one self-contained HTML page.

    Parameters
    ----------
    diagnosis : Diagnosis
        Shown on the held-out log if there is one, else on the first training log.
    path : path
    command : str, optional
        Command that reproduces the report.

    Returns
    -------
    Path
        Path of the page, which is written atomically.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.identification.diagnose import diagnose
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.documents.samples import sample_path
    >>> log = read_log(sample_path()).between(0.0, 15.0)
    >>> found = diagnose(hc.vehicle("c17_experiment"), [log], names=["slope"])
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(found, Path(folder) / 'report.html').name
    'report.html'
    """
    with threadpool_limits(1, "blas"):  # as in diagnose
        m = collect(diagnosis, command)
        sections = [
            verdict(m), functions(m), where(m), equations(m), evidence(m), holdout(m), free_runs(m),
            remainder(m), rivals_section(m), coefficients(m), appendix(m),
        ]  # fmt: skip
    text = page(headline(diagnosis), sections)
    return write_atomically(path, lambda target: target.write_text(text, encoding="utf-8"))
