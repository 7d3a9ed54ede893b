"""Section on simulation and measurement: runs of some seconds, driven by the commands alone."""

from __future__ import annotations

from hovercontrol.identification.diagnose.report import pictures
from hovercontrol.identification.diagnose.report.context import Context
from hovercontrol.identification.diagnose.report.free_run import free_run
from hovercontrol.identification.diagnose.report.templates import legend, render

#: Lengths of a run [s], of which the longest that stays near the log is used; minimum rows of a run.
SECONDS, ROWS = (10.0, 5.0, 2.0, 1.0), 10


def free_runs(m: Context) -> str:
    """Return the section that shows free runs along a log."""
    problem = m.after.problem
    for wanted in SECONDS:
        seconds = max(wanted * problem.tempo, ROWS * problem.shortest)
        after = free_run(m.after, 0, seconds)
        if after.keeps_near():
            break
    before = free_run(m.before, 0, seconds) if m.changed else after
    kinds = ("measured", "before", "after") if m.changed else ("measured", "before")
    begin, end = pictures.stretch(before)
    part = end - begin < before.time[-1] - before.time[0]
    plots = pictures.overlays(before, after, m.changed)
    ring = ("start",) if any('class="start' in plot for plot in plots) else ()
    return render(
        "free_runs.html",
        log=before.log,
        held_out=m.held_out,
        seconds=f"{seconds:.2g}",
        part=part,
        kinds=legend(*kinds, *ring),
        plots=plots,
    )
