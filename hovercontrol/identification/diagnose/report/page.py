"""The page of a report: one file without scripts or external resources, for screen, phone and A4."""

from __future__ import annotations

from collections.abc import Sequence

from hovercontrol.identification.diagnose.report.templates import render


def page(title: str, sections: Sequence[str]) -> str:
    """Return a whole HTML page.

    Parameters
    ----------
    sections : sequence of str
        HTML of the sections (:class:`markupsafe.Markup`), in order.
    """
    return str(render("page.html", title=title, sections=sections))
