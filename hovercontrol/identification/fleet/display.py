"""The findings of a fleet in sentences, and as one page."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from hovercontrol.base.html import fold
from hovercontrol.base.percent import percent
from hovercontrol.base.svg import Plot
from hovercontrol.identification.diagnose.report.page import page as html_page
from hovercontrol.identification.fleet.findings import Coefficient, left, scattered
from hovercontrol.identification.fleet.random_effects import LEVEL
from hovercontrol.identification.fleet.sources import DATED, bare_reason, file_name
from hovercontrol.identification.fleet.trends import LEAST, Trend

if TYPE_CHECKING:
    from hovercontrol.identification.fleet.fleet import Common, Fleet

#: Refused logs that are listed for one reason.
SHOWN = 5

_STYLE = """<style>
.fleet td, .fleet th { padding: .15rem .5rem; text-align: right; white-space: nowrap; border: 0; }
.fleet td:first-child, .fleet th:first-child { text-align: left; }
.fleet a { color: inherit; } .fleet .off { font-weight: 700; outline: 2px solid var(--before); }
.fleet .low { background: color-mix(in srgb, var(--after) calc(var(--z) * 1%), transparent); }
.fleet .high { background: color-mix(in srgb, var(--before) calc(var(--z) * 1%), transparent); }
.fleet small { font-size: .8em; } .find li { max-width: 60rem; }
</style>"""


def sentences(fleet: Fleet) -> Iterator[str]:
    """Yield the findings, one line each."""
    good = len(fleet.results) - len(fleet.refused)
    yield f"{good} of {len(fleet.results)} logs of {len(fleet.craft)} craft used; model {fleet.model.name}"
    yield from map(_common, fleet.common)
    yield from _left(fleet)
    found = [*_faults(fleet), *_off(fleet), *_changes(fleet), *_few(fleet), *_scattered(fleet)]
    yield from found
    if not (found or fleet.common):
        yield "no craft differs from the others, nothing drifts, and the model lacks nothing beyond noise"
    yield from _every(fleet)
    yield from _unlike(fleet)
    yield from (f"not used, {n}: {why}" for why, n in _reasons(fleet))
    yield from _clocks(fleet)


def _common(c: Common) -> str:
    at = c.equation
    (before, _, unit), (after, _, _) = c.before[at], c.after.get(at, c.before[at])
    rivals = f"; {', '.join(c.rivals)} less likely" if c.rivals else ""
    return (
        f"the model lacks {c.name}, in {c.craft} of {c.of} craft: with it the missing acceleration in {at} "
        f"falls from {before:.2g} to {after:.2g} {unit}, {percent(c.taken)} of its mean square{rivals}"
    )


def _left(fleet: Fleet) -> Iterator[str]:
    """Yield what the model, with these effects, leaves of the accelerations of all logs."""
    every = left(fleet.results.values()).items()
    parts = [f"{rms:.2g} of {seen:.2g} {unit} in {equation}" for equation, (rms, seen, unit) in every]
    if parts:
        yield f"unexplained acceleration: {', '.join(parts)}"


def _faults(fleet: Fleet) -> Iterator[str]:
    for craft, f in fleet.faults.items():
        named = ", ".join(
            f"{e['name']} ({e['coefficient']:.3g} ± {e['std'] or math.nan:.2g} {e['unit']})"
            for e in f.get("effects", ())
        )
        if named:
            yield f"{craft} lacks {named}; the other craft do not (verdict {f['verdict']})"
        elif "refused" not in f and f["verdict"] != "none":
            yield f"{craft}: its logs show a missing effect that has no name (verdict {f['verdict']})"


def _off(fleet: Fleet) -> Iterator[str]:
    for c in fleet.coefficients:
        for craft in c.off:
            if craft not in c.trends:
                i = c.craft.index(craft)
                own = _pm(c.of.own[i], c.of.own_std[i], c.unit)
                others = f"the others {c.of.mean:.3g}, scatter {c.of.between:.2g}"
                yield f"{craft} differs from the others: {c.name} {own}; {others}"


def _changes(fleet: Fleet) -> Iterator[str]:
    for c in fleet.coefficients:
        for craft, t in c.trends.items():
            yield f"{craft}: {c.name} {_change(t, c.unit)}"


def _change(t: Trend, unit: str) -> str:
    verb = {"line": "drifts", "ramp": "drifts", "step": "jumps"}[t.shape]
    since = (
        "over all logs"
        if t.shape == "line"
        else f"since {_date(t.since)} (95 %: {_date(t.earliest)} to {_date(t.latest)})"
    )
    return f"{verb} {since}: {t.before:.3g} to {_pm(t.now, t.now_std, unit)}"


def _few(fleet: Fleet) -> Iterator[str]:
    """Yield what differs between craft that are too few to judge one by the others."""
    few = [c for c in fleet.coefficients if c.few]
    differ = [c for c in few if c.differs]
    for c in differ:
        each = ", ".join(f"{n} {_pm(v, s)}" for n, v, s in zip(c.craft, c.of.own, c.of.own_std, strict=True))
        yield f"{c.name} differs between craft: {each} {c.unit}"
    if few and not differ:
        yield f"no coefficient differs between the {len(fleet.craft)} craft by more than logs of one craft do"


def _scattered(fleet: Fleet) -> Iterator[str]:
    """Yield what differs between logs of one craft that are too few for a change over time."""
    for craft, name, values, unit in scattered(fleet.results.values()):
        seen = f"{values.min():.4g} to {values.max():.4g} {unit}"
        yield f"{craft}: {name} differs between its {values.size} logs: {seen}"


def _every(fleet: Fleet) -> Iterator[str]:
    """Yield the verdicts and the alarms, where every log was diagnosed and replayed."""
    verdicts = Counter(r["verdict"] for r in fleet.results.values() if "verdict" in r)
    if verdicts:
        yield "verdicts of the logs: " + ", ".join(f"{n} {verdict}" for verdict, n in verdicts.most_common())
        alarms = {log for log, r in fleet.results.items() if r.get("alarms")}
        some = f": {', '.join(sorted(alarms)[:SHOWN])}" if alarms else ""
        yield f"the monitor alarms in {len(alarms)} logs{some}"


def _unlike(fleet: Fleet) -> Iterator[str]:
    logs = list(fleet.results)
    names: dict[str, list[str]] = {}
    for c in fleet.coefficients:
        for k in c.unlike:
            names.setdefault(logs[k], []).append(c.name)
    for log, own in names.items():
        yield f"{log}: unlike the craft's logs before and after it in {', '.join(own)}; not used for these"


def _reasons(fleet: Fleet) -> list[tuple[str, int]]:
    """Return the reasons of refused logs without the logs' names, with their numbers."""
    return Counter(bare_reason(log, why) for log, why in fleet.refused.items()).most_common()


def _clocks(fleet: Fleet) -> Iterator[str]:
    used = [r for r in fleet.results.values() if "refused" not in r]
    kinds = Counter(r["clock"] for r in used)
    if kinds[""] == len(used):
        yield "no log has a date in its name or its clock: changes over time follow the order of names"
    elif kinds[""]:
        yield f"{kinds['']} logs have no date in their names or clocks: left out of changes over time"
    if kinds["name"] and kinds["clock"]:
        yield f"dates are of two kinds: of {kinds['name']} logs by name, of {kinds['clock']} by clock"
    lost = sorted({r["craft"] for r in fleet.results.values() if r.get("craft")} - set(fleet.craft))
    if lost:
        yield f"{len(lost)} craft without a usable log: {', '.join(lost[:SHOWN])}"
    if len(fleet.craft) == 1 and len(used) > 1:
        yield f"all logs count as one craft, {fleet.craft[0]}; --by '([^/]+)[.]' takes each file as a craft"
    short = [n for n, k in Counter(r["craft"] for r in used).items() if k < LEAST]
    if short and len(used) > len(fleet.craft):
        some = ", ".join(sorted(short)[:SHOWN])
        yield f"{len(short)} craft with fewer than {LEAST} logs, too few for a change over time: {some}"


# ---- the page ---------------------------------------------------------------------------------------------


def page(fleet: Fleet) -> str:
    """Return the whole page."""
    return html_page(
        f"{len(fleet.craft)} craft, {len(fleet.results)} logs", [Markup(part) for part in body(fleet)]
    )


def body(fleet: Fleet) -> list[str]:
    """Return the sections of the page."""
    good = len(fleet.results) - len(fleet.refused)
    off = sorted({*(n for c in fleet.coefficients for n in (*c.off, *c.trends)), *_with_fault(fleet)})
    head = f"{len(off)} of {len(fleet.craft)} craft to look at" if off else "No craft stands out"
    used = f"{good} of {len(fleet.results)} logs used · model {escape(fleet.model.name)}"
    common = [*map(_common, fleet.common)] or ["nothing beyond noise in most craft"]
    common += _left(fleet)
    own = [*_faults(fleet), *_off(fleet), *_changes(fleet), *_few(fleet)] or ["none"]
    return [
        f"{_STYLE}<p class=kicker>{used}</p><h1>{head}</h1>",
        f"<h2>What the model lacks for all</h2>{_list(common)}",
        f"<h2>Which craft, and since when</h2>{_list(own)}",
        f"<h2>Craft by coefficient</h2>{_legend()}<div class=scroll>{_cells(fleet, off)}</div>",
        _pictures(fleet),
        _not_used(fleet),
    ]


def _with_fault(fleet: Fleet) -> list[str]:
    return [craft for craft, f in fleet.faults.items() if f.get("effects")]


def _list(texts: Sequence[str]) -> str:
    return "<ul class=find>" + "".join(f"<li>{escape(text)}</li>" for text in texts) + "</ul>"


def _legend() -> str:
    return (
        "<p class=small>Value ± standard error, shrunk towards the mean of all; blue below it, orange above, "
        "full colour at four standard deviations. Framed: differs or changes (false discovery rate "
        f"{percent(LEVEL)}). A link opens the report of the diagnosis.</p>"
    )


def _cells(fleet: Fleet, first: Sequence[str]) -> str:
    columns = [c for c in fleet.coefficients if len(c.craft) > 1 or len(fleet.craft) == 1]
    heads = "".join(
        f"<th>{escape(c.name).replace('_', '_<wbr>')}<br><small>{escape(c.unit)}</small></th>"
        for c in columns
    )
    mean = "".join(f"<td>{_pm(c.of.mean, c.of.between)}</td>" for c in columns)
    rows = [f"<tr><td><b>mean ± between craft</b></td><td></td>{mean}</tr>"] if len(fleet.craft) > 1 else []
    counts = Counter(r["craft"] for r in fleet.results.values() if "refused" not in r)
    reports = {craft for craft, f in fleet.faults.items() if f.get("report")}
    for craft in [*first, *(c for c in fleet.craft if c not in first)]:
        name = f'<a href="{_address(craft)}">{escape(craft)}</a>' if craft in reports else escape(craft)
        cells = "".join(_cell(c, craft, craft in reports) for c in columns)
        rows.append(f"<tr><td>{name}</td><td>{counts[craft]}</td>{cells}</tr>")
    table = (
        "<table class=fleet><thead><tr><th>craft</th><th>logs</th>{}</tr></thead><tbody>{}</tbody></table>"
    )
    return table.format(heads, "".join(rows))


def _cell(c: Coefficient, craft: str, linked: bool) -> str:
    if craft not in c.craft:
        return "<td>–</td>"
    i = c.craft.index(craft)
    between = c.of.between if math.isfinite(c.of.between) else 0.0
    text = _pm(c.of.value[i], max(c.of.std[i], between / 10.0))
    size = math.hypot(between, c.of.std[i]) or math.inf
    z = (c.of.value[i] - c.of.mean) / size
    kind = ("low" if z < 0 else "high") + (" off" if craft in (*c.off, *c.trends) else "")
    text = f'<a href="{_address(craft)}">{text}</a>' if linked else text
    return f'<td class="{kind}" style="--z:{min(abs(z) / 4.0, 1.0) * 70:.0f}">{text}</td>'


def _address(craft: str) -> str:
    return f"reports/{escape(file_name(craft), quote=True)}.html"


def _pictures(fleet: Fleet) -> str:
    """Return a plot of each coefficient that changes, over days."""
    plots = []
    for c in fleet.coefficients:
        for craft, t in c.trends.items():
            own = [
                (r["time"], v)
                for r in fleet.results.values()
                if r.get("craft") == craft
                for v in r["coefficients"]
            ]
            points = [
                (when, v["value"], v["noise_std"])
                for when, v in own
                if v["name"] == c.name and v["std"] and when
            ]
            if not points:
                continue
            when, y, std = (np.array(p) for p in zip(*sorted(points), strict=True))
            days = (when - when[0]) / 86400.0
            half = 1.96 * np.hypot(std, c.of.within)
            plot = Plot(
                (float(days[0]), float(days[-1])),
                (float((y - half).min()), float((y + half).max())),
                f"{craft}: {c.name}",
            )
            plot.dots(days, y, half, "measured")
            since = (t.since - when[0]) / 86400.0
            bend = {
                "step": [0.0, since, since, days[-1]],
                "ramp": [0.0, since, days[-1]],
                "line": [0.0, days[-1]],
            }[t.shape]
            value = {
                "step": [t.before] * 2 + [t.now] * 2,
                "ramp": [t.before] * 2 + [t.now],
                "line": [t.before, t.now],
            }[t.shape]
            plot.line(np.array(bend), np.array(value), "before")
            plots.append(plot.svg(c.unit, f"[days from {_date(when[0])}]"))
    return (
        f"<h2>Changes over time</h2><div class=grid>{''.join(f'<figure>{p}</figure>' for p in plots)}</div>"
        if plots
        else ""
    )


def _not_used(fleet: Fleet) -> str:
    rest = [*_every(fleet), *_unlike(fleet), *_clocks(fleet)]
    parts = [_list(rest)] if rest else []
    for why, n in _reasons(fleet):
        logs = [log for log, text in fleet.refused.items() if bare_reason(log, text) == why]
        parts.append(
            fold(f"{n} not used: {why}", _list(logs)) if n > SHOWN else _list([f"{', '.join(logs)}: {why}"])
        )
    return f"<h2>Logs: what could not be used, and why</h2>{''.join(parts) or '<p>Every log was used.</p>'}"


def _pm(value: float, std: float, unit: str = "") -> str:
    """Return a value with its standard error, to two digits of that."""
    if not (math.isfinite(std) and std > 0):
        return f"{value:.4g} {unit}".strip()
    digits = max(1 - math.floor(math.log10(std)), 0)
    return f"{value:.{digits}f} ± {std:.{digits}f} {unit}".strip()


def _date(when: float) -> str:
    """Return a day; without dates, the place in the order of logs."""
    if when < DATED:
        return f"log {math.ceil(when) + 1}"
    return datetime.fromtimestamp(when, tz=UTC).strftime("%Y-%m-%d")
