"""JSON Schemas of the files that other programs use: models, scenarios, results of commands.

They are made of what the loaders check by and of the types of the result, so that editors complete and check
a TOML file as it is written, and programs can rely on ``result.json``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hovercontrol.app.schema.fmu import fmu_schema
from hovercontrol.app.schema.model import model_schema
from hovercontrol.app.schema.monitor import monitor_event_schema, monitor_schema
from hovercontrol.app.schema.result import result_schema
from hovercontrol.app.schema.runs import simulation_schema, sweep_schema
from hovercontrol.app.schema.scenario import scenario_schema
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import check_known

__all__ = [
    "KINDS", "schema", "model_schema", "scenario_schema", "result_schema", "fmu_schema", "monitor_schema",
    "monitor_event_schema", "simulation_schema", "sweep_schema",
]  # fmt: skip

#: Of each kind of file its schema.
KINDS: dict[str, Callable[[], dict[str, Any]]] = {
    "result": result_schema,
    "fmu": fmu_schema,
    "monitor": monitor_schema,
    "monitor_event": monitor_event_schema,
    "simulation": simulation_schema,
    "sweep": sweep_schema,
    "model": model_schema,
    "scenario": scenario_schema,
}


@checked
def schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a kind of file.

    Parameters
    ----------
    kind : {"result", "fmu", "monitor", "monitor_event", "simulation", "sweep", "model", "scenario"}

    Raises
    ------
    InputError
        If there is none of that kind; the nearest is named.

    Examples
    --------
    >>> schema("model")["properties"]["effects"]["properties"]["yaw_coulomb"]["anyOf"][0]
    {'type': 'number', 'minimum': 0.0}
    """
    check_known(kind, KINDS, f"schema: unknown kind {kind!r}")
    return KINDS[kind]()
