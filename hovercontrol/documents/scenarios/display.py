"""HTML of a scenario's run and of a sweep over scenarios in a notebook."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from hovercontrol.base.html import Markup, card, fold, table
from hovercontrol.blocks.backends.sweep_display import sweep_html
from hovercontrol.logs.display import courses

if TYPE_CHECKING:
    from hovercontrol.documents.scenarios.grid import GridResult
    from hovercontrol.documents.scenarios.result import Run


def run_html(run: Run) -> str:
    """Return a scenario's run as HTML: figures of merit, and its signals as sparklines."""
    rows = [
        (
            m.metric.name, float(m.value), m.metric.unit, _range(m.metric.low, m.metric.high),
            Markup("&#10003;") if m.met else Markup("<b>outside</b>"), m.metric.paper,
        )
        for m in run.metrics()
    ]  # fmt: skip
    figures = table(("figure", "measured", "unit", "expected", "met", "the paper says"), rows)
    signals = fold(f"{len(run.columns)} signals", courses(run.log()), unfolded=not rows)
    return card("Run", run.scenario.name, f"{run.scenario.title}; {run.time[-1]:g} s", figures, signals)


def _range(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return ""
    return f"< {high:g}" if math.isinf(low) else f"> {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"


def varied_html(found: GridResult) -> str:
    """Return a sweep as HTML."""
    axes = [(a.name, a.unit, float(a.values[0]), float(a.values[-1]), len(a.values)) for a in found.axes]
    heads = ("varied", "unit", "from", "to", "points")
    what = f"{found.figure} of {found.of} [{found.unit}]"
    return card("Sweep of", found.name, what, table(heads, axes), sweep_html(found.result))
