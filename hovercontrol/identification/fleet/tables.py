"""The results of a fleet as Parquet tables, for DuckDB, pandas or Grafana."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet

from hovercontrol.identification.fleet.sources import DATED
from hovercontrol.identification.fleet.trends import Trend

if TYPE_CHECKING:
    from hovercontrol.identification.fleet.fleet import Fleet

_TEXT, _NUMBER, _TIME = pa.string(), pa.float64(), pa.timestamp("us", tz="UTC")

#: Columns of fleet.parquet: a row for each log and coefficient; of a refused log one row with the reason.
LOGS = {
    "craft": _TEXT, "log": _TEXT, "time": _TIME, "coefficient": _TEXT, "unit": _TEXT, "value": _NUMBER,
    "std": _NUMBER, "noise_std": _NUMBER, "bound": _TEXT, "reason": _TEXT, "readings": _TEXT,
    "missing": _TEXT, "gain": _NUMBER, "remaining": _TEXT, "verdict": _TEXT, "effects": _TEXT,
    "alarms": _TEXT, "rows": pa.int64(), "refused": _TEXT, "notes": _TEXT,
}  # fmt: skip

#: Columns of craft.parquet: a row for each craft and coefficient.
CRAFT = {
    "craft": _TEXT, "coefficient": _TEXT, "unit": _TEXT, "logs": pa.int64(), "value": _NUMBER, "std": _NUMBER,
    "own": _NUMBER, "own_std": _NUMBER, "mean": _NUMBER, "between": _NUMBER, "within": _NUMBER,
    "q": _NUMBER, "off": pa.bool_(), "q_differ": _NUMBER, "change": _TEXT, "since": _TIME,
    "earliest": _TIME, "latest": _TIME, "before": _NUMBER, "now": _NUMBER, "change_p": _NUMBER,
}  # fmt: skip


def log_table(fleet: Fleet) -> pa.Table:
    """Return the results of all logs."""
    rows = []
    for log, r in sorted(fleet.results.items(), key=lambda one: (str(one[1].get("craft", "")), one[0])):
        texts = {k: "; ".join(r.get(k, ())) for k in ("notes",)}
        more = {k: json.dumps(r[k]) for k in ("remaining", "effects", "alarms") if k in r}
        own = {k: r.get(k) for k in ("craft", "time", "gain", "verdict", "rows", "refused")}
        own |= (
            {"log": log, "missing": ", ".join(e["name"] for e in r.get("missing", ())) or None} | texts | more
        )
        rows += [own | c | {"coefficient": c["name"]} for c in r.get("coefficients", ())] or [own]
    return _table(rows, LOGS)


def craft_table(fleet: Fleet) -> pa.Table:
    """Return every coefficient of every craft."""
    rows = []
    for c in fleet.coefficients:
        of = c.of
        for i, craft in enumerate(c.craft):
            change: Trend | None = c.trends.get(craft)
            row = {
                "craft": craft, "coefficient": c.name, "unit": c.unit, "logs": c.logs[i],
                "value": of.value[i], "std": of.std[i], "own": of.own[i], "own_std": of.own_std[i],
                "mean": of.mean, "between": of.between, "within": of.within, "q": c.q[i],
                "off": craft in c.off, "q_differ": c.q_differ,
            }  # fmt: skip
            if change is not None:
                row |= {k: getattr(change, k) for k in ("since", "earliest", "latest", "before", "now")}
                row |= {"change": change.shape, "change_p": change.p}
            rows.append(row)
    return _table(rows, CRAFT)


def summary(fleet: Fleet) -> dict[str, Any]:
    """Return the findings for JSON."""
    return {
        "model": fleet.model.name,
        "logs": len(fleet.results),
        "refused": fleet.refused,
        "craft": fleet.craft,
        "findings": fleet.text().splitlines(),
        "common": [
            {"name": c.name, "craft": c.craft, "of": c.of, "taken": c.taken, "rivals": c.rivals}
            for c in fleet.common
        ],
        "faults": {
            craft: {k: f.get(k) for k in ("verdict", "effects", "logs", "refused")}
            for craft, f in fleet.faults.items()
        },
    }


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table as Parquet."""
    pa.parquet.write_table(table, path, compression="zstd")


def _table(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, pa.DataType]) -> pa.Table:
    arrays = [pa.array([_value(row.get(n), t) for row in rows], t) for n, t in columns.items()]
    return pa.table(arrays, names=list(columns))


def _value(value: Any, kind: pa.DataType) -> Any:
    """Return a cell: times from seconds since 1970, None for NaN, empty text and logs without dates."""
    if value is None or value == "" or value != value or (kind == _TIME and value < DATED):
        return None
    return datetime.fromtimestamp(value, tz=UTC) if kind == _TIME else value
