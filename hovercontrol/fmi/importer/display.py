"""HTML of an imported FMU in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hovercontrol.base.html import card, fold, table
from hovercontrol.blocks.display import UNFOLDED

if TYPE_CHECKING:
    from hovercontrol.fmi.importer.system import FmuSystem


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
