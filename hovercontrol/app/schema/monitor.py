"""The JSON Schemas of the ``result.json`` of a monitor, and of the lines of ``monitor --follow``."""

from __future__ import annotations

from typing import Annotated, Literal, TypedDict

from hovercontrol.app.schema.parts import Schema, document, of_type
from hovercontrol.base.boundary import checked


class AlarmRow(TypedDict):
    """An alarm."""

    time: Annotated[float, "when it was raised, s"]
    name: Annotated[
        str, "of the candidate, the state with an unknown acceleration, the dead sensor, or the lost command"
    ]
    kind: Literal["change", "bias", "unknown", "dead"]
    change: Annotated[float | None, "of the coefficient, or unknown acceleration; null for a dead sensor"]
    std: Annotated[float | None, "standard error of the change"]
    unit: str
    since: Annotated[float, "estimated onset, s"]
    rivals: Annotated[list[str], "candidates that the samples cannot tell apart from it"]
    evidence: Annotated[float | None, "twice the log-likelihood ratio"]
    last: Annotated[float, "when it was seen for the last time, s"]
    rate: Annotated[float | None, "of the change, per s"]
    rate_std: Annotated[float | None, "standard error of the rate; null if there is none"]
    ended: Annotated[float | None, "when the change ended, s; null while it has not"]
    beside: Annotated[str, "another change at once, an alarm of its own; empty if there is none"]


class Monitored(TypedDict):
    """What changed along a log, as ``hovercontrol monitor`` found it."""

    log: str
    seconds: Annotated[float, "length of the replay"]
    ticks: int
    threshold: Annotated[float, "of the evidence, for an alarm"]
    candidates: list[str]
    alarms: list[AlarmRow]
    largest_evidence: Annotated[dict[str, float], "by candidate"]
    late_rows: Annotated[int, "left out because of their times"]
    restarts: Annotated[int, "after gaps of more than 30 s for one"]
    notes: Annotated[list[str], "where noise and threshold come from, and what is wrong with the rows"]


class Started(TypedDict):
    """The first line: the monitor is ready for rows."""

    event: Literal["start"]
    monitor: str
    columns: Annotated[list[str], "signals that it reads"]
    candidates: list[str]
    period: Annotated[float, "of its ticks, s"]
    threshold: Annotated[float, "of the evidence, for an alarm"]


class AlarmEvent(AlarmRow):
    """An alarm, or what came of it.

    `alarm`: raised. `named`: the evidence is collected. `ended`: the change has ended. `dead`: no samples of
    a sensor, no values of a command, or no rows at all. `back`: they come again.
    """

    event: Literal["alarm", "named", "ended", "dead", "back"]


class Fault(TypedDict):
    """A fault of the rows: told for the 1st, 10th, 100th and so on of a kind.

    `bad`: a row or a cell that is left out. `clock`: a stamp that is left out, or another unit of the
    stamps. `restart`: the monitor starts anew. `header`: another header. `file`: another file of the name, or
    the file was written anew.
    """

    event: Literal["bad", "clock", "restart", "header", "file"]
    time: Annotated[float, "of the last row before it, s; null before the first"]
    text: Annotated[str, "what is wrong, in one sentence"]
    rows: Annotated[int, "number of such rows until now; 0 where rows are not counted"]


class Ended(TypedDict):
    """The last line."""

    event: Literal["end"]
    alarms: int
    late_rows: Annotated[int, "rows left out because of their times"]
    bad_rows: Annotated[int, "rows left out, or with cells that are left out"]
    restarts: Annotated[int, "starts anew"]


@checked
def monitor_event_schema() -> Schema:
    """Return the JSON Schema of a line of ``hovercontrol monitor --follow``.

    Examples
    --------
    >>> [kind["properties"]["event"]["enum"] for kind in monitor_event_schema()["anyOf"]][2]
    ['bad', 'clock', 'restart', 'header', 'file']
    """
    text = "A line of `hovercontrol monitor --follow`."
    return document("hovercontrol monitor --follow", text, of_type(Started | AlarmEvent | Fault | Ended))


@checked
def monitor_schema() -> Schema:
    """Return the JSON Schema of the ``result.json`` of ``hovercontrol monitor``.

    Examples
    --------
    >>> monitor_schema()["properties"]["alarms"]["items"]["properties"]["kind"]["enum"]
    ['change', 'bias', 'unknown', 'dead']
    """
    body = of_type(Monitored)
    return document("hovercontrol monitor", body.pop("description"), body)
