"""The JSON Schema of the ``result.json`` of a monitor."""

from __future__ import annotations

from typing import Annotated, Literal, TypedDict

from hovercontrol.core.boundary import checked
from hovercontrol.schema.parts import Schema, document, of_type


class AlarmRow(TypedDict):
    """An alarm; with ``--follow`` each line of JSON has these keys and ``event``."""

    time: Annotated[float, "when it was raised, s"]
    name: Annotated[str, "of the candidate, or of the channel of a dead sensor"]
    kind: Literal["change", "bias", "dead"]
    change: Annotated[float | None, "of the coefficient; null for a dead sensor"]
    std: Annotated[float | None, "standard error of the change"]
    unit: str
    since: Annotated[float, "estimated onset, s"]
    rivals: Annotated[list[str], "candidates that the samples cannot tell apart from it"]
    evidence: Annotated[float | None, "twice the log-likelihood ratio"]
    last: Annotated[float, "when it was seen for the last time, s"]


class Monitored(TypedDict):
    """What changed along a log, as ``hovercontrol monitor`` found it."""

    log: str
    seconds: Annotated[float, "length of the replay"]
    ticks: int
    threshold: Annotated[float, "of the evidence, for an alarm"]
    candidates: list[str]
    alarms: list[AlarmRow]
    largest_evidence: Annotated[dict[str, float], "by candidate"]
    late_rows: Annotated[int, "left out because their time does not increase"]
    restarts: Annotated[int, "after gaps of more than 30 s"]
    notes: Annotated[list[str], "where noise and threshold come from"]


@checked
def monitor_schema() -> Schema:
    """Return the JSON Schema of the ``result.json`` of ``hovercontrol monitor``.

    Examples
    --------
    >>> monitor_schema()["properties"]["alarms"]["items"]["properties"]["kind"]["enum"]
    ['change', 'bias', 'dead']
    """
    body = of_type(Monitored)
    return document("hovercontrol monitor", body.pop("description"), body)
