"""What a tool answers to a case of the benchmark."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.craft.models.interface import AnyModel
from hovercontrol.logs import Log

Verdict = Literal["none", "missing", "unknown"]


@checked
@dataclass(frozen=True)
class Term:
    """One thing that a tool says the model lacks.

    Attributes
    ----------
    equation : str
        State in whose derivative it acts (``"r"``); empty for an effect named by `text` that says it itself.
    text : str
        Name of an effect (``"rudder_lag"``), or an expression of states and inputs, up to its coefficient
        (``"Abs(v)*r"``).
    coefficient, std : float or None
        Factor of the expression, or the first number of the effect, and its standard error, in SI units.
    sure : bool
        False for one of several readings.

    Examples
    --------
    >>> Term("r", "Abs(v)*r", -0.6, 0.02).sure
    True
    """

    equation: str
    text: str
    coefficient: float | None = None
    std: float | None = None
    sure: bool = True

    __repr__ = short_repr


@checked
@dataclass(frozen=True)
class Answer:
    """The answer of a tool.

    Attributes
    ----------
    verdict : {"none", "missing", "unknown"}
        Nothing is missing; something is missing, named by `terms` or not; the tool cannot tell.
    terms : tuple of Term
    predicted : Model, BlockModel, Block or None
        The model with what was found, with the states and inputs of the given model. The held-out motion is
        predicted with it.

    Raises
    ------
    InputError
        If the verdict is unknown.

    Examples
    --------
    >>> Answer("missing", (Term("r", "Abs(v)*r", -0.6, 0.02),)).verdict
    'missing'
    """

    verdict: str
    terms: tuple[Term, ...] = ()
    predicted: AnyModel | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", tuple(self.terms))
        if self.verdict not in get_args(Verdict):
            raise InputError(f"answer: expected the verdict none, missing or unknown, found {self.verdict!r}")


#: ``tool(model, train_logs, holdout_log) -> Answer``
Tool = Callable[[AnyModel, tuple[Log, ...], Log], Answer]
