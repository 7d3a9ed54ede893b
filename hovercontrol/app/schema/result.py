"""The JSON Schema of ``result.json``, made of types that say what ``diagnose`` writes."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired, TypedDict

from hovercontrol.app.schema.parts import Schema, document, of_type
from hovercontrol.base.boundary import checked
from hovercontrol.identification.diagnose.verdict import Verdict


class Number(TypedDict):
    """A number of an effect, with its standard error."""

    value: float
    std: float
    unit: str


class Blocks(TypedDict):
    """The same coefficient on disjoint segments of the logs."""

    n: Annotated[int, "segments that show it"]
    same_sign: Annotated[int, "segments with the sign of the whole"]
    t: Annotated[float, "mean over its standard error"]
    spread: Annotated[float, "of the segments, in parts of the mean"]
    p_value: Annotated[float, "chance of as much without the effect"]


class Ahead(TypedDict):
    """Errors on the held-out logs some time ahead."""

    horizon: Annotated[float, "s"]
    channel: str
    before: Annotated[float, "root mean square without what was added"]
    after: Annotated[float, "and with it"]
    unit: str
    t: Annotated[float, "of the change"]


class HoldoutGain(TypedDict):
    """What an effect brings on the held-out logs."""

    gain: Annotated[float, "twice the log likelihood gained there, coefficients kept"]
    t: Annotated[float, "that in its standard errors over segments"]


class Evidence(TypedDict):
    """Why an effect is named."""

    gain: Annotated[float, "twice the log likelihood gained"]
    blocks: Blocks
    holdout_gain: HoldoutGain | None
    holdout: list[Ahead]


class Range(TypedDict):
    """A range of a signal."""

    signal: str
    low: Annotated[float | None, "null without a lower limit"]
    high: float | None


class Function(TypedDict):
    """A function of one signal: straight lines through values at grid points."""

    signals: Annotated[list[str], "its own, then the factors that multiply it"]
    grid: list[float]
    values: list[float]
    std: Annotated[list[float], "standard errors of the values"]


class FormNumber(TypedDict):
    """A number of a form of a function."""

    value: float
    std: Annotated[float | None, "standard error"]
    unit: str


class Form(TypedDict):
    """A form that an unknown function may have."""

    name: str
    text: str
    probability: float
    numbers: dict[str, FormNumber]


class UnknownFunction(Function):
    """A function that the model's user does not know (``hc.unknown``), as the logs determine it."""

    name: str
    unit: str
    forms: Annotated[list[Form], "the most probable first"]


class NamedEffect(TypedDict):
    """An effect that the model lacks."""

    name: str
    kind: Annotated[Literal["effect", "law"], "of the catalogue, or a law that is found"]
    equation: Annotated[str, "where it acts"]
    place: Annotated[str, "where in the loop: command, actuator, force, sensor or clock, and of what"]
    coefficient: float
    std: Annotated[float, "standard error"]
    unit: str
    numbers: dict[str, Number]
    region: Annotated[list[Range] | None, "in any of which it acts; null if everywhere"]
    function: Function | None
    evidence: Evidence
    readings: Annotated[list[str], "names of the same finding"]


class Reading(TypedDict):
    """Another estimate of a coefficient, beside an effect that is neither named nor refuted."""

    value: float
    std: float
    cause: str


class Coefficient(TypedDict):
    """A coefficient of the amended model, fitted again or kept."""

    name: str
    value: float
    std: Annotated[float | None, "standard error"]
    unit: str
    start: Annotated[float | None, "as the given model has it; null for a number of an added effect"]
    kept: Annotated[str, "why it was kept; empty if it was estimated"]
    readings: list[Reading]


class Group(TypedDict):
    """A product or sum of coefficients that the logs determine, though no single member."""

    name: Annotated[str, "such as k/m"]
    value: float
    std: float
    unit: str


class Rival(TypedDict):
    """An effect that cannot be told from a named one."""

    name: str
    place: Annotated[str, "where in the loop: command, actuator, force, sensor or clock, and of what"]
    reason: str


class TrainGap(TypedDict):
    """Errors on the training logs, by channel, in parts of its scatter."""

    before: dict[str, float]
    after: dict[str, float]


class HoldoutGap(TypedDict):
    """Errors on the held-out logs, by channel, in parts of its scatter; empty without one."""

    before: NotRequired[dict[str, float]]
    after: NotRequired[dict[str, float]]
    floor: NotRequired[Annotated[dict[str, float], "what noise alone makes"]]
    horizon: NotRequired[float]
    ahead: NotRequired[list[Ahead]]


class Gap(TypedDict):
    """How far the model was off, and is."""

    train: TrainGap
    holdout: HoldoutGap


class RemainderPlace(TypedDict):
    """Where what remains in one equation is."""

    regime: Annotated[str, "in words; empty where no force is significant"]
    log: Annotated[str, "in which most of it is"]
    segments: Annotated[list[tuple[float, float]], "s: when it is significant there"]


class Predictable(TypedDict):
    """How much of what remains in an equation any law of one signal, times others, could take."""

    signals: Annotated[list[str], "of which it is a function, and that multiply it"]
    gain: Annotated[float, "cross-validated, in twice the log likelihood"]
    share_named: Annotated[float, "of what these signals tell, the share that named effects have taken"]


class Remainder(TypedDict):
    """What one equation still leaves unexplained."""

    rms: float
    unit: str
    share_explained: float
    averaged_over: Annotated[float, "s"]
    gain: float
    where: RemainderPlace | None
    predictable: Predictable | None


class SlowError(TypedDict):
    """What a sensor shows that is neither the motion nor noise from sample to sample."""

    rms: float
    noise: float
    unit: str
    over: Annotated[float, "s: of medians"]


class Lead(TypedDict):
    """A candidate that came near and is not named."""

    name: str
    gain: float
    blocks_t: float
    reason: str


class Decision(TypedDict):
    """A decision of the search: a rule applied to an effect."""

    step: Annotated[str, "score, fit, confirm, challenge or hold out"]
    effect: str
    rule: Annotated[str, "what is asked; ends before the limit"]
    value: Annotated[float | None, "null where the rule compares no number"]
    limit: float | None
    passed: bool


class Region(Range):
    """Where what stays unnamed acts in an equation."""

    equation: str


class Rows(TypedDict):
    """Rows of a log in which what stays unnamed is significant."""

    equation: str
    log: str
    rows: list[tuple[int, int]]


class Where(TypedDict):
    """Where the given model lacks most, and where what stays unnamed acts."""

    equation: str | None
    log: NotRequired[str]
    segments: list[tuple[float, float]]
    regime: str
    regions: list[Region]
    rows: list[Rows]


class Result(TypedDict):
    """What a model lacks, as ``hovercontrol diagnose`` found it."""

    verdict: Verdict
    effects: list[NamedEffect]
    coefficients: Annotated[list[Coefficient], "of the amended model, fitted or kept"]
    groups: Annotated[list[Group], "what the logs show only together"]
    rivals: list[Rival]
    functions: Annotated[list[UnknownFunction], "those that the model leaves open"]
    gap: Gap
    remainder: Annotated[dict[str, Remainder], "by equation"]
    slow_errors: Annotated[dict[str, SlowError], "by channel"]
    leads: list[Lead]
    trace: Annotated[list[Decision], "every decision of the search, in order"]
    where: Where
    next_experiment: str | None
    rows_dropped: int
    rows_down_weighted: int
    warnings: list[str]


@checked
def result_schema() -> Schema:
    """Return the JSON Schema of ``result.json``.

    Examples
    --------
    >>> result_schema()["properties"]["verdict"]["enum"]
    ['effect', 'none', 'ambiguous', 'partial', 'unexplained']
    """
    body = of_type(Result)
    return document("hovercontrol diagnosis", body.pop("description"), body)
