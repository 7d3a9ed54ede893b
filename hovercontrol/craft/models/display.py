"""HTML of a model in a notebook: effects with their values, inputs, equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hovercontrol.base.html import Markup, card, fold, table
from hovercontrol.blocks.display import block_html, equations_html, signals_html

if TYPE_CHECKING:
    from hovercontrol.craft.models.blockmodel import BlockModel
    from hovercontrol.craft.models.model import Model


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
        signals_html("inputs", block.inputs),
        fold("equations", equations_html(block)),
    ]
    return card("Model", model.name, f"{len(rows)} effects", *parts)


def blockmodel_html(model: BlockModel) -> str:
    """Return the HTML of a machine of one's own: its Block, what was added, what it may lack."""
    added = table(("effect", "values"), [(e.name, str(e.values)) for e in model.effects])
    lacks = ", ".join(cls.name for cls in model.candidates())
    may = fold("what it may lack", Markup(f"<div>{lacks}</div>")) if lacks else ""
    return card("BlockModel", model.name, "", added, may, block_html(model.plant()))
