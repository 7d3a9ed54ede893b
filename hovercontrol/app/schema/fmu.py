"""The JSON Schema of the ``result.json`` of a diagnosis of an FMU."""

from __future__ import annotations

from typing import Annotated, Literal, TypedDict

from hovercontrol.app.schema.parts import Schema, document, of_type
from hovercontrol.app.schema.result import Decision
from hovercontrol.base.boundary import checked
from hovercontrol.identification.diagnose.verdict import Verdict

Place = Annotated[
    Literal["before", "after", "added"], "before the inputs, after the outputs, in the equations"
]


class FmuBlocks(TypedDict):
    """The same size, or gain, on disjoint segments of the logs."""

    n: Annotated[int, "segments that show it"]
    same_sign: Annotated[int, "segments with the sign of the whole"]
    t: Annotated[float, "mean over its standard error"]


class FmuEffect(TypedDict):
    """An effect that the FMU lacks."""

    place: Place
    effect: str
    numbers: dict[str, float]
    std: Annotated[dict[str, float], "standard errors"]
    gain: Annotated[float, "twice the log likelihood gained"]
    blocks: FmuBlocks
    rivals: Annotated[list[str], "effects that the logs do not tell from it"]
    same: Annotated[list[str], "effects that are equivalent to it in every log"]


class FmuLead(TypedDict):
    """A candidate that came near and is not named."""

    name: str
    gain: float
    reason: str


class AroundNumber(TypedDict):
    """A number of an effect around the FMU."""

    value: float
    unit: str


class AroundEffect(TypedDict):
    """An effect around the FMU."""

    place: Place
    name: str
    numbers: dict[str, AroundNumber]


class AroundEquations(TypedDict):
    """The equations around the FMU; null where there are none."""

    before: str | None
    after: str | None
    added: Annotated[dict[str, str], "by derivative"]


class Around(TypedDict):
    """What stands around the FMU, as in around.json."""

    effects: list[AroundEffect]
    equations: AroundEquations


class FmuResult(TypedDict):
    """What an FMU lacks, as ``hovercontrol diagnose --model FILE.fmu`` found it."""

    model: str
    verdict: Verdict
    effects: list[FmuEffect]
    leads: list[FmuLead]
    residual_before: Annotated[dict[str, float], "root mean square of measured minus computed, by channel"]
    residual_after: Annotated[dict[str, float], "and with the effects"]
    remains: Annotated[list[str], "channels whose residuals depend on their past"]
    held_before: Annotated[dict[str, dict[str, float]], "by held-out log and channel: residual over spread"]
    held_after: Annotated[dict[str, dict[str, float]], "and with the effects"]
    around: Around
    trace: Annotated[list[Decision], "every decision of the search, in order"]


@checked
def fmu_schema() -> Schema:
    """Return the JSON Schema of the ``result.json`` of ``hovercontrol diagnose --model FILE.fmu``.

    Examples
    --------
    >>> fmu_schema()["properties"]["effects"]["items"]["properties"]["place"]["enum"]
    ['before', 'after', 'added']
    """
    body = of_type(FmuResult)
    return document("hovercontrol diagnosis of an FMU", body.pop("description"), body)
