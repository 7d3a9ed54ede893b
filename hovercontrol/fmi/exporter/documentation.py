"""``documentation/index.html`` of an FMU: one self-contained page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from itertools import groupby

import hovercontrol
from hovercontrol.blocks.mathml import equations
from hovercontrol.fmi.exporter.description import Experiment
from hovercontrol.fmi.exporter.sources import Version
from hovercontrol.fmi.exporter.variables import Interface, Variable

#: More rows or equations than this are folded away until they are asked for.
_MANY = 20

#: ``m/s^2`` as a person writes it.
_RAISED = str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹", "^")

_STYLE = """
:root { color-scheme: light dark;
  --ink: #1b2a33; --soft: #5b6b75; --line: #d5dde2; --page: #fff; --mark: #1d4e6b; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6edf1; --soft: #9fb0ba; --line: #33434d; --page: #12191e; --mark: #8fc3de; }
}
body { font: 16px/1.55 system-ui, sans-serif; color: var(--ink); background: var(--page);
  max-width: 62rem; margin: 0 auto; padding: 1.2rem; }
header { display: flex; gap: 1rem; align-items: center; }
header svg { width: 5rem; height: 5rem; flex: none; }
h1 { margin: 0; color: var(--mark); overflow-wrap: anywhere; }
h2 { margin: 2rem 0 .6rem; color: var(--mark); border-bottom: 1px solid var(--line); }
h3 { margin: 1.2rem 0 .4rem; }
header p { margin: .2rem 0 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th { text-align: left; color: var(--soft); font-weight: 600; }
th, td { padding: .3rem .8rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
td.u { white-space: nowrap; }
code { font-size: .92em; }
.eq { overflow-x: auto; padding: .25rem 0; font-size: 1.08rem; }
.long { font-size: .9rem; overflow-wrap: anywhere; font-family: ui-monospace, monospace; }
summary { cursor: pointer; color: var(--mark); padding: .3rem 0; }
@media (max-width: 40rem) {
  body { font-size: 15px; padding: .8rem; }
  code { overflow-wrap: anywhere; }
  header svg { width: 3.4rem; height: 3.4rem; }
  thead { display: none; }
  tr { display: grid; grid-template-columns: 1fr auto; padding: .35rem 0; }
  tr { border-bottom: 1px solid var(--line); }
  td { border: 0; padding: .05rem .4rem .05rem 0; }
  td.d { grid-column: 1 / -1; color: var(--soft); }
  td.b:empty, td.d:empty { display: none; }
  td.n { text-align: left; }
  td.b::before { content: "bounds "; color: var(--soft); }
}
"""

_FRICTION = {
    "events": "Each changes between sticking at exactly zero velocity and slipping: while the other forces "
    "stay below breakaway, the velocity is exactly zero. In Model Exchange each gives one event indicator; "
    "in Co-Simulation the FMU finds the instants itself. The widths among the parameters are used only "
    "where a controller or an estimator computes with a smoothed sign.",
    "smooth": "Each is smoothed: sgn(v) is computed as tanh(v/width), with the width among the parameters. "
    "There are no events, and no sticking at exactly zero velocity.",
}


def documentation(
    interface: Interface,
    version: Version,
    token: str,
    experiment: Experiment,
    text: str,
    icon: str,
    files: Iterable[str],
) -> str:
    """Return the page.

    Parameters
    ----------
    version : {2, 3}
    text : str
        Description of the model.
    icon : str
        As SVG.
    files : iterable of str
        Paths within the FMU: the reference trajectory and its inputs.
    """
    name = escape(interface.block.name)
    parts = [
        f"<header>{icon}<div><h1>{name}</h1><p>{escape(text)}</p></div></header>",
        _summary(interface, version, experiment),
        "<h2>Variables</h2>",
        *_variables(interface),
        *_equations(interface),
        *_friction(interface),
        *_late_inputs(interface),
        *_reference(experiment, list(files)),
        _origin(interface, version, token),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{name}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body>\n</html>\n"
    )


def _summary(interface: Interface, version: Version, experiment: Experiment) -> str:
    counts = {
        "input": len(interface.of("input")),
        "output": len(interface.outputs),
        "parameter": len(interface.of("parameter")),
        "state": len(interface.of("state")),
    }
    words = ", ".join(f"{n} {word}{'' if n == 1 else 's'}" for word, n in counts.items() if n)
    return (
        f"<p>FMI {version}.0, Model Exchange and Co-Simulation. {words}. Default experiment: 0 to "
        f"{experiment.stop:g} s, communication every {experiment.step:g} s, relative tolerance "
        f"{experiment.rtol:g}.</p>"
    )


def _variables(interface: Interface) -> Iterable[str]:
    for title, found in (
        ("Inputs", interface.of("input")),
        ("Outputs", interface.outputs),
        ("Parameters", interface.of("parameter")),
        ("States", [v for v in interface.of("state") if v.causality != "output"]),
        ("Friction modes", interface.of("mode")),
    ):
        if found:
            yield _folded(title, _table(found), len(found))


def _folded(title: str, content: str, n: int) -> str:
    if n <= _MANY:
        return f"<h3>{title}</h3>\n{content}"
    return f"<details><summary>{title} ({n})</summary>\n{content}</details>"


def _table(variables: Sequence[Variable]) -> str:
    rows = []
    for v in variables:
        start = "" if v.start is None else f"{v.start:.6g}"
        unit = v.unit.name.translate(_RAISED) if v.unit and v.unit.name != "1" else ""
        rows.append(
            f"<tr><td><code>{escape(v.name)}</code></td><td class='n'>{start} {unit}</td>"
            f"<td class='b'>{_bounds(v)}</td><td class='d'>{escape(v.description)}</td></tr>"
        )
    head = "<thead><tr><th>name</th><th class='n'>start</th><th>bounds</th><th>meaning</th></tr></thead>"
    return f"<div class='scroll'><table>{head}<tbody>\n" + "\n".join(rows) + "\n</tbody></table></div>"


def _bounds(v: Variable) -> str:
    low, high = math.isfinite(v.lower), math.isfinite(v.upper)
    if low and high:
        return f"{v.lower:.6g} to {v.upper:.6g}"
    return f"≥ {v.lower:.6g}" if low else f"≤ {v.upper:.6g}" if high else ""


def _equations(interface: Interface) -> Iterable[str]:
    yield "<h2>Equations</h2>"
    for title, group in groupby(equations(interface.block), key=lambda pair: pair[0]):
        lines = [line for _, line in group]
        yield _folded(title, "\n".join(lines), len(lines))


def _friction(interface: Interface) -> Iterable[str]:
    velocities = [f.state for f in interface.frictions]
    if interface.friction == "smooth":
        smoothed = Interface(interface.block, "events").frictions
        velocities = [f.state for f in smoothed]
    if velocities:
        names = ", ".join(f"<code>{escape(name)}</code>" for name in velocities)
        text = _FRICTION[interface.friction]
        yield f"<h2>Dry friction</h2>\n<p>Dry friction acts on {names}. {text}</p>"


def _late_inputs(interface: Interface) -> Iterable[str]:
    delays = dict(zip(interface.block.inputs, interface.of("input"), strict=True))
    late = [
        f"<code>{escape(v.name)}</code> by {escape(str(interface.block.delays[s.name]))}"
        for s, v in delays.items()
        if s.name in interface.block.delays
    ]
    if late:
        yield (
            f"<h2>Late inputs</h2>\n<p>Inputs act late: {', '.join(late)} (seconds). In the equations each "
            "has the value with which it arrives; until the first one arrives that is its start value. They "
            "are discrete: a value holds until the next is set. In Co-Simulation the FMU stops at each "
            "arrival itself; in Model Exchange an arrival is a time event, and the importer sets such an "
            "input in an event, as FMI demands. What is under way is part of the FMU state. How late it "
            "is, is fixed at initialization.</p>"
        )


def _reference(experiment: Experiment, files: list[str]) -> Iterable[str]:
    if files:
        names = " and ".join(f"<code>{escape(f)}</code>" for f in files)
        yield (
            f"<h2>Reference trajectory</h2>\n<p>{names}: the outputs over the default experiment from the "
            "start values, by the FMU's own solver; inputs, if there are any, are constant. Expect "
            f"differences of up to {100 * max(experiment.rtol, 1e-6):.0e} of each output's size with another "
            "solver.</p>"
        )


def _origin(interface: Interface, version: Version, token: str) -> str:
    where = "sources/buildDescription.xml" if version == 3 else "modelDescription.xml"
    computed = "derivatives, partial derivatives" if interface.differentiable else "what ticks set"
    return (
        "<h2>How it was made</h2>\n"
        f"<p>By hovercontrol {hovercontrol.__version__} from a symbolic definition; {computed} "
        "and this page come from the same equations. The C sources are in <code>sources</code>, "
        f"listed in <code>{where}</code>; they need a C99 compiler and its mathematics library. The same "
        f"definition gives the same file, byte by byte. Token: <code>{escape(token)}</code>.</p>\n"
        "<h2>Licence</h2>\n<p>The runtime in <code>sources</code> and in the binaries is under the BSD "
        "3-clause licence, see <code>documentation/licenses/license.txt</code>. The model itself "
        "belongs to whoever wrote it.</p>"
    )
