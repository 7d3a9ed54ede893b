"""HTML of a Block in a notebook: equations and signals with units."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from hovercontrol.base.html import card, fold, table
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.mathml import equations
from hovercontrol.blocks.signals import Signal

#: Equations of one kind that are shown unfolded.
UNFOLDED = 12

_HEADS = ("name", "unit", "start", "bounds", "description")


def block_html(block: Block) -> str:
    """Return a Block's HTML: equations typeset, signals with units."""
    kinds = (("states", block.states), ("inputs", block.inputs), ("outputs", block.outputs))
    counts = [f"{len(signals)} {kind}" for kind, signals in (*kinds, ("parameters", block.parameters))]
    periods = ", ".join(f"{p:g} s" for p in dict.fromkeys(tick.period for tick in block.ticks))
    ticks = [f"ticks every {periods}"] if periods else []
    sampled = [f"sampled every {block.period:g} s"] if block.period else []
    late = [f"late: {', '.join(block.delays)}"] if block.delays else []
    parts = [equations_html(block)]
    parts += [signals_html(kind, signals) for kind, signals in kinds]
    keyed = [(block.parameter_key(p.name), p) for p in block.parameters]
    parts.append(
        fold(
            f"{len(keyed)} parameters",
            table(_HEADS, [_row(p, key) for key, p in keyed]),
            unfolded=len(keyed) <= UNFOLDED,
        )
        if keyed
        else ""
    )
    return card("Block", block.name, "; ".join([", ".join(counts), *sampled, *ticks, *late]), *parts)


def equations_html(block: Block) -> str:
    """Return a Block's equations as MathML, by groups; long groups folded away."""
    groups: dict[str, list[str]] = defaultdict(list)
    for group, line in equations(block):
        groups["Next values" if block.period and group == "Differential equations" else group].append(line)
    for tick in block.ticks:
        inside = block.unchecked(derivatives=tick.updates, output_expressions={}, definitions={}, period=1.0)
        name = f"Every {tick.period:g} s: {tick.name}"
        groups[name] += [line for _, line in equations(inside)]
    return "".join(
        fold(f"{group} ({len(found)})", "".join(found), unfolded=len(found) <= UNFOLDED)
        for group, found in groups.items()
    )


def signals_html(kind: str, signals: Sequence[Signal]) -> str:
    """Return signals of one kind as a table with units and bounds, folded if it is long."""
    if not signals:
        return ""
    rows = [_row(s, s.name) for s in signals]
    return fold(f"{len(rows)} {kind}", table(_HEADS, rows), unfolded=len(rows) <= UNFOLDED)


def _row(s: Signal, name: str) -> tuple[object, ...]:
    low, high = s.lower, s.upper
    bounds = "" if math.isinf(low) and math.isinf(high) else f"{_bound(low)} to {_bound(high)}"
    shown = f"{s.start:.5g}" if not s.modes else s.modes[int(s.start)]
    return name, s.unit, shown, ", ".join(s.modes) or bounds, s.description


def _bound(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else ("-∞" if value < 0 else "∞")
