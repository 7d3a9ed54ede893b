"""Section on the unknown functions of a model: tables with bands, and their forms."""

from __future__ import annotations

from hovercontrol.base.percent import percent
from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context
from hovercontrol.identification.diagnose.report.templates import render, table

#: Smallest probability of a form that is listed.
LISTED = 1e-3


def functions(m: Context) -> str:
    """Return the section on unknown functions; empty if the model has none."""
    found = m.diagnosis.functions
    if not found:
        return ""
    rows = [
        (f.name, percent(form.probability), str(form))
        for f in found
        for form in f.forms
        if form.probability > LISTED
    ]
    return render(
        "functions.html",
        kinds={"before": "table", "after": "likeliest form"},
        pictures=[pictures.function(f) for f in found],
        forms=table(("function", "probability", "form"), rows),
    )
