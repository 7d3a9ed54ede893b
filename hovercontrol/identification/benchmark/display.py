"""The table of a run as text, CSV and a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

Row = dict[str, Any]


def _cell(row: Row) -> str:
    if row["figure"].startswith("seconds"):
        return f"{row['value']:.1f} s"
    interval = f"{100 * row['low']:.0f} to {100 * row['high']:.0f} %"
    count = "" if row["met"] is None else f"{row['met']}/{row['cases']} "
    return f"{count}{100 * row['value']:.0f} % ({interval})"


def text_table(rows: Sequence[Row]) -> str:
    """Return the table as text: a line for each figure, a column for each tool."""
    tools = list(dict.fromkeys(r["tool"] for r in rows))
    cells = {(r["figure"], r["tool"]): _cell(r) for r in rows}
    figures = list(dict.fromkeys(r["figure"] for r in rows))
    lines = [f"{'':42}" + "".join(f"{t[-26:]:28}" for t in tools)]
    lines += [f"{f:42}" + "".join(f"{cells.get((f, t), '-'):28}" for t in tools) for f in figures]
    return "\n".join(line.rstrip() for line in lines)


def csv_table(rows: Sequence[Row]) -> str:
    """Return the table as CSV, a line for each tool and figure; empty where a value does not apply."""
    import csv
    import io

    names = ("tool", "figure", "cases", "met", "value", "low", "high")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([["" if r[n] is None else r[n] for n in names] for r in rows])
    return text.getvalue()


def table_figure(rows: Sequence[Row]) -> Figure:
    """Return a figure of all shares with their 95 % intervals, a colour for each tool."""
    shares = [r for r in rows if r["met"] is not None]
    tools = list(dict.fromkeys(r["tool"] for r in shares))
    figures = list(dict.fromkeys(r["figure"] for r in shares))
    figure = Figure(figsize=(8.0, 0.6 + 0.5 * len(figures)), layout="constrained")
    axes = figure.subplots()
    for k, tool in enumerate(tools):
        own = [r for r in shares if r["tool"] == tool]
        y = [figures.index(r["figure"]) + 0.2 * (k - (len(tools) - 1) / 2) for r in own]
        value = [100 * r["value"] for r in own]
        below = [100 * (r["value"] - r["low"]) for r in own]
        above = [100 * (r["high"] - r["value"]) for r in own]
        axes.errorbar(value, y, xerr=[below, above], fmt="o", capsize=2, label=tool)
    axes.set_yticks(range(len(figures)), figures)
    axes.invert_yaxis()
    axes.set_xlim(-2, 102)
    axes.set_xlabel("share of cases [%], 95 % interval (Clopper-Pearson)")
    axes.grid(axis="x", alpha=0.3)
    if tools:
        axes.legend(loc="best")
    return figure
