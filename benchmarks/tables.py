"""C17's Table I and Table II: what the paper reports, from the shipped scenarios."""

from __future__ import annotations

import math
from collections.abc import Iterator

from hovercontrol.documents.scenarios import load_scenario, run_scenario

Row = tuple[str, str, str, bool | None]


def rows() -> Iterator[Row]:
    for name in ("table1", "table2"):
        for m in run_scenario(load_scenario(name)).metrics():
            d = m.metric
            wanted = f"< {d.high:g}" if math.isinf(d.low) else f"{d.low:g} to {d.high:g}"
            yield f"{name}: {d.name}", f"{m.value:.3g} {d.unit}", wanted, m.met
