"""Logs and results as notebooks show them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hovercontrol.io.percent import percent
from hovercontrol.notebook.html import Markup, card, fold, lines, sparkline, table

if TYPE_CHECKING:
    from hovercontrol.discrepancy.diagnosis import Diagnosis
    from hovercontrol.identify.result import Identified
    from hovercontrol.identify.study import Study
    from hovercontrol.log_check.check import Checked
    from hovercontrol.logs import Log
    from hovercontrol.scenarios.result import Run
    from hovercontrol.scenarios.varied import Varied
    from hovercontrol.targets.sweep import SweepResult


def log_html(log: Log) -> str:
    """Return a log's HTML: each column's range and its course as a sparkline."""
    span = f"{log.time[0]:.4g} to {log.time[-1]:.4g} s" if len(log) else "empty"
    step = f", usually {1e3 * float(np.median(np.diff(log.time))):.4g} ms apart" if len(log) > 1 else ""
    gaps = f", {len(log.gaps)} gaps" if log.gaps else ""
    return card("Log", log.name, f"{len(log)} rows, {span}{step}{gaps}", _courses(log))


def _courses(log: Log) -> str:
    rows = []
    for name, row in log.columns.items():
        known = row[np.isfinite(row)]
        held = known.size > 2 and np.mean(np.diff(known) == 0.0) > 0.5
        low, high = (float(f(known)) if known.size else math.nan for f in (np.min, np.max))
        rows.append((name, low, high, sparkline(log.time, row, stairs=bool(held))))
    return table(("column", "from", "to", "over time"), rows)


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
    signals = fold(f"{len(run.columns)} signals", _courses(run.log()), unfolded=not rows)
    return card("Run", run.scenario.name, f"{run.scenario.title}; {run.time[-1]:g} s", figures, signals)


def _range(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return ""
    return f"< {high:g}" if math.isinf(low) else f"> {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"


def identified_html(found: Identified) -> str:
    """Return identified coefficients as HTML, with what remains and what was left out."""
    rows = []
    for c in found.coefficients:
        remark = "; ".join(
            [*([f"at its {c.bound} bound"] if c.bound else []), *([c.reason] if c.reason else [])]
        )
        std = f"± {c.std:.2g}" if math.isfinite(c.std) else "unknown"
        rows.append((c.name, c.value, std, c.unit, c.start, remark))
    left = [(r.equation, r.rms, r.seen, r.unit, percent(r.share)) for r in found.remaining]
    used = f"{found.rows} of {found.rows_total} rows of {', '.join(found.logs)}"
    return card(
        "Identified",
        found.model.name,
        "; ".join(filter(None, (used, found.not_converged))),
        table(("coefficient", "value", "std. error", "unit", "before", "remark"), rows),
        table(("equation", "remains", "seen", "unit", "share"), left, "what no equation says"),
        lines(found.misfit),
    )


def study_html(study: Study) -> str:
    """Return an identification and its predictions as HTML."""
    rows = [
        (
            f"{j.label}{' (held out)' if j.holdout else ''}",
            c,
            rms,
            j.prediction.trivial[c],
            j.prediction.units[c],
        )
        for j in study.judged
        for c, rms in j.prediction.rms.items()
    ]
    ahead = table(("log", "channel", "error 1 s ahead", "if velocities stayed", "unit"), rows)
    return identified_html(study.found) + fold("predictions", ahead, unfolded=True)


def diagnosis_html(found: Diagnosis, sentences: Sequence[str]) -> str:
    """Return a diagnosis as HTML: verdict, sentences on it, what was added, what remains, what came near."""
    added = [(e.effect, e.parameter, e.acts_in, e.value, f"± {e.std:.2g}", e.unit) for e in found.effects]
    left = [(r.equation, r.rms, r.unit, percent(r.share_explained)) for r in found.remainders]
    leads = [(lead.name, lead.gain, lead.reason) for lead in found.leads]
    return card(
        "Diagnosis",
        found.verdict,
        "",
        lines(*sentences),
        table(("effect", "number", "acts in", "value", "std. error", "unit"), added, "added"),
        table(("equation", "remains", "unit", "explained"), left, "what remains"),
        fold("came near", table(("effect", "gain", "why it is not named"), leads)) if leads else "",
        lines(*(f"warning: {w}" for w in found.warnings)),
        lines(f"next: {found.advice}" if found.advice else ""),
    )


def sweep_html(found: SweepResult) -> str:
    """Return a sweep as HTML: the spread of each output's figures over the runs, and what failed."""
    given = found.given
    runs = np.arange(len(found), dtype=float)
    varied = [
        (name, float(v.min()), float(v.max()), sparkline(runs, v))
        for name, v in given.items()
        if np.ptp(v) > 0
    ]
    rows = []
    for name in found.outputs:
        for figure in ("final", "rms", "settling"):
            values = getattr(found[name], figure)
            known = values[np.isfinite(values)]
            if known.size:
                rows.append(
                    (name, figure, float(known.min()), float(np.median(known)), float(known.max()),
                     sparkline(runs, values))
                )  # fmt: skip
    failed = [f"{len(found.failures)} runs failed; {found.failures[0]}"] if found.failures else []
    return card(
        "Sweep",
        f"{len(found)} runs",
        "",
        table(("given", "from", "to", "over the runs"), varied),
        table(("output", "figure", "least", "median", "most", "over the runs"), rows),
        lines(*failed),
    )


def varied_html(found: Varied) -> str:
    """Return a sweep as HTML."""
    axes = [(a.name, a.unit, float(a.values[0]), float(a.values[-1]), len(a.values)) for a in found.axes]
    heads = ("varied", "unit", "from", "to", "points")
    what = f"{found.figure} of {found.of} [{found.unit}]"
    return card("Sweep of", found.name, what, table(heads, axes), sweep_html(found.result))


def checked_html(found: Checked) -> str:
    """Return a log check as HTML."""
    logs = [
        (f.log.name, t.of, t.rows, t.rate, 1e3 * t.jitter, len(t.gaps), t.lost)
        for f in found.logs
        for t in f.timing
    ]
    columns = [
        (f.log.name, c.name, c.unit or "?", c.low, c.high, c.noise, len(c.outliers) if c.noise else "",
         sparkline(f.log.time, f.log[c.name], stairs=c.kind == "command"))
        for f in found.logs
        for c in f.columns
    ]  # fmt: skip
    shown = [
        (c.name, c.value, f"± {c.std:.2g}", c.unit, "yes" if c.excited else f"no: {c.reason}")
        for c in found.coefficients
    ]
    return card(
        "Log check",
        found.model,
        "",
        lines(*(f"must be corrected: {e}" for e in found.errors), *(f"look at: {w}" for w in found.warnings)),
        table(("log", "file", "rows", "per second", "jitter [ms]", "gaps", "lost"), logs),
        table(("log", "column", "unit", "from", "to", "noise", "outliers", "over time"), columns),
        table(("coefficient", "estimate", "std. error", "unit", "shown"), shown),
    )
