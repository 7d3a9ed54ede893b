"""JSON Schemas of what ``hovercontrol simulate --json`` and ``hovercontrol sweep --json`` print."""

from __future__ import annotations

from typing import Annotated, NotRequired, TypedDict

from hovercontrol.app.schema.parts import Schema, document, of_type
from hovercontrol.base.boundary import checked

#: ``from`` is no name of Python.
Figure = TypedDict(
    "Figure",
    {
        "name": str,
        "of": Annotated[str, "signal"],
        "from": Annotated[float, "s"],
        "to": Annotated[float, "s"],
        "value": float,
        "unit": str,
        "low": Annotated[float, "least value that meets the limit; null: none"],
        "high": Annotated[float, "largest value that meets the limit; null: none"],
        "met": bool,
    },
)
Figure.__doc__ = "A figure of merit of a scenario."


class Apart(TypedDict):
    """How far a computed output is from that of the log."""

    rms: Annotated[float, "root mean square of measured minus computed"]
    spread: Annotated[float, "standard deviation of the measured values"]
    unit: str


class Simulated(TypedDict):
    """A run of a scenario, a model or an FMU."""

    scenario: Annotated[str, "name of the scenario, the model or the FMU"]
    figures: list[Figure]
    clipped: Annotated[dict[str, float], "ticks at which a command exceeded its limit, by limit"]
    errors: NotRequired[Annotated[dict[str, Apart], "of an FMU, by output that the log has"]]
    start: NotRequired[Annotated[dict[str, float], "of an FMU: continuous states at the first row"]]
    animation: NotRequired[Annotated[str, "file"]]
    files: list[str]


class Axis(TypedDict):
    """What is varied."""

    key: str
    unit: str
    values: list[float]


class Swept(TypedDict):
    """Runs of a scenario, a model or an FMU over a range or a grid."""

    scenario: Annotated[str, "name of the scenario, the model or the FMU"]
    of: Annotated[str, "signal"]
    figure: Annotated[str, "final, maximum, minimum, rms or settling"]
    unit: str
    axes: list[Axis]
    values: Annotated[list[float] | list[list[float]], "by the axes; null where a run fails"]
    failures: Annotated[list[str], "one line for each run that fails"]
    files: list[str]


@checked
def simulation_schema() -> Schema:
    """Return the JSON Schema of what ``hovercontrol simulate --json`` prints.

    Examples
    --------
    >>> simulation_schema()["required"]
    ['scenario', 'figures', 'clipped', 'files']
    """
    body = of_type(Simulated)
    return document("hovercontrol simulation", body.pop("description"), body)


@checked
def sweep_schema() -> Schema:
    """Return the JSON Schema of what ``hovercontrol sweep --json`` prints.

    Examples
    --------
    >>> sorted(sweep_schema()["properties"]["axes"]["items"]["properties"])
    ['key', 'unit', 'values']
    """
    body = of_type(Swept)
    return document("hovercontrol sweep", body.pop("description"), body)
