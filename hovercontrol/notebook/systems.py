"""Blocks, models and FMUs as notebooks show them."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hovercontrol.core.block import Block
from hovercontrol.core.signals import Signal
from hovercontrol.notebook.html import Markup, card, fold, table
from hovercontrol.notebook.mathml import equations

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.imported import FmuSystem
    from hovercontrol.models.blockmodel import BlockModel
    from hovercontrol.models.model import Model

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
    parts += [_signals(kind, signals) for kind, signals in kinds]
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


def _signals(kind: str, signals: Sequence[Signal]) -> str:
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


def model_html(model: Model) -> str:
    """Return a craft's HTML: its effects with numbers and units, inputs, equations."""
    block = model.plant()
    rows = []
    for e in model.effects:
        sentence = (type(e).__doc__ or "").strip().split("\n")[0]
        named = {p.name.rpartition(".")[2]: p for p in block.parameters}
        numbers = []
        for key, value in e.values.items():
            p = named.get(e.parameter(key))
            unit = f" {p.unit}" if p is not None and p.unit != "1" else ""
            if key == "value" or value != e.numbers[key].default:
                numbers.append(f"{'' if key == 'value' else f'{key} = '}{value:.5g}{unit}")
        rows.append((e.name, ", ".join(numbers), sentence))
    fans = [(f.name, f.x, f.y, f.direction, f.gain) for f in model.fans]
    parts = [
        table(("effect", "value", "what it is"), rows),
        table(("fan", "x [m]", "y [m]", "direction [rad]", "gain"), fans),
        _signals("inputs", block.inputs),
        fold("equations", equations_html(block)),
    ]
    return card("Model", model.name, f"{len(rows)} effects", *parts)


def blockmodel_html(model: BlockModel) -> str:
    """Return the HTML of a machine of one's own: its Block, what was added, what it may lack."""
    added = table(("effect", "values"), [(e.name, str(e.values)) for e in model.effects])
    lacks = ", ".join(cls.name for cls in model.candidates())
    may = fold("what it may lack", Markup(f"<div>{lacks}</div>")) if lacks else ""
    return card("BlockModel", model.name, "", added, may, block_html(model.plant()))


def fmu_html(fmu: FmuSystem) -> str:
    """Return an imported FMU's HTML: inputs, outputs and parameters with units and descriptions."""
    interface = fmu.interface
    remark = (
        f"FMI {interface.fmi}, Co-Simulation, steps of {fmu.dt:g} s; "
        f"{'saves its state' if interface.has_states else 'cannot save its state'}; {fmu.path.name}"
    )
    parts = []
    for kind, names in (("inputs", fmu.input_index), ("outputs", fmu.output_index)):
        labels = [v.labels for v in (interface.inputs if kind == "inputs" else interface.outputs)]
        own = [label for group in labels for label in group]
        rows = [
            (name, fmu.units.get(label, ""), fmu.descriptions.get(label, ""))
            for name, label in zip(names, own, strict=True)
        ]
        body = table(("name", "unit", "description"), rows)
        parts.append(fold(f"{len(rows)} {kind}", body, unfolded=len(rows) <= UNFOLDED) if rows else "")
    rows_ = [(k, fmu.units.get(k, ""), float(v), fmu.descriptions.get(k, "")) for k, v in fmu.params.items()]
    body = table(("parameter", "unit", "value", "description"), rows_)
    parts.append(fold(f"{len(rows_)} parameters", body, unfolded=len(rows_) <= UNFOLDED) if rows_ else "")
    return card("FMU", fmu.name, remark, *parts)
