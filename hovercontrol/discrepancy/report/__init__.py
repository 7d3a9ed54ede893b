"""``report.html``: a diagnosis for readers who do not know the code."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits

from hovercontrol.core.boundary import checked
from hovercontrol.discrepancy.report.appendix import appendix
from hovercontrol.discrepancy.report.context import collect
from hovercontrol.discrepancy.report.equations import coefficients, equations
from hovercontrol.discrepancy.report.evidence_section import evidence, holdout
from hovercontrol.discrepancy.report.free_run_section import free_runs
from hovercontrol.discrepancy.report.others import others
from hovercontrol.discrepancy.report.page import page
from hovercontrol.discrepancy.report.remainder_section import remainder
from hovercontrol.discrepancy.report.verdict import gap_sentence, headline, remainder_sentence, verdict
from hovercontrol.io.files import write_atomically

if TYPE_CHECKING:
    from hovercontrol.discrepancy.diagnosis import Diagnosis

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
    >>> from hovercontrol.discrepancy import diagnose
    >>> from hovercontrol.logs import read_log
    >>> from hovercontrol.samples import sample_path
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
            verdict(m), equations(m), evidence(m), holdout(m), free_runs(m), remainder(m), others(m),
            coefficients(m), appendix(m),
        ]  # fmt: skip
    text = page(headline(diagnosis), sections)
    return write_atomically(path, lambda target: target.write_text(text, encoding="utf-8"))
