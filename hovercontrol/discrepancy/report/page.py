"""The page around a report: one file, no script, nothing from elsewhere; for screen, phone and A4."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.discrepancy.report.templates import render


def page(title: str, sections: Sequence[str]) -> str:
    """Return a whole HTML page.

    Parameters
    ----------
    title : str
    sections : sequence of str
        HTML (:class:`markupsafe.Markup`), one after the other.
    """
    return str(render("page.html", title=title, sections=sections))
